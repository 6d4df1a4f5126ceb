#include "gateway/master_objects.hpp"

#include <margay/version.hpp>

#include <algorithm>
#include <cstdio>

namespace margay::gateway {
namespace {

using subdevice::constant;
using subdevice::DataType;
using subdevice::Entry;
using subdevice::Object;
using subdevice::ObjectCode;

// Device profile 5001, the modular device profile (ETG.5001), in the lower word.
constexpr std::uint32_t kDeviceType = 5001;
constexpr std::size_t kListEntries = 255;
constexpr std::size_t kLists = 16;
constexpr std::size_t kMostSlaves = kLists * kListEntries;  // the number of slaves that fit 0xF020 to 0xF02F

// Octets of the answers, kept until they are sent.
class Answers final : public subdevice::Outbox {
  public:
    explicit Answers(std::vector<Octets>& mails) : mails_(mails) {}
    MutableBytes open() override { return slot_; }
    void commit(wire::MailboxType, std::size_t bytes, std::uint16_t) override {
        mails_.emplace_back(slot_.begin(), slot_.begin() + static_cast<std::ptrdiff_t>(bytes));
    }

  private:
    std::vector<Octets>& mails_;
    std::array<std::byte, kMostDataBytes> slot_{};
};

std::string numbered(const char* name, std::size_t number) {
    std::array<char, 80> text{};
    std::snprintf(text.data(), text.size(), "%s %03zu", name, number);
    return text.data();
}

}  // namespace

MasterObjects::MasterObjects(std::string name, const Identity& identity) : name_(std::move(name)), identity_(identity) {
    build();
}

void MasterObjects::update(const std::vector<SlaveFacts>& slaves) {
    if (slaves == slaves_) return;
    slaves_ = slaves;
    build();
}

void MasterObjects::add_array(std::uint16_t index, std::string name, Entries entries) {
    const auto& kept = keep(std::move(entries));
    objects_.push_back(subdevice::array(index, keep(std::move(name)), kept));
}
void MasterObjects::add_record(std::uint16_t index, std::string name, Entries entries, DataType type) {
    const auto& kept = keep(std::move(entries));
    objects_.push_back(subdevice::record(index, keep(std::move(name)), kept, nullptr, type));
}
void MasterObjects::add_variable(std::uint16_t index, std::string name, const Entry& entry) {
    const auto& kept = keep(Entries{entry});
    objects_.push_back(subdevice::variable(index, keep(std::move(name)), kept));
}

// Station addresses, 255 in each list.
void MasterObjects::add_lists(std::uint16_t first, const char* name, const std::vector<const SlaveFacts*>& slaves) {
    for (std::size_t list = 0; list < kLists && (list == 0 || list * kListEntries < slaves.size()); ++list) {
        const std::size_t from = list * kListEntries;
        const std::size_t count = std::min(kListEntries, slaves.size() - std::min(slaves.size(), from));
        Entries entries{subdevice::entry_count(static_cast<std::uint8_t>(count))};
        for (std::size_t n = 0; n < count; ++n)
            entries.push_back(
                constant(static_cast<std::uint8_t>(n + 1), "Fixed station address", slaves[from + n]->station.value));
        add_array(static_cast<std::uint16_t>(first + list), numbered(name, list), std::move(entries));
    }
}

void MasterObjects::add_slaves(std::uint16_t first, const char* name, const std::vector<const SlaveFacts*>& slaves,
                               bool wanted) {
    for (std::size_t n = 0; n < slaves.size(); ++n) {
        const Identity& identity = wanted ? slaves[n]->wanted : slaves[n]->identity;
        add_record(static_cast<std::uint16_t>(first + n), numbered(name, n),
                   {subdevice::entry_count(8), constant(1, "Fixed station address", slaves[n]->station.value),
                    constant(5, "Vendor ID", identity.vendor), constant(6, "Product code", identity.product),
                    constant(7, "Revision number", identity.revision), constant(8, "Serial number", identity.serial)});
    }
}

void MasterObjects::build() {
    server_.reset();
    dictionary_.reset();
    objects_.clear();
    entries_.clear();
    names_.clear();
    std::vector<const SlaveFacts*> configured;
    std::vector<const SlaveFacts*> detected;
    for (const SlaveFacts& slave : slaves_) {
        if (slave.configured && configured.size() < kMostSlaves) configured.push_back(&slave);
        if (slave.detected && detected.size() < kMostSlaves) detected.push_back(&slave);
    }
    std::ranges::stable_sort(detected, {}, &SlaveFacts::ring_position);

    add_variable(0x1000, "Device type", constant(0, "Device type", kDeviceType));
    add_variable(0x1008, "Device name", subdevice::text(0, "Device name", name_));
    add_variable(0x100A, "Software version", subdevice::text(0, "Software version", MARGAY_VERSION_TEXT));
    add_record(0x1018, "Identity",
               {subdevice::entry_count(4), constant(1, "Vendor ID", identity_.vendor),
                constant(2, "Product code", identity_.product), constant(3, "Revision number", identity_.revision),
                constant(4, "Serial number", identity_.serial)},
               DataType::identity);
    add_slaves(0x8000, "Configuration data of slave", configured, true);
    add_slaves(0x9000, "Information data of slave", detected, false);
    add_record(0xF000, "Modular device profile",
               {subdevice::entry_count(2), constant<std::uint16_t>(1, "Module index distance", 1),
                constant(2, "Maximum number of modules", static_cast<std::uint16_t>(kMostSlaves))});
    // The state of the command object: no command was executed, and none is possible.
    using namespace std::string_view_literals;
    add_record(
        0xF002, "Detect modules command",
        {subdevice::entry_count(3), subdevice::text(1, "Command", "\0\0"sv).as(DataType::octet_string),
         constant<std::uint8_t>(2, "Status", 0), subdevice::text(3, "Response", "\0\0"sv).as(DataType::octet_string)},
        DataType::command);
    add_lists(0xF020, "Configured address list", configured);
    add_lists(0xF040, "Detected address list", detected);

    dictionary_.emplace(std::span<const Object>(objects_), MutableBytes{});
    server_.emplace(*dictionary_, staging_, true);
    server_->start(AlState::preop, {.receive_bytes = kMostDataBytes, .send_bytes = kMostDataBytes});
}

MasterObjects::Answer MasterObjects::answer(Bytes data) {
    Answer answer;
    Answers out(answer.mails);
    const wire::MailboxMessage message{
        .header = {.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::coe}, .data = data};
    answer.refusal = server_->receive(message, out, Time{});
    // Sends the remaining fragments of a list.
    for (std::size_t n = 0; n < kMostSlaves && server_->busy(); ++n) (void)server_->step(out, Time{});
    return answer;
}

}  // namespace margay::gateway
