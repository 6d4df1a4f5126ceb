// Base class for the behaviour of a device of the library, and Blueprint, its description as tables.
#pragma once

#include "sim/esc_description.hpp"
#include "sim/ethernet_port.hpp"
#include "sim/library/quirk.hpp"
#include "subdevice/aoe_server.hpp"
#include "subdevice/device.hpp"
#include "subdevice/diagnosis.hpp"
#include "subdevice/emergency.hpp"
#include "subdevice/eoe_server.hpp"
#include "subdevice/foe_server.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/soe_server.hpp"
#include "subdevice/voe_server.hpp"

#include <memory>

namespace margay::sim {

class BridgeHalf;

// The objects that a model uses from one start of the firmware to the next.
struct Surroundings {
    subdevice::EscAccess* esc = nullptr;
    subdevice::ObjectDictionary* dictionary = nullptr;
    subdevice::Device* device = nullptr;
};

class Model : public subdevice::Application {
  public:
    virtual ~Model() = default;

    void begin(const Surroundings& around, Time now);
    // Decides whether a transition may happen. Application::before() calls it after the checks of the quirks.
    [[nodiscard]] virtual subdevice::Verdict may(subdevice::Transition transition, Time now) {
        (void)transition, (void)now;
        return subdevice::Verdict::go();
    }
    // Inline, because a program with RTTI may have a model of its own, and the library has no RTTI.
    subdevice::Verdict before(subdevice::Transition transition, Time now) final { return decide(transition, now); }
    void dropped(subdevice::Transition) override { slow_until_ = kNever; }

    // The firmware starts. All objects have their initial values.
    virtual void start(const Surroundings& around, Time now) { (void)around, (void)now; }
    // Advances the simulation of the device, independent of the master. Returns the latest time for the next call.
    virtual Time advance(Time now) {
        (void)now;
        return kNever;
    }
    // Measured values of the device, which other programs set; empty if there are none.
    [[nodiscard]] virtual MutableBytes measured() { return {}; }
    [[nodiscard]] virtual subdevice::FoeStore* files() { return nullptr; }
    // The SoE server of a device with SoE; nullptr: the device has no SoE.
    [[nodiscard]] virtual subdevice::SoeServer* soe() { return nullptr; }
    // The server of a device with VoE, AoE or EoE; nullptr: the device does not have the protocol.
    [[nodiscard]] virtual subdevice::VoeServer* voe() { return nullptr; }
    [[nodiscard]] virtual subdevice::AoeServer* aoe() { return nullptr; }
    [[nodiscard]] virtual subdevice::EoeServer* eoe() { return nullptr; }
    // The Ethernet port of a device with EoE.
    [[nodiscard]] virtual EthernetPort* ethernet() { return nullptr; }
    // One half of a bridge between two segments.
    [[nodiscard]] virtual BridgeHalf* bridge() { return nullptr; }
    // Returns true when the firmware must restart (called after each step). The restart takes restart_time().
    [[nodiscard]] virtual bool wants_restart() { return false; }
    [[nodiscard]] virtual Duration restart_time() const { return std::chrono::milliseconds(200); }

    [[nodiscard]] subdevice::Emergencies* emergencies() override { return &emergencies_; }
    [[nodiscard]] subdevice::DiagnosisHistory* diagnosis() override { return &diagnosis_; }

    void set_quirks(Quirks quirks) { quirks_ = quirks; }

    static constexpr std::uint8_t kErrorLines = 8;
    static constexpr std::uint8_t kDiagnosisLines = 8;

  protected:
    // Sends an emergency and adds it to the diagnosis history.
    void report(std::uint16_t error_code, std::uint8_t error_register, Time now);

  private:
    std::array<subdevice::EmergencyMessage, 8> queue_{};
    std::array<std::byte, 4 * kErrorLines> history_{};
    std::array<std::byte, 32 * kDiagnosisLines> diagnosis_memory_{};
    subdevice::Emergencies emergencies_{queue_, history_};
    subdevice::DiagnosisHistory diagnosis_{diagnosis_memory_, kDiagnosisLines};
    [[nodiscard]] subdevice::Verdict decide(subdevice::Transition transition, Time now);
    [[nodiscard]] subdevice::AlStatusCode objection(subdevice::Transition transition);

