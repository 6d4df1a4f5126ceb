// The far end of a cable for measuring: a veth pair in a network namespace of this process's own, and behind it
// something that gives each EtherCAT frame back as a segment would, marked as passed and with the working counter that
// is told.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace margay::bench {

// Where the near end is. The interface "far" is the other one.
inline constexpr const char* kNear = "near";

// Moves this process into a new network namespace with the pair in it. False, and why, where that is not allowed.
[[nodiscard]] bool make_cable(std::string& why);

class FarEnd {
  public:
    FarEnd() = default;
    FarEnd(const FarEnd&) = delete;
    FarEnd& operator=(const FarEnd&) = delete;
    virtual ~FarEnd() = default;
    // In words.
    [[nodiscard]] virtual std::string name() const = 0;
};

// The working counter, 16 bits at `wkc_at` in frames of `frame_bytes`.
struct Answer {
    std::size_t frame_bytes = 0;
    std::size_t wkc_at = 0;
    std::uint16_t wkc = 0;
};

// An XDP program: it runs in the sender's own system call and takes no second core. nullptr, and why, where it cannot
// be had.
[[nodiscard]] std::unique_ptr<FarEnd> echo_by_xdp(const Answer& answer, std::string& why);
// A thread with a socket. nullptr, and why.
[[nodiscard]] std::unique_ptr<FarEnd> echo_by_thread(const Answer& answer, std::string& why);

}  // namespace margay::bench
