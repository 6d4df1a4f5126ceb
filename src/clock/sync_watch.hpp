// Whether a clock is in sync, from the difference that its slave reports (ESC register 0x092C).
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// Register 0x092C: bit 31 is set when the local copy is behind the received time, the other bits are the magnitude.
[[nodiscard]] constexpr std::int32_t load_difference_ns(std::uint32_t raw) {
    const auto magnitude = static_cast<std::int32_t>(raw & 0x7FFF'FFFF);
    return (raw & 0x8000'0000) != 0 ? -magnitude : magnitude;
}

// The registers of all slaves combined by OR, as a broadcast reads them: no magnitude is greater than the result, and
// the result is less than twice the greatest magnitude.
[[nodiscard]] constexpr std::uint32_t load_greatest_difference_ns(std::uint32_t raw) { return raw & 0x7FFF'FFFF; }

struct SyncLimit {
    std::uint32_t limit_ns = 1000;
    Duration settle{0};  // how long the difference must stay within the limit before the clock is in sync
};

class SyncWatch {
  public:
    enum class Change : std::uint8_t { none, in_sync, out_of_sync };

    [[nodiscard]] bool in_sync() const { return in_sync_; }
    void reset() { *this = SyncWatch{}; }
    // Sets whether the clock is in sync, from other knowledge.
    void set(bool in_sync) {
        reset();
        in_sync_ = in_sync;
    }

    [[nodiscard]] Change update(std::int32_t difference_ns, const SyncLimit& limit, Time now) {
        const std::uint32_t magnitude = difference_ns < 0 ? 0U - static_cast<std::uint32_t>(difference_ns)
                                                          : static_cast<std::uint32_t>(difference_ns);
        if (magnitude > limit.limit_ns) {
            const bool was = in_sync_;
            reset();
            return was ? Change::out_of_sync : Change::none;
        }
        if (in_sync_) return Change::none;
        if (since_ == kNever) since_ = now;
        if (now < later(since_, limit.settle)) return Change::none;
        in_sync_ = true;
        return Change::in_sync;
    }

  private:
    Time since_ = kNever;  // since this time the difference has been within the limit
    bool in_sync_ = false;
};

}  // namespace margay
