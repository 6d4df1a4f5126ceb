// Modular devices (ETG.5001.1 "Modular Device Profile"): a table of the kinds of modules, a list of slots, and in each
// slot the module that is plugged in. The author writes the objects of one module with the indices of the first
// slot. From them the stack makes the objects of each slot, the PDO assignment, and the objects that describe the
// modules to the master:
//
//     struct OutValues { std::uint8_t lamps; };                                           // of one module
//     constexpr Entry kOut[] = {entry_count(1),
//                               value<&OutValues::lamps>(1, "Lamps", od::kReadWrite | od::kRxMappable)};
//     constexpr Entry kOutPdo[] = {entry_count(1), mapped(1, 0x7000, 1, 8)};
//     constexpr Object kOutObjects[] = {record(0x1600, "Lamps", kOutPdo, nullptr, DataType::pdo_mapping),
//                                       record(0x7000, "Lamps", kOut)};
//     constexpr ModuleKind kKinds[] = {
//         {.ident = 0x21, .name = "8 lamps", .objects = kOutObjects, .value_bytes = sizeof(OutValues)}};
//     constexpr ModularDevice kModular{.kinds = kKinds, .slots = 4};
//
//     using Tables = ModuleTables<kModular, sizeof(Values)>;                             // behind the own values
//     constexpr auto kObjects = joined(kOwnObjects, Tables::kObjects);                   // 0x1C12, 0x1C13, 0xF000 …
//     constexpr DeviceDescription kDevice{… .outputs = {… .max_bytes = Tables::most_bytes(true)}};
//
//     using Stack = StandardDevice<kDevice, kObjects, ModularValues<Values, Tables>, 0, 0x1389, Tables::kMostMapped,
//                                  Tables::kLargestValue>;                              // 1 more for each own entry
//     // With the objects that StandardDevice adds: own values that may be mapped make a 0x1600 or 0x1A00.
//     static_assert(well_formed(Stack::Objects::kObjects, Tables::end, kModular));
//
//     class Coupler final : public Stack::App {                                          // the application has them
//         ModuleLayout* modules() override { return &modules_; }
//         ModuleMemory<Tables> memory_;
//         Modules modules_{memory_};
//     };
//
// The firmware says what is plugged in: detect(slot, ident), at any time. Object 0xF050 shows it at once. The objects,
// the PDOs and the sizes of the process data follow at the next INIT→PREOP; until then SAFEOP is refused with AL status
// code 0x0021 (needs INIT). In SAFEOP and OP process data continues with the objects of the old module; a device that
// must not do so calls Device::fall_back(). SAFEOP is refused with 0x0070 while the master has written a list of
// modules (0xF030) or of their slots (0xF020) that differs from what is plugged in.
#pragma once

#include "subdevice/application.hpp"
#include "subdevice/pdo_mapping.hpp"
#include "subdevice/stored_values.hpp"

#include <algorithm>

namespace margay::subdevice {

inline constexpr std::uint16_t kModuleProfile = 0xF000;
inline constexpr std::uint16_t kModuleProfileList = 0xF010;
inline constexpr std::uint16_t kConfiguredAddresses = 0xF020;
inline constexpr std::uint16_t kConfiguredModules = 0xF030;
inline constexpr std::uint16_t kDetectedModules = 0xF050;

// The common data of all modules of one kind.
struct ModuleKind {
    std::uint32_t ident = 0;  // not 0, which is an empty slot
    std::string_view name{};  // for display
    // In object 0xF010. The lower 16 bits: the number of the device profile of the module.
    std::uint32_t profile = 5001;
    // The objects of a module in the first slot, ascending by index: 0x2000 to 0xEFFF, and the PDOs. The offsets of
    // their values begin with 0 in the values of the module. PDOs of both directions are assigned in this order.
    std::span<const Object> objects{};
    std::uint16_t value_bytes = 0;
};

// All texts and tables must exist as long as the device.
struct ModularDevice {
    std::span<const ModuleKind> kinds{};
    std::uint8_t slots = 0;               // 1 to 254
    std::uint16_t index_distance = 0x10;  // between the indices of the objects of two slots that follow each other
    std::uint16_t pdo_distance = 1;       // the same for the PDOs
    // PDOs of the device itself; they are assigned before the PDOs of the modules.
    std::span<const std::uint16_t> own_rx_pdos{};
    std::span<const std::uint16_t> own_tx_pdos{};

