#include "subdevice/sii_image.hpp"

#include "wire/esc.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace sii = wire::sii;
using sii::Fault;

namespace {

constexpr bool is_pdo(std::uint16_t index, std::uint16_t first) { return index >= first && index < first + 0x200; }

bool count_writable(const Object& object) { return (object.entries.front().access & od::kWrite) != 0; }

MailboxInfo mailbox_info(const MailboxPair& pair, std::uint16_t protocols) {
    return {pair.receive.start, pair.receive.size_bytes, pair.send.start, pair.send.size_bytes, protocols};
}

std::uint16_t protocol_bits(const MailboxProtocols& p) {
    namespace bit = mailbox_protocol;
    return static_cast<std::uint16_t>((p.aoe ? bit::kAoE : 0) | (p.eoe ? bit::kEoE : 0) | (p.coe ? bit::kCoE : 0) |
                                      (p.foe ? bit::kFoE : 0) | (p.soe ? bit::kSoE : 0) | (p.voe ? bit::kVoE : 0));
}

bool is_assigned(const ObjectDictionary& dictionary, std::uint16_t assignment, std::uint16_t pdo) {
    const auto count = static_cast<unsigned>(dictionary.number(assignment, 0));
    for (unsigned n = 1; n <= count; ++n)
        if (dictionary.number(assignment, n) == pdo) return true;
    return false;
}

// Fills the workspace with the PDOs of one direction. `pdos` and `entries` are reduced to the unused rest.
class PdoCollector {
  public:
    PdoCollector(const ObjectDictionary& dictionary, std::span<sii::PdoDescription>& pdos,
                 std::span<sii::PdoEntryDescription>& entries)
        : dictionary_(dictionary), pdos_(pdos), entries_(entries) {}

    bool collect(const DeviceDescription& device, bool outputs, std::span<const sii::PdoDescription>& found) {
        const std::uint16_t first_index = outputs ? 0x1600 : 0x1A00;
        const auto all = pdos_;
        std::size_t count = 0;
        bool room = true;
        const auto add = [&](const Object& object, const ProcessDataArea* area) {
            room = room && count < all.size();
            if (!room) return;
            auto& pdo = all[count++];
            pdo = {.index = object.index, .name = object.name};
            if (area != nullptr) pdo.sync_manager = area->sync_manager;
            if (!count_writable(object)) pdo.flags = sii::pdo_flag::kFixedContent;
            room = collect_entries(pdo);
        };
        // The process data of a SyncManager have the order of its assignment, so the category has this order too.
        // Behind them are the PDOs that are not assigned.
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
            const auto assigned = static_cast<unsigned>(dictionary_.number(area.assignment(), 0));
            for (unsigned n = 1; n <= assigned; ++n) {
                const auto index = static_cast<std::uint16_t>(dictionary_.number(area.assignment(), n));
                const auto* const object = is_pdo(index, first_index) ? dictionary_.find(index) : nullptr;
                if (object != nullptr) add(*object, &area);
            }
        });
        for (const auto& object : dictionary_.objects()) {
            if (!is_pdo(object.index, first_index)) continue;
            bool assigned = false;
            for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
                assigned = assigned || is_assigned(dictionary_, area.assignment(), object.index);
            });
            if (!assigned) add(object, nullptr);
        }
        if (!room) return false;
        found = all.first(count);
        pdos_ = all.subspan(count);
        return true;
    }

  private:
    bool collect_entries(sii::PdoDescription& pdo) {
        const auto count = static_cast<std::size_t>(dictionary_.number(pdo.index, 0));
        if (count > entries_.size()) return false;
        for (std::size_t n = 0; n < count; ++n) {
            const auto mapped = MappingEntry::of(
                static_cast<std::uint32_t>(dictionary_.number(pdo.index, static_cast<unsigned>(n + 1))));
            auto& entry = entries_[n];
            entry = {.index = mapped.index, .subindex = mapped.subindex, .bit_length = mapped.bits};
            const auto* const object = dictionary_.find(mapped.index);
            const auto* const found = object != nullptr ? object->entry(mapped.subindex) : nullptr;
            if (found == nullptr) continue;
            entry.name = found->name;
            entry.data_type = static_cast<std::uint8_t>(found->type);
        }
        pdo.entries = entries_.first(count);
        entries_ = entries_.subspan(count);
        return true;
    }

    const ObjectDictionary& dictionary_;
    std::span<sii::PdoDescription>& pdos_;
    std::span<sii::PdoEntryDescription>& entries_;
};

