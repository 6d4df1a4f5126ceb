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

std::coroutine_handle<> begin_task(std::coroutine_handle<> task, PromiseBase& parent,
                                   std::coroutine_handle<> waiting) noexcept {
    if (task) return task;
    if (parent.crew != nullptr) return waiting;  // a member of a crew returns the error to the crew
    auto* memory = static_cast<std::byte*>(waiting.address()) - kHeaderBytes;
    parent.self = waiting;
    (*reinterpret_cast<Arena**>(memory))->starving.push_back(parent);
    return std::noop_coroutine();
}

void end_task(std::coroutine_handle<>& handle) noexcept {
    if (handle) std::exchange(handle, {}).destroy();
}

PromiseBase::PromiseBase() noexcept = default;

PromiseBase::~PromiseBase() {
    if (crew != nullptr) crew->member_gone();
}

void PromiseBase::return_value(const Error& returned) noexcept { error = returned; }

std::coroutine_handle<> PromiseBase::ended(std::coroutine_handle<> own) noexcept {
    if (crew == nullptr) return continuation ? continuation : std::noop_coroutine();
    Crew& ours = *crew;
    const Error kept = error;  // it is in the frame, so copy it before the frame is destroyed
    own.destroy();
    return ours.member_ended(kept);
}

}  // namespace margay::detail
