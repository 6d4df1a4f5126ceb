#include "network/wanted.hpp"

#include "network/boot.hpp"
#include "network/expectation.hpp"
#include "network/group_layout.hpp"
#include "network/image_layout.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/pdo_lists.hpp"
#include "network/settings.hpp"
#include "network/transition.hpp"

#include <algorithm>

namespace margay {
namespace {

Error fault(const Slave& slave, Errc code, Step step) { return {.code = code, .step = step, .slave = slave.number}; }

// Whether an expected slave may be missing even while the first slave of its hot connect group is present.
bool may_be_missing(const ExpectedSlave& wanted) {
    return wanted.optional || (wanted.config != nullptr && wanted.config->optional);
}

// The error that ended the start-up of the slave; if there is none, `otherwise`.
Error start_up_error(const Slave& slave, const Error& otherwise) {
    const bool failed = slave.error.code != Errc::none && !is_warning(slave.error.code) &&
                        slave.error.step != Step::parse_sii && slave.error.step != Step::identify;
    return failed ? slave.error : otherwise;
}

Error state_trouble(const Network& network, const Slave& slave, AlState wanted) {
    const bool in_hook = network.marks(slave).in_hook && !slave.al.error;
    Error error = fault(slave, slave.al.error ? Errc::al_status : Errc::other_state,
                        in_hook ? Step::application_hook : Step::request_state);
    error.expected = static_cast<std::uint32_t>(wanted);
    error.actual = static_cast<std::uint32_t>(slave.al.state);
    error.detail = slave.al.code;
    const SlaveMarks& marks = network.marks(slave);
    if (slave.al.error) return error;
    const bool unfinished = is_unfinished(network, slave);
    if (slave.al.state == wanted && !unfinished && !is_settling(network, slave)) return {};
    if (slave.al.state == wanted) error.code = Errc::start_up_unfinished;
    const bool failed = slave.hook_failed || slave.pdos_failed || marks.attempts > 0 || unfinished;
    return failed ? start_up_error(slave, error) : error;
}

// The error of a slave that does not answer. If a slave may have come back whose EEPROM cannot be read, it is the error
// that the search has stored in the slave.
Error absence_error(Network& network, const Slave& slave) {
    const Error missing = missing_error(network, slave);
    const auto is_unasked = [](const RingPlace& place) { return static_cast<bool>(place.unasked); };
    const bool unread = network.searching || std::ranges::any_of(network.seen_ring(), is_unasked);
    return missing.code != Errc::none && unread && is_unreadable(slave.error) ? slave.error : missing;
}

}  // namespace

void update_held(Network& network) {
    const Tolerance& tolerated = network.tolerance;
    for (Slave& slave : network.slaves()) {
        const bool other = tolerated.other_slaves || (slave.wanted != nullptr && slave.wanted->tolerate);
        slave.held = (slave.other && !other) || (slave.unexpected && !tolerated.unexpected_slaves);
    }
}

Error held_error(const Slave& slave, Step step) {
    if (!slave.held) return {};
    if (slave.unexpected) return fault(slave, Errc::unexpected_slave, step);
    Error error = slave.wanted == nullptr ? Error{} : difference(slave, *slave.wanted);
    // False: the EEPROM of the slave could not be read, or is being read.
    const bool compared = slave.wanted == nullptr;
    if (error.code == Errc::none) error = fault(slave, compared ? Errc::other_slave : Errc::identity_unread, step);
    if (!is_unread(slave)) error.step = step;
    return error;
}

bool may_be_missing(const Network& network, const Slave& slave) {
    if (slave.wanted == nullptr) return slave.config.optional;
    if (slave.wanted->hot_connect != 0 && !slave.wanted->optional)
        return !first_of_group_is_there(network, slave.wanted->hot_connect);
    return is_optional(slave);
}

Error missing_error(Network& network, const Slave& slave) {
    // An unexpected slave is not in the list, so it is not wanted. Without a list, all slaves of the scan are wanted.
    const bool is_unexpected = slave.wanted == nullptr && !network.expected.empty();
    const bool is_tolerated = slave.wanted != nullptr && !slave.seen && network.tolerance.missing_slaves;
    if (is_unexpected || is_tolerated || may_be_missing(network, slave)) return {};
    Error error = fault(slave, Errc::missing_slave, slave.wanted == nullptr ? Step::read_state : Step::identify);
    if (slave.wanted == nullptr || !is_located(network.expected, *slave.wanted)) return error;
    const ExpectedSlave& wanted = *slave.wanted;
    error.subindex = static_cast<std::uint8_t>(wanted.alias ? IdentityField::alias : IdentityField::device_id);
    error.actual = wanted.alias.value_or(wanted.device_id.value_or(0));
    return error;
}

bool is_mapped(const Network& network, const Slave& slave) {
    return slave.image.group < network.process.groups.size() && network.process.groups[slave.image.group].mapped;
}

bool is_being_mapped(const Network& network, const Slave& slave) {
    return std::ranges::any_of(network.process.groups, [&slave](const ProcessGroup& group) {
        return group.mapping && (group.number == slave.config.group || group.number == slave.image.group);
    });
}

bool has_place(const Slave& slave) {
    const bool wants = std::ranges::any_of(slave.config.used_sms(), [](const ProcessSm& sm) { return sm.bits != 0; });
    return !slave.unplaced && (!wants || exchanges(slave) || !is_as_mapped(slave));
}

bool needs_mapping(const Network& network, const Slave& slave) {
    return exchanges(slave) && (!is_as_mapped(slave) || network.marks(slave).pdos_written);
}

void note_boot(Network& network, const Slave& slave) {
    network.marks(slave).from_boot = true;
    // Without Features::boot, the slave is not compared before it leaves BOOT.
    network.marks(slave).boot_read = network.boot != nullptr;
    const bool checked = !is_by_application(slave.config) && !slave.config.unchecked_pdos;
    network.marks(slave).pdos_in_doubt = network.marks(slave).new_firmware = checked;
}

bool may_be_exchanged(const Network& network, const Slave& slave) {
    const SlaveMarks& marks = network.marks(slave);
    return slave.takes_part || marks.finding || marks.in_hook || !needs_mapping(network, slave);
}

AlState wanted_state(const Network& network, const Slave& slave) {
    return limited(slave, slave.target != AlState::none ? slave.target : network.target);
}

AlState goal(const Network& network, const Slave& slave) {
    const AlState wanted = wanted_state(network, slave);
    if (wanted == AlState::init || wanted == AlState::boot) return wanted;
    if (slave.held) return slave.mailbox.present() && !slave.config.no_mailbox ? AlState::preop : AlState::init;
    return is_mapped(network, slave) && has_place(slave) && may_be_exchanged(network, slave) ? wanted : AlState::preop;
}

bool is_to_be_asked(const Network& network, const Slave& slave) {
    return slave.unplaced && (slave.pdos_failed || !slave.seen) && !slave.held && is_mapped(network, slave) &&
           wanted_state(network, slave) >= AlState::safeop;
}

bool is_wanted_in_exchange(const Network& network, const Slave& slave) {
    const bool unknown = slave.wanted == nullptr && !is_known(slave) && !network.expected.empty();
    const bool nobody = (slave.held && slave.unexpected) || unknown;
    const bool absent = slave.wanted != nullptr && !slave.seen && network.tolerance.missing_slaves;
    const bool awaited = slave.wanted != nullptr && slave.wanted->hot_connect != 0 && network.marks(slave).awaited &&
                         !may_be_missing(*slave.wanted) && first_of_group_is_there(network, slave.wanted->hot_connect);
    const bool leaving = slave.image.group != slave.config.group && is_being_mapped(network, slave);
    const bool refused = !is_highest(slave.config.highest);
    return (!is_optional(slave) || awaited) && !leaving && !nobody && !absent &&
           (refused || wanted_state(network, slave) >= AlState::safeop);
}

Error state_error(Network& network, const Slave& slave) {
    if (!is_highest(slave.config.highest)) return invalid_highest(slave);
    const AlState wanted = wanted_state(network, slave);
    if (slave.al.state == AlState::none) return absence_error(network, slave);
    if (wanted == AlState::init || wanted == AlState::boot) return state_trouble(network, slave, wanted);
    if (slave.held) return held_error(slave, Step::identify);
    if (network.is_doubted(slave) && !network.is_believed(slave))
        return start_up_error(slave, fault(slave, Errc::identity_unread, Step::identify));
    const bool process = wanted >= AlState::safeop;
    if (process && !is_mapped(network, slave)) {
        Error error = unmapped_group(network, slave.config.group);
        error.slave = slave.number;
        return error;
    }
    if (process && !has_place(slave)) {
        const Error no_place = fault(slave, Errc::no_place, Step::map_process_data);
        return slave.pdos_failed ? start_up_error(slave, no_place) : no_place;
    }
    if (process && !may_be_exchanged(network, slave))
        return fault(slave, Errc::remapping_needed, Step::map_process_data);
    const Error state = state_trouble(network, slave, wanted);
    if (state.code != Errc::none || !process || !exchanges(slave) || slave.takes_part) return state;
    return fault(slave, Errc::working_counter, Step::exchange_process_data);
}

Error start_up_refusal(const Network& network, const Slave& slave) {
    const bool again = slave.al.state <= AlState::preop && slave.al.state != AlState::none;
    if ((again || !slave.seen) && network.marks(slave).pdos_written && exchanges(slave))
        return fault(slave, Errc::remapping_needed, Step::map_process_data);
    const bool unfinished = is_unfinished(network, slave);
    if (!slave.hook_failed && !slave.pdos_failed && !unfinished) return {};
    const Errc code = unfinished ? Errc::start_up_unfinished : Errc::wrong_state;
    return start_up_error(slave, fault(slave, code, Step::request_state));
}

Error target_refusal(const Network& network, const Slave& slave, AlState state) {
    if (state == AlState::boot) return boot_refusal(network, slave);
    if (slave.held && state >= AlState::safeop) return held_error(slave, Step::request_state);
    return limited(slave, state) == state ? Error{} : above_highest(slave, state);
}

Error refusal(const Network& network, const Slave& slave, AlState state) {
    const Error never = target_refusal(network, slave, state);
    if (never.code != Errc::none) return never;
    const bool up = state >= AlState::safeop && state >= slave.al.state;
    const Error failed = up ? start_up_refusal(network, slave) : Error{};
    if (failed.code != Errc::none) return failed;
    return contradiction(network, slave, state);
}

Error contradiction(const Network& network, const Slave& slave, AlState state) {
    if (!network.supervised || is_being_mapped(network, slave) || state == goal(network, slave)) return {};
    Error error = fault(slave, Errc::supervised, Step::request_state);
    error.actual = static_cast<std::uint32_t>(state);
    error.expected = static_cast<std::uint32_t>(goal(network, slave));
    return error;
}

AlState target_of_all(const Network& network) {
    const SuperviseRequest* const request = network.supervision;
    const bool changed = request != nullptr && request->target != network.target_read && can_be_target(request->target);
    return changed ? request->target : network.target;
}

void set_target_of_all(Network& network, AlState state) {
    network.target = state;
    // The target that the supervision has read.
    if (network.supervision != nullptr) network.target_read = network.supervision->target;
}

void set_targets(Network& network, std::uint16_t slave, AlState state, AlState of_all) {
    if (slave == 0) set_target_of_all(network, state);
    for (Slave& one : network.slaves()) {
        if (slave == 0) one.target = AlState::none;
        if (one.number == slave) {
            // A slave with OP of its own would stay in OP when the target of all slaves is lowered.
            one.target = state == AlState::op && of_all == AlState::op ? AlState::none : state;
            network.marks(one).leave_boot = state != AlState::boot;
        }
        update_counted(network, one);
    }
}

}  // namespace margay
