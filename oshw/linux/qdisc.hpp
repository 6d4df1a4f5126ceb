// The queueing disciplines of an interface, and whether they let a frame leave at a time (SO_TXTIME). The kernel
// accepts a time for every interface, and most queueing disciplines ignore it: so their settings are read first.
#pragma once

#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

struct Qdisc {
    static constexpr std::size_t kClasses = 16;  // traffic classes and priorities (TC_QOPT_MAX_QUEUE)

    std::uint32_t handle = 0;
    std::uint32_t parent = 0;  // 0xFFFFFFFF: the root
    std::array<char, 16> kind{};
    // Settings of "etf".
    std::int32_t delta_ns = 0;  // how long before its time a frame goes to the driver
    std::int32_t clock = 0;     // CLOCK_TAI
    bool deadline = false;      // frames leave before their time
    bool offload = false;       // the NIC holds the frame until its time
    // Settings of "mqprio" and "taprio": the traffic class of a priority, and the queues of a class.
    std::uint8_t classes = 0;
    std::array<std::uint8_t, kClasses> class_of{};
    std::array<std::uint16_t, kClasses> first_queue{};
    std::array<std::uint16_t, kClasses> queues{};

    [[nodiscard]] std::string_view name() const noexcept { return kind.data(); }
};

// The queueing disciplines of one interface, as the kernel lists them.
class Qdiscs {
  public:
    // Reads them by netlink, in the network namespace of the calling thread. False: error() says why. Needs no
    // privilege. Not callable from the cycle.
    [[nodiscard]] bool read(int interface_index) noexcept;
    // Adds the queueing disciplines of the interface that messages of the kernel (RTM_NEWQDISC) name. False: the last
    // message was read, or a message is an error.
    bool add(std::span<const std::byte> messages, int interface_index) noexcept;

    [[nodiscard]] std::span<const Qdisc> all() const noexcept { return std::span(all_).first(count_); }
    [[nodiscard]] int error() const noexcept { return error_; }  // errno

  private:
    void add_one(std::span<const std::byte> message) noexcept;

    std::array<Qdisc, 72> all_{};  // a root and 64 queues
    std::size_t count_ = 0;
    int error_ = 0;
};

// The way by which frames of a priority leave at a given time.
struct TimedWay {
    enum class Holder : std::uint8_t {
        nobody,  // the frames leave at once; `why` is the reason
        qdisc,   // a timer of the kernel
        nic
    };
    Holder holder = Holder::nobody;
    std::int32_t clock = 0;   // the clock of the times: CLOCK_TAI or CLOCK_MONOTONIC
    Duration early{0};        // how much earlier than its time a frame leaves
    std::string_view kind{};  // the kind of the queueing discipline that decides; empty: none was found
    std::string_view why{};   // the setting that does not fit; empty: all settings fit
};

// The way of frames with this priority (SO_PRIORITY). Frames without a time have priority 0 and bypass the queueing
// disciplines.
[[nodiscard]] TimedWay timed_way(std::span<const Qdisc> all, unsigned priority) noexcept;

}  // namespace margay