std::uint16_t mapped_bytes(const ObjectDictionary& dictionary, const ProcessDataArea& area) {
    if (dictionary.find(area.assignment()) == nullptr) return area.sii_bytes != 0 ? area.sii_bytes : area.max_bytes;
    MappingReader reader(dictionary, area.assignment());
    std::size_t bits = 0;
    while (reader.next()) bits += reader.entry().bits;
    return static_cast<std::uint16_t>((bits + 7) / 8);
}

SmInfo process_data_info(const ProcessDataArea& area, std::uint16_t bytes, bool outputs) {
    namespace control = wire::sm_control;
    const unsigned bits = (area.three_buffers ? control::kModeBuffered : control::kModeMailbox) |
                          control::kPdiInterrupt | (outputs ? control::kEcatWrites : control::kEcatReads) |
                          (outputs && (area.watchdog || area.watchdog_required) ? control::kWatchdogTrigger : 0u);
    return {area.start, bytes, static_cast<std::uint8_t>(bits), bytes != 0 ? std::uint8_t{1} : std::uint8_t{0},
            outputs ? SmType::outputs : SmType::inputs};
}

// Register 0x0141 bit 2: without it, chips that can save its power have no SYNC signals.
constexpr unsigned kSyncUnit = 0x0400;

std::uint16_t pdi_configuration(const DcDescription& dc, const BoardDescription& board) {
    const SyncPin signal{.output = true, .event = true};
    const auto sync0 = board.sync0.value_or(dc.supported ? signal : SyncPin{});
    const auto sync1 = board.sync1.value_or(dc.supported && dc.sync1 ? signal : SyncPin{});
    return static_cast<std::uint16_t>(board.pdi_configuration | (sync0.bits() << 8) | (sync1.bits() << 12));
}

// The operation mode with SYNC signals.
sii::DcOpMode dc_mode(const DcDescription& dc) {
    constexpr unsigned kSync0 = wire::sync_activation::kCyclic | wire::sync_activation::kSync0;
    sii::DcOpMode mode{.assign_activate = kSync0 << 8, .sync0_cycle_factor = dc.sync0_cycle_factor};
    if (dc.sync1) {
        mode.sync1_shift_time_ns = static_cast<std::int32_t>(dc.sync1_shift.count());
        mode.sync1_cycle_factor = dc.sync1_cycle_factor;
        mode.assign_activate = (kSync0 | wire::sync_activation::kSync1) << 8;
    }
    return mode;
}

// The SyncManager category: the place of an entry is the number of its SyncManager. Those between that the device does
// not use are of type unused.
class SyncManagerTable {
  public:
    [[nodiscard]] bool set(std::uint8_t number, const SmInfo& info) {
        if (number >= all_.size() || all_[number].type != SmType::unused) return false;
        all_[number] = info;
        count_ = std::max<std::size_t>(count_, number + 1U);
        return true;
    }
    [[nodiscard]] std::span<const SmInfo> entries() const { return std::span(all_).first(count_); }

  private:
    std::array<SmInfo, 16> all_{};
    std::size_t count_ = 0;
};

// Mailboxes and process data must not overlap in the process RAM. The size of the RAM is not known here.
Fault place_fault(const sii::Description& d) {
    const auto least = (d.mailbox.protocols & mailbox_protocol::kCoE) != 0 ? kLeastCoeMailbox : kLeastMailbox;
    for (const MailboxInfo& mailboxes : {d.mailbox, d.boot_mailbox}) {
        if (const auto fault = sii::mailbox_fault(mailboxes); fault != Fault::none) return fault;
        if (mailboxes.present() && std::min(mailboxes.out_bytes, mailboxes.in_bytes) < least)
            return Fault::mailbox_too_short;
    }
    using Place = wire::SyncManagerPlace;
    wire::SyncManagerPlaces<kMostSyncManagers> places;
    for (const SmInfo& sm : d.sync_managers) {
        if (sm.type == SmType::unused || sm.length_bytes == 0) continue;
        const auto place = places.add({sm.start, sm.length_bytes, sm.control, sm.enable});
        if (place == Place::outside) return Fault::sync_manager_outside;
        if (place == Place::taken) return Fault::sync_manager_overlap;
    }
    return Fault::none;
}

}  // namespace

