// Task<T>: a sequence that waits without blocking anybody, as a C++20 coroutine. Hooks of the application are written
// with it (see hook.hpp), and so is every protocol sequence of the library.
//
//     margay::Task<> choose_mode(margay::HookedSlave slave, void*) {
//         const auto mode = co_await slave.sdo_read<std::int8_t>(0x6061, 0);
//         if (!mode) co_return mode.error();
//         …
//     }
//
// T is a Result. The memory of the coroutine comes from the arena of a context: one parameter of the coroutine (for a
// member function: the object) has a member arena(). When the arena is full, the call returns an empty task: to await
// an empty task yields Errc::capacity, and no statement of the sequence has been executed. A task begins when it is
// awaited. Whoever owns the task ends it: to destroy a task destroys all that it waits for.
//
// An exception must not leave a sequence: it ends the program.
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

// Memory of a coroutine, nullptr when the arena is full.
[[nodiscard]] void* allocate_frame(Arena& arena, std::size_t bytes) noexcept;
void release_frame(void* frame) noexcept;
[[noreturn]] void exception_left_sequence() noexcept;

struct PromiseBase : ListNode {
    std::coroutine_handle<> continuation;  // the coroutine that awaits the task,
    Crew* crew = nullptr;                  // or the crew that the task belongs to:
    std::coroutine_handle<> self;          // then the list node is in the list of the crew

    PromiseBase() = default;
    ~PromiseBase();

    template <class First, class... Rest>
    static void* operator new(std::size_t bytes, First& first, Rest&... rest) noexcept {
        if constexpr (requires { first.arena(); })
            return allocate_frame(first.arena(), bytes);
        else
            return operator new(bytes, rest...);
    }
    static void operator delete(void* frame) noexcept { release_frame(frame); }

    std::suspend_always initial_suspend() noexcept { return {}; }
    void unhandled_exception() noexcept { exception_left_sequence(); }

  protected:
    // For Task: the end of a task. Returns the coroutine that goes on.
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

    // False when the arena had no room for the task.
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(handle_); }
    [[nodiscard]] bool done() const { return !handle_ || handle_.done(); }
    // The value of a task that is done.
    [[nodiscard]] T result() const { return handle_ ? handle_.promise().value : T(Error{.code = Errc::capacity}); }
    // The coroutine, which can be destroyed by this wherever the task is kept.
    [[nodiscard]] std::coroutine_handle<> handle() const { return handle_; }
    // Begins a task that no coroutine awaits; its owner asks done().
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
