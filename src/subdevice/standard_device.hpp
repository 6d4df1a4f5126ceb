// A whole device out of tables: the author writes the description, the values, and the objects of the device itself.
// The objects of every device, the memory and the wiring follow from them.
//
//     constexpr DeviceDescription kDevice{…};
//     struct Values { Le<std::uint16_t> lamps; };
//     constexpr Entry kLamps[] = {value<&Values::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
//     constexpr Object kObjects[] = {variable(0x7000, "Lamps", kLamps)};
//     using Stack = StandardDevice<kDevice, kObjects, Values>;
//
//     struct Lamps final : Stack::App {
//         using App::App;
//         void cycle(Time, bool outputs_valid) override { … values.lamps … }
//         void safe_outputs(Time) override { … }           // OP has ended: cycle() need not be called again
//     };
//     Stack::Memory memory;
//     Lamps lamps(memory);
//     Stack stack(esc, lamps, memory);                     // esc: the EscAccess of the board
//     stack.device.start(now);
//     for (;;) (void)stack.device.step(esc.now());         // RunMode::polling; see device.hpp for the other modes
#pragma once

#include "subdevice/coe_server.hpp"
#include "subdevice/device.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <array>

namespace margay::subdevice {

namespace standard {
[[nodiscard]] constexpr std::size_t protocol_count(const MailboxProtocols& p) {
    return std::size_t{p.aoe} + p.eoe + p.coe + p.foe + p.soe + p.voe;
}

// Calls `visit(object, entry, subindex)` for each subindex that may be mapped in this direction. Objects of the
// communication (0x1000 to 0x1FFF), such as 0x10F3, are mapped only by a PDO of the author.
template <class Visit>
constexpr void for_each_mappable(std::span<const Object> objects, std::uint16_t access, Visit visit) {
    for (const Object& object : objects)
        for (const Entry& entry : object.entries)
            if (object.index >= 0x2000 && (entry.access & access) != 0)
                for (unsigned n = 0; n < entry.count; ++n) visit(object, entry, entry.subindex + n);
}

struct Mapped {
    std::size_t entries = 0;  // a gap included
    std::size_t bits = 0;     // without the gap
    std::size_t widest = 0;   // bits of the widest entry

