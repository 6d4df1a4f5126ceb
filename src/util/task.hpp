// Task<T>: a protocol sequence as a coroutine whose frame lives in an Arena.
//
//     Task<Result<std::uint16_t>> read_something(Engine& engine, …) { auto reply = co_await …; …; co_return
//     value; }
//
// The first parameter of the coroutine (for a member function: the object) names the arena by a member
// arena(). When the arena is full the call returns an empty task; awaiting it yields Errc::capacity and
// nothing has happened. T is always a Result. A task starts when it is awaited or given to a Crew, and ends
// with whoever owns it: destroying a Task destroys what it was waiting for.
#pragma once

#include "util/arena.hpp"
#include "util/list.hpp"

#include <margay/result.hpp>

#include <coroutine>
#include <cstddef>
#include <utility>

namespace margay {

class Crew;

namespace detail {

struct PromiseBase : ListNode {
    std::coroutine_handle<> continuation;  // whoever awaits the task,
    Crew* crew = nullptr;                  // or the crew it belongs to:
    std::coroutine_handle<> self;          // then the list node is in the crew's list

    PromiseBase() = default;
    ~PromiseBase();

    // The frame lies behind a word that says which arena it is from.
    static constexpr std::size_t kHeaderBytes = alignof(std::max_align_t);

    template <class First, class... Rest>
    static void* operator new(std::size_t bytes, First& first, Rest&...) noexcept {
        Arena& arena = first.arena();
        auto* memory = static_cast<std::byte*>(arena.allocate(bytes + kHeaderBytes));
        if (memory == nullptr) return nullptr;
        *reinterpret_cast<Arena**>(memory) = &arena;
        return memory + kHeaderBytes;
    }
    static void operator delete(void* frame) noexcept {
        auto* memory = static_cast<std::byte*>(frame) - kHeaderBytes;
        (*reinterpret_cast<Arena**>(memory))->release(memory);
    }

    std::suspend_always initial_suspend() noexcept { return {}; }
    void unhandled_exception() noexcept {}
};

}  // namespace detail

template <class T>
class [[nodiscard]] Task {
  public:
    struct promise_type : detail::PromiseBase {
        T value{};

        static Task get_return_object_on_allocation_failure() noexcept { return Task(); }
        Task get_return_object() noexcept { return Task(std::coroutine_handle<promise_type>::from_promise(*this)); }
        void return_value(T result) noexcept { value = std::move(result); }

        struct Final {
            bool await_ready() noexcept { return false; }
            std::coroutine_handle<> await_suspend(std::coroutine_handle<promise_type> self) noexcept;
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

    // False when the arena had no room for it.
    [[nodiscard]] explicit operator bool() const { return static_cast<bool>(handle_); }
    [[nodiscard]] bool done() const { return !handle_ || handle_.done(); }
    // The value of a task that is done.
    [[nodiscard]] T result() const { return handle_ ? handle_.promise().value : T(Error{.code = Errc::capacity}); }
    // The coroutine itself, for TaskHandle.
    [[nodiscard]] std::coroutine_handle<> handle() const { return handle_; }
    // The coroutine's address, by which it can be destroyed wherever it is kept.
    [[nodiscard]] void* address() const { return handle_.address(); }
    // Starts a task that nobody awaits; its owner asks done().
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

// The right to end a task that a Crew runs. The task's own guard calls release() when the task ends by itself or with
// its Crew, so that the handle never names a coroutine that is gone.
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
    // Ends the task if it still runs. A task must not end itself by this.
    void end() {
        if (handle_) std::exchange(handle_, {}).destroy();
    }

  private:
    std::coroutine_handle<> handle_;
};

// Tasks that run beside each other on behalf of one parent, which waits for one or for all of them.
// Destroying the crew ends them.
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
    // The first error that a member ended with.
    [[nodiscard]] const Error& first_error() const { return first_error_; }

    // Starts a task, which then belongs to the crew. False when the task is empty (arena full): nothing has
    // happened.
    template <class T>
    [[nodiscard]] bool start(Task<T> task) {
        if (!task) return false;
        auto handle = std::exchange(task.handle_, {});
        detail::PromiseBase& member = handle.promise();
        member.crew = this;
        member.self = handle;
        members_.push_back(member);
        ++running_;
        handle.resume();
        return true;
    }

    // Awaitables: until one member has ended (at once when none runs), until all have.
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

    // For Task: a member is gone, be it that it has ended or that it was destroyed from outside.
    void member_gone() noexcept { --running_; }
    // For Task: a member has ended; who goes on now?
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

inline detail::PromiseBase::~PromiseBase() {
    if (crew != nullptr) crew->member_gone();
}

template <class T>
std::coroutine_handle<> Task<T>::promise_type::Final::await_suspend(std::coroutine_handle<promise_type> self) noexcept {
    auto& promise = self.promise();
    if (promise.crew != nullptr) {
        Crew& crew = *promise.crew;
        const Error error = promise.value.error();
        self.destroy();
        return crew.member_ended(error);
    }
    return promise.continuation ? promise.continuation : std::noop_coroutine();
}

}  // namespace margay
