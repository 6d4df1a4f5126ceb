// Calls of the application's hooks.
#pragma once

#include "network/network.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {

struct HookAccess {
    [[nodiscard]] static HookedSlave slave(Network& network, std::uint16_t number) { return {network, number}; }
    [[nodiscard]] static Network& network(const HookedSlave& slave) { return *slave.network_; }
};

// One call of a function of HookedSlave. A hook that tries again and again must stop neither the cycle nor other
// slaves: the function awaits pause_after() before it returns.
class HookCall {
  public:
    explicit HookCall(const HookedSlave& slave) : engine_(HookAccess::network(slave).engine), began_(engine_.now()) {}
    // A millisecond after an error of a call that has taken no time; otherwise nothing.
    [[nodiscard]] Engine::Sleep pause_after(const Error& error) const {
        const bool at_once = error.code != Errc::none && engine_.now() == began_;
        return engine_.sleep_for(at_once ? std::chrono::milliseconds(1) : Duration{0});
    }

  private:
    Engine& engine_;
    Time began_;
};

namespace detail {
struct HookKind {
    Task<> (*call)(Network& network, const Slave& slave, Transition which, Moment moment);
};
}  // namespace detail

// Calls this hook of the slave, which is set, and waits for its end: a plain function is called again while it returns
// Errc::busy, for 10 s at most. Transition::none: the hook preop_to_safeop. When the task is destroyed before the hook
// has ended, Network::slave_of_cut_hook is the slave.
template <class Hook>
[[nodiscard]] Task<> call_hook(const Hook& hook, Network& network, const Slave& slave,
                               Transition which = Transition::none, Moment moment = Moment::before) {
    return hook.kind()->call(network, slave, which, moment);
}

}  // namespace margay