    // The limits of a mapping object: the subindices 1 to 254, and 8 bits for the length of an entry (ETG.1000.6 "PDO
    // Mapping").
    [[nodiscard]] constexpr bool fits_mapping() const { return entries <= 254 && widest <= 255; }
};

// A SyncManager of one octet is only a watchdog trigger, without buffers and events (ESC data sheets, register 0x0802):
// then a gap follows, if the description has room for it.
constexpr std::size_t kLeastBits = 16;

constexpr Mapped count_mapped(std::span<const Object> objects, std::uint16_t access, std::size_t max_bytes) {
    Mapped all;
    for_each_mappable(objects, access, [&](const Object&, const Entry& entry, unsigned) {
        ++all.entries;
        all.bits += entry.bits;
        all.widest = std::max<std::size_t>(all.widest, entry.bits);
    });
    if (all.bits != 0 && all.bits < kLeastBits && kLeastBits <= 8 * max_bytes) ++all.entries;
    return all;
}

// The octets of a value of the device (0x2000 on), or of an object of the communication.
struct Range {
    std::size_t begin = 0;
    std::size_t end = 0;
    bool of_device = true;
};
constexpr void for_each_value(std::span<const Object> objects, auto&& call) {
    for (const Object& object : objects)
        for (const Entry& entry : object.entries)
            if (entry.storage == Storage::image && entry.bytes() != 0 && entry.count != 0)
                call(Range{entry.offset, entry.offset + std::size_t{entry.bytes()} * entry.count,
                           object.index >= 0x2000});
}
constexpr std::size_t value_count(std::span<const Object> objects) {
    std::size_t count = 0;
    for_each_value(objects, [&](const Range&) { ++count; });
    return count;
}
// Whether no value of the device (0x2000 on) lies in the octets of another value: two members of different structs, a
// member of a base class, whose offset is that in the base class, or an object of the communication with a wrong
// offset. Objects of the communication may show the same values.
template <std::size_t N>
constexpr bool lie_apart(std::span<const Object> objects) {
    // Sorted by their offsets, each value is compared with the ones before: a device may have thousands.
    std::array<Range, N> ranges{};
    std::size_t n = 0;
    for_each_value(objects, [&](const Range& range) { ranges[n++] = range; });
    std::ranges::sort(ranges, {}, &Range::begin);
    std::size_t all_end = 0;
    std::size_t device_end = 0;
    for (const Range& range : ranges) {
        if (range.begin < (range.of_device ? all_end : device_end)) return false;
        all_end = std::max(all_end, range.end);
        if (range.of_device) device_end = std::max(device_end, range.end);
    }
    return true;
}

// The entries of a PDO with all values that may be mapped in this direction, in the order of the objects.
template <std::size_t N>
constexpr std::array<Entry, N + 1> mapping_entries(std::span<const Object> objects, std::uint16_t access) {
    std::array<Entry, N + 1> entries{};
    entries[0] = entry_count(static_cast<std::uint8_t>(N));
    if (N == 0) return entries;
    std::uint8_t n = 0;
    std::size_t bits = 0;
    for_each_mappable(objects, access, [&](const Object& object, const Entry& entry, unsigned subindex) {
        bits += entry.bits;
        ++n;
        entries[n] =
            mapped(n, object.index, static_cast<std::uint8_t>(subindex), static_cast<std::uint8_t>(entry.bits));
    });
    if (n < N) entries[N] = mapped(static_cast<std::uint8_t>(N), 0, 0, static_cast<std::uint8_t>(kLeastBits - bits));
    return entries;
}

constexpr bool no_area_of_one_octet(const DeviceDescription& device) {
    bool none = true;
    for_each_area(device, true, [&](const ProcessDataArea& area, std::size_t) { none = none && area.max_bytes != 1; });
    return none;
}

// The memory of the SyncManagers of the description. Process data have their largest size, mailboxes have the size in
// the SII. The state machine refuses a size of the master that does not fit. BOOT has no process data.
enum class Places : std::uint8_t { apart, mailboxes_outside, mailboxes_overlap, data_outside, data_overlap };
constexpr Places places_of(const DeviceDescription& device) {
    namespace control = wire::sm_control;
    using Channels = wire::SyncManagerPlaces<kMostSyncManagers>;
    auto found = Places::apart;
    const auto add = [&](Channels& channels, const wire::SyncManager& sm, Places outside, Places overlap) {
        const auto place = channels.add(sm);
        if (found != Places::apart || place == wire::SyncManagerPlace::free) return;
        found = place == wire::SyncManagerPlace::outside ? outside : overlap;
    };
    Channels boot;
    Channels usual;
    for (const bool of_boot : {true, false}) {
        const MailboxPair& pair = of_boot ? device.boot_mailbox : device.mailbox;
        for (const MailboxArea& area : {pair.receive, pair.send})
            if (pair.present())
                add(of_boot ? boot : usual, {area.start, area.size_bytes, control::kModeMailbox, 1},
                    Places::mailboxes_outside, Places::mailboxes_overlap);
    }
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
            const auto mode = area.three_buffers ? control::kModeBuffered : control::kModeMailbox;
            add(usual, {area.start, area.max_bytes, mode, 1}, Places::data_outside, Places::data_overlap);
        });
    return found;
}

// A mailbox must have room for an SDO request, with its headers.
constexpr bool mailboxes_fit_an_sdo(const DeviceDescription& device) {
    bool fit = true;
    for (const MailboxPair& pair : {device.mailbox, device.boot_mailbox})
        fit = fit && (!pair.present() || std::min(pair.receive.size_bytes, pair.send.size_bytes) >= kLeastCoeMailbox);
    return fit;
}

constexpr std::uint16_t largest(const MailboxPair& pair) {
    const auto of = [](const MailboxArea& area) { return std::max(area.size_bytes, area.max_bytes); };
    return std::max(of(pair.receive), of(pair.send));
}

}  // namespace standard

