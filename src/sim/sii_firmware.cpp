#include "sim/sii_firmware.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"

#include <algorithm>
#include <utility>

namespace margay::sim {

using subdevice::Transition;
using subdevice::Verdict;
namespace reg = wire::reg;
namespace al_event = wire::al_event;

namespace {

constexpr std::uint32_t kSyncManagerEvents = 0x00FFFF00;
constexpr Duration kLookAgain = std::chrono::milliseconds(1);

}  // namespace

SiiFirmware::SiiFirmware(Bytes sii, const SiiModel& model)
    : device_(model.description()), emulation_(model.device_emulation()), areas_(model.areas) {
    if (device_.mailbox.present()) mail_.emplace(sii, model);
}

void SiiFirmware::start(subdevice::EscAccess& esc, Time) {
    esc_ = &esc;
    wait_until_ = kNever;
    begin(esc);
    for (const auto& area : areas_) {
        const auto bytes = area.pdo_bits != 0 ? (area.pdo_bits + 7) / 8 : area.info.length_bytes;
        if (area.info.type == SmType::inputs && bytes == 1) show_always(area.sync_manager, area.info.start);
    }
    if (mail_) mail_->power_up(esc);
    esm_.reset();
    followed_ = AlState::init;
    if (emulation_) return;
    esm_.emplace(esc, device_, static_cast<subdevice::EsmClient&>(*this));
    esm_->init();
}

// ETG.1000.6: in SAFEOP the outputs are read, which triggers the watchdog, but they are not applied.
Time SiiFirmware::step(Time now) {
    const auto events = subdevice::read_register<std::uint32_t>(*esc_, reg::kAlEventRequest.address);
    // Outputs are read even without an event, because the SyncManagers of digital I/O and of many other SIIs raise no
    // event.
    const auto before = state();
    if (before == AlState::op || before == AlState::safeop) read_outputs();
    if (before == AlState::safeop) clear_outputs();
    Time next = kNever;
    if (esm_) {
        next = esm_->step(now, events);
        if ((events & al_event::kWatchdog) != 0) {
            (void)subdevice::read_register<std::uint16_t>(*esc_, reg::kProcessDataWatchdogStatus.address);
            clear_outputs();
            if (esm_->state() == AlState::op)
                esm_->fall_back(AlState::safeop, subdevice::AlStatusCode::sync_manager_watchdog, now);
        }
        if (mail_) next = std::min(next, serve_mail(now, events));
    } else {
        next = step_emulated(now, events);
    }
    const bool changed = (events & al_event::kSmActivation) != 0 || state() != before;
    if (changed) configure();
    if (changed || (events & kSyncManagerEvents) != 0) write_inputs();
    return next;
}

// A device with device emulation and without a mailbox has no program that could follow: it is always active.
AlState SiiFirmware::state() const { return esm_ ? esm_->state() : mail_ ? followed_ : AlState::op; }

// The chip shows the requested state before the program has seen the request, and the program cannot change it. A
// mailbox that the master sets up late, or with a size that the program cannot serve, therefore stays silent until its
// SyncManagers are right.
Time SiiFirmware::step_emulated(Time now, std::uint32_t events) {
    const bool activation = (events & al_event::kSmActivation) != 0;
    if (activation) subdevice::read_activations(*esc_);
    if (!mail_) return kNever;
    if ((events & al_event::kWatchdog) != 0)
        (void)subdevice::read_register<std::uint16_t>(*esc_, reg::kProcessDataWatchdogStatus.address);
    if (outputs_stopped()) clear_outputs();
    follow(events);
    if (followed_ == AlState::init) return kNever;
    auto& mailbox = mail_->mailbox();
    if (!mailbox.running() && activation && mailbox.fits()) mailbox.start(followed_);
    const auto next = serve_mail(now, events);
    if (mailbox.sync_manager_lost()) mailbox.stop();
    return next;
}

void SiiFirmware::follow(std::uint32_t events) {
    if ((events & al_event::kAlControl) == 0) return;
    const auto control = subdevice::read_register<std::uint16_t>(*esc_, reg::kAlControl.address);
    const auto wanted = static_cast<AlState>(control & wire::al::kStateMask);
    const auto before = std::exchange(followed_, wanted);
    if (wanted == before) return;
    auto& mailbox = mail_->mailbox();
    // INIT has no mailbox, and BOOT has another one.
    const bool other = wanted == AlState::init || wanted == AlState::boot || before == AlState::boot;
    if (other) mailbox.stop();
    if (wanted == AlState::init) return;
    if (!mailbox.running() && mailbox.fits()) mailbox.start(wanted);
    mailbox.state_changed(wanted);
}

// The watchdog of the outputs has expired, or they were never written.
bool SiiFirmware::outputs_stopped() {
    const auto& outputs = device_.outputs;
    if (!outputs.present()) return false;
    const auto sm = subdevice::read_sync_manager(*esc_, outputs.sync_manager);
    const bool watched = (sm.control & wire::sm_control::kWatchdogTrigger) != 0;
    return watched &&
           (subdevice::read_register<std::uint16_t>(*esc_, reg::kProcessDataWatchdogStatus.address) & 1) == 0;
}

// The size of the process data follows from the PDO assignment objects of a device with CoE, or from its SII. When the
// objects assign nothing, the size that the master has configured is accepted.
subdevice::ProcessDataSizes SiiFirmware::process_data_sizes() {
    const auto size = [&](const subdevice::ProcessDataArea& described) -> std::uint16_t {
        if (!described.present()) return 0;
        if (mail_ && device_.protocols.coe) {
            const auto assigned = mail_->assigned_bytes(described.sync_manager);
            if (assigned && *assigned != 0) return *assigned;
            return subdevice::read_register<std::uint16_t>(
                *esc_, static_cast<std::uint16_t>(reg::sync_manager(described.sync_manager).address + 2));
        }
        for (const auto& area : areas_)
            if (area.sync_manager == described.sync_manager)
                return area.pdo_bits != 0 ? static_cast<std::uint16_t>((area.pdo_bits + 7) / 8)
                                          : area.info.length_bytes;
        return 0;
    };
    return {size(device_.outputs), size(device_.inputs), subdevice::AlStatusCode::none};
}

// OP waits for the first outputs (ETG.1000.6), at most for the time in the description.
Verdict SiiFirmware::before(Transition transition, Time now) {
    if (transition.from == AlState::init && mail_ && !mail_->mailbox().fits())
        return Verdict::refuse(subdevice::AlStatusCode::no_memory);
    if (transition != Transition{AlState::safeop, AlState::op} || !outputs_missing()) return Verdict::go();
    if (wait_until_ == kNever) wait_until_ = now + device_.outputs_wait;
    if (now < wait_until_) return Verdict::wait(std::min(wait_until_, now + kLookAgain));
    wait_until_ = kNever;
    return Verdict::refuse(subdevice::AlStatusCode::no_valid_outputs);
}

bool SiiFirmware::outputs_missing() {
    const auto& outputs = device_.outputs;
    if (!outputs.present() || !outputs.three_buffers) return false;
    std::array<std::byte, reg::kSyncManagerStride> raw{};
    esc_->read(reg::sync_manager(outputs.sync_manager).address, raw);
    const auto status = wire::SyncManagerLayout::status::load(raw);
    const auto sm = wire::load_sync_manager(raw);
    if (sm.length_bytes == 0) return false;
    const bool watched = (sm.control & wire::sm_control::kWatchdogTrigger) != 0;
    const auto running = subdevice::read_register<std::uint16_t>(*esc_, reg::kProcessDataWatchdogStatus.address) & 1;
    // Outputs that were received before the watchdog expired are not used.
    if (watched && running == 0) return true;
    if (sm.length_bytes == 1) return false;  // a watchdog trigger without a buffer: only the watchdog shows outputs
    return (status & wire::sm_status::kLastBufferMask) == wire::sm_status::kLastBufferMask;
}

void SiiFirmware::perform(Transition transition, Time) {
    if (mail_ && transition.to == AlState::init) mail_->mailbox().stop();
    if (mail_ && transition.from == AlState::init) mail_->mailbox().start(transition.to);
}

void SiiFirmware::after(Transition transition, Time) {
    wait_until_ = kNever;
    if (mail_) mail_->mailbox().state_changed(transition.to);
}

// The objects are updated with the process data before a message is answered.
Time SiiFirmware::serve_mail(Time now, std::uint32_t events) {
    if ((events & al_event::sync_manager(0)) != 0 && state() >= AlState::safeop) {
        mail_->show(true, outputs());
        mail_->show(false, inputs());
    }
    const auto next = mail_->mailbox().step(now, events);
    return esm_ && mail_->mailbox().sync_manager_lost() ? std::min(next, esm_->step(now, al_event::kSmActivation))
                                                        : next;
}

}  // namespace margay::sim
