#include "subdevice/device.hpp"

#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al_event = wire::al_event;

void Device::start(Time now) {
    if (mailbox_ != nullptr) mailbox_->stop();
    process_data_.stop_outputs(now);
    process_data_.stop();
    outputs_until_ = kNever;
    esm_.init();
    write_mask();
}

Time Device::step(Time now) {
    const auto events = read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address);
    esm_.step(now, events);
    Time next = kNever;
    if (mailbox_ != nullptr) {
        next = mailbox_->step(now, events);
        if (mailbox_->sync_manager_lost()) esm_.step(now, al_event::kSmActivation);
    }
    if (eeprom_ != nullptr) eeprom_->step(events);
    if (run_mode_ == RunMode::polling) process_data_.serve(now, events);
    if (outputs_came()) esm_.ask_again(now);
    if (const auto fault = process_data_.watch(now, events); fault != AlStatusCode::none)
        esm_.fall_back(AlState::safeop, fault, now);
    if (run_mode_ == RunMode::interrupts) write_mask();
    if (run_mode_ == RunMode::polling) next = std::min(next, process_data_.serve_deadline());
    return std::min({next, esm_.step(now, 0), process_data_.watch_deadline()});
}

std::uint32_t Device::interrupt(Time now) {
    const auto events = read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address);
    process_data_.serve(now, events);
    auto left = events & background_events();
    if (outputs_came()) left |= al_event::kAlControl;  // step() must execute the waiting transition
    // step() unmasks the other events
    if (left != 0) write_register(esc_, reg::kAlEventMask.address, process_data_.events());
    return left;
}

bool Device::outputs_came() const { return outputs_until_ != kNever && process_data_.missing() == AlStatusCode::none; }

std::uint32_t Device::background_events() const {
    if (run_mode_ != RunMode::interrupts) return 0;
    auto bits = al_event::kAlControl | al_event::kSmActivation;
    if (mailbox_ != nullptr) bits |= al_event::sync_manager(0) | al_event::sync_manager(1);
    if (eeprom_ != nullptr) bits |= al_event::kEeprom;
    return bits;
}

void Device::write_mask() {
    const auto mask = run_mode_ == RunMode::polling ? 0u : process_data_.events() | background_events();
    write_register(esc_, reg::kAlEventMask.address, mask);
}

Verdict Device::before(Transition transition, Time now) {
    if (transition.from == AlState::init && mailbox_ != nullptr && !mailbox_->fits())
        return Verdict::refuse(AlStatusCode::no_memory);
    if (transition == Transition{AlState::safeop, AlState::op}) {
        if (const auto missing = process_data_.missing(); missing != AlStatusCode::none) {
            if (outputs_until_ == kNever) outputs_until_ = now + application_.description().outputs_wait;
            if (now < outputs_until_) return Verdict::wait(outputs_until_);
            outputs_until_ = kNever;
            return Verdict::refuse(missing);
        }
        outputs_until_ = kNever;
    }
    return application_.before(transition, now);
}

void Device::dropped(Transition transition) {
    outputs_until_ = kNever;
    application_.dropped(transition);
}

void Device::perform(Transition transition, Time now) {
    if (transition.from == AlState::op) process_data_.stop_outputs(now);
    if (transition.from >= AlState::safeop && transition.to < AlState::safeop) process_data_.stop();
    if (mailbox_ != nullptr && transition.to == AlState::init) mailbox_->stop();
    if (mailbox_ != nullptr && transition.from == AlState::init) mailbox_->start(transition.to);
    if (transition == Transition{AlState::preop, AlState::safeop}) process_data_.start(now);
    if (transition.to == AlState::op) process_data_.start_outputs(now);
}

void Device::after(Transition transition, Time now) {
    if (mailbox_ != nullptr) mailbox_->state_changed(transition.to);
    write_mask();
    application_.after(transition, now);
}

}  // namespace margay::subdevice
