// The far end of a cable for measurements: a veth pair in a network namespace of this process. The far end returns
// each EtherCAT frame as a segment would: with the mark of an ESC and with the given working counter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace margay::bench {

// The interface of the near end. The other interface is "far".
inline constexpr const char* kNear = "near";

// Moves this process to a new network namespace with the veth pair. Returns false and the reason when this is not
// permitted.
[[nodiscard]] bool make_cable(std::string& why);

class FarEnd {
  public:
    FarEnd() = default;
    FarEnd(const FarEnd&) = delete;
    FarEnd& operator=(const FarEnd&) = delete;
    virtual ~FarEnd() = default;
    // A description for the output.
    [[nodiscard]] virtual std::string name() const = 0;
};

// The working counter to write: 16 bits at `wkc_at` in frames of `frame_bytes`.
struct Answer {
    std::size_t frame_bytes = 0;
    std::size_t wkc_at = 0;
    std::uint16_t wkc = 0;
};

// An XDP program. The kernel executes it in the sender's system call, so it needs no second core. Returns nullptr and
// the reason when it is not available.
[[nodiscard]] std::unique_ptr<FarEnd> echo_by_xdp(const Answer& answer, std::string& why);
// A thread with a socket. Returns nullptr and the reason after an error.
[[nodiscard]] std::unique_ptr<FarEnd> echo_by_thread(const Answer& answer, std::string& why);

}  // namespace margay::bench
