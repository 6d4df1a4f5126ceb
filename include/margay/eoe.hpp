// Ethernet over EtherCAT (EoE, ETG.1000.6): Ethernet frames to and from slaves that have an IP stack or an Ethernet
// port of their own, and the parameters of such a slave.
//
//     margay::EoeIp ip;
//     ip.address = {192, 168, 5, 2};
//     ip.subnet_mask = {255, 255, 255, 0};
//     margay::EOEset_ip(ctx, 3, ip);                   // waits; EoeSetIp is the request
//
//     static margay::EoePortMemory<8, 8> memory;       // frames that wait in each direction
//     margay::EoePort port(memory);                    // lives in the caller's memory
//     port.slave = 3;
//     margay::submit(ctx, port);                       // from any thread; exchanges frames until it is cancelled
//     port.send(frame);                                // from one thread, never waits
//     while (auto frame = port.receive(buffer)) use(buffer, frame->bytes);               // from one thread
//
// After a timeout or cancel() of a request for parameters, the slave may still answer. The next request waits for the
// late answer for 100 ms (after cancel() for the rest of the `timeout`, 3 s if it is zero). Then the library reads
// another parameter. A slave answers in order, so no late answer can follow the answer to this question, and the
// request is sent after it. With a slow slave, a few requests may end with timeout and are not sent. If a slave never
// answers the question, the library sends the request once more for each late answer (14 at most), and uses the last
// answer.
//
// A frame is an Ethernet II frame from its destination address to the last octet before the FCS.
#pragma once

#include <margay/detail/octet_ring.hpp>
#include <margay/detail/writable_ring.hpp>
#include <margay/eoe_parameters.hpp>
#include <margay/request.hpp>

#include <array>
#include <atomic>
#include <optional>
#include <string_view>

namespace margay {

// ------------------------------------------------------------------ parameters

// Sets the parameters of the IP stack of a slave that have a value in `ip`. Errors: eoe_error (detail: the EoeResult;
// describe() puts it in words), invalid_argument (the mailbox of the slave is smaller than the message of 68 octets),
// unsupported (no EoE), timeout, mailbox_error … A slave may forget the parameters with its power: a start-up command
// (eoe_ip_message(), startup_mail.hpp) or a hook (HookedSlave::eoe_set_ip()) sets them in each start-up.
struct EoeSetIp : MailRequest {
    EoeSetIp();
    EoeIp ip;
    // Parameters that are not set occupy no octets in the message. In the standard each parameter has a fixed place in
    // the message; some slaves expect a packed message.
    bool packed = false;
};

// Reads the parameters of the IP stack of a slave. Errors: as of EoeSetIp, protocol.
struct EoeGetIp : MailRequest {
    EoeGetIp();
    EoeIp ip;  // result
};

// Sets the filter for the frames that the slave passes on. Errors: as of EoeSetIp; the message has 132 octets.
struct EoeSetFilter : MailRequest {
    EoeSetFilter();
    EoeFilter filter;
};

// Reads the filter. Errors: as of EoeSetIp, protocol.
struct EoeGetFilter : MailRequest {
    EoeGetFilter();
    EoeFilter filter;  // result
};

// ------------------------------------------------------------------ frames

// The longest frame: 1500 octets of data and up to five VLAN tags.
inline constexpr std::size_t kEoeFrameBytes = 1536;

// Counters of a port, modulo 2^32. A frame of send() is counted once: in sent, refused or not_sent. A frame that the
// slave has begun is counted once: in received, overrun, incomplete, malformed or too_long.
struct EoeStatistics {
    std::uint32_t sent = 0;  // frames that the slave has accepted
    std::uint32_t sent_octets = 0;
    std::uint32_t refused = 0;   // send() returned false: the queue was full, or the size of the frame is wrong
    std::uint32_t not_sent = 0;  // the mailbox of the slave was closed, or the slave refused a fragment for too long
    std::uint32_t received = 0;  // frames that receive() has returned, or will return
    std::uint32_t received_octets = 0;
    std::uint32_t overrun = 0;     // complete frames that were dropped because the queue was full
    std::uint32_t incomplete = 0;  // frames of which a fragment is missing
    std::uint32_t malformed = 0;   // fragments whose sizes contradict each other, and frames of less than 14 octets
    std::uint32_t too_long = 0;    // frames of more than kEoeFrameBytes octets
};

// The memory of a port. ToSlave, FromSlave: how many frames of the greatest length can wait in each direction; more
// frames fit if they are shorter. AtOnce: how many frames can be incomplete at the same time, because the slave sends
// their fragments alternately.
template <std::size_t ToSlave, std::size_t FromSlave, std::size_t AtOnce = 2>
struct EoePortMemory {
    static constexpr std::size_t kOne = kEoeFrameBytes + 8;
    std::array<std::byte, ToSlave * kOne> to_slave;
    std::array<std::byte, FromSlave * kOne> from_slave;
    std::array<std::byte, AtOnce * kEoeFrameBytes> parts;
};

// A received frame.
struct EoeFrame {
    std::size_t bytes = 0;                      // its size; a buffer that is smaller contains the first octets
    std::uint8_t port = 0;                      // Ethernet port of the slave, the first is 1; 0: unknown
    std::optional<std::uint32_t> time_stamp{};  // if the slave appends them: the lower 32 bits of its system time, ns
};

// Exchanges Ethernet frames with one slave, beside the cycle, until the request is cancelled. poll() sends and fetches:
// a frame goes in fragments that fit the mailbox of the slave, one message at a time, so that other requests to the
// slave have their turn after each fragment. All messages are acyclic datagrams: during a cycle they use the budget of
// the group (GroupConfiguration::acyclic_bytes), in the order in which slaves have queued them, so that each slave gets
// the same share. When a message is lost on the wire, the mailbox repeats it; a frame of which a fragment is missing
// all the same is dropped, and only that frame.
//
// A port outlives the loss of its slave: while the mailbox of the slave is closed, and in BOOT, its frames are dropped.
// After a scan the port belongs to the slave that has the number; the frames are dropped while that slave has no EoE.
// The request ends only by cancel(). Errors: invalid_argument (too little memory, a mailbox of less than 42 octets),
// unsupported (no EoE), busy (another port of the slave is busy), wrong_state, unknown_slave.
//
// Threads: poll() works in the thread of the owner. One thread may call send(), and one receive() and
// take_sending_time(); both may be any threads, also the thread of the cycle. No call waits.
class EoePort final : public MailRequest {
  public:
    // All memory outlives the request. `parts`: kEoeFrameBytes for each frame that can be incomplete at the same time;
    // at most kMostAtOnce frames.
    EoePort(std::span<std::byte> to_slave, std::span<std::byte> from_slave, std::span<std::byte> parts);
    template <std::size_t ToSlave, std::size_t FromSlave, std::size_t AtOnce>
    explicit EoePort(EoePortMemory<ToSlave, FromSlave, AtOnce>& memory)
        : EoePort(memory.to_slave, memory.from_slave, memory.parts) {}

