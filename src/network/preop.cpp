#include "network/preop.hpp"

#include "network/startup.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"
#include "wire/sync_manager.hpp"

namespace margay {
namespace {

namespace reg = wire::reg;

// A mailbox SyncManager: address and length from the SII's mailbox words, control octet from its SyncManager category
// if it has one.
wire::SyncManager mailbox_sync_manager(const Slave& slave, SmType type) {
    const bool out = type == SmType::mailbox_out;
    wire::SyncManager sm{.physical_start = out ? slave.mailbox.out_start : slave.mailbox.in_start,
                         .length_bytes = out ? slave.mailbox.out_bytes : slave.mailbox.in_bytes,
                         .control = wire::sm_control::kModeMailbox | wire::sm_control::kPdiInterrupt,
                         .activate = wire::sm_activate::kEnable};
    if (out) sm.control |= wire::sm_control::kEcatWrites;
    const auto& described = slave.sync_managers[out ? 0 : 1];
    if (described.type == type) sm.control = described.control;
    return sm;
}

}  // namespace

Task<Result<>> bring_to_preop(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    const bool mailbox = slave.mailbox.present() && !slave.config.no_mailbox;
    if (mailbox) {
        std::array<std::byte, 2 * reg::kSyncManagerStride> sms{};
        wire::store_sync_manager(sms, mailbox_sync_manager(slave, SmType::mailbox_out));
        wire::store_sync_manager(MutableBytes(sms).subspan(reg::kSyncManagerStride),
                                 mailbox_sync_manager(slave, SmType::mailbox_in));
        auto written = co_await write_bytes(station, reg::kSyncManagerBase, sms, Step::configure_mailbox);
        if (!written) co_return written.error();
    }
    // The commands of the application are for the wanted slave, not for a held one.
    network.marks(slave).held_back = slave.held;
    network.marks(slave).unfinished = Transition::none;
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
        if (mailbox && network.has_mailbox(slave))
            network.mailbox(slave).open(network.mailboxes, station, slave, slave.mailbox);
        co_return co_await around_transition(network, slave, which, Moment::after);
    }
    auto seen = co_await read_al_status(station);
    update_al_status(slave.al, seen);
    co_return state.error();
}

}  // namespace margay