    Quirks quirks_;
    subdevice::EscAccess* pdi_ = nullptr;
    Time slow_until_ = kNever;
    bool op_refused_ = false;
};

// A type of device. Description and objects are constants; all other data is generated from them.
struct Blueprint {
    std::string_view name;  // the name for make_device()
    EscDescription (*chip)();
    const subdevice::DeviceDescription* device;
    subdevice::BoardDescription board;
    std::span<const subdevice::Object> objects;
    std::size_t image_bytes;  // size of the values of the objects
    std::unique_ptr<Model> (*make)();
};

// PDI control words for the SII: a processor connected by SPI, with or without SYNC and latch units.
inline constexpr std::uint16_t kSpi = 0x0005;
inline constexpr std::uint16_t kSpiWithDc = 0x0C05;
// In units of 10 ns: longer than the latency of the firmware (EscDescription::firmware_latency). The AL event of SYNC0
// ends with the pulse, so a firmware without the SYNC0 pin would never see a shorter one.
inline constexpr std::uint16_t kSyncPulse = 5000;

// --- Objects of every device ---

template <const subdevice::DeviceDescription& Device, std::uint32_t Type>
struct CommonObjects {
    static constexpr std::array<subdevice::Entry, 1> kType{subdevice::constant<std::uint32_t>(0, "Device type", Type)};
    static constexpr std::array<subdevice::Entry, 1> kName{subdevice::text(0, "Device name", Device.name)};
    static constexpr std::array<subdevice::Entry, 1> kHardware{subdevice::text(0, "Hardware version", "1")};
    static constexpr std::array<subdevice::Entry, 1> kSoftware{subdevice::text(0, "Software version", "1.0")};
    static constexpr auto kIdentity = subdevice::identity_entries(Device);
    static constexpr auto kSyncManagers =
        subdevice::sync_manager_type_entries<subdevice::sync_manager_count(Device)>(Device);
    static constexpr auto kErrors = subdevice::kErrorHistoryEntries<Model::kErrorLines>;
    static constexpr auto kDiagnosis = subdevice::kDiagnosisEntries<Model::kDiagnosisLines>;

    static constexpr subdevice::Object device_type = subdevice::variable(0x1000, "Device type", kType);
    static constexpr subdevice::Object error_history =
        subdevice::array(0x1003, "Pre-defined error field", kErrors, &subdevice::kErrorHistoryHooks);
    static constexpr subdevice::Object device_name = subdevice::variable(0x1008, "Device name", kName);
    static constexpr subdevice::Object hardware = subdevice::variable(0x1009, "Hardware version", kHardware);
    static constexpr subdevice::Object software = subdevice::variable(0x100A, "Software version", kSoftware);
    static constexpr subdevice::Object identity =
        subdevice::record(0x1018, "Identity", kIdentity, nullptr, subdevice::DataType::identity);
    static constexpr subdevice::Object diagnosis =
        subdevice::record(0x10F3, "Diagnosis history", kDiagnosis, &subdevice::kDiagnosisHooks);
    static constexpr subdevice::Object sync_manager_types =
        subdevice::array(0x1C00, "Sync manager types", kSyncManagers);
};

// Entries from subindex `first` on of an array of adjacent numbers of one type, each with its own initial value.
template <class T, std::size_t N>
[[nodiscard]] constexpr std::array<subdevice::Entry, N> numbers(std::uint8_t first, const char* name,
                                                                std::uint16_t access, std::size_t offset,
                                                                const std::array<T, N>& initial) {
    std::array<subdevice::Entry, N> entries{};
    for (std::size_t i = 0; i < N; ++i)
        entries[i] = subdevice::Entry{.subindex = static_cast<std::uint8_t>(first + i),
                                      .storage = subdevice::Storage::image,
                                      .type = subdevice::kTypeOf<T>,
                                      .access = access,
                                      .bits = sizeof(T) * 8,
                                      .offset = static_cast<std::uint32_t>(offset + i * sizeof(T)),
                                      .name = name}
                         .beginning(static_cast<std::uint64_t>(initial[i]));
    return entries;
}

// A list that the master may change: the count, followed by the numbers. `offset` is the offset of the count in the
// image.
template <class T, std::size_t N>
[[nodiscard]] constexpr std::array<subdevice::Entry, N + 1> changeable_list(std::size_t offset, std::uint8_t used,
                                                                            const char* name,
                                                                            const std::array<T, N>& initial) {
    std::array<subdevice::Entry, N + 1> entries{};
    entries[0] = numbers<std::uint8_t, 1>(0, "SubIndex 000", subdevice::od::kReadWritePreop, offset, {used})[0].within(
        subdevice::kLimits<0, static_cast<std::int64_t>(N)>);
    const auto rest = numbers<T, N>(1, name, subdevice::od::kReadWritePreop, offset + 1, initial);
    for (std::size_t i = 0; i < N; ++i) entries[i + 1] = rest[i];
    return entries;
}
template <class T, std::size_t N>
inline constexpr std::size_t kListBytes = 1 + sizeof(T) * N;

// The 32-bit value of a mapping entry.
[[nodiscard]] constexpr std::uint32_t map(std::uint16_t index, std::uint8_t subindex, std::uint8_t bits) {
    return subdevice::MappingEntry{index, subindex, bits}.word();
}

}  // namespace margay::sim