    [[nodiscard]] constexpr const ModuleKind* kind(std::uint32_t ident) const {
        for (const auto& one : kinds)
            if (one.ident == ident) return &one;
        return nullptr;
    }
    // The index, in a slot from 1 on, of an object that has this index in the first slot.
    [[nodiscard]] constexpr std::uint32_t index_in(std::uint16_t index, unsigned slot) const {
        const std::uint32_t distance = moves_with_slot(index) ? index_distance : pdo_distance;
        return index + distance * (slot - 1);
    }
};

namespace module_rules {
[[nodiscard]] constexpr bool is_rx_pdo(std::uint16_t index) { return index >= 0x1600 && index < 0x1800; }
[[nodiscard]] constexpr bool is_tx_pdo(std::uint16_t index) { return index >= 0x1A00 && index < 0x1C00; }
[[nodiscard]] constexpr bool same_area(std::uint16_t a, std::uint32_t b) {
    if (moves_with_slot(a)) return a >> 12 == b >> 12;
    if (b > 0xFFFF) return false;
    return is_rx_pdo(a) ? is_rx_pdo(static_cast<std::uint16_t>(b))
                        : is_tx_pdo(a) && is_tx_pdo(static_cast<std::uint16_t>(b));
}
// Whether a module in any slot from `first` on has an object with this index.
[[nodiscard]] constexpr bool used(const ModularDevice& device, std::uint16_t index, unsigned first) {
    for (const auto& kind : device.kinds)
        for (const auto& object : kind.objects)
            for (unsigned slot = first; slot <= device.slots; ++slot)
                if (device.index_in(object.index, slot) == index) return true;
    return false;
}

// The largest value that `of(kind)` has for any kind.
template <class Of>
[[nodiscard]] constexpr std::size_t most(const ModularDevice& device, Of of) {
    std::size_t all = 0;
    for (const auto& kind : device.kinds) all = std::max(all, static_cast<std::size_t>(of(kind)));
    return all;
}
// The PDOs of a module in this direction, their entries and bits.
struct Mapped {
    std::size_t pdos = 0;
    std::size_t entries = 0;
    std::size_t bits = 0;
};
[[nodiscard]] constexpr Mapped mapped_by(const ModuleKind& kind, bool outputs) {
    Mapped all;
    for (const auto& object : kind.objects) {
        if (!(outputs ? is_rx_pdo(object.index) : is_tx_pdo(object.index))) continue;
        ++all.pdos;
        for (const auto& entry : object.entries.subspan(1)) {
            ++all.entries;
            all.bits += MappingEntry::of(static_cast<std::uint32_t>(entry.initial())).bits;
        }
    }
    return all;
}
}  // namespace module_rules

// Checks the tables of the modules: idents unique and not 0, objects of each kind as for a dictionary, PDOs with
// constant entries, and no index that two slots share or that leaves its area.
[[nodiscard]] constexpr bool well_formed(const ModularDevice& device) {
    if (device.slots < 1 || device.slots > 254 || device.kinds.empty()) return false;
    for (std::size_t i = 0; i < device.kinds.size(); ++i) {
        const auto& kind = device.kinds[i];
        if (kind.ident == 0 || device.kind(kind.ident) != &kind || !well_formed(kind.objects, kind.value_bytes))
            return false;
        for (const auto& object : kind.objects) {
            if (!module_rules::same_area(object.index, device.index_in(object.index, device.slots))) return false;
            if (module_rules::used(device, object.index, 2)) return false;
            if (moves_with_slot(object.index)) continue;
            for (const auto& entry : object.entries)
                if (entry.storage != Storage::constant || entry.count != 1) return false;
        }
    }
    return true;
}
// Also checks that the table of the device itself contains no index of a module.
[[nodiscard]] constexpr bool well_formed(std::span<const Object> table, std::size_t image_bytes,
                                         const ModularDevice& device) {
    for (const auto& object : table)
        if (module_rules::used(device, object.index, 1)) return false;
    return well_formed(table, image_bytes) && well_formed(device);
}

// A list of numbers in the image: their count, and the numbers.
template <class T, std::size_t Offset, std::size_t Most>
struct ModuleList {
    using count = Field<std::uint8_t, Offset>;
    using first = Field<T, count::end>;
    static constexpr std::size_t most = Most;
    static constexpr std::size_t end = count::end + sizeof(T) * Most;
    [[nodiscard]] static constexpr std::array<Entry, 2> entries(const char* name, std::uint16_t access) {
        auto number = value<count>(0, "SubIndex 000", access);
        if ((access & od::kWrite) != 0) number = number.within(kLimits<0, std::int64_t{Most}>);
        return {number, value<first>(1, name, access).times(static_cast<std::uint8_t>(Most))};
    }
};

// Data that is derived from the table: the objects that describe modules and PDO assignment, and the places of all
// values in the image, from `Offset` on.
template <const ModularDevice& Device, std::size_t Offset>
struct ModuleTables {
    static constexpr const ModularDevice& kDevice = Device;
    static constexpr std::size_t kSlots = Device.slots;
    static constexpr std::size_t kOffset = Offset;
    [[nodiscard]] static constexpr std::size_t most_pdos(bool outputs) {
        const auto own = (outputs ? Device.own_rx_pdos : Device.own_tx_pdos).size();
        return own + kSlots * module_rules::most(Device, [=](const ModuleKind& kind) {
                         return module_rules::mapped_by(kind, outputs).pdos;
                     });
    }
    static_assert(most_pdos(true) <= 254 && most_pdos(false) <= 254, "a SyncManager has at most 254 PDOs");
    // For ProcessDataArea::max_bytes, and for `MostMapped` of a StandardDevice: without the PDOs of the device itself.
    [[nodiscard]] static constexpr std::uint16_t most_bytes(bool outputs) {
        const auto bits = module_rules::most(
            Device, [=](const ModuleKind& kind) { return module_rules::mapped_by(kind, outputs).bits; });
        return static_cast<std::uint16_t>((kSlots * bits + 7) / 8);
    }
    static constexpr std::size_t kMostMapped =
        kSlots * module_rules::most(Device, [](const ModuleKind& kind) {
            return std::max(module_rules::mapped_by(kind, true).entries, module_rules::mapped_by(kind, false).entries);
        });
    static constexpr std::size_t kMostObjects =
        kSlots * module_rules::most(Device, [](const ModuleKind& kind) { return kind.objects.size(); });
    // The staging buffer of a StandardDevice needs as much (`LargestValue`).
    static constexpr std::size_t kLargestValue =
        module_rules::most(Device, [](const ModuleKind& kind) { return largest_value(kind.objects); });
    // Of each slot.
    static constexpr std::size_t kSlotBytes =
        module_rules::most(Device, [](const ModuleKind& kind) { return kind.value_bytes; });

