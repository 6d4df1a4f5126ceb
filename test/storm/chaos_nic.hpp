// A NIC around another NIC. It disturbs frames as wires, switches and drivers do, at rates that can change during a
// run: it loses, duplicates, delays, reorders and damages frames, and is busy.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"
#include "oshw/frame_queue.hpp"

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

    ChaosNic(Nic& inner, Osal& clock, std::uint64_t seed) noexcept : FilterNic(inner), clock_(clock), chance_(seed) {}

    void settle() { rates = {}, busy_until_ = Time::min(); }
    [[nodiscard]] std::uint64_t sent() const { return sent_; }

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (clock_.now() < busy_until_) return SendStatus::busy;
        if (chance_.happens(rates.busy)) {
            busy_until_ = clock_.now() + rates.busy_for;
            return SendStatus::busy;
        }
        ++sent_;
        if (chance_.happens(rates.drop_out)) return SendStatus::sent;
        const auto status = inner().send(frame);
        if (status == SendStatus::sent && chance_.happens(rates.twice_out)) (void)inner().send(frame);
        return status;
    }

    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override {
        while (const auto length = inner().receive(buffer_)) {
            const std::span<std::byte> frame(buffer_.data(), length);
            if (chance_.happens(rates.drop_in)) continue;
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
    std::uint64_t sent_ = 0;
};

}  // namespace margay::storm
