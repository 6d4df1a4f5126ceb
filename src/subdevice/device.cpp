#include "subdevice/device.hpp"

#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al_event = wire::al_event;

void Device::start(Time now) {
    if (mailbox_ != nullptr) mailbox_->stop();
    {
        const Guard guard(esc_);
        process_data_.stop_outputs(now);
        process_data_.stop();
    }
    wait_for_outputs(kNever);
    if (auto* const modules = application_.modules()) modules->lay_out(process_data_.dictionary());
    esm_.init();
    const Guard guard(esc_);
    mask_ = ~0u;  // unknown: it is written in any case
    update_mask();
}

Time Device::step(Time now) {
    const auto events = read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address);
    const bool running = process_data_.running();
    const bool op = esm_.state() == AlState::op;
    (void)esm_.step(now, events);
    Time next = kNever;
    if (mailbox_ != nullptr) {
        next = mailbox_->step(now, events);
        if (mailbox_->sync_manager_lost()) {
            (void)esm_.step(now, al_event::kSmActivation);
            if (mailbox_->sync_manager_lost())  // its new setting is allowed, but only INIT may be left with it
                esm_.fall_back(AlState::init,
                               esm_.state() == AlState::boot ? AlStatusCode::invalid_boot_mailbox_configuration
                                                             : AlStatusCode::invalid_mailbox_configuration,
                               now);
        }
    }
    if (eeprom_ != nullptr) eeprom_->step(events);
    // Events from before the start of process data belong to outputs and SYNC signals of an earlier use.
    const bool old = !running || (op && esm_.state() != AlState::op);
    if (const auto fault = serve_process_data(now, old ? 0 : events); fault != AlStatusCode::none)
        esm_.fall_back(AlState::safeop, fault, now);
    next = std::min(next, esm_.step(now, 0));
    if (const auto feed = application_.description().pdi_watchdog; feed != Duration::zero())
        next = std::min(next, now + feed);
    const Guard guard(esc_);
    update_mask();
    next_ = std::min(next, deadline());
    return next_;
}

// In the run modes with interrupts, the events of process data are left to interrupt().
AlStatusCode Device::serve_process_data(Time now, std::uint32_t events) {
    bool came = false;
    esm_.hold();  // fall_back() in Application::cycle(): it is executed without the lock
    {
        const Guard guard(esc_);
        process_data_.serve(now, run_mode_ == RunMode::polling ? events : 0);
        came = outputs_came(now);
    }
    esm_.release(now);
    if (came) esm_.ask_again(now);
    const Guard guard(esc_);
    return process_data_.watch(now, events);
}

std::uint32_t Device::interrupt(Time now) {
    const Guard guard(esc_);
    const auto events = read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address);
    process_data_.serve(now, events);
    const auto left = (events & background_) | wake(now);
    // Events of process data follow the update. Other events are unmasked by step() only.
    const auto background = left == 0 ? mask_ & background_ : 0;
    set_mask(process_data_.events() | background);
    return left;
}

std::uint32_t Device::sync0(Time now) {
    const Guard guard(esc_);
    process_data_.sync0(now);
    if (run_mode_ != RunMode::polling) set_mask(process_data_.events() | (mask_ & background_));
    return wake(now);
}

// Not zero: step() must execute a waiting transition, or it has a deadline that is earlier than the one it returned.
std::uint32_t Device::wake(Time now) {
    return outputs_came(now) || deadline() < next_ ? al_event::kAlControl : std::uint32_t{0};
}

Time Device::deadline() const { return std::min(process_data_.serve_deadline(), process_data_.watch_deadline()); }

void Device::sync1(Time now) {
    const Guard guard(esc_);
    process_data_.sync1(now);
}

bool Device::outputs_came(Time now) {
    return outputs_until_ != kNever && process_data_.missing(now) == AlStatusCode::none;
}

void Device::wait_for_outputs(Time until) {
    const Guard guard(esc_);
    outputs_until_ = until;
}

std::uint32_t Device::background_events() const {
    if (run_mode_ != RunMode::interrupts) return 0;
    auto bits = al_event::kAlControl | al_event::kSmActivation;
    if (mailbox_ != nullptr) bits |= mailbox_->events();
    if (eeprom_ != nullptr) bits |= al_event::kEeprom;
    if (process_data_.running()) bits |= al_event::kWatchdog;
    return bits;
}

void Device::update_mask() {
    background_ = background_events();
    set_mask(run_mode_ == RunMode::polling ? 0u : process_data_.events() | background_);
}

void Device::set_mask(std::uint32_t mask) {
    if (mask == mask_) return;
    mask_ = mask;
    write_register(esc_, reg::kAlEventMask.address, mask);
}

// The sizes of modules that do not match are wrong, too: the AL status code must name the modules.
ProcessDataSizes Device::process_data_sizes() {
    auto sizes = process_data_.sizes();
    const auto* const modules = application_.modules();
    const auto mismatch = modules != nullptr && !process_data_.running() ? modules->check() : AlStatusCode::none;
    if (mismatch != AlStatusCode::none) sizes.fault = mismatch;
    return sizes;
}

Verdict Device::before(Transition transition, Time now) {
    if (transition.from == AlState::init && mailbox_ != nullptr && !mailbox_->fits())
        return Verdict::refuse(AlStatusCode::no_memory);
    if (transition == Transition{AlState::safeop, AlState::op}) {
        const auto missing = [&] {
            const Guard guard(esc_);
            return process_data_.missing(now);
        }();
        if (missing != AlStatusCode::none) {
            if (outputs_until_ == kNever) wait_for_outputs(now + application_.description().outputs_wait);
            if (now < outputs_until_) return Verdict::wait(outputs_until_);
            wait_for_outputs(kNever);
            return Verdict::refuse(missing);
        }
        wait_for_outputs(kNever);
    }
    if (transition == Transition{AlState::preop, AlState::safeop}) {
        auto* const modules = application_.modules();
        const auto mismatch = modules != nullptr ? modules->check() : AlStatusCode::none;
        if (mismatch != AlStatusCode::none) return Verdict::refuse(mismatch);
        const auto types = process_data_.check_sync_types();
        if (types != AlStatusCode::none) return Verdict::refuse(types);
    }
    return application_.before(transition, now);
}

void Device::dropped(Transition transition) {
    wait_for_outputs(kNever);
    application_.dropped(transition);
}

void Device::perform(Transition transition, Time now) {
    {
        const Guard guard(esc_);
        if (transition.from == AlState::op) process_data_.stop_outputs(now);
        if (transition.from >= AlState::safeop && transition.to < AlState::safeop) process_data_.stop();
    }
    if (mailbox_ != nullptr && transition.to == AlState::init) mailbox_->stop();
    auto* const modules = application_.modules();
    if (modules != nullptr && transition == Transition{AlState::init, AlState::preop})
        modules->lay_out(process_data_.dictionary());
    if (mailbox_ != nullptr && transition.from == AlState::init) mailbox_->start(transition.to);
    const Guard guard(esc_);
    if (transition == Transition{AlState::preop, AlState::safeop}) process_data_.start(now);
    if (transition.to == AlState::op) process_data_.start_outputs(now);
}

void Device::after(Transition transition, Time now) {
    if (mailbox_ != nullptr) mailbox_->state_changed(transition.to);
    {
        const Guard guard(esc_);
        update_mask();
    }
    application_.after(transition, now);
}

}  // namespace margay::subdevice