    using Profiles = ModuleList<std::uint32_t, Offset, kSlots>;
    using Addresses = ModuleList<std::uint16_t, Profiles::end, kSlots>;
    using Configured = ModuleList<std::uint32_t, Addresses::end, kSlots>;
    using Detected = ModuleList<std::uint32_t, Configured::end, kSlots>;
    using RxPdos = ModuleList<std::uint16_t, Detected::end, std::max<std::size_t>(1, most_pdos(true))>;
    using TxPdos = ModuleList<std::uint16_t, RxPdos::end, std::max<std::size_t>(1, most_pdos(false))>;
    static constexpr std::size_t kValues = TxPdos::end;  // of the module in the first slot; the others follow
    static constexpr std::size_t kValueBytes = kSlots * kSlotBytes;
    static constexpr std::size_t end = kValues + kValueBytes;
    // For the buffer of StoredValues, besides stored_bytes() of the table of the device.
    static constexpr std::size_t kStoredBytes =
        kSlots * (kStoredPartHeadBytes +
                  module_rules::most(Device, [](const ModuleKind& kind) { return stored_value_bytes(kind.objects); }));
    static_assert(end <= 0x10000, "the values of modules lie in the first 64 KiB of the image");

    static constexpr auto kRxPdos = RxPdos::entries("Assigned PDO", od::kReadOnly);
    static constexpr auto kTxPdos = TxPdos::entries("Assigned PDO", od::kReadOnly);
    static constexpr std::array<Entry, 3> kProfile{
        entry_count(2), constant<std::uint16_t>(1, "Module index distance", Device.index_distance),
        constant<std::uint16_t>(2, "Maximum number of modules", Device.slots)};
    static constexpr auto kProfiles = Profiles::entries("Module profile", od::kReadOnly);
    static constexpr auto kAddresses = Addresses::entries("Configured address", od::kReadWritePreop);
    static constexpr auto kConfigured = Configured::entries("Configured module ident", od::kReadWritePreop);
    static constexpr auto kDetected = Detected::entries("Detected module ident", od::kReadOnly);
    static constexpr std::array<Object, 7> kObjects{
        array(kOutputAssignment, "RxPDO assignment", kRxPdos),
        array(kInputAssignment, "TxPDO assignment", kTxPdos),
        record(kModuleProfile, "Modular device profile", kProfile),
        array(kModuleProfileList, "Module profile list", kProfiles),
        array(kConfiguredAddresses, "Configured address list", kAddresses),
        array(kConfiguredModules, "Configured module ident list", kConfigured),
        array(kDetectedModules, "Detected module ident list", kDetected)};
};

// The values of a modular device: its own values, then the values of the lists and of the modules (Modules::values()).
template <class Own, class Tables>
struct ModularValues {
    static_assert(Tables::kOffset == sizeof(Own), "ModuleTables begin behind the values of the device itself");
    Own own;
    std::array<std::byte, Tables::end - sizeof(Own)> of_modules;
};

// The state of the modules of a device.
template <class Tables>
struct ModuleMemory {
    using For = Tables;
    std::array<std::uint32_t, Tables::kSlots> detected{};
    std::array<std::uint32_t, Tables::kSlots> used{};  // idents of the present layout
    std::array<Object, Tables::kMostObjects> objects{};
};

class Modules final : public ModuleLayout {
  public:
    // `memory` must outlive the modules.
    template <class Tables>
    explicit Modules(ModuleMemory<Tables>& memory)
        : device_(Tables::kDevice),
          detected_(memory.detected),
          used_(memory.used),
          objects_(memory.objects),
          values_(Tables::kValues),
          slot_bytes_(Tables::kSlotBytes) {}

