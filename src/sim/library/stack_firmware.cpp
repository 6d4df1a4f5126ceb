#include "sim/library/stack_firmware.hpp"

#include "subdevice/esm_checks.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

constexpr std::size_t kReplySlots = 4;

std::size_t mailbox_bytes(const subdevice::DeviceDescription& device) {
    std::size_t most = 0;
    for (const auto* pair : {&device.mailbox, &device.boot_mailbox})
        for (const auto* area : {&pair->receive, &pair->send})
            most = std::max<std::size_t>({most, area->size_bytes, area->max_bytes});
    return most;
}

}  // namespace

StackFirmware::StackFirmware(const Blueprint& blueprint)
    : blueprint_(blueprint),
      model_(blueprint.make()),
      image_(blueprint.image_bytes),
      dictionary_(blueprint.objects, image_, model_.get()),
      coe_(dictionary_, staging_, blueprint.device->complete_access, model_->emergencies()) {
    protocols_.push_back({wire::MailboxType::coe, &coe_});
    if (auto* const files = model_->files(); files != nullptr)
        protocols_.push_back({wire::MailboxType::foe, &foe_.emplace(*files), true});
    receive_.resize(mailbox_bytes(*blueprint.device));
    send_.resize(kReplySlots * receive_.size());
}

void StackFirmware::start(subdevice::EscAccess& esc, Time now) {
    esc_ = &esc;
    away_until_ = kNever;
    dictionary_.restore_defaults();
    dictionary_.block_downloads(nullptr);
    process_data_.emplace(esc, *model_, dictionary_, process_memory_);
    mailbox_.emplace(esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
    device_.emplace(esc, *model_, *process_data_, &*mailbox_);
    model_->start({&esc, &dictionary_, &*device_}, now);
    device_->start(now);
}

Time StackFirmware::step(Time now) {
    if (away_until_ != kNever) {
        if (now < away_until_) return away_until_;
        start(*esc_, now);
    }
    const auto beside = model_->advance(now);
    const auto next = std::min(beside, device_->step(now));
    if (!model_->wants_restart()) return next;
    away_until_ = now + model_->restart_time();
    return away_until_;
}

bool StackFirmware::set_quirks(Quirks quirks) {
    model_->set_quirks(quirks);
    return true;
}

Bytes StackFirmware::outputs() {
    const auto& area = blueprint_.device->outputs;
    if (esc_ == nullptr || !area.present()) return {};
    const std::size_t bytes = subdevice::read_sync_manager(*esc_, area.sync_manager).length_bytes;
    return Bytes(process_memory_.outputs).first(std::min(bytes, process_memory_.outputs.size()));
}

void StackFirmware::poke() {
    if (process_data_ && away_until_ == kNever)
        process_data_->process(subdevice::part::kApplication | subdevice::part::kInputs, esc_->now());
}

}  // namespace margay::sim
