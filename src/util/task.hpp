// Crew: tasks that run concurrently. Task itself is public: <margay/task.hpp>.
#pragma once

#include "util/arena.hpp"

#include <margay/task.hpp>

#include <coroutine>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace margay {

// The right to end a task of a Crew. The guard of the task calls release() when the task ends, either by itself or with
// its Crew, so the handle never refers to a destroyed coroutine.
class TaskHandle {
  public:
    TaskHandle() = default;
    TaskHandle(const TaskHandle&) = delete;
    TaskHandle& operator=(const TaskHandle&) = delete;
    ~TaskHandle() { end(); }

    // Call it before the task is started.
    template <class T>
    void take(const Task<T>& task) {
        handle_ = task.handle();
    }
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(handle_); }
    void release() { handle_ = {}; }
    // Ends the task if it is still running. A task must not end itself by this function.
    void end() {
        if (handle_) std::exchange(handle_, {}).destroy();
    }

  private:
    std::coroutine_handle<> handle_;
};

// Tasks that run concurrently for one parent task, which waits for one or for all of them. The destructor of the crew
// ends them.
class Crew {
  public:
    explicit Crew(std::size_t most = SIZE_MAX) : most_(most) {}
    Crew(const Crew&) = delete;
    Crew& operator=(const Crew&) = delete;
    ~Crew() {
        while (detail::PromiseBase* member = members_.front()) member->self.destroy();
    }

    [[nodiscard]] std::size_t running() const { return running_; }
    [[nodiscard]] bool full() const { return running_ >= most_; }
    // The first error of a member.
    [[nodiscard]] const Error& first_error() const { return first_error_; }

    // Starts a task and takes ownership of it. Returns false and does nothing when the task is empty (arena full).
    template <class T>
    [[nodiscard]] bool start(Task<T> task) {
        if (!task) return false;
        detail::PromiseBase& member = task.promise();
        auto handle = std::exchange(task.handle_, {});
        member.crew = this;
        member.self = handle;
        members_.push_back(member);
        ++running_;
        handle.resume();
        return true;
    }

    // Awaitable: waits until one member has ended (returns at once when none is running), or until all have ended.
    struct Wait {
        Crew& crew;
        bool all;
        bool await_ready() const noexcept { return crew.running_ == 0 || (!all && crew.ended_ > 0); }
        void await_suspend(std::coroutine_handle<> waiting) const noexcept {
            crew.parent_ = waiting;
            crew.wait_all_ = all;
        }
        void await_resume() const noexcept { crew.ended_ = 0; }
    };
    [[nodiscard]] Wait one() { return {*this, false}; }
    [[nodiscard]] Wait all() { return {*this, true}; }

    // Ends all members; calls `after` after each.
    template <class After>
    void end_all(After after) {
        while (detail::PromiseBase* member = members_.front()) {
            member->self.destroy();
            after();
        }
    }

    // Called by Task: a member has ended or was destroyed from outside.
    void member_gone() noexcept { --running_; }
    // Called by Task: a member has ended. Returns the coroutine to resume.
    std::coroutine_handle<> member_ended(const Error& error) noexcept {
        ++ended_;
        if (error.code != Errc::none && first_error_.code == Errc::none) first_error_ = error;
        if (parent_ && (running_ == 0 || !wait_all_)) return std::exchange(parent_, {});
        return std::noop_coroutine();
    }

  private:
    List<detail::PromiseBase> members_;
    std::coroutine_handle<> parent_;
    std::size_t most_;
    std::size_t running_ = 0;
    std::size_t ended_ = 0;
    bool wait_all_ = false;
    Error first_error_;
};

}  // namespace margay