    // A module was plugged into the slot, from 1 on, or pulled out of it (0). Slots that do not exist are ignored. An
    // ident without a kind is shown in 0xF050, and has no objects. From the context of step(), or with the lock of
    // EscAccess held.
    void detect(unsigned slot, std::uint32_t ident);
    [[nodiscard]] std::uint32_t detected(unsigned slot) const;  // 0: an empty slot

    // The kind of the module whose objects exist now; nullptr: the slot has no objects.
    [[nodiscard]] const ModuleKind* in_use(unsigned slot) const;
    // The octets of the values of that module, for values_in() and store_values(); empty before lay_out().
    [[nodiscard]] MutableBytes values(unsigned slot) const;

    // Device calls it. Before the device starts, call it for write_sii() and StoredValues::load(). A module that takes
    // the place of one of another kind, or of none, has its initial values (StoredValues::load_module()).
    void lay_out(ObjectDictionary& dictionary) override;
    [[nodiscard]] AlStatusCode check() const override;

  private:
    [[nodiscard]] bool has(unsigned slot) const { return slot >= 1 && slot <= device_.slots; }
    [[nodiscard]] bool matches(std::uint16_t list, bool addresses) const;
    void show_detected();
    void place(unsigned slot, const ModuleKind& kind, bool anew);
    void show_list(std::uint16_t list, unsigned nth, std::uint32_t number);
    void assign(std::uint16_t list, std::span<const std::uint16_t> own, bool outputs);

    const ModularDevice& device_;
    std::span<std::uint32_t> detected_;
    std::span<std::uint32_t> used_;
    std::span<Object> objects_;
    std::size_t count_ = 0;  // objects of the present layout
    bool hidden_ = false;    // the device itself has an object with the index of one of a module
    std::size_t values_;
    std::size_t slot_bytes_;
    ObjectDictionary* dictionary_ = nullptr;
};

}  // namespace margay::subdevice
