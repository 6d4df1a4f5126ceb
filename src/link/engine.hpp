// The engine of a master: the link, the arena and the timers of the tasks that wait, and the time of the last poll().
#pragma once

#include "link/cycle.hpp"
#include "util/arena.hpp"

#include <margay/time.hpp>

namespace margay {

class Engine {
  public:
    // `nic` and the memory of `slots` and `arena_memory` outlive the engine.
    Engine(Nic& nic, std::span<FrameSlot> slots, std::span<std::byte> arena_memory)
        : link_(nic, slots), arena_(arena_memory) {}

    // Receives replies, resumes the coroutines whose datagrams have ended or whose time has come, sends the queued
    // datagrams, and returns the time at which it must be called again at the latest. `now` never decreases. Does not
    // block.
    Time poll(Time now);

    // For the cycle: receives one frame. Coroutines that become ready are resumed by the next poll(). False when the
    // NIC has no frame.
    bool receive_one(Time now) { return link_.receive_one(now, ready_); }
    // The same, repeatedly, until all of these frames are back or the NIC has no frame.
    [[nodiscard, gnu::always_inline]] CycleEnd receive_cycle(std::span<PreparedFrame> frames, Time now) {
        return link_.receive_cycle(frames, now, ready_);
    }

    [[nodiscard]] bool receive_overlapped(std::span<PreparedFrame> frames, Time now) {
        return link_.receive_overlapped(frames, now, ready_);
    }

    [[nodiscard]] Arena& arena() { return arena_; }
    [[nodiscard]] Link& link() { return link_; }
    // The time of the current poll(). Set it before starting a task outside of poll().
    [[nodiscard]] Time now() const { return now_; }
    void set_now(Time now) { now_ = now; }

    // Awaitable: resumes when the time `until` has come.
    struct Sleep {
        struct Timer : Waiter {
            Time until;
        };
        Engine& engine;
        Timer timer;
        Sleep(Engine& e, Time until);
        bool await_ready() const noexcept;
        void await_suspend(std::coroutine_handle<> h) noexcept;
        void await_resume() const noexcept {}
    };
    // Awaitable: resumes in the next poll(); now() is the time of that poll() then.
    struct NextPoll : Sleep {
        explicit NextPoll(Engine& e) : Sleep(e, Time::min()) {}
        bool await_ready() const noexcept { return false; }
    };
    // Ends a sleep in the next poll().
    void wake(Sleep::Timer& timer) { ready_.push_back(timer); }
    [[nodiscard]] NextPoll next_poll() { return NextPoll(*this); }
    [[nodiscard]] Sleep sleep_until(Time until) { return {*this, until}; }
    [[nodiscard]] Sleep sleep_for(Duration duration);

    // For awaitables of other layers. sleep() resumes the timer's coroutine when its time has come; wake() resumes any
    // waiter in this poll() or in the next one, whatever it waits for. Neither resumes a coroutine during the call.
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
    List<Sleep::Timer> timers_;  // sorted, soonest first
    Time now_ = Time::min();
};

}  // namespace margay
