// Calls of the application's hooks.
#pragma once

#include "network/network.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {

struct HookAccess {
    [[nodiscard]] static HookedSlave slave(Network& network, std::uint16_t number) { return {network, number}; }
    [[nodiscard]] static Network& network(const HookedSlave& slave) { return *slave.network_; }
};

// Completes an error that a hook returns: slave, and step if the hook has not set one.
[[nodiscard]] inline Result<> of_slave(const Result<>& done, const Slave& slave) {
    if (done) return done;
    Error error = done.error();
    error.slave = slave.number;
    if (error.step == Step::none) error.step = Step::application_hook;
    return error;
}

// Calls a hook and waits for its end: a plain function is called again while it returns Errc::busy. `args` are values.
// Without a hook: success.
template <class... Args>
Task<> call_hook(Network& network, const Slave& slave, Hook<Args...> hook, void* user, Args... args) {
    const HookedSlave hooked = HookAccess::slave(network, slave.number);
    if (hook.sequence() != nullptr) {
        auto done = co_await hook.sequence()(hooked, args..., user);
        co_return of_slave(done, slave);
    }
    while (hook.plain() != nullptr) {
        const Result<> done = hook.plain()(hooked, args..., user);
        if (done.error().code != Errc::busy) co_return of_slave(done, slave);
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
    co_return Result<>();
}

}  // namespace margay
