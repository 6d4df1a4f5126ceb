#include "sim/sii_dictionary.hpp"

#include "subdevice/pdo_mapping.hpp"

#include <algorithm>
#include <array>

namespace margay::sim {

namespace sii = wire::sii;
using subdevice::DataType;
using subdevice::MappingEntry;
using subdevice::Object;
namespace od = subdevice::od;

namespace {

constexpr std::size_t kEntryRoom = 32;  // maximum number of entries of a mapping that the master may change

// The data type in the SII may not fit the length of the entry; in this case the length determines the type.
DataType type_of(std::uint8_t said, std::uint32_t bits) {
    const auto fits = [&](DataType type) {
        switch (type) {
            case DataType::boolean: return bits == 1;
            case DataType::integer8:
            case DataType::unsigned8:
            case DataType::byte: return bits == 8;
            case DataType::integer16:
            case DataType::unsigned16:
            case DataType::word: return bits == 16;
            case DataType::integer32:
            case DataType::unsigned32:
            case DataType::dword:
            case DataType::real32: return bits == 32;
            case DataType::integer64:
            case DataType::unsigned64:
            case DataType::real64: return bits == 64;
            default: return false;
        }
    };
    if (const auto type = static_cast<DataType>(said); fits(type)) return type;
    if (bits <= 8 && bits != 8)
        return bits == 1 ? DataType::boolean : static_cast<DataType>(static_cast<unsigned>(DataType::bit1) + bits - 1);
    switch (bits) {
        case 8: return DataType::unsigned8;
        case 16: return DataType::unsigned16;
        case 32: return DataType::unsigned32;
        case 64: return DataType::unsigned64;
        default: return DataType::octet_string;
    }
}

}  // namespace

SiiDictionary::SiiDictionary(Bytes image, const SiiModel& model) {
    read(image);
    add_fixed(model);
    add_assignments(model);
    add_pdos((model.general.coe_details & coe_detail::kPdoConfiguration) != 0);
    Mapped mapped;
    for (const auto& pdo : pdos_) collect(mapped, pdo);
    add_mapped(mapped);
    for (const auto& [index, object] : by_index_) objects_.push_back(object);
    pdos_.clear();
    strings_ = {};
}

void SiiDictionary::read(Bytes image) {
    sii::CategoryWalker walker(image);
    while (const auto category = walker.next()) {
        const auto type = category->place.type;
        if (type == sii::category::kStrings) strings_ = category->content;
        if (type != sii::category::kTxPdo && type != sii::category::kRxPdo) continue;
        sii::Pdos pdos(category->content);
        while (const auto pdo = pdos.next()) pdos_.push_back({*pdo, type == sii::category::kRxPdo});
    }
}

void SiiDictionary::add_fixed(const SiiModel& model) {
    const auto device = model.description();
    // Device profile 402 when the SII has drive channels; otherwise none.
    add(0x1000, "Device type",
        {subdevice::constant<std::uint32_t>(0, "Device type", model.general.ds402_channels != 0 ? 0x20192 : 0)});
    names_.push_back(model.name.empty() ? "unnamed" : model.name);
    add(0x1008, "Device name", {subdevice::text(0, "Device name", names_.back())});
    const auto identity = subdevice::identity_entries(device);
    add(0x1018, "Identity", {identity.begin(), identity.end()}, nullptr, DataType::identity);

    std::vector<Entry> types;
    const auto set = [&](std::size_t manager, int type) {
        while (types.size() <= manager)
            types.push_back(
                subdevice::constant<std::uint8_t>(static_cast<std::uint8_t>(types.size() + 1), "SyncManager type", 0));
        types[manager].low = static_cast<std::uint32_t>(type);
    };
    if (device.mailbox.present()) set(0, 1), set(1, 2);
    for (const auto& area : model.areas)
        if (area.sync_manager < 32) set(area.sync_manager, area.info.type == SmType::outputs ? 3 : 4);
    types.insert(types.begin(), subdevice::entry_count(static_cast<std::uint8_t>(types.size())));
    add(0x1C00, "SyncManager types", std::move(types), nullptr, DataType::unsigned8);
}

void SiiDictionary::add_assignments(const SiiModel& model) {
    const bool assignable = (model.general.coe_details & coe_detail::kPdoAssignment) != 0;
    for (const auto& area : model.areas) {
        if (area.sync_manager >= 32) continue;
        // The rules for changes support only SyncManagers 2 and 3.
        const bool free = assignable && (area.sync_manager == 2 || area.sync_manager == 3);
        const bool outputs = area.info.type == SmType::outputs;
        std::vector<std::uint32_t> assigned;
        std::size_t room = 0;
        for (const auto& [pdo, of_outputs] : pdos_) {
            if (of_outputs != outputs) continue;
            ++room;
            if (pdo.sync_manager == area.sync_manager) assigned.push_back(pdo.index);
        }
        add(static_cast<std::uint16_t>(kAssignments + area.sync_manager),
            outputs ? "RxPDO assignment" : "TxPDO assignment",
            list(assigned, free ? std::max<std::size_t>(room, 1) : 0, DataType::unsigned16),
            free ? &subdevice::kPdoAssignmentHooks : nullptr, DataType::unsigned16);
    }
}

void SiiDictionary::add_pdos(bool configurable) {
    for (const auto& [pdo, outputs] : pdos_) {
        // Devices exist that have inputs at 0x1700 and 0x1800: the category of a PDO determines its direction, not its
        // index.
        if (pdo.index < 0x1600 || pdo.index >= 0x1C00) continue;
        std::vector<std::uint32_t> mapping;
        sii::PdoEntries entries(pdo.entries);
        while (const auto entry = entries.next())
            mapping.push_back(MappingEntry{entry->index, entry->subindex, entry->bit_length}.word());
        const bool free = configurable && (pdo.flags & sii::pdo_flag::kFixedContent) == 0;
        add(pdo.index, name(pdo.name, outputs ? "RxPDO" : "TxPDO"),
            list(mapping, free ? std::max(kEntryRoom, mapping.size()) : 0, DataType::unsigned32),
            free ? &subdevice::kPdoMappingHooks : nullptr, DataType::pdo_mapping);
    }
}

void SiiDictionary::collect(Mapped& mapped, const ReadPdo& read) {
    const std::uint16_t access = read.outputs ? od::kReadWrite | od::kRxMappable : od::kReadOnly | od::kTxMappable;
    sii::PdoEntries entries(read.pdo.entries);
    while (const auto entry = entries.next()) {
        if (entry->index == 0 || entry->bit_length == 0) continue;
        auto& object = mapped[entry->index];
        const auto found = object.find(entry->subindex);
        if (found == object.end())
            object.emplace(entry->subindex,
                           in_image(entry->subindex, name(entry->name, "Value"),
                                    type_of(entry->data_type, entry->bit_length), entry->bit_length, access));
        else if (found->second.bits == entry->bit_length)
            found->second.access |= access;
    }
}

void SiiDictionary::add_mapped(const Mapped& mapped) {
    for (const auto& [index, by_subindex] : mapped) {
        std::vector<Entry> entries;
        const bool variable = by_subindex.size() == 1 && by_subindex.begin()->first == 0;
        if (!variable) entries.push_back(subdevice::entry_count(by_subindex.rbegin()->first));
        for (const auto& [subindex, entry] : by_subindex)
            if (variable || subindex != 0) entries.push_back(entry);
        const std::string_view called = entries.back().name;
        add(index, called, std::move(entries));
    }
}

void SiiDictionary::add(std::uint16_t index, std::string_view name, std::vector<Entry> entries,
                        const subdevice::ObjectHooks* hooks, DataType type) {
    if (by_index_.contains(index)) return;
    entries_.push_back(std::move(entries));
    const std::span<const Entry> all = entries_.back();
    auto object = all.size() == 1 && all.front().subindex == 0 && hooks == nullptr && type == DataType::none
                      ? subdevice::variable(index, name, all)
                      : subdevice::record(index, name, all, hooks, type);
    by_index_.emplace(index, object);
}

std::vector<subdevice::Entry> SiiDictionary::list(const std::vector<std::uint32_t>& values, std::size_t room,
                                                  DataType type) {
    const std::uint32_t bits = type == DataType::unsigned32 ? 32 : 16;
    const auto count = static_cast<std::uint8_t>(std::min<std::size_t>(values.size(), 254));
    const std::size_t places = room == 0 ? count : std::clamp<std::size_t>(room, count, 254);
    const std::uint16_t access = od::kReadWritePreop;
    std::vector<Entry> entries;
    entries.push_back(room == 0 ? subdevice::entry_count(count)
                                : in_image(0, "SubIndex 000", DataType::unsigned8, 8, access, count));
    for (std::size_t n = 0; n < places; ++n) {
        const auto subindex = static_cast<std::uint8_t>(n + 1);
        const std::uint32_t value = n < values.size() ? values[n] : 0;
        auto number = std::to_string(n + 1);
        names_.push_back("SubIndex " + std::string(3 - number.size(), '0') + number);
        auto entry = in_image(subindex, names_.back().c_str(), type, bits, access, value);
        if (room == 0) {
            entry.storage = subdevice::Storage::constant;
            entry.access = od::kReadOnly;
        }
        entries.push_back(entry);
    }
    return entries;
}

subdevice::Entry SiiDictionary::in_image(std::uint8_t subindex, const char* name, DataType type, std::uint32_t bits,
                                         std::uint16_t access, std::uint64_t initial) {
    const Entry entry{.subindex = subindex,
                      .storage = subdevice::Storage::image,
                      .type = type,
                      .access = access,
                      .bits = bits,
                      .offset = static_cast<std::uint32_t>(image_bytes_),
                      .name = name};
    image_bytes_ += entry.bytes();
    return entry.beginning(initial);
}

const char* SiiDictionary::name(sii::StringNumber number, const char* otherwise) {
    const auto text = sii::string(strings_, number);
    if (!text.ok() || text.value.empty()) return otherwise;
    std::array<char, 768> buffer{};
    names_.emplace_back(sii::to_utf8(text.value, buffer));
    return names_.back().c_str();
}

}  // namespace margay::sim
