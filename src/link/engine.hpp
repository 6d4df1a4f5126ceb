// The engine of a master: the link, the tasks that wait for it, and the time that poll() was last told.
#pragma once

#include "link/cycle.hpp"
#include "util/arena.hpp"

#include <margay/time.hpp>

namespace margay {

class Engine {
  public:
    // `nic` and both pieces of memory outlive the engine.
    Engine(Nic& nic, std::span<FrameSlot> slots, std::span<std::byte> arena_memory)
        : link_(nic, slots), arena_(arena_memory) {}

    // Takes in replies, resumes what waited for them or whose time has come, sends what is queued, and returns when it
    // wants to be called again. `now` never goes backwards. Never waits.
    Time poll(Time now);

    // For the cycle: takes in one frame and resumes nobody before the next poll(). False when there is none.
    bool receive_one(Time now) { return link_.receive_one(now, ready_); }
    // The same until all of these frames are back.
    [[nodiscard, gnu::always_inline]] CycleEnd receive_cycle(std::span<PreparedFrame> frames, Time now) {
        return link_.receive_cycle(frames, now, ready_);
    }

    [[nodiscard]] bool receive_overlapped(std::span<PreparedFrame> frames, Time now) {
        return link_.receive_overlapped(frames, now, ready_);
    }

    [[nodiscard]] Arena& arena() { return arena_; }
    [[nodiscard]] Link& link() { return link_; }
    // The time of the current poll(), and for what is started just before one.
    [[nodiscard]] Time now() const { return now_; }
    void set_now(Time now) { now_ = now; }

    // Awaitable: until `until` has come.
    struct Sleep {
        struct Timer : Waiter {
            Time until;
        };
        Engine& engine;
        Timer timer;
        Sleep(Engine& e, Time until) : engine(e) { timer.until = until; }
        bool await_ready() const noexcept { return timer.until <= engine.now_; }
        void await_suspend(std::coroutine_handle<> h) noexcept { engine.sleep(timer, h, timer.until); }
        void await_resume() const noexcept {}
    };
    // Awaitable: until the next poll(), from which on now() is the time.
    struct NextPoll : Sleep {
        explicit NextPoll(Engine& e) : Sleep(e, Time::min()) {}
        bool await_ready() const noexcept { return false; }
    };
    // Ends a sleep with the next poll().
    void wake(Sleep::Timer& timer) { ready_.push_back(timer); }
    [[nodiscard]] NextPoll next_poll() { return NextPoll(*this); }
    [[nodiscard]] Sleep sleep_until(Time until) { return {*this, until}; }
    [[nodiscard]] Sleep sleep_for(Duration duration) { return {*this, now_ + duration}; }

    // For awaitables of other layers: resumes the timer's coroutine when its time has come, or any waiter in this
    // poll() or the next one, whatever it was waiting for. Never resumes at once.
    void sleep(Sleep::Timer& timer, std::coroutine_handle<> waiting, Time until) {
        timer.handle = waiting;
        timer.until = until;
        add_timer(timer);
    }
    void wake(Waiter& waiter) { ready_.push_back(waiter); }

  private:
    void add_timer(Sleep::Timer& timer);

    Link link_;
    Arena arena_;
    List<Waiter> ready_;
    List<Sleep::Timer> timers_;  // soonest first
    Time now_ = Time::min();
};

}  // namespace margay
