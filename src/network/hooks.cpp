#include "network/hooks.hpp"

namespace margay {
namespace {

// Completes an error that a hook returns: slave, and step if the hook has not set one.
Error of_slave(Error error, const Slave& slave) {
    if (error.code == Errc::none) return error;
    error.slave = slave.number;
    if (error.step == Step::none) error.step = Step::application_hook;
    return error;
}

bool has_sequence(const SlaveHooks& hooks, Transition which) {
    return which == Transition::none ? hooks.preop_to_safeop.sequence() != nullptr
                                     : hooks.transition.sequence() != nullptr;
}

Task<> begin_sequence(const SlaveHooks& hooks, HookedSlave slave, Transition which, Moment moment) {
    return which == Transition::none ? hooks.preop_to_safeop.sequence()(slave, hooks.user)
                                     : hooks.transition.sequence()(slave, which, moment, hooks.user);
}

// Calls a hook that is a plain function; without one: success.
Result<> call_plain(const SlaveHooks& hooks, HookedSlave slave, Transition which, Moment moment) {
    if (which == Transition::none) {
        const auto plain = hooks.preop_to_safeop.plain();
        return plain == nullptr ? Result<>() : plain(slave, hooks.user);
    }
    const auto plain = hooks.transition.plain();
    return plain == nullptr ? Result<>() : plain(slave, which, moment, hooks.user);
}

}  // namespace

Task<> call_hook(Network& network, const Slave& slave, Transition which, Moment moment) {
    const SlaveHooks hooks = slave.hooks;  // the application may change them meanwhile
    const HookedSlave hooked = HookAccess::slave(network, slave.number);
    if (has_sequence(hooks, which)) {
        auto done = co_await begin_sequence(hooks, hooked, which, moment);
        co_return of_slave(done.error(), slave);
    }
    for (;;) {
        const Result<> done = call_plain(hooks, hooked, which, moment);
        if (done.error().code != Errc::busy) co_return of_slave(done.error(), slave);
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
}

}  // namespace margay
