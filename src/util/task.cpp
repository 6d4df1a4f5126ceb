#include "util/task.hpp"

namespace margay::detail {
namespace {

// A pointer to the arena is stored in front of the coroutine frame.
constexpr std::size_t kHeaderBytes = alignof(std::max_align_t);

}  // namespace

void* allocate_frame(Arena& arena, std::size_t bytes) noexcept {
    auto* memory = static_cast<std::byte*>(arena.allocate(bytes + kHeaderBytes));
    if (memory == nullptr) return nullptr;
    *reinterpret_cast<Arena**>(memory) = &arena;
    return memory + kHeaderBytes;
}

void release_frame(void* frame) noexcept {
    auto* memory = static_cast<std::byte*>(frame) - kHeaderBytes;
    (*reinterpret_cast<Arena**>(memory))->release(memory);
}

void exception_left_sequence() noexcept { __builtin_trap(); }

PromiseBase::PromiseBase() noexcept = default;

void PromiseBase::return_value(const Error& returned) noexcept { error = returned; }

namespace {

// All tasks are destroyed here.
void destroy(PromiseBase& task) noexcept {
    task.unlink();
    Crew* const crew = task.parent == PromiseBase::Parent::crew ? task.crew : nullptr;
    task.self().destroy();
    if (crew != nullptr) crew->member_gone();
}

std::coroutine_handle<> begin(PromiseBase& task, PromiseBase& waiting, PromiseBase::Parent parent) noexcept {
    waiting.awaited = &task;
    task.waiting = &waiting;
    task.parent = parent;
    return task.self();
}

// A sequence has found no memory. A member of a crew continues at once, and returns the error to the crew.
std::coroutine_handle<> starve(PromiseBase& task) noexcept {
    if (task.parent == PromiseBase::Parent::crew) return end_of_starving(task);
    auto* memory = static_cast<std::byte*>(task.self().address()) - kHeaderBytes;
    (*reinterpret_cast<Arena**>(memory))->starving.push_back(task);
    return std::noop_coroutine();
}

std::coroutine_handle<> require(PromiseBase* task, PromiseBase& waiting, PromiseBase::Parent parent) noexcept {
    if (task != nullptr) return begin(*task, waiting, parent);
    waiting.fails = true;
    return starve(waiting);
}

}  // namespace

std::coroutine_handle<> await_task(PromiseBase* task, PromiseBase& waiting) noexcept {
    return task != nullptr ? begin(*task, waiting, PromiseBase::Parent::task) : starve(waiting);
}

std::coroutine_handle<> require_task(PromiseBase* task, PromiseBase& waiting) noexcept {
    return require(task, waiting, PromiseBase::Parent::required);
}

std::coroutine_handle<> require_value(PromiseBase* task, PromiseBase& waiting) noexcept {
    return require(task, waiting, PromiseBase::Parent::required_value);
}

std::coroutine_handle<> await_completion(PromiseBase* task, PromiseBase& waiting) noexcept {
    return task != nullptr ? begin(*task, waiting, PromiseBase::Parent::completion) : starve(waiting);
}

std::coroutine_handle<> end_of_starving(PromiseBase& task) noexcept {
    if (!task.fails) return task.self();
    task.error.code = Errc::capacity;  // nothing has set the error yet
    task.error.detail = Error::kTasks;
    return end_of_task(task);
}

std::coroutine_handle<> end_of_task(PromiseBase& task) noexcept {
    using Parent = PromiseBase::Parent;
    PromiseBase* ended = &task;
    for (;;) {
        ended->over = true;
        if (ended->parent == Parent::none) return std::noop_coroutine();
        if (ended->parent == Parent::crew) {
            Crew& crew = *ended->crew;
            const Error error = ended->error;  // a copy, because the frame with the error is destroyed
            destroy_task(ended);
            return crew.member_ended(error);
        }
        PromiseBase& waiting = *ended->waiting;
        const bool failed = ended->error.code != Errc::none && ended->parent != Parent::completion;
        if (ended->parent == Parent::task || (!failed && ended->parent == Parent::required_value))
            return waiting.self();
        if (failed) waiting.error = ended->error;
        release_awaited(*ended);
        if (!failed) return waiting.self();
        ended = &waiting;
    }
}

void destroy_task(PromiseBase* task) noexcept {
    if (task == nullptr) return;
    PromiseBase* last = task;
    while (last->awaited != nullptr) last = last->awaited;
    while (last != task) {
        PromiseBase* const waiting = last->waiting;
        destroy(*last);
        last = waiting;
    }
    destroy(*task);
}

void release_awaited(PromiseBase& task) noexcept {
    task.waiting->awaited = nullptr;
    destroy(task);
}

}  // namespace margay::detail

namespace margay {

Crew::~Crew() {
    while (detail::PromiseBase* member = members_.front()) detail::destroy_task(member);
}

bool Crew::start(TaskReference task) {
    if (!task) return false;
    detail::PromiseBase& member = *task.promise_;
    member.crew = this;
    member.parent = detail::PromiseBase::Parent::crew;
    members_.push_back(member);
    ++running_;
    member.self().resume();
    return true;
}

std::coroutine_handle<> Crew::member_ended(const Error& error) noexcept {
    ++ended_;
    if (error.code != Errc::none && first_error_.code == Errc::none) first_error_ = error;
    if (parent_ && (running_ == 0 || !wait_all_)) return std::exchange(parent_, {});
    return std::noop_coroutine();
}

}  // namespace margay