std::uint8_t coe_details(const DeviceDescription& device, const ObjectDictionary& dictionary) {
    if (!device.protocols.coe) return 0;
    auto details = static_cast<unsigned>(coe_detail::kSdo | coe_detail::kSdoInformation);
    if (device.complete_access) details |= coe_detail::kCompleteAccess;
    for (const auto& object : dictionary.objects()) {
        if (!count_writable(object)) continue;
        if (object.index >= 0x1C10 && object.index < 0x1C30) details |= coe_detail::kPdoAssignment;
        if (is_pdo(object.index, 0x1600) || is_pdo(object.index, 0x1A00)) details |= coe_detail::kPdoConfiguration;
    }
    return static_cast<std::uint8_t>(details);
}

sii::Parsed<std::size_t> write_sii(const DeviceDescription& device, const BoardDescription& board,
                                   const ObjectDictionary& dictionary, std::span<sii::PdoDescription> pdos,
                                   std::span<sii::PdoEntryDescription> entries, MutableBytes eeprom) {
    sii::Description d;
    const unsigned sync_unit = device.dc.supported ? kSyncUnit : 0u;
    d.configuration = {.pdi_control = static_cast<std::uint16_t>(board.pdi_control | sync_unit),
                       .pdi_configuration = pdi_configuration(device.dc, board),
                       .sync_pulse_length_10ns = board.sync_pulse_length_10ns,
                       .alias = board.alias};
    d.identity = {device.vendor_id, device.product_code, device.revision, device.serial};
    d.mailbox = mailbox_info(device.mailbox, protocol_bits(device.protocols));
    d.boot_mailbox = mailbox_info(device.boot_mailbox, 0);
    d.group = device.group;
    d.order = device.order_code;
    d.name = device.name;
    d.general.coe_details = coe_details(device, dictionary);
    d.general.foe_details = device.protocols.foe ? 1 : 0;
    d.general.eoe_details = device.protocols.eoe ? 1 : 0;
    d.general.ds402_channels = device.drive_axes;
    d.general.ebus_current_ma = device.ebus_current_ma;
    d.general.physical_ports = board.physical_ports;
    d.general.flags = static_cast<std::uint8_t>(
        (device.mailbox.present() ? sii::general_flag::kMailboxDataLink : 0) |
        (device.device_id != 0 || device.device_id_switch ? sii::general_flag::kIdentAlStatus : 0));

    std::array<FmmuUse, 2 * (1 + kMostMoreAreas) + 1> fmmus{};
    std::size_t fmmu_count = 0;
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea&, std::size_t) {
            fmmus[fmmu_count++] = outputs ? FmmuUse::outputs : FmmuUse::inputs;
        });
    if (device.mailbox.present()) fmmus[fmmu_count++] = FmmuUse::mailbox_status;
    d.fmmus = std::span(fmmus).first(fmmu_count);

    if (!cycle_limits_agree(device.dc)) return {0, Fault::cycle_limits};
    SyncManagerTable managers;
    if (device.mailbox.present()) {
        const MailboxPair& pair = device.mailbox;
        (void)managers.set(0, {pair.receive.start, pair.receive.size_bytes, 0x26, 1, SmType::mailbox_out});
        (void)managers.set(1, {pair.send.start, pair.send.size_bytes, 0x22, 1, SmType::mailbox_in});
    }
    bool room = device.more_outputs.size() <= kMostMoreAreas && device.more_inputs.size() <= kMostMoreAreas;
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
            const auto info = process_data_info(area, mapped_bytes(dictionary, area), outputs);
            room = managers.set(area.sync_manager, info) && room;
        });
    if (!room) return {0, Fault::sync_manager_overlap};
    d.sync_managers = managers.entries();
    if (const auto fault = place_fault(d); fault != Fault::none) return {0, fault};

    PdoCollector collector(dictionary, pdos, entries);
    if (!collector.collect(device, true, d.rx_pdos) || !collector.collect(device, false, d.tx_pdos))
        return {0, Fault::no_room};

    const std::array<sii::DcDescription, 2> modes{
        {{{.assign_activate = 0}, "Synchron", "SM-Synchron"}, {dc_mode(device.dc), "DC", "DC-Synchron"}}};
    if (device.dc.supported) d.dc = device.dc.required ? std::span(modes).subspan(1) : std::span(modes);
    return sii::write_image(d, eeprom);
}

}  // namespace margay::subdevice
