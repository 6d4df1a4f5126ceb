// Calls of the application's hooks.
#pragma once

#include "network/network.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {

struct HookAccess {
    [[nodiscard]] static HookedSlave slave(Network& network, std::uint16_t number) { return {network, number}; }
    [[nodiscard]] static Network& network(const HookedSlave& slave) { return *slave.network_; }
};

// What a function of HookedSlave does when it is refused at once: it returns the error a millisecond later, so that a
// hook that tries again and again stops neither the cycle nor other slaves.
[[nodiscard]] Task<> refuse_in_hook(HookedSlave slave, Error refused);

// Calls the hook of a transition and waits for its end: a plain function is called again while it returns Errc::busy,
// for 10 s at most. Transition::none: the hook preop_to_safeop. Without a hook: success. When the task is destroyed
// before the hook has ended, Network::slave_of_cut_hook is the slave.
[[nodiscard]] Task<> call_hook(Network& network, const Slave& slave, Transition which = Transition::none,
                               Moment moment = Moment::before);

}  // namespace margay
