// Task<T>: a sequence, that is, a C++20 coroutine that waits without blocking the thread. Hooks of the application are
// written as tasks (see hook.hpp), and so are all protocol sequences of the library.
//
//     margay::Task<> choose_mode(margay::HookedSlave slave, void*) {
//         const auto mode = co_await slave.sdo_read<std::int8_t>(0x6061, 0);
//         if (!mode) co_return mode.error();
//         …
//     }
//
// T is a Result. `required()` ends the awaiting sequence with the error of the awaited one:
//
//         const auto mode = co_await required(slave.sdo_read<std::int8_t>(0x6061, 0));
//         co_await required(slave.sdo_write(0x6060, 0, mode));
//
// The memory of the coroutine comes from the arena of a context: one parameter of the coroutine (for a member function:
// the object) has a member arena(). If the arena is full, the call returns an empty task: awaiting it yields
// Errc::capacity in the next poll(), and no statement of the sequence is executed. A task begins when it is awaited. A
// Task is a pointer: await each task that you create, because the memory of a task that is never awaited stays in use
// until the context ends. A task that is destroyed destroys all tasks that it awaits.
//
// An exception must not leave a sequence: that ends the program.
#pragma once

#include <margay/detail/list.hpp>
#include <margay/result.hpp>

#include <concepts>
#include <coroutine>
#include <cstddef>
#include <cstdint>

namespace margay {

class Arena;
class Crew;

namespace detail {

// Allocates the memory of a coroutine; nullptr if the arena is full.
[[nodiscard]] void* allocate_frame(Arena& arena, std::size_t bytes) noexcept;
void release_frame(void* frame) noexcept;
[[noreturn]] void exception_left_sequence() noexcept;

// The functions of this class that each sequence calls are out of line: they are compiled once, not for each sequence.
struct PromiseBase : ListLink {
    // The coroutine or crew that continues when the task ends.
    enum class Parent : std::uint8_t {
        none,
        crew,            // the task is a member of `crew`
        task,            // `waiting` awaits the result of the task
        required,        // `waiting` awaits the task by required(): an error ends `waiting` too
        required_value,  // the same, and `waiting` reads the value of the task
        completion,      // `waiting` awaits the end of the task, and not its result
    };

    union {
        PromiseBase* waiting = nullptr;
        Crew* crew;
    };
    PromiseBase* awaited = nullptr;  // the task that this one awaits
    Error error;                     // the error that the task has returned
    Parent parent = Parent::none;
    bool over = false;   // the task has ended
    bool fails = false;  // in Arena::starving: `error` ends the task in the next poll()

    PromiseBase() noexcept;
    // No destructor, because each sequence would call it: see destroy_task().
    PromiseBase(const PromiseBase&) = delete;
    PromiseBase& operator=(const PromiseBase&) = delete;

    void return_value(const Error& returned) noexcept;

    // The coroutine. The distance from it to its promise depends on the alignment only, see Promise.
    [[nodiscard]] std::coroutine_handle<> self() noexcept {
        return std::coroutine_handle<PromiseBase>::from_promise(*this);
    }

    // Both operators are inlined: otherwise GCC does not recognise that they belong together, and warns in the sources
    // of users.
    template <class First, class... Rest>
    [[gnu::always_inline]] static void* operator new(std::size_t bytes, First& first, Rest&... rest) noexcept {
        if constexpr (requires { first.arena(); })
            return allocate_frame(first.arena(), bytes);
        else
            return operator new(bytes, rest...);
    }
    [[gnu::always_inline]] static void operator delete(void* frame) noexcept { release_frame(frame); }

    std::suspend_always initial_suspend() noexcept { return {}; }
    void unhandled_exception() noexcept { exception_left_sequence(); }
};

// Begins `task` for the sequence that awaits it. Returns the coroutine that continues. nullptr: the arena was full.
// Then the waiting sequence continues, or ends, only in the next poll(), because it may repeat the attempt without end.
[[nodiscard]] std::coroutine_handle<> await_task(PromiseBase* task, PromiseBase& waiting) noexcept;
[[nodiscard]] std::coroutine_handle<> require_task(PromiseBase* task, PromiseBase& waiting) noexcept;
[[nodiscard]] std::coroutine_handle<> require_value(PromiseBase* task, PromiseBase& waiting) noexcept;
[[nodiscard]] std::coroutine_handle<> await_completion(PromiseBase* task, PromiseBase& waiting) noexcept;
// For poll(): returns the coroutine that continues for a sequence of Arena::starving.
[[nodiscard]] std::coroutine_handle<> end_of_starving(PromiseBase& task) noexcept;
// Called when the task has ended; its result is in its promise. Returns the coroutine that continues.
[[nodiscard]] std::coroutine_handle<> end_of_task(PromiseBase& task) noexcept;
// Destroys a task, after the task that it awaits. nullptr: no effect.
void destroy_task(PromiseBase* task) noexcept;
// Destroys a task that has ended, and that `waiting` has awaited.
void release_awaited(PromiseBase& task) noexcept;

// The promise of a task that returns a Result<T>.
template <class T>
struct Promise : PromiseBase {
    static_assert(alignof(T) <= 2 * sizeof(void*), "PromiseBase::self() does not find the coroutine");
    T value{};

