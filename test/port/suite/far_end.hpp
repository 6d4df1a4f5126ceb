// Frames to the slave at the far end of the cable and back, with a comparison of each octet.
//
// A frame has one NOP datagram. Its data begins with the number of the frame; the rest depends on this number and the
// size. Slaves return it unchanged except for the mark in the source address and the event field of the datagram. The
// working counter stays 0.
#pragma once

#include "run.hpp"

#include <margay/receive_clock.hpp>

namespace margay::port {

class FarEnd {
  public:
    explicit FarEnd(Run& run) : run_(run), nic_(*run.port.nic) { drain(); }

    // Sends one frame once. `alignment`: 0 to 3, the address of the frame modulo 4.
    SendStatus send(std::size_t size, std::size_t alignment);
    // Sends octets that are not a legal frame.
    SendStatus send_raw(std::size_t size);
    // Repeats a busy frame until it is accepted.
    bool send_patiently(std::size_t size, std::size_t alignment);
    // Receives the replies to the next `count` frames, in order.
    bool collect(std::size_t count);
    // Receives replies until no more comes.
    bool collect_rest();
    // Receives the replies that are in the NIC, without waiting.
    bool collect_ready();
    // How many replies are missing.
    [[nodiscard]] std::size_t on_the_way() const { return next_sent_ - next_received_; }
    // Sends a frame with a VLAN tag, or a frame that is too short for a datagram. No slave answers it.
    SendStatus send_other(std::size_t size);
    // How long receive() took for the last frame.
    [[nodiscard]] Duration receive_took() const { return receive_took_; }
    // Receives the next reply into a memory that is too small.
    bool receive_cut(std::size_t bytes);
    // Returns false when the octets that did not fit come as a separate frame.
    bool rest_is_gone(std::size_t bytes);
    // True if the last function failed because no frame came back. With `is_echo()`, frames came back unchanged.
    [[nodiscard]] bool is_lost() const { return lost_; }
    [[nodiscard]] bool is_echo() const { return echoes_ != 0; }
    bool exchange(std::size_t size, std::size_t alignment) { return send_patiently(size, alignment) && collect(1); }
    // From now on replies may be missing.
    void allow_losses() { losses_ = true; }

    // Receives frames that an earlier check has not received.
    void drain();
    // Fails the check with the reason that the last function found.
    void report() {
        if (number_ == kNoNumber)
            run_.fail(what_);
        else
            run_.fail(what_, number_, unit_);
    }

    // The first octets of the frame that was sent last, and of its reply.
    [[nodiscard]] std::span<const std::byte> sent_head() const { return sent_head_; }
    [[nodiscard]] std::span<const std::byte> reply_head() const { return reply_head_; }

    // Memory for receive().
    [[nodiscard]] std::span<std::byte> memory() { return std::span(received_).subspan(kGuard, kMost); }

  private:
    static constexpr std::size_t kMost = 1600;
    static constexpr std::size_t kGuard = 16;  // octets before and behind the memory that receive() must not touch
    static constexpr std::byte kGuardValue{0xA5};
    static constexpr std::size_t kRemembered = 512;
    static constexpr std::uint64_t kNoNumber = ~std::uint64_t{0};

    // The outcome of fetching one frame.
    enum class Got : std::uint8_t { nothing, reply, fault };

    bool fault(std::string_view what, std::uint64_t number = kNoNumber, std::string_view unit = {});
    void fill_address(std::span<std::byte> frame) const;
    void fill(std::span<std::byte> frame, std::uint32_t number) const;
    Got fetch(std::size_t room);
    Got match(std::size_t length, std::size_t room);
    Got compare(std::uint32_t number, std::size_t length, std::size_t room);
    bool await_reply(std::size_t room);
    void discard();

    Run& run_;
    Nic& nic_;
    std::uint32_t next_sent_ = 0;      // number of the next frame; busy frames get no number
    std::uint32_t next_received_ = 0;  // number of the next expected reply
    bool losses_ = false;
    bool lost_ = false;
    std::size_t echoes_ = 0;
    Duration receive_took_{};
    std::string_view what_;
    std::uint64_t number_ = kNoNumber;
    std::string_view unit_;
    std::array<std::uint16_t, kRemembered> sizes_{};
    std::array<std::byte, SendClock::kHeadBytes> sent_head_{};
    std::array<std::byte, ReceiveClock::kHeadBytes> reply_head_{};
    alignas(8) std::array<std::byte, 2048> sent_{};
    alignas(8) std::array<std::byte, kMost + 2 * kGuard> received_{};
    std::array<std::byte, 1514> expected_{};
};

}  // namespace margay::port