// The objects of every device, out of its description, and one fixed PDO in each direction that has all values from
// 0x2000 on that may be mapped. An object of the author with the same index replaces that of this list.
template <const DeviceDescription& Description, const auto& Own, std::uint32_t Type = 0>
class StandardObjects {
    static constexpr std::span<const Object> kOwn{Own};
    static constexpr auto kRx = standard::count_mapped(kOwn, od::kRxMappable, Description.outputs.max_bytes);
    static constexpr auto kTx = standard::count_mapped(kOwn, od::kTxMappable, Description.inputs.max_bytes);
    static constexpr bool replaced(std::uint16_t index) {
        return std::ranges::any_of(kOwn, [index](const Object& object) { return object.index == index; });
    }
    // The limits of a PDO of the author are unknown to this list.
    static_assert(replaced(0x1600) || kRx.bits <= std::size_t{8} * Description.outputs.max_bytes,
                  "the values with od::kRxMappable do not fit into DeviceDescription::outputs");
    static_assert(replaced(0x1A00) || kTx.bits <= std::size_t{8} * Description.inputs.max_bytes,
                  "the values with od::kTxMappable do not fit into DeviceDescription::inputs");
    static_assert(replaced(0x1600) || kRx.fits_mapping(),
                  "a PDO has at most 254 entries of at most 255 bits: write object 0x1600 and further PDOs yourself");
    static_assert(replaced(0x1A00) || kTx.fits_mapping(),
                  "a PDO has at most 254 entries of at most 255 bits: write object 0x1A00 and further PDOs yourself");
    // With more than one SyncManager in a direction, the author decides which values go where.
    static constexpr bool every_area_assigned(bool outputs) {
        bool all = true;
        for_each_area(Description, outputs,
                      [&](const ProcessDataArea& area, std::size_t) { all = all && replaced(area.assignment()); });
        return all;
    }
    static_assert(Description.more_outputs.size() <= kMostMoreAreas &&
                  Description.more_inputs.size() <= kMostMoreAreas);
    static_assert(Description.more_outputs.empty() || every_area_assigned(true),
                  "a device with more_outputs needs PDO assignment objects (0x1C10 + SyncManager) of its own");
    static_assert(Description.more_inputs.empty() || every_area_assigned(false),
                  "a device with more_inputs needs PDO assignment objects (0x1C10 + SyncManager) of its own");

    static constexpr Entry kType[] = {constant<std::uint32_t>(0, "Device type", Type)};
    static constexpr Entry kName[] = {text(0, "Device name", Description.name)};
    static constexpr auto kIdentity = identity_entries(Description);
    static constexpr auto kRxEntries = standard::mapping_entries < kRx.fits_mapping() ? kRx.entries
                                                                                      : 0 > (kOwn, od::kRxMappable);
    static constexpr auto kTxEntries = standard::mapping_entries < kTx.fits_mapping() ? kTx.entries
                                                                                      : 0 > (kOwn, od::kTxMappable);
    static constexpr auto kSyncManagers = sync_manager_type_entries<sync_manager_count(Description)>(Description);
    static constexpr Entry kRxAssigned[] = {entry_count(1), assigned(1, 0x1600)};
    static constexpr Entry kTxAssigned[] = {entry_count(1), assigned(1, 0x1A00)};
    static constexpr Object kAll[] = {
        variable(0x1000, "Device type", kType),
        variable(0x1008, "Device name", kName),
        record(0x1018, "Identity", kIdentity, nullptr, DataType::identity),
        record(0x1600, "Outputs", kRxEntries, nullptr, DataType::pdo_mapping),
        record(0x1A00, "Inputs", kTxEntries, nullptr, DataType::pdo_mapping),
        array(0x1C00, "Sync manager types", kSyncManagers),
        array(Description.outputs.assignment(), "RxPDO assignment", kRxAssigned),
        array(Description.inputs.assignment(), "TxPDO assignment", kTxAssigned),
    };

