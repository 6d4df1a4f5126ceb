#include "link/engine.hpp"

#include <margay/task.hpp>

#include <algorithm>

namespace margay {

void Engine::add_timer(Sleep::Timer& timer) {
    // Search from the end, because a new timer is usually the latest one.
    Sleep::Timer* later = nullptr;
    for (Sleep::Timer* t = timers_.back(); t != nullptr && t->until > timer.until; t = timers_.before(*t)) later = t;
    if (later == nullptr)
        timers_.push_back(timer);
    else
        timers_.insert_before(*later, timer);
}

Engine::Sleep::Sleep(Engine& e, Time until) : engine(e) { timer.until = until; }

bool Engine::Sleep::await_ready() const noexcept { return timer.until <= engine.now_; }

void Engine::Sleep::await_suspend(std::coroutine_handle<> h) noexcept { engine.sleep(timer, h, timer.until); }

Engine::Sleep Engine::sleep_for(Duration duration) { return {*this, later(now_, duration)}; }

Time Engine::poll(Time now) {
    now_ = now;
    link_.receive(now, ready_);
    for (auto* timer = timers_.front(); timer != nullptr && timer->until <= now; timer = timers_.front())
        ready_.push_back(*timer);
    List<detail::PromiseBase> starving;
    starving.take_back(arena_.starving);
    while (detail::PromiseBase* sequence = starving.pop_front()) detail::end_of_starving(*sequence).resume();
    while (Waiter* waiter = ready_.pop_front()) DatagramWait::next(*waiter).resume();
    link_.send(now);
    Time timer = timers_.empty() ? kNever : timers_.front()->until;
    if (!arena_.starving.empty()) timer = std::min(timer, later(now, std::chrono::milliseconds(1)));
    return std::min(timer, link_.next_deadline(now));
}

}  // namespace margay
