#include "network/preop.hpp"

#include "network/mailbox_setup.hpp"
#include "network/search.hpp"
#include "network/startup.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"

namespace margay {

Task<Result<>> bring_to_preop(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    if (uses_mailbox(slave)) {
        const MailboxSyncManagers sms = mailbox_sync_managers(slave, slave.mailbox);
        co_await required(write_bytes(station, wire::reg::kSyncManagerBase, sms, Step::configure_mailbox));
    }
    // The commands of the application are for the wanted slave, not for a held one.
    network.marks(slave).held_back = slave.held;
    network.marks(slave).unfinished = network.marks(slave).requested = Transition::none;
    network.marks(slave).started_with = check_of_ip_commands(slave);
    const Transition which = network.marks(slave).held_back ? Transition::none : Transition::init_to_preop;
    const Time begun = network.engine.now();
    co_await required(around_transition(network, slave, which, Moment::before));
    if (doubt_after_hook(network, slave, begun)) {
        co_await required(prove_before_request(network, slave, AlState::preop));
    }
    if (slave.al.state == AlState::none) {
        slave.al = co_await required(read_al_status(station));
    }
    mark_unfinished(network, slave, which);
    auto state = co_await change_al_state_from(station, slave.al, AlState::preop, slave.device_emulation,
                                               al_timeout(slave, AlState::preop));
    if (state) {
        slave.al = *state;
        open_mailbox(network, slave, slave.mailbox);
        // After BOOT, the new firmware of the slave runs now, and the identity may have changed.
        co_await required(prove_before_request(network, slave, AlState::preop));
        const Time reached = network.engine.now();
        co_await required(around_transition(network, slave, which, Moment::after));
        if (doubt_after_hook(network, slave, reached)) {
            co_await required(prove_before_request(network, slave, AlState::preop));
        }
        co_return Nothing{};
    }
    auto seen = co_await read_al_status(station);
    update_al_status(slave.al, seen);
    update_mailbox(network, slave);
    co_return state.error();
}

}  // namespace margay