    // How often poll() looks for frames of the slave, and for frames that another thread has queued, while there are no
    // frames. While frames are exchanged, each call of poll() looks, at most every 100 µs.
    Duration look_every = std::chrono::milliseconds(1);
    // How long the slave may refuse a fragment before the frame is dropped.
    Duration send_patience = std::chrono::milliseconds(500);
    // The Ethernet port of the slave in sent frames; 0: the slave decides.
    std::uint8_t port = 0;

    // The name of the network interface to which the application passes the frames, "eoe0s1" for example. Programs that
    // are attached to the application show this name (`ethercat eoe`). The port keeps the first kNameBytes octets. Set
    // the name before submit(), or between the calls of poll(). Empty: none.
    static constexpr std::size_t kNameBytes = 15;
    void set_interface_name(std::string_view name) {
        for (name_bytes_ = 0; name_bytes_ < kNameBytes && name_bytes_ < name.size(); ++name_bytes_)
            name_[name_bytes_] = name[name_bytes_];
    }
    [[nodiscard]] std::string_view interface_name() const { return {name_.data(), name_bytes_}; }

    // Queues a frame. False: the queue is full, or the frame has fewer than 14 or more than kEoeFrameBytes octets; it
    // is dropped and counted. `want_time`: asks the slave for the time at which it sends the frame.
    bool send(std::span<const std::byte> frame, bool want_time = false);
    // Whether the queue has room for the longest frame.
    [[nodiscard]] bool can_send() const;

    // Removes the oldest received frame and copies its octets to `into`, as far as they fit.
    std::optional<EoeFrame> receive(std::span<std::byte> into);
    // Removes the oldest time that the slave has reported for a frame with `want_time`. The port keeps four times.
    std::optional<std::uint32_t> take_sending_time() { return sending_times_.take(); }

    // From any thread.
    [[nodiscard]] EoeStatistics statistics() const;

    // Whether the memory has room for a frame in each direction, and for one frame whose fragments arrive.
    [[nodiscard]] bool has_memory() const {
        constexpr std::size_t kOne = EoePortMemory<1, 1, 1>::kOne;
        return to_slave_.size() >= kOne && from_slave_.size() >= kOne && parts_.size() >= kEoeFrameBytes;
    }

    static constexpr std::size_t kMostAtOnce = 4;

  private:
    friend class EoeRelay;
    enum Count : std::uint8_t {
        kSent,
        kSentOctets,
        kRefused,
        kNotSent,
        kReceived,
        kReceivedOctets,
        kOverrun,
        kIncomplete,
        kMalformed,
        kTooLong,
        kCounts
    };
    // Each counter is written by one thread.
    void count(Count which, std::size_t by = 1) {
        auto& counter = counts_[which];
        counter.store(counter.load(std::memory_order_relaxed) + static_cast<std::uint32_t>(by),
                      std::memory_order_relaxed);
    }

    OctetRing to_slave_;
    OctetRing from_slave_;
    std::span<std::byte> parts_;
    WritableRingOf<std::uint32_t, 4> sending_times_;
    std::array<std::atomic<std::uint32_t>, kCounts> counts_{};
    std::array<char, kNameBytes> name_{};
    std::uint8_t name_bytes_ = 0;
};

// ------------------------------------------------------------------ functions that wait
//
// Each function submits the request of the same name and waits for it. `timeout` zero: 3 s for the answer of the slave.

Result<> EOEset_ip(Context& ctx, std::uint16_t slave, const EoeIp& ip, Duration timeout = Duration{0});
Result<EoeIp> EOEget_ip(Context& ctx, std::uint16_t slave, Duration timeout = Duration{0});
Result<> EOEset_filter(Context& ctx, std::uint16_t slave, const EoeFilter& filter, Duration timeout = Duration{0});
Result<EoeFilter> EOEget_filter(Context& ctx, std::uint16_t slave, Duration timeout = Duration{0});

// The text of a result code. A static string, callable from anywhere.
[[nodiscard]] std::string_view eoe_result_text(EoeResult result);

}  // namespace margay