    // Templates, so that only the last one takes `co_return {}`.
    template <std::same_as<Error> E>
    void return_value(const E& returned) noexcept {
        PromiseBase::return_value(returned);
    }
    template <std::same_as<T> Value>
    void return_value(const Value& returned) noexcept {
        value = returned;
    }
    [[gnu::noinline]] void return_value(const Result<T>& returned) noexcept {
        error = returned.error();
        value = *returned;
    }
    [[nodiscard]] Result<T> result() const { return error.code == Errc::none ? Result<T>(value) : Result<T>(error); }
};
template <>
struct Promise<Nothing> : PromiseBase {
    template <std::same_as<Error> E>
    void return_value(const E& returned) noexcept {
        PromiseBase::return_value(returned);
    }
    template <std::same_as<Result<>> R>
    void return_value(const R& returned) noexcept {
        PromiseBase::return_value(returned.error());
    }
    void return_value(Nothing) noexcept {}
    [[nodiscard]] Result<> result() const { return error; }
};

}  // namespace detail

// Refers to a task; owns nothing.
class TaskReference {
  public:
    TaskReference() = default;
    // False if there is no task: the arena had no memory for it.
    [[nodiscard]] explicit operator bool() const { return promise_ != nullptr; }

  protected:
    friend class Completion;
    friend class Crew;
    friend struct TaskAccess;
    explicit TaskReference(detail::PromiseBase& promise) : promise_(&promise) {}
    detail::PromiseBase* promise_ = nullptr;
};

template <class T = Result<>>
class [[nodiscard]] Task : public TaskReference {
  public:
    struct promise_type : detail::Promise<typename T::Value> {
        static Task get_return_object_on_allocation_failure() noexcept { return Task(); }
        Task get_return_object() noexcept { return Task(*this); }

        struct Final {
            bool await_ready() noexcept { return false; }
            std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> own) noexcept {
                return detail::end_of_task(own.promise());
            }
            void await_resume() noexcept {}
        };
        Final final_suspend() noexcept { return {}; }
    };

    Task() = default;
    Task(Task&&) = default;  // trivial, so that a Task is passed in a register
    Task& operator=(Task&&) = default;

    bool await_ready() const noexcept { return false; }
    template <std::derived_from<detail::PromiseBase> P>
    std::coroutine_handle<> await_suspend(std::coroutine_handle<P> waiting) const noexcept {
        return detail::await_task(promise_, waiting.promise());
    }
    T await_resume() const noexcept { return take_result(promise_); }

    // The awaitable that required() returns.
    class Required {
      public:
        explicit Required(const Task& task) : task_(task.promise_) {}
        bool await_ready() const noexcept { return false; }
        template <std::derived_from<detail::PromiseBase> P>
        std::coroutine_handle<> await_suspend(std::coroutine_handle<P> waiting) noexcept {
            if constexpr (std::same_as<typename T::Value, Nothing>)
                return detail::require_task(task_, waiting.promise());
            else
                return detail::require_value(task_, waiting.promise());
        }
        typename T::Value await_resume() const noexcept {
            if constexpr (std::same_as<typename T::Value, Nothing>)
                return {};
            else
                return take_value(task_);
        }

      private:
        detail::PromiseBase* task_;
    };

  protected:
    // For the owner of a task that no coroutine awaits: begins the task. done() is true when the task has ended.
    void start() {
        if (promise_ != nullptr) promise_->self().resume();
    }
    [[nodiscard]] bool done() const { return promise_ == nullptr || promise_->over; }
    // The result of a finished task.
    [[nodiscard, gnu::noinline]] T result() const {
        return promise_ != nullptr ? promise().result() : T(Error{.code = Errc::capacity});
    }

  private:
    using TaskReference::TaskReference;
    [[nodiscard]] promise_type& promise() const { return static_cast<promise_type&>(*promise_); }
    // Static: GCC copies a member function into each source to pass `promise_` in place of `this`.
    [[gnu::noinline]] static T take_result(detail::PromiseBase* task) noexcept {
        if (task == nullptr) return Error{.code = Errc::capacity};
        T result = static_cast<promise_type*>(task)->result();
        detail::release_awaited(*task);
        return result;
    }
    [[nodiscard, gnu::noinline]] static typename T::Value take_value(detail::PromiseBase* task) noexcept {
        const typename T::Value value = static_cast<promise_type*>(task)->value;
        detail::release_awaited(*task);
        return value;
    }
};

// Awaitable: awaits the task and returns its value. If the task returns an error, the awaiting sequence ends with this
// error, and no further statement of it is executed.
template <class T>
[[nodiscard]] typename Task<T>::Required required(Task<T> task) {
    return typename Task<T>::Required(task);
}

// Awaitable: awaits the end of the task, whether it succeeds or fails.
class [[nodiscard]] Completion {
  public:
    explicit Completion(TaskReference task) : task_(task.promise_) {}
    bool await_ready() const noexcept { return false; }
    template <std::derived_from<detail::PromiseBase> P>
    std::coroutine_handle<> await_suspend(std::coroutine_handle<P> waiting) const noexcept {
        return detail::await_completion(task_, waiting.promise());
    }
    void await_resume() const noexcept {}

  private:
    detail::PromiseBase* task_;
};
template <class T>
Completion completion(Task<T> task) {
    return Completion(task);
}

}  // namespace margay