    static constexpr bool is_there(const Object& object) {
        const bool of_outputs = object.index == 0x1600 || object.index == Description.outputs.assignment();
        const bool of_inputs = object.index == 0x1A00 || object.index == Description.inputs.assignment();
        // The author writes the PDOs of a device with more SyncManagers.
        if ((of_outputs && !Description.more_outputs.empty()) || (of_inputs && !Description.more_inputs.empty()))
            return false;
        // If the device has its own assignment, its PDOs have other indices, and this list adds no PDO without a value.
        if (object.index == 0x1600 && kRx.entries == 0 && replaced(Description.outputs.assignment())) return false;
        if (object.index == 0x1A00 && kTx.entries == 0 && replaced(Description.inputs.assignment())) return false;
        // If a modular device has its own PDOs, this list adds no PDOs, because a module may have their index.
        const auto own_pdo = [](std::uint16_t first) {
            return std::ranges::any_of(
                kOwn, [first](const Object& own) { return own.index >= first && own.index < first + 0x200; });
        };
        if ((object.index == 0x1600 || object.index == 0x1A00) && replaced(0xF000) && own_pdo(object.index))
            return false;
        return !replaced(object.index) && (!of_outputs || Description.outputs.present()) &&
               (!of_inputs || Description.inputs.present());
    }
    static constexpr std::size_t count() {
        return kOwn.size() + static_cast<std::size_t>(std::ranges::count_if(kAll, is_there));
    }
    static constexpr auto merge() {
        std::array<Object, count()> merged{};
        auto to = std::ranges::copy_if(kAll, merged.begin(), is_there).out;
        std::ranges::copy(kOwn, to);
        std::ranges::sort(merged, {}, &Object::index);
        return merged;
    }

  public:
    static constexpr auto kObjects = merge();
    // Between two areas of a direction, a gap may follow the last entry.
    static constexpr std::size_t kMostMapped = std::max(
        {kRx.entries + Description.more_outputs.size(), kTx.entries + Description.more_inputs.size(), std::size_t{1}});
};

// A device with CoE. `Values`: the struct of the values (values.hpp), or std::array<std::byte, N>. `More`: other
// mailbox protocols besides CoE. `MostMapped`: how many entries the master may map in one direction, for PDOs that it
// can change, and for PDOs of modules: with more entries SAFEOP is refused with 0x0002 "no memory". `LargestValue`:
// ModuleTables::kLargestValue, for a modular device. An object with a large value in the memory of a hook
// (ObjectHooks::memory) needs ObjectHooks::in_pieces.
template <const DeviceDescription& Description, const auto& Own, class Values, std::size_t More = 0,
          std::uint32_t Type = 0, std::size_t MostMapped = StandardObjects<Description, Own, Type>::kMostMapped,
          std::size_t LargestValue = 0>
class StandardDevice {
    // The SII announces the protocols of the description. A master gets no answers from one that has no server.
    static_assert(Description.protocols.coe, "a StandardDevice has CoE: DeviceDescription::protocols must say so");
    static_assert(standard::protocol_count(Description.protocols) <= 1 + More,
                  "DeviceDescription::protocols has a protocol for which `More` has no server");
    static_assert(Description.mailbox.present(), "a device with CoE needs DeviceDescription::mailbox");
    static_assert(Description.output_timeout == Duration::zero() || standard::no_area_of_one_octet(Description),
                  "DeviceDescription::output_timeout has no effect on outputs of one octet: give them two octets");

    static_assert(standard::mailboxes_fit_an_sdo(Description),
                  "a mailbox of the DeviceDescription is too short for an SDO request: it needs 16 octets");
    static_assert(cycle_limits_agree(Description.dc), "DcDescription::min_cycle is above DcDescription::max_cycle");
    static_assert(Description.dc.supported || !Description.dc.required,
                  "DcDescription::required needs DcDescription::supported");
    static_assert(mailbox_sizes_agree(Description),
                  "MailboxArea::size_bytes is not between `min_bytes` and `max_bytes`: the device refuses its own SII");
    static_assert(sync_managers_agree(Description),
                  "ProcessDataArea::sync_manager is that of a mailbox (0, 1) or of another area, or above 15");
    static constexpr auto kPlaces = standard::places_of(Description);
    static_assert(kPlaces != standard::Places::mailboxes_outside,
                  "a mailbox of the DeviceDescription is not in the RAM of an ESC, 0x1000 to 0xFFFF");
    static_assert(kPlaces != standard::Places::mailboxes_overlap,
                  "the two mailboxes of the DeviceDescription share memory: in `mailbox`, or in `boot_mailbox`");
    static_assert(kPlaces != standard::Places::data_outside,
                  "process data of the DeviceDescription are not in the RAM of an ESC, 0x1000 to 0xFFFF");
    static_assert(kPlaces != standard::Places::data_overlap,
                  "process data of the DeviceDescription share memory with other process data or with a mailbox: three "
                  "buffers take three times `max_bytes`");

