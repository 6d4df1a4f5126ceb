// The state of a request, which its threads and the owner share.
#include "api/queue.hpp"

#include "osal/osal.hpp"

namespace margay {

bool RequestAccess::claim(Request& r, Context& ctx) {
    constexpr auto kBusy = static_cast<std::uint32_t>(RequestState::busy);
    std::uint32_t state = r.state_.load(std::memory_order_relaxed);
    do {
        if (Request::plain(state) == RequestState::busy) return false;
    } while (!r.state_.compare_exchange_weak(state, kBusy | Request::kPreparing, std::memory_order_acq_rel));
    r.ctx_ = &ctx;
    r.error_ = {};
    r.passed_ = 0;
    r.why_ = Errc::canceled;
    r.sequence_ = {};
    r.deadline_ = kNever;
    r.cancel_asked_.store(false, std::memory_order_relaxed);
    r.state_.fetch_and(~Request::kPreparing, std::memory_order_release);
    return true;
}

void RequestAccess::end(Request& r, const Error& error, Osal& osal) {
    r.sequence_ = {};
    r.error_ = error;
    const RequestState state = error.code == Errc::none ? RequestState::success : RequestState::error;
    const std::uint32_t before = r.state_.exchange(static_cast<std::uint32_t>(state), std::memory_order_acq_rel);
    // Use only the address of the word from here on: a thread that has seen the end may have destroyed the request.
    if ((before & Request::kAwaited) != 0) osal.wake_sleepers(&r.state_);
}

void RequestAccess::sleep(Request& r, Osal& osal, Time until) {
    std::uint32_t state = r.state_.load(std::memory_order_acquire);
    if (Request::plain(state) != RequestState::busy) return;
    const std::uint32_t awaited = state | Request::kAwaited;
    if (state != awaited && !r.state_.compare_exchange_strong(state, awaited, std::memory_order_acq_rel)) return;
    osal.sleep_while(r.state_, awaited, until);
}

}  // namespace margay
