#include "network/hooks.hpp"

#include "network/transition.hpp"

namespace margay {
namespace {

// A plain function that returns Errc::busy for longer has failed.
constexpr Duration kBusyTimeout = std::chrono::seconds(10);

// Exists while a hook executes. If the request that waits for the hook is ended, the error of the request names the
// slave of the hook.
class Execution {
  public:
    Execution(Network& network, const Slave& slave)
        : network_(network), slave_(slave.number), limit_(network, slave.number) {
        network.marks(slave).in_hook = true;
    }
    Execution(const Execution&) = delete;
    Execution& operator=(const Execution&) = delete;
    ~Execution() {
        network_.marks(slave_).in_hook = false;
        std::uint16_t& first = network_.slave_of_cut_hook;
        if (!over && (first == 0 || slave_ < first)) first = slave_;
    }
    bool over = false;

  private:
    Network& network_;
    std::uint16_t slave_;
    WorkLimit limit_;
};

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

Task<> run_hook(Network& network, const Slave& slave, Transition which, Moment moment) {
    const SlaveHooks hooks = slave.hooks;  // a copy, because the application may change the hooks meanwhile
    const HookedSlave hooked = HookAccess::slave(network, slave.number);
    Execution execution(network, slave);
    Result<> done;
    if (has_sequence(hooks, which)) {
        done = co_await begin_sequence(hooks, hooked, which, moment);
    } else {
        const Time give_up = later(network.engine.now(), kBusyTimeout);
        for (;;) {
            done = call_plain(hooks, hooked, which, moment);
            if (done.error().code != Errc::busy) break;
            if (network.engine.now() >= give_up) {
                done = Error{.code = Errc::timeout, .step = Step::application_hook};
                break;
            }
            co_await network.engine.sleep_for(std::chrono::milliseconds(1));
        }
    }
    execution.over = true;
    co_return of_slave(done.error(), slave);
}

}  // namespace

constexpr detail::HookKind detail::kPlainHook{run_hook};
constexpr detail::HookKind detail::kSequenceHook{run_hook};

}  // namespace margay
