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

// A plain function that returns Errc::busy for longer has failed.
inline constexpr Duration kBusyHookTimeout = std::chrono::seconds(10);

// While a hook executes: when the request that waits for the hook is ended, its error names the slave of the hook.
class HookInExecution {
  public:
    HookInExecution(Network& network, const Slave& slave) : network_(network), slave_(slave.number) {}
    HookInExecution(const HookInExecution&) = delete;
    HookInExecution& operator=(const HookInExecution&) = delete;
    ~HookInExecution() {
        if (!over) network_.slave_of_cut_hook = slave_;
    }
    bool over = false;

  private:
    Network& network_;
    std::uint16_t slave_;
};

// Calls a hook and waits for its end: a plain function is called again while it returns Errc::busy. `args` are values.
// Without a hook: success.
template <class... Args>
Task<> call_hook(Network& network, const Slave& slave, Hook<Args...> hook, void* user, Args... args) {
    const HookedSlave hooked = HookAccess::slave(network, slave.number);
    HookInExecution execution(network, slave);
    Result<> done;
    if (hook.sequence() != nullptr) {
        done = co_await hook.sequence()(hooked, args..., user);
    } else if (hook.plain() != nullptr) {
        const Time give_up = later(network.engine.now(), kBusyHookTimeout);
        for (;;) {
            done = hook.plain()(hooked, args..., user);
            if (done.error().code != Errc::busy) break;
            if (network.engine.now() >= give_up) {
                done = Error{.code = Errc::timeout, .step = Step::application_hook};
                break;
            }
            co_await network.engine.sleep_for(std::chrono::milliseconds(1));
        }
    }
    execution.over = true;
    co_return of_slave(done, slave);
}

}  // namespace margay
