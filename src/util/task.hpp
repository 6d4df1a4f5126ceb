// Crew: tasks that run concurrently. Task itself is public: <margay/task.hpp>.
#pragma once

#include "util/arena.hpp"

#include <margay/task.hpp>

#include <coroutine>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace margay {

struct TaskAccess {
    // Destroys the task, which exists, or no task. A task must not destroy itself.
    static void end(TaskReference task) noexcept { detail::destroy_task(task.promise_); }
};

// The right to end a task of a Crew. The guard of the task calls release() when the task ends, either by itself or with
// its Crew, so the handle never refers to a destroyed coroutine.
class TaskHandle {
  public:
    TaskHandle() = default;
    TaskHandle(const TaskHandle&) = delete;
    TaskHandle& operator=(const TaskHandle&) = delete;
    ~TaskHandle() { end(); }

    // Call it before the task is started.
    void take(TaskReference task) { task_ = task; }
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(task_); }
    void release() { task_ = {}; }
    // Ends the task if it is still running. A task must not end itself by this function.
    void end() { TaskAccess::end(std::exchange(task_, {})); }

  private:
    TaskReference task_;
};

// A task that no coroutine awaits. The destructor destroys the task.
template <class T = Result<>>
class OwnedTask : public Task<T> {
  public:
    OwnedTask() = default;
    explicit(false) OwnedTask(Task<T> task) : Task<T>(std::move(task)) {}
    OwnedTask(OwnedTask&& other) noexcept : Task<T>(std::exchange(other.task(), {})) {}
    OwnedTask& operator=(OwnedTask&& other) noexcept {
        if (this != &other) {
            reset();
            task() = std::exchange(other.task(), {});
        }
        return *this;
    }
    ~OwnedTask() { TaskAccess::end(task()); }
    void reset() { TaskAccess::end(std::exchange(task(), {})); }

    using Task<T>::done;
    using Task<T>::result;
    using Task<T>::start;

  private:
    Task<T>& task() { return *this; }
};

// Tasks that run concurrently for one parent task, which waits for one or for all of them. The destructor of the crew
// ends them.
class Crew {
  public:
    explicit Crew(std::size_t most = SIZE_MAX) : most_(most) {}
    Crew(const Crew&) = delete;
    Crew& operator=(const Crew&) = delete;
    ~Crew();

    [[nodiscard]] std::size_t running() const { return running_; }
    [[nodiscard]] bool full() const { return running_ >= most_; }
    // The first error of a member.
    [[nodiscard]] const Error& first_error() const { return first_error_; }

    // Starts a task and takes ownership of it. Returns false and does nothing when the task is empty (arena full).
    [[nodiscard]] bool start(TaskReference task);

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

    // Called by Task: a member has ended or was destroyed from outside.
    void member_gone() noexcept { --running_; }
    // Called by Task: a member has ended. Returns the coroutine to resume.
    std::coroutine_handle<> member_ended(const Error& error) noexcept;

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
