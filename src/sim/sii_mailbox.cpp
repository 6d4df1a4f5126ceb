#include "sim/sii_mailbox.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

constexpr std::size_t kReplySlots = 4;
constexpr std::uint16_t kMaxProcessData = 8192;  // the memory of the chip is the limit, not the rules for PDOs

std::size_t mailbox_bytes(const subdevice::DeviceDescription& device) {
    std::size_t most = 0;
    for (const auto* pair : {&device.mailbox, &device.boot_mailbox})
        most = std::max<std::size_t>({most, pair->receive.size_bytes, pair->send.size_bytes});
    return most;
}

}  // namespace

SiiMailbox::SiiMailbox(Bytes sii, const SiiModel& model)
    : objects_(sii, model),
      image_(objects_.image_bytes()),
      dictionary_(objects_.objects(), image_, &described_),
      coe_(dictionary_, staging_, (model.general.coe_details & coe_detail::kCompleteAccess) != 0) {
    described_.device = model.description();
    described_.device.outputs.max_bytes = kMaxProcessData;
    described_.device.inputs.max_bytes = kMaxProcessData;
    if (described_.device.protocols.coe) protocols_.push_back({wire::MailboxType::coe, &coe_});
    receive_.resize(mailbox_bytes(described_.device));
    send_.resize(kReplySlots * receive_.size());
    for (const auto& area : model.areas) assignments_.push_back({area.sync_manager, area.info.type == SmType::outputs});
}

void SiiMailbox::power_up(subdevice::EscAccess& esc) {
    dictionary_.restore_defaults();
    mailbox_.emplace(esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
}

bool SiiMailbox::build(std::uint8_t sync_manager) {
    const auto index = static_cast<std::uint16_t>(SiiDictionary::kAssignments + sync_manager);
    return dictionary_.find(index) != nullptr &&
           mapping_.build(dictionary_, index, kMaxProcessData) == subdevice::Abort::none;
}

std::optional<std::uint16_t> SiiMailbox::assigned_bytes(std::uint8_t sync_manager) {
    if (!build(sync_manager)) return std::nullopt;
    return mapping_.bytes();
}

void SiiMailbox::show(bool outputs, Bytes process_data) {
    std::size_t at = 0;
    for (const auto& assignment : assignments_) {
        if (assignment.outputs != outputs || !build(assignment.sync_manager)) continue;
        if (at + mapping_.bytes() > process_data.size()) return;
        mapping_.unpack(process_data.subspan(at, mapping_.bytes()));
        at += mapping_.bytes();
    }
}

}  // namespace margay::sim
