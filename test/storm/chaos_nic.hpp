// A NIC around another NIC. It disturbs frames as wires, switches and drivers do, at rates that can change during a
// run: it loses, duplicates, delays, reorders and damages frames, and is busy.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"
#include "oshw/frame_queue.hpp"
#include "wire/datagram.hpp"

#include <vector>

namespace margay::storm {

class ChaosNic final : public FilterNic {
  public:
    struct Rates {
        Rate drop_out{}, drop_in{};
        Rate twice_out{}, twice_in{};
        Rate delay{};
        Duration delay_up_to{};
        Rate flip{};
        Rate busy{};  // per frame: the NIC becomes busy for some time
        Duration busy_for{};
    };
    Rates rates;
    // Slaves that do not set the mark of the first ESC, and a NIC that knows its own frames.
    bool unmarked = false;

    ChaosNic(Nic& inner, Osal& clock, std::uint64_t seed) noexcept : FilterNic(inner), clock_(clock), chance_(seed) {}

    void settle() { rates = {}, busy_until_ = Time::min(); }
    // What was sent: frames, datagrams, and octets of datagrams with their headers.
    struct Sent {
        std::uint64_t frames = 0;
        std::uint64_t datagrams = 0;
        std::uint64_t bytes = 0;
    };
    [[nodiscard]] const Sent& sent() const { return sent_; }
    [[nodiscard]] bool hides_own_frames() const noexcept override { return unmarked || inner().hides_own_frames(); }

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (clock_.now() < busy_until_) return SendStatus::busy;
        if (chance_.happens(rates.busy)) {
            busy_until_ = clock_.now() + rates.busy_for;
            return SendStatus::busy;
        }
        const bool dropped = chance_.happens(rates.drop_out);
        const auto status = dropped ? SendStatus::sent : inner().send(frame);
        if (status == SendStatus::sent) note_sent(frame);
        if (status == SendStatus::sent && !dropped && chance_.happens(rates.twice_out)) (void)inner().send(frame);
        return status;
    }

    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override {
        while (const auto length = inner().receive(buffer_)) {
            const std::span<std::byte> frame(buffer_.data(), length);
            if (chance_.happens(rates.drop_in)) continue;
            if (unmarked) frame[wire::kSourceMacOffset] &= ~wire::kPassedEscBit;
            if (chance_.happens(rates.flip))
                frame[14 + chance_.below(length - 14)] ^= static_cast<std::byte>(1U << chance_.below(8));
            keep(frame);
            if (chance_.happens(rates.twice_in)) keep(frame);
        }
        return held_.take(clock_.now(), into);
    }

    [[nodiscard]] Time next_arrival() const noexcept override {
        return std::min(held_.next_due(), inner().next_arrival());
    }

  private:
    void note_sent(std::span<const std::byte> frame) noexcept {
        constexpr unsigned kLength = 0x07FF;
        constexpr unsigned kMore = 0x8000;
        ++sent_.frames;
        std::size_t at = wire::kFramePrefixBytes;
        for (bool more = true; more && at + wire::kDatagramHeaderBytes <= frame.size();) {
            const unsigned length = load_le<std::uint16_t>(frame, at + 6);
            const std::size_t bytes = (length & kLength) + wire::kDatagramOverheadBytes;
            ++sent_.datagrams;
            sent_.bytes += bytes;
            at += bytes;
            more = (length & kMore) != 0;
        }
    }
    void keep(std::span<const std::byte> frame) noexcept {
        Time due = clock_.now();
        if (chance_.happens(rates.delay))
            due += Duration(
                static_cast<std::int64_t>(chance_.below(static_cast<std::uint64_t>(rates.delay_up_to.count()) + 1)));
        (void)held_.put(due, frame);  // the frame is lost when there is no memory for it
    }

    Osal& clock_;
    Chance chance_;
    std::vector<HeldFrame> memory_ = std::vector<HeldFrame>(64);
    FrameQueue held_{memory_};
    std::array<std::byte, 1518> buffer_;
    Time busy_until_ = Time::min();
    Sent sent_;
};

}  // namespace margay::storm
