// "modular_io": a coupler with four slots for modules. Digital outputs of 4 bits, digital inputs of 8 bits, two
// analogue inputs with an offset, and a counter, in any order.
#include "sim/library/device_tables.hpp"
#include "subdevice/modules.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;

constexpr auto kModularOut = od::kReadWrite | od::kRxMappable;
constexpr auto kModularIn = od::kRead | od::kTxMappable;

// The values of one module of each kind.
struct FourLamps {
    std::array<std::uint8_t, 4> lamps;
};
struct EightKeys {
    std::uint8_t keys;
};
struct TwoMeters {
    std::array<Le<std::int16_t>, 2> levels;
    std::array<Le<std::int16_t>, 2> offsets;
};
struct OneCounter {
    Le<std::uint32_t> preset;
    Le<std::uint32_t> count;
};

constexpr Entry kLampEntries[] = {entry_count(4), flag<&FourLamps::lamps>(1, "Lamp", kModularOut)};
constexpr Entry kLampPdo[] = {entry_count(4), mapped(1, 0x7000, 1, 1), mapped(2, 0x7000, 2, 1), mapped(3, 0x7000, 3, 1),
                              mapped(4, 0x7000, 4, 1)};
constexpr Object kLampModule[] = {record(0x1600, "Lamps", kLampPdo, nullptr, DataType::pdo_mapping),
                                  array(0x7000, "Lamps", kLampEntries)};

constexpr Entry kKeyEntries[] = {entry_count(1), value<&EightKeys::keys>(1, "Keys", kModularIn)};
constexpr Entry kKeyPdo[] = {entry_count(1), mapped(1, 0x6000, 1, 8)};
constexpr Object kKeyModule[] = {record(0x1A00, "Keys", kKeyPdo, nullptr, DataType::pdo_mapping),
                                 record(0x6000, "Keys", kKeyEntries)};

constexpr Entry kMeterEntries[] = {entry_count(2), value<&TwoMeters::levels>(1, "Level", kModularIn)};
constexpr Entry kMeterSettings[] = {
    entry_count(2), value<&TwoMeters::offsets>(1, "Offset", od::kReadWrite | od::kBackup | od::kSettings, 100)
                        .within(kLimits<-1000, 1000>)};
constexpr Entry kMeterPdo[] = {entry_count(2), mapped(1, 0x6000, 1, 16), mapped(2, 0x6000, 2, 16)};
constexpr Object kMeterModule[] = {record(0x1A00, "Levels", kMeterPdo, nullptr, DataType::pdo_mapping),
                                   array(0x6000, "Levels", kMeterEntries), array(0x8000, "Offsets", kMeterSettings)};

constexpr Entry kCounterPreset[] = {entry_count(1), value<&OneCounter::preset>(1, "Preset", kModularOut)};
constexpr Entry kCounterCount[] = {entry_count(1), value<&OneCounter::count>(1, "Count", kModularIn)};
constexpr Entry kCounterRxPdo[] = {entry_count(1), mapped(1, 0x7000, 1, 32)};
constexpr Entry kCounterTxPdo[] = {entry_count(1), mapped(1, 0x6000, 1, 32)};
constexpr Object kCounterModule[] = {record(0x1600, "Preset", kCounterRxPdo, nullptr, DataType::pdo_mapping),
                                     record(0x1A00, "Count", kCounterTxPdo, nullptr, DataType::pdo_mapping),
                                     record(0x6000, "Count", kCounterCount), record(0x7000, "Preset", kCounterPreset)};

constexpr ModuleKind kModuleKinds[] = {
    {.ident = 0x104, .name = "4 lamps", .objects = kLampModule, .value_bytes = sizeof(FourLamps)},
    {.ident = 0x208, .name = "8 keys", .objects = kKeyModule, .value_bytes = sizeof(EightKeys)},
    {.ident = 0x302, .name = "2 meters", .objects = kMeterModule, .value_bytes = sizeof(TwoMeters)},
    {.ident = 0x401, .name = "Counter", .objects = kCounterModule, .value_bytes = sizeof(OneCounter)},
};
constexpr unsigned kModularSlots = 4;
constexpr ModularDevice kModular{.kinds = kModuleKinds, .slots = kModularSlots};
using ModularTables = ModuleTables<kModular, 0>;

constexpr auto kModularDevice = io_device({.product_code = 0x5030,
                                           .name = "Coupler with four slots",
                                           .order_code = "MG5030",
                                           .group = "Modular",
                                           .output_bytes = ModularTables::most_bytes(true),
                                           .input_bytes = ModularTables::most_bytes(false)});
using ModularCommon = CommonObjects<kModularDevice, 0x00001389>;
constexpr auto kModularObjects = with_common<ModularCommon>(ModularTables::kObjects);
static_assert(well_formed(kModularObjects, ModularTables::end, kModular));

class ModularIo final : public Model {
  public:
    ModularIo() {
        for (std::size_t slot = 0; slot < kModularSlots; ++slot) terminals_[slot] = std::byte(slot + 1);
        look();
    }
    [[nodiscard]] const DeviceDescription& description() const override { return kModularDevice; }
    [[nodiscard]] ModuleLayout* modules() override { return &modules_; }
    Time advance(Time) override {
        look();
        return kNever;
    }
    void cycle(Time, bool) override {
        look();
        for (unsigned slot = 1; slot <= kModularSlots; ++slot) measure(slot);
    }
    // One octet for each slot: the module that is plugged in (0: none; 1 lamps, 2 keys, 3 meters, 4 counter). Then four
    // octets of terminals for each slot: the keys; the two levels; the count, which begins at the preset.
    [[nodiscard]] MutableBytes measured() override { return terminals_; }

  private:
    // Detects the plugged modules.
    void look() {
        for (unsigned slot = 1; slot <= kModularSlots; ++slot) {
            const auto number = std::to_integer<unsigned>(terminals_[slot - 1]);
            const bool known = number >= 1 && number <= std::size(kModuleKinds);
            modules_.detect(slot, known ? kModuleKinds[number - 1].ident : number);
        }
    }
    // A module that was pulled out measures nothing.
    void measure(unsigned slot) {
        const auto* const kind = modules_.in_use(slot);
        if (kind == nullptr || kind->ident != modules_.detected(slot)) return;
        const auto octets = modules_.values(slot);
        const auto terminals = Bytes(terminals_).subspan(kModularSlots + 4 * std::size_t{slot - 1}, 4);
        if (kind->objects.data() == kKeyModule) {
            store_values(octets, EightKeys{load_le<std::uint8_t>(terminals)});
        } else if (kind->objects.data() == kCounterModule) {
            auto values = values_in<OneCounter>(octets);
            values.count = values.preset + load_le<std::uint32_t>(terminals);
            store_values(octets, values);
        } else if (kind->objects.data() == kMeterModule) {
            auto values = values_in<TwoMeters>(octets);
            for (std::size_t n = 0; n < 2; ++n) {
                const int level = load_le<std::int16_t>(terminals, 2 * n) + values.offsets[n];
                values.levels[n] = static_cast<std::int16_t>(std::clamp<int>(level, INT16_MIN, INT16_MAX));
            }
            store_values(octets, values);
        }
    }

    std::array<std::byte, kModularSlots + 4 * kModularSlots> terminals_{};
    ModuleMemory<ModularTables> memory_;
    Modules modules_{memory_};
};

}  // namespace

constexpr Blueprint kModularIo =
    blueprint<ModularIo>("modular_io", kModularDevice, kModularObjects, ModularTables::end);

}  // namespace margay::sim
