#include "network/preop.hpp"

#include "network/mailbox_setup.hpp"
#include "network/startup.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"

namespace margay {

Task<Result<>> bring_to_preop(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    if (uses_mailbox(slave)) {
        const MailboxSyncManagers sms = mailbox_sync_managers(slave, slave.mailbox);
        auto written = co_await write_bytes(station, wire::reg::kSyncManagerBase, sms, Step::configure_mailbox);
        if (!written) co_return written.error();
    }
    // The commands of the application are for the wanted slave, not for a held one.
    network.marks(slave).held_back = slave.held;
    network.marks(slave).unfinished = network.marks(slave).requested = Transition::none;
    network.marks(slave).started_with = check_of_ip_commands(slave);
    const Transition which = network.marks(slave).held_back ? Transition::none : Transition::init_to_preop;
    auto before = co_await around_transition(network, slave, which, Moment::before);
    if (!before) co_return before;
    if (slave.al.state == AlState::none) {
        auto now = co_await read_al_status(station);
        if (!now) co_return now.error();
        slave.al = *now;
    }
    mark_unfinished(network, slave, which);
    auto state = co_await change_al_state_from(station, slave.al, AlState::preop, slave.device_emulation,
                                               al_timeout(slave, AlState::preop));
    if (state) {
        slave.al = *state;
        open_mailbox(network, slave, slave.mailbox);
        co_return co_await around_transition(network, slave, which, Moment::after);
    }
    auto seen = co_await read_al_status(station);
    update_al_status(slave.al, seen);
    co_return state.error();
}

}  // namespace margay
