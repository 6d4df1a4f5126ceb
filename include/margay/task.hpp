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
// yields Errc::capacity, and no statement of the sequence is executed. A task begins when it is awaited. Destroying a
// task destroys all tasks that it awaits.
//
// An exception must not leave a sequence: that ends the program.
#pragma once

#include <margay/detail/list.hpp>
#include <margay/result.hpp>

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

struct PromiseBase : ListNode {
    std::coroutine_handle<> continuation;  // the coroutine that awaits the task,
    Crew* crew = nullptr;                  // or the crew that the task belongs to: then
    std::coroutine_handle<> self;          // the node of this object is in the list of the crew

    PromiseBase() = default;
    ~PromiseBase();

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
    [[nodiscard]] std::coroutine_handle<> ended(std::coroutine_handle<> own, const Error& error) noexcept;
};

}  // namespace detail

template <class T = Result<>>
class [[nodiscard]] Task {
  public:
    struct promise_type : detail::PromiseBase {
        T value{};

        static Task get_return_object_on_allocation_failure() noexcept { return Task(); }
        Task get_return_object() noexcept { return Task(std::coroutine_handle<promise_type>::from_promise(*this)); }
        void return_value(T result) noexcept { value = std::move(result); }

        struct Final {
            bool await_ready() noexcept { return false; }
            std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> own) noexcept {
                return own.promise().ended(own, own.promise().value.error());
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
    ~Task() { reset(); }

    // False if the arena had no memory for the task.
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(handle_); }
    [[nodiscard]] bool done() const { return !handle_ || handle_.done(); }
    // The value of a finished task.
    [[nodiscard]] T result() const { return handle_ ? handle_.promise().value : T(Error{.code = Errc::capacity}); }
    // The coroutine of the task. Destroying it destroys the task, wherever the Task object is.
    [[nodiscard]] std::coroutine_handle<> handle() const { return handle_; }
    // Begins a task that no coroutine awaits; its owner calls done() to find its end.
    void start() {
        if (handle_) handle_.resume();
    }
    void reset() {
        if (handle_) std::exchange(handle_, {}).destroy();
    }

    bool await_ready() const noexcept { return !handle_; }
    std::coroutine_handle<> await_suspend(std::coroutine_handle<> waiting) noexcept {
        handle_.promise().continuation = waiting;
        return handle_;
    }
    T await_resume() noexcept { return result(); }

  private:
    friend class Crew;
    explicit Task(std::coroutine_handle<promise_type> handle) : handle_(handle) {}
    std::coroutine_handle<promise_type> handle_;
};

}  // namespace margay
