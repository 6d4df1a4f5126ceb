// Filters that hold received frames back: late ones and overtaken ones.
//
// Held frames cannot wake a wait on the inner NIC's handle: whoever waits takes next_arrival() into account,
// as for any NIC in virtual time.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"
#include "oshw/frame_queue.hpp"

namespace margay {

class HoldingNic : public FilterNic {
  public:
    // Takes what the inner NIC has, then delivers what is due. A frame that finds the memory full is lost and
    // counted.
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept final;
    [[nodiscard]] Time next_arrival() const noexcept final;

    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

  protected:
    // `memory` holds so many frames at a time; it, the clock and the inner NIC must outlive the filter.
    HoldingNic(Nic& inner, Osal& clock, std::span<HeldFrame> memory) noexcept
        : FilterNic(inner), clock_(clock), queue_(memory) {}
    ~HoldingNic() = default;

    // When a frame that came at `now` shall be delivered.
    [[nodiscard]] virtual Time due(Time now) noexcept = 0;

  private:
    Osal& clock_;
    FrameQueue queue_;
    std::uint64_t lost_ = 0;
    std::array<std::byte, HeldFrame::kMaxBytes> buffer_;
};

// Every frame comes later, by `delay` and up to `jitter` more; the order is kept.
class DelayNic final : public HoldingNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Duration delay{};
        Duration jitter{};
    };
    DelayNic(Nic& inner, Osal& clock, std::span<HeldFrame> memory, const Options& options) noexcept
        : HoldingNic(inner, clock, memory), options_(options), chance_(options.seed) {}

  private:
    [[nodiscard]] Time due(Time now) noexcept override;

    Options options_;
    Chance chance_;
    Time last_{Time::min()};
};

// Some frames are held for `hold`, and what comes meanwhile overtakes them.
class ReorderNic final : public HoldingNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Rate rate{};
        Duration hold{};
    };
    ReorderNic(Nic& inner, Osal& clock, std::span<HeldFrame> memory, const Options& options) noexcept
        : HoldingNic(inner, clock, memory), options_(options), chance_(options.seed) {}

    [[nodiscard]] std::uint64_t held() const noexcept { return held_; }

  private:
    [[nodiscard]] Time due(Time now) noexcept override;

    Options options_;
    Chance chance_;
    std::uint64_t held_ = 0;
};

}  // namespace margay
