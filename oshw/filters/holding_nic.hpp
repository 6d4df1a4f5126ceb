// Filters that delay received frames, or let later frames overtake them.
//
// A delayed frame does not end a wait on the handle of the inner NIC. Therefore a caller that waits must also use
// next_arrival(), as for any NIC in virtual time.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"
#include "oshw/frame_queue.hpp"

namespace margay {

class HoldingNic : public FilterNic {
  public:
    // Reads all frames of the inner NIC, then delivers the frames that are due. When the memory is full, a frame is
    // lost and counted.
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept final;
    [[nodiscard]] Time next_arrival() const noexcept final;
    // Without receive times: the inner NIC received the frames earlier than this NIC delivers them.
    [[nodiscard]] FrameTiming timing() noexcept final {
        const FrameTiming of_inner = inner().timing();
        return {.sent = of_inner.sent, .send_at = of_inner.send_at};
    }

    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

  protected:
    // `memory` is the maximum number of delayed frames. The memory, the clock and the inner NIC must outlive the
    // filter.
    HoldingNic(Nic& inner, Osal& clock, std::span<HeldFrame> memory) noexcept
        : FilterNic(inner), clock_(clock), queue_(memory) {}
    ~HoldingNic() = default;

    // Returns the delivery time of a frame that arrived at `now`.
    [[nodiscard]] virtual Time due(Time now) noexcept = 0;

  private:
    Osal& clock_;
    FrameQueue queue_;
    std::uint64_t lost_ = 0;
    std::array<std::byte, HeldFrame::kMaxBytes> buffer_;
};

// Delays every frame by `delay` plus at most `jitter`. The order is kept.
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

// Delays some frames by `hold`; frames that arrive in the meantime overtake them.
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
