#include "oshw/filters/holding_nic.hpp"

namespace margay {

std::size_t HoldingNic::receive(std::span<std::byte> into) noexcept {
    const Time now = clock_.now();
    while (const auto length = inner().receive(buffer_))
        if (!queue_.put(due(now), std::span(buffer_).first(length))) ++lost_;
    return queue_.take(now, into);
}

Time HoldingNic::next_arrival() const noexcept { return std::min(queue_.next_due(), inner().next_arrival()); }

Time DelayNic::due(Time now) noexcept {
    const auto extra = chance_.below(static_cast<std::uint64_t>(options_.jitter.count()) + 1);
    last_ = std::max(last_, now + options_.delay + Duration(static_cast<Duration::rep>(extra)));
    return last_;
}

Time ReorderNic::due(Time now) noexcept {
    if (!chance_.happens(options_.rate)) return now;
    ++held_;
    return now + options_.hold;
}

}  // namespace margay
