// Task<T>: a sequence, that is, a C++20 coroutine that waits without blocking the thread. Hooks of the application are
// written as tasks (see hook.hpp), and so are all protocol sequences of the library.
//
//     margay::Task<> choose_mode(margay::HookedSlave slave, void*) {
//         const auto mode = co_await slave.sdo_read<std::int8_t>(0x6061, 0);
//         if (!mode) co_return mode.error();
//         …
//     }
//
// T is a Result. The memory of the coroutine comes from the arena of a context: one parameter of the coroutine (for a
// member function: the object) has a member arena(). If the arena is full, the call returns an empty task: awaiting it
// yields Errc::capacity in the next poll(), and no statement of the sequence is executed. A task begins when it is
// awaited. Destroying a task destroys all tasks that it awaits.
//
// An exception must not leave a sequence: that ends the program.
#pragma once

#include <margay/detail/list.hpp>
#include <margay/result.hpp>

#include <concepts>
#include <coroutine>
#include <cstddef>
#include <utility>

namespace margay {

class Arena;
class Crew;

namespace detail {

// Allocates the memory of a coroutine; nullptr if the arena is full.
[[nodiscard]] void* allocate_frame(Arena& arena, std::size_t bytes) noexcept;
void release_frame(void* frame) noexcept;
[[noreturn]] void exception_left_sequence() noexcept;

// The functions of this class that each sequence calls are out of line: they are compiled once, not for each sequence.
struct PromiseBase : ListNode {
    std::coroutine_handle<> continuation;  // the coroutine that awaits the task,
    Crew* crew = nullptr;                  // or the crew that the task belongs to: then
    std::coroutine_handle<> self;          // the node of this object is in the list of the crew.
                                           // Or self waits for the next poll(): see begin_task()
    Error error;                           // the error that the task has returned

    PromiseBase() noexcept;
    ~PromiseBase();
    PromiseBase(const PromiseBase&) = delete;
    PromiseBase& operator=(const PromiseBase&) = delete;

    void return_value(const Error& returned) noexcept;

    // Both are inlined: GCC does not know that they belong together, and would warn in the sources of users.
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

  protected:
    // For Task: called at the end of a task. Returns the coroutine that continues.
    [[nodiscard]] std::coroutine_handle<> ended(std::coroutine_handle<> own) noexcept;
};

// Awaits a task: returns the coroutine to resume, that of the task. Without memory there was no task: then `waiting`
// continues in the next poll(), since it might try again and again.
[[nodiscard]] std::coroutine_handle<> begin_task(std::coroutine_handle<> task, PromiseBase& parent,
                                                 std::coroutine_handle<> waiting) noexcept;

// Destroys the coroutine of a task, if there is one.
void end_task(std::coroutine_handle<>& handle) noexcept;

// The promise of a task that returns a Result<T>.
template <class T>
struct Promise : PromiseBase {
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

template <class T = Result<>>
class [[nodiscard]] Task {
  public:
    struct promise_type : detail::Promise<typename T::Value> {
        static Task get_return_object_on_allocation_failure() noexcept { return Task(); }
        Task get_return_object() noexcept { return Task(std::coroutine_handle<promise_type>::from_promise(*this)); }

        struct Final {
            bool await_ready() noexcept { return false; }
            std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> own) noexcept {
                return own.promise().ended(own);
            }
            void await_resume() noexcept {}
        };
        Final final_suspend() noexcept { return {}; }
    };

    Task() = default;
    Task(Task&& other) noexcept : handle_(std::exchange(other.handle_, {})) {}
    Task& operator=(Task&& other) noexcept {
        if (this != &other) {
            reset();
            handle_ = std::exchange(other.handle_, {});
        }
        return *this;
    }
    ~Task() { detail::end_task(handle_); }

    // False if the arena had no memory for the task.
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(handle_); }
    [[nodiscard]] bool done() const { return !handle_ || handle_.done(); }
    // The value of a finished task.
    [[nodiscard, gnu::noinline]] T result() const {
        return handle_ ? promise().result() : T(Error{.code = Errc::capacity});
    }
    // The coroutine of the task. Destroying it destroys the task, wherever the Task object is.
    [[nodiscard]] std::coroutine_handle<> handle() const { return handle_; }
    // Begins a task that no coroutine awaits; its owner calls done() to find its end.
    void start() {
        if (handle_) handle_.resume();
    }
    void reset() { detail::end_task(handle_); }

    bool await_ready() const noexcept { return false; }
    template <std::derived_from<detail::PromiseBase> P>
    std::coroutine_handle<> await_suspend(std::coroutine_handle<P> waiting) noexcept {
        if (handle_) promise().continuation = waiting;
        return detail::begin_task(handle_, waiting.promise(), waiting);
    }
    T await_resume() noexcept { return result(); }

  private:
    friend class Crew;
    explicit Task(std::coroutine_handle<promise_type> handle) : handle_(handle) {}
    [[nodiscard]] promise_type& promise() const {
        return std::coroutine_handle<promise_type>::from_address(handle_.address()).promise();
    }
    std::coroutine_handle<> handle_;  // of a promise_type
};

}  // namespace margay
