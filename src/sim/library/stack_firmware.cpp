#include "sim/library/stack_firmware.hpp"

#include "sim/library/library.hpp"
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
    if (blueprint.device->protocols.coe) protocols_.push_back({wire::MailboxType::coe, &coe_});
    if (auto* const soe = model_->soe(); soe != nullptr) protocols_.push_back({wire::MailboxType::soe, soe});
    if (auto* const voe = model_->voe(); voe != nullptr) protocols_.push_back({wire::MailboxType::voe, voe});
    if (auto* const aoe = model_->aoe(); aoe != nullptr) protocols_.push_back({wire::MailboxType::aoe, aoe});
    if (auto* const eoe = model_->eoe(); eoe != nullptr) protocols_.push_back({wire::MailboxType::eoe, eoe});
    if (auto* const files = model_->files(); files != nullptr)
        protocols_.push_back({wire::MailboxType::foe, &foe_.emplace(*files, wire::foe::to_text), true});
    if (auto* const modules = model_->modules(); modules != nullptr) modules->lay_out(dictionary_);
    receive_.resize(mailbox_bytes(*blueprint.device));
    send_.resize(kReplySlots * receive_.size());
}

void StackFirmware::start(subdevice::EscAccess& esc, Time now) {
    esc_ = &esc;
    away_until_ = kNever;
    dictionary_.restore_defaults();
    dictionary_.block_downloads(nullptr);
    if (quirks_.has(Quirk::other_pdos) || quirks_.has(Quirk::coe_disagrees)) assign_other_pdos();
    odd_pdi_.attach(esc, quirks_);
    const bool odd = quirks_.any();
    auto& pdi = odd ? static_cast<subdevice::EscAccess&>(odd_pdi_) : esc;
    process_data_.emplace(pdi, *model_, dictionary_, process_memory_);
    mailbox_.emplace(pdi, MutableBytes(receive_), MutableBytes(send_), odd ? odd_protocols_ : protocols_);
    device_.emplace(pdi, *model_, *process_data_, &*mailbox_, nullptr, subdevice::RunMode::interrupts);
    model_->begin({&esc, &dictionary_, &*device_}, now);
    device_->start(now);
}

Time StackFirmware::step(Time now) {
    if (away_until_ != kNever) {
        if (now < away_until_) return away_until_;
        start(*esc_, now);
    }
    const auto beside = model_->advance(now);
    // The handler of the PDI interrupt, and the task that it wakes.
    (void)device_->interrupt(now);
    const auto next = std::min({beside, device_->step(now), odd_pdi_.next()});
    if (!model_->wants_restart()) return next;
    away_until_ = now + model_->restart_time();
    return away_until_;
}

void StackFirmware::fetch() const {
    constexpr std::size_t kMapped = 16;  // entries of a direction
    sim::fetch(&model_, sizeof model_ + sizeof image_ + sizeof dictionary_ + sizeof staging_ + sizeof coe_);
    sim::fetch(&odd_pdi_, sizeof odd_pdi_ + sizeof quirks_);
    sim::fetch(&process_memory_.outputs, 1);
    sim::fetch(&process_memory_.inputs, 1);
    sim::fetch(&process_memory_.output_entries, kMapped * sizeof(subdevice::MappedEntry));
    sim::fetch(&process_memory_.input_entries, kMapped * sizeof(subdevice::MappedEntry));
    sim::fetch(&esc_, sizeof esc_ + sizeof process_data_ + sizeof mailbox_ + sizeof device_ + sizeof away_until_);
    sim::fetch(model_.get(), sizeof(Model));
    sim::fetch(image_.data(), 1);
}

bool StackFirmware::add_quirk(Quirk quirk, std::vector<std::byte>& sii) {
    quirks_.add(quirk);
    model_->set_quirks(quirks_);
    if (odd_mail_.empty()) {
        for (const auto& line : protocols_) {
            odd_mail_.push_back(std::make_unique<OddMail>(*line.server, line.type, receive_.size()));
            odd_protocols_.push_back({line.type, odd_mail_.back().get(), line.in_boot});
        }
    }
    for (const auto& odd : odd_mail_) odd->set_quirks(quirks_);
    if (quirk == Quirk::other_pdos) {
        assign_other_pdos();
        sii = sii_of(blueprint_, dictionary_);
    }
    return true;
}

// Assigns the second PDO of a direction instead of the first PDO if there are two.
void StackFirmware::assign_other_pdos() {
    for (const std::uint16_t index : {subdevice::kOutputAssignment, subdevice::kInputAssignment}) {
        const auto* const assignment = dictionary_.find(index);
        if (assignment == nullptr || assignment->entry(1) == nullptr) continue;
        const auto other = static_cast<std::uint16_t>(dictionary_.number(index, 1) + 1);
        const auto memory = dictionary_.in_image(*assignment, *assignment->entry(1), 1);
        if (memory.size() == 2 && dictionary_.find(other) != nullptr) store_le<std::uint16_t>(memory, 0, other);
    }
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