  public:
    using Objects = StandardObjects<Description, Own, Type>;
    static_assert(counts_what_is_there(Objects::kObjects),
                  "subindex 0 of an array or record counts subindices that the table does not have: entry_count()");
    static_assert(well_formed(Objects::kObjects, sizeof(Values)),
                  "the table has values outside of `Values`, or another mistake that well_formed() finds");
    static_assert(standard::lie_apart<standard::value_count(Objects::kObjects)>(Objects::kObjects),
                  "two values of the table lie in the same octets: name members of `Values` itself, not of a base, and "
                  "offset_of(&Values::member) for the objects of the stack, such as sync_output_entries()");
    static constexpr std::size_t kMailboxBytes =
        std::max(standard::largest(Description.mailbox), standard::largest(Description.boot_mailbox));

    // The memory for messages and values; all other members of the device hold state only.
    struct Memory {
        MailboxMemory<kMailboxBytes, 3> mailbox;
        // Values of more than one message, until all of their segments have arrived.
        std::array<std::byte, std::max<std::size_t>({256, largest_value(Objects::kObjects), LargestValue})> staging{};
        Values values{};
        ProcessDataMemory<most_bytes(Description, true), most_bytes(Description, false), MostMapped> process_data;
    };

    // The base class of the author's application, with the description and the values.
    class App : public Application {
      public:
        explicit App(Memory& memory) : values(memory.values) {}
        [[nodiscard]] const DeviceDescription& description() const override { return Description; }

      protected:
        ~App() = default;
        Values& values;
    };

    // All arguments must outlive the device. `eeprom`: for an ESC without an EEPROM.
    StandardDevice(EscAccess& esc, Application& application, Memory& memory,
                   const std::array<MailboxProtocol, More>& more = {}, RunMode mode = RunMode::polling,
                   EepromEmulation* eeprom = nullptr)
        : dictionary(Objects::kObjects, image_of(memory.values), &application),
          coe_(dictionary, memory.staging, Description.complete_access, application.emergencies()),
          mailbox_(esc, memory.mailbox, protocols_),
          process_data(esc, application, dictionary, memory.process_data),
          device(esc, application, process_data, &mailbox_, eeprom, mode) {
        protocols_[0] = {wire::MailboxType::coe, &coe_};
        std::ranges::copy(more, protocols_.begin() + 1);
    }
    StandardDevice(const StandardDevice&) = delete;
    StandardDevice& operator=(const StandardDevice&) = delete;

    ObjectDictionary dictionary;

  private:
    CoeServer coe_;
    std::array<MailboxProtocol, 1 + More> protocols_{};
    Mailbox mailbox_;

  public:
    ProcessData process_data;
    Device device;
};

// Hooks of objects that are functions of the author's application:
//
//     struct Lamps final : Application {
//         HookAnswer check_dimming(const ObjectAccess& access, Bytes data);
//         void dimmed(const ObjectAccess& access);
//     };
//     constexpr ObjectHooks kDimmingHooks{.before_write = before_write_by<&Lamps::check_dimming>,
//                                         .after_write = after_write_by<&Lamps::dimmed>};
//
// The application of the dictionary must be of this class.
namespace standard {
template <class App, class Result, class... Args>
App* application_of(const ObjectAccess& access, Result (App::*)(Args...)) {
    return static_cast<App*>(access.application);
}
}  // namespace standard

template <auto Function>
HookAnswer before_read_by(const ObjectAccess& access) {
    return (standard::application_of(access, Function)->*Function)(access);
}
template <auto Function>
HookAnswer before_write_by(const ObjectAccess& access, Bytes data) {
    return (standard::application_of(access, Function)->*Function)(access, data);
}
template <auto Function>
void after_write_by(const ObjectAccess& access) {
    (standard::application_of(access, Function)->*Function)(access);
}
template <auto Function>
MutableBytes memory_by(const ObjectAccess& access) {
    return (standard::application_of(access, Function)->*Function)(access);
}

}  // namespace margay::subdevice
