#include "subdevice/esm.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"

#include <array>
#include <utility>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al = wire::al;

namespace {

constexpr bool known(AlState state) {
    return state == AlState::init || state == AlState::preop || state == AlState::boot || state == AlState::safeop ||
           state == AlState::op;
}

constexpr bool has_mailboxes(const DeviceDescription& device) {
    return device.mailbox.present() || device.boot_mailbox.present();
}
constexpr bool has_mailbox(AlState state) { return state != AlState::init && state != AlState::none; }
constexpr bool has_process_data(AlState state) { return state == AlState::safeop || state == AlState::op; }

// BOOT can only be entered from INIT and left to INIT. Upward transitions go one state at a time, downward transitions
// may skip states.
constexpr bool allowed(Transition t) {
    if (t.from == AlState::boot || t.to == AlState::boot) return t.from == AlState::init || t.to == AlState::init;
    if (t.to < t.from) return true;
    return (t.from == AlState::init && t.to == AlState::preop) ||
           (t.from == AlState::preop && t.to == AlState::safeop) || (t.from == AlState::safeop && t.to == AlState::op);
}

// Order for the comparison of states: BOOT has the same rank as PREOP.
constexpr int rank(AlState state) {
    return state == AlState::boot ? static_cast<int>(AlState::preop) : static_cast<int>(state);
}

}  // namespace

void Esm::init() {
    drop_pending();
    holding_ = false;
    held_ = {};
    status_ = {AlState::init, false, 0};
    device_id_ = 0;
    identifying_ = false;
    disable_sync_managers({AlState::op, AlState::init});
    write_status();
}

Time Esm::step(Time now, std::uint32_t events) {
    if ((events & wire::al_event::kAlControl) != 0)
        control(read_register<std::uint16_t>(esc_, reg::kAlControl.address), now);
    if ((events & wire::al_event::kSmActivation) != 0) watch_sync_managers(now);
    if (again_ <= now) ask_again(now);
    return pending_ ? again_ : kNever;
}

// ETG.1000.6 "AL control": while the error indication is set, only an acknowledge or a request for a lower state is
// executed.
void Esm::control(std::uint16_t al_control, Time now) {
    const auto to = static_cast<AlState>(al_control & al::kStateMask);
    const bool acknowledge = (al_control & al::kErrorAcknowledge) != 0;
    const bool asked = (al_control & al::kDeviceIdentification) != 0;
    // Clears only the error that the master has acknowledged, not an error that the client reports during this step.
    const bool acknowledged = acknowledge && status_.error && !(pending_ && to == transition_.to);
    if (acknowledged) {
        status_.error = false;
        status_.code = 0;
    }
    device_id_ = asked ? client_.device_id() : std::uint16_t{0};
    identifying_ = asked && (device_id_ != 0 || device_.device_id_switch);  // a switch may be at 0
    if (pending_ && to == transition_.to) return;                           // this transition is already pending
    drop_pending();
    if (status_.error && known(to) && rank(to) >= rank(status_.state)) return;
    request(to, now);
    if (acknowledged && pending_) write_status();  // a master that waits for the new state must not see the old error
}

void Esm::request(AlState to, Time now) {
    const Transition transition{status_.state, to};
    if (!known(to)) return refuse(AlStatusCode::unknown_requested_state);
    if (to == AlState::boot && !device_.boot_mailbox.present()) return refuse(AlStatusCode::bootstrap_not_supported);
    if (to == status_.state) return write_status();
    if (!allowed(transition)) return refuse(AlStatusCode::invalid_requested_state_change);

    if (const auto fault = check(transition); fault != AlStatusCode::none) return refuse(fault);

    pending_ = true;
    transition_ = transition;
    advance(now);
}

// Checks the configuration of the master for the transition.
AlStatusCode Esm::check(Transition transition) {
    if (transition.to == AlState::boot || transition == Transition{AlState::init, AlState::preop})
        return check_mailbox(transition.to);
    if (transition != Transition{AlState::preop, AlState::safeop}) return AlStatusCode::none;
    const auto fault = check_areas();
    return fault == AlStatusCode::none ? check_dc(esc_, device_.dc) : fault;
}

AlStatusCode Esm::check_mailbox(AlState state) {
    const bool boot = state == AlState::boot;
    return check_mailboxes(
        esc_, boot ? device_.boot_mailbox : device_.mailbox,
        boot ? AlStatusCode::invalid_boot_mailbox_configuration : AlStatusCode::invalid_mailbox_configuration);
}

AlStatusCode Esm::check_areas() {
    const auto sizes = client_.process_data_sizes();
    const auto fault = check_process_data(esc_, device_, sizes);
    return fault == AlStatusCode::none ? check_watchdog(esc_, device_, sizes) : fault;
}

