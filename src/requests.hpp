// How a request becomes a task of the engine. The sequence of a request is run(network, request) of
// namespace margay, declared before start() is called with it.
#pragma once

#include "context_access.hpp"
#include "network/network.hpp"

#include <margay/request.hpp>

#include <utility>

namespace margay {

struct RequestAccess {
    static void begin(Request& r, void* coroutine) {
        r.coroutine_ = coroutine;
        r.error_ = {};
        r.state_.store(RequestState::busy, std::memory_order_release);
    }
    static void end(Request& r, const Error& error) {
        r.coroutine_ = nullptr;
        r.error_ = error;
        r.state_.store(error.code == Errc::none ? RequestState::success : RequestState::error,
                       std::memory_order_release);
    }
    // Makes it busy; false when it is already. Of several threads one succeeds.
    [[nodiscard]] static bool claim(Request& r) {
        auto state = r.state_.load(std::memory_order_relaxed);
        do {
            if (state == RequestState::busy) return false;
        } while (!r.state_.compare_exchange_weak(state, RequestState::busy, std::memory_order_acq_rel));
        return true;
    }
    [[nodiscard]] static bool started(const Request& r) { return r.coroutine_ != nullptr; }
};

// Ends the request when its sequence is done, or when the context goes away under it.
class RequestGuard {
  public:
    explicit RequestGuard(Request& request) : request_(request) {}
    RequestGuard(const RequestGuard&) = delete;
    RequestGuard& operator=(const RequestGuard&) = delete;
    ~RequestGuard() { RequestAccess::end(request_, error_); }
    void done(const Error& error) { error_ = error; }

  private:
    Request& request_;
    Error error_{.code = Errc::canceled};
};

// What holds while a request of this kind is busy; most need nothing.
template <class R>
struct RequestScope {
    explicit RequestScope(Network&) {}
};

template <class R>
Task<Result<>> drive(Network& network, R& request) {
    RequestGuard guard(request);
    [[maybe_unused]] const RequestScope<R> scope(network);
    co_await network.engine.next_poll();
    auto result = co_await run(network, request);
    guard.done(result.error());
    co_return Result<>();
}

[[nodiscard]] inline Error check_slave(Network& network, std::uint16_t slave, Step step) {
    if (slave >= 1 && slave <= network.count) return {};
    return {.code = Errc::unknown_slave, .step = step, .slave = slave, .expected = network.count};
}

// Slave 0 is all of them.
[[nodiscard]] inline Error check_slave_or_all(Network& network, std::uint16_t slave, Step step) {
    return slave == 0 ? Error{} : check_slave(network, slave, step);
}

[[nodiscard]] inline Error check_words(std::size_t octets, std::uint16_t slave, Step step) {
    if (octets % 2 == 0) return {};
    return {.code = Errc::invalid_argument, .step = step, .slave = slave};
}

template <class R>
Result<> start(Context& ctx, R& request, const Error& refused) {
    if (refused.code != Errc::none) return refused;
    if (request.busy()) return Error{.code = Errc::busy};
    Task<Result<>> task = drive(*ContextAccess::network(ctx), request);
    if (!task) return Error{.code = Errc::capacity};
    RequestAccess::begin(request, task.address());
    (void)ContextAccess::network(ctx)->requests.start(std::move(task));
    return Result<>();
}

// For the calls that wait.
template <class R>
Result<> submit_and_wait(Context& ctx, R& request) {
    const auto submitted = submit(ctx, request);
    return submitted ? wait(ctx, request) : submitted;
}

[[nodiscard]] inline Error check_init(Context& ctx) {
    return ContextAccess::network(ctx) != nullptr ? Error{} : Error{.code = Errc::wrong_state};
}

}  // namespace margay
