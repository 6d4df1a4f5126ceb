#include "attach/event_log.hpp"

#include <algorithm>

namespace margay::attach {

EventLog::EventLog(Context& ctx) : ctx_(ctx), before_(ctx.events().callback), before_user_(ctx.events().user) {
    ctx.events().user = this;
    ctx.events().callback = tap;
}

// Several servers may observe the same events: their callbacks form a chain, and the servers end in any order.
EventLog::~EventLog() {
    auto* callback = &ctx_.events().callback;
    auto* user = &ctx_.events().user;
    while (*callback == tap && *user != this) {
        auto& newer = *static_cast<EventLog*>(*user);
        callback = &newer.before_;
        user = &newer.before_user_;
    }
    if (*callback != tap) return;  // the application has set another callback
    *callback = before_;
    *user = before_user_;
}

void EventLog::tap(const Event& event, void* user) {
    auto& log = *static_cast<EventLog*>(user);
    (void)log.ring_.add(event);
    if (log.before_ != nullptr) log.before_(event, log.before_user_);
}

void EventLog::collect() {
    while (const auto event = ring_.take()) {
        std::array<char, 400> text{};
        kept_.push_back({.number = ++last_,
                         .at_ns = event->at.time_since_epoch().count(),
                         .kind = event->kind,
                         .slave = event->slave,
                         .text = std::string(describe(*event, text))});
        if (kept_.size() > kKept) kept_.pop_front();
    }
}

Octets EventLog::after(std::uint64_t number) const {
    const auto first = std::ranges::find_if(kept_, [&](const EventFacts& event) { return event.number > number; });
    const auto count = std::min<std::size_t>(static_cast<std::size_t>(kept_.end() - first), kOnce);
    Octets out(64 + count * 512);
    Writer into(out);
    into(last_, ring_.dropped(), static_cast<std::uint32_t>(count));
    for (std::size_t n = 0; n < count; ++n) into(*(first + static_cast<std::ptrdiff_t>(n)));
    out.resize(into.written().size());
    return out;
}

}  // namespace margay::attach