// While the transition waited, the master may have changed its configuration, or the mapping.
void Esm::ask_again(Time now) {
    if (!pending_) return;
    if (const auto fault = check(transition_); fault != AlStatusCode::none) {
        drop_pending();
        return refuse(fault);
    }
    advance(now);
}

void Esm::advance(Time now) {
    holding_ = true;
    const auto verdict = client_.before(transition_, now);
    if (!holding_) return;  // the client has called init()
    if (held_.error) {
        drop_pending();
        return release(now);
    }
    holding_ = false;
    if (verdict.waits()) {
        again_ = verdict.again();
        return;
    }
    pending_ = false;
    if (verdict.goes()) return carry_out(transition_, now);
    refuse(verdict.why());
}

void Esm::carry_out(Transition transition, Time now) {
    if (transition.from == AlState::init) enable_mailboxes(true);
    if (transition == Transition{AlState::preop, AlState::safeop}) enable_process_data(true);
    holding_ = true;
    client_.perform(transition, now);
    if (!holding_) return;  // the client has called init()
    disable_sync_managers(transition);
    status_ = {transition.to, held_.error, held_.code};
    write_status();
    client_.after(transition, now);
    release(now);
}

void Esm::release(Time now) {
    holding_ = false;
    const auto held = std::exchange(held_, {});
    if (held.state != AlState::none) fall_back(held.state, static_cast<AlStatusCode>(held.code), now);
}

void Esm::fall_back(AlState to, AlStatusCode why, Time now) {
    if (holding_) {  // of several calls in one function, the one with the lowest state is executed
        if (held_.state == AlState::none || rank(to) < rank(held_.state))
            held_ = {to, true, static_cast<std::uint16_t>(why)};
        return;
    }
    const auto wanted = pending_ ? transition_.to : to;
    drop_pending();
    if (rank(to) < rank(status_.state)) {
        held_ = {AlState::none, true, static_cast<std::uint16_t>(why)};  // the error of the new state
        carry_out({status_.state, to}, now);
    } else {
        refuse(why);
    }
    // The master waits for an even lower state, and does not repeat its request.
    if (rank(wanted) < rank(to) && rank(wanted) < rank(status_.state)) request(wanted, now);
}

void Esm::refuse(AlStatusCode why) {
    status_.error = true;
    status_.code = static_cast<std::uint16_t>(why);
    write_status();
}

void Esm::drop_pending() {
    if (!pending_) return;
    pending_ = false;
    client_.dropped(transition_);
}

// The master has deactivated or changed a sync manager while the device uses it: the device falls back to a state that
// does not need it.
void Esm::watch_sync_managers(Time now) {
    read_activations(esc_);
    if (has_mailbox(status_.state)) {
        const auto fault = check_mailbox(status_.state);
        if (fault != AlStatusCode::none) return fall_back(AlState::init, fault, now);
    }
    if (has_process_data(status_.state)) {
        const auto fault = check_areas();
        if (fault != AlStatusCode::none) fall_back(AlState::preop, fault, now);
    }
}

void Esm::disable_sync_managers(Transition transition) {
    if (has_process_data(transition.from) && !has_process_data(transition.to)) enable_process_data(false);
    if (!has_mailbox(transition.to)) enable_mailboxes(false);
}

void Esm::enable_mailboxes(bool enabled) {
    if (!has_mailboxes(device_)) return;
    set_enabled(0, enabled);
    set_enabled(1, enabled);
}

void Esm::enable_process_data(bool enabled) {
    for (const bool outputs : {true, false})
        for_each_area(device_, outputs,
                      [&](const ProcessDataArea& area, std::size_t) { set_enabled(area.sync_manager, enabled); });
}

void Esm::set_enabled(std::uint8_t sync_manager, bool enabled) {
    const auto address = static_cast<std::uint16_t>(reg::sync_manager(sync_manager).address +
                                                    wire::SyncManagerLayout::pdi_control::offset);
    const auto was = read_register<std::uint8_t>(esc_, address);
    const auto repeat = was & wire::sm_pdi_control::kRepeatAcknowledge;
    write_register(esc_, address,
                   static_cast<std::uint8_t>(repeat | (enabled ? 0 : wire::sm_pdi_control::kDeactivate)));
}

// The code is written first: a master that reads the error bit must also read the code that belongs to it.
void Esm::write_status() {
    const bool identify = identifying_ && !status_.error;
    const auto code = identify ? device_id_ : status_.code;
    write_register(esc_, reg::kAlStatusCode.address, code);
    const auto word = static_cast<unsigned>(status_.state) | (status_.error ? al::kErrorIndication : 0u) |
                      (identify ? al::kDeviceIdentification : 0u);
    write_register(esc_, reg::kAlStatus.address, static_cast<std::uint16_t>(word));
}

}  // namespace margay::subdevice
