#include "sim/devices.hpp"

#include "sim/library/library.hpp"
#include "sim/sii_firmware.hpp"
#include "wire/sii_writer.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace margay::sim {

namespace {

namespace sii = wire::sii;
using sii::PdoDescription;
using sii::PdoEntryDescription;

constexpr std::uint8_t kBool = 0x01;
constexpr std::uint8_t kInt16 = 0x03;
constexpr std::uint8_t kInt32 = 0x04;
constexpr std::uint8_t kUint16 = 0x06;

// --- Simple terminals: without a processor, or with a processor that only copies process data ---

constexpr std::array<std::string_view, 16> kChannelNames{
    "Channel 1", "Channel 2",  "Channel 3",  "Channel 4",  "Channel 5",  "Channel 6",  "Channel 7",  "Channel 8",
    "Channel 9", "Channel 10", "Channel 11", "Channel 12", "Channel 13", "Channel 14", "Channel 15", "Channel 16"};

struct Terminal {
    std::string_view name;
    std::string_view order;
    std::string_view text;
    std::uint32_t product;
    std::uint8_t channels;
    std::uint8_t bits;  // of one channel
    bool outputs;
    std::int16_t ebus_current_ma;
};

constexpr std::array kTerminals{
    Terminal{"digital_in_8", "MG1008", "8-channel digital input", 0x1008, 8, 1, false, 90},
    Terminal{"digital_in_16", "MG1016", "16-channel digital input", 0x1016, 16, 1, false, 100},
    Terminal{"digital_out_8", "MG2008", "8-channel digital output", 0x2008, 8, 1, true, 110},
    Terminal{"digital_out_16", "MG2016", "16-channel digital output", 0x2016, 16, 1, true, 140},
    Terminal{"analog_in_4", "MG3004", "4-channel analogue input", 0x3004, 4, 16, false, 130},
    Terminal{"analog_out_2", "MG4002", "2-channel analogue output", 0x4002, 2, 16, true, 140},
};

constexpr std::uint32_t kCouplerProduct = 0x0100;
constexpr std::uint32_t kJunctionProduct = 0x0122;

constexpr std::uint32_t kPulseAxisProduct = 0x2521;

constexpr auto kNames = [] {
    constexpr std::array<std::string_view, 3> kOthers{"coupler", "junction", "pulse_axis"};
    std::array<std::string_view, kTerminals.size() + kOthers.size()> names{};
    std::copy(kOthers.begin(), kOthers.end(), names.begin());
    for (std::size_t i = 0; i < kTerminals.size(); ++i) names[kOthers.size() + i] = kTerminals[i].name;
    return names;
}();

constexpr std::uint16_t ports(sii::PhysicalPort p0, sii::PhysicalPort p1, sii::PhysicalPort p2 = {},
                              sii::PhysicalPort p3 = {}) {
    return static_cast<std::uint16_t>(static_cast<unsigned>(p0) | static_cast<unsigned>(p1) << 4 |
                                      static_cast<unsigned>(p2) << 8 | static_cast<unsigned>(p3) << 12);
}

std::vector<std::byte> image_of(const sii::Description& description) {
    std::vector<std::byte> image(1024);
    [[maybe_unused]] const auto written = sii::write_image(description, image);
    return image;
}

Device make_coupler(bool junction) {
    using Port = sii::PhysicalPort;
    sii::Description d;
    d.configuration.pdi_control = 0x0D00;  // no PDI, device emulation, DC units enabled
    d.identity = {kVendorId, junction ? kJunctionProduct : kCouplerProduct, 1, 0};
    d.group = "Couplers";
    d.order = junction ? "MG0122" : "MG0100";
    d.name = junction ? "Junction with four ports" : "EtherCAT coupler";
    d.general.ebus_current_ma = junction ? std::int16_t{0} : std::int16_t{-2000};
    d.general.physical_ports =
        junction ? ports(Port::mii, Port::mii, Port::mii, Port::mii) : ports(Port::mii, Port::ebus, Port::mii);
    Device device;
    device.chip = junction ? sim::junction() : et1100();
    device.sii = image_of(d);
    return device;
}

Device make_terminal(const Terminal& terminal) {
    using Port = sii::PhysicalPort;
    const bool digital = terminal.bits == 1;
    std::array<PdoEntryDescription, 16> entries{};
    std::array<PdoDescription, 16> pdos{};
    const std::uint16_t base = terminal.outputs ? 0x7000 : 0x6000;
    for (unsigned n = 0; n < terminal.channels; ++n) {
        entries[n] = {.index = static_cast<std::uint16_t>(base + 0x10 * n),
                      .subindex = digital ? std::uint8_t{1} : std::uint8_t{0x11},
                      .name = "Value",
                      .data_type = digital ? kBool : kInt16,
                      .bit_length = terminal.bits};
        pdos[n] = {.index = static_cast<std::uint16_t>((terminal.outputs ? 0x1600 : 0x1A00) + n),
                   .sync_manager = 0,
                   .name = kChannelNames[n],
                   .flags = sii::pdo_flag::kMandatory | sii::pdo_flag::kFixedContent,
                   .entries = std::span(entries).subspan(n, 1)};
    }
    const auto bytes = static_cast<std::uint16_t>((terminal.channels * terminal.bits + 7) / 8);
    const std::array sync_managers{SmInfo{
        // Digital outputs are registers of the ESC and need no PDI interrupt. All other process data are in RAM with
        // three buffers.
        .start = digital && terminal.outputs ? std::uint16_t{0x0F00} : std::uint16_t{0x1000},
        .length_bytes = bytes,
        .control = static_cast<std::uint8_t>(terminal.outputs ? (digital ? 0x44 : 0x64) : (digital ? 0x00 : 0x20)),
        .enable = 1,
        .type = terminal.outputs ? SmType::outputs : SmType::inputs}};
    const std::array fmmus{terminal.outputs ? FmmuUse::outputs : FmmuUse::inputs, FmmuUse::unused};

    sii::Description d;
    // Digital I/O by the ESC itself, or a processor connected by SPI.
    d.configuration.pdi_control = digital ? 0x0104 : 0x0005;
    d.identity = {kVendorId, terminal.product, 1, 0};
    d.group = digital ? "Digital" : "Analogue";
    d.order = terminal.order;
    d.name = terminal.text;
    d.general.ebus_current_ma = terminal.ebus_current_ma;
    d.general.physical_ports = ports(Port::ebus, Port::ebus);
    d.fmmus = fmmus;
    d.sync_managers = sync_managers;
    const auto used = std::span(pdos).first(terminal.channels);
    (terminal.outputs ? d.rx_pdos : d.tx_pdos) = used;

    Device device;
    device.chip = et1200();
    device.sii = image_of(d);
    return device;
}

// A device that sends pulses and direction to a stepper drive: no mailbox, fixed process data, and SYNC0 from its
// clock.
Device make_pulse_axis() {
    using Port = sii::PhysicalPort;
    constexpr std::array outputs{
        PdoEntryDescription{
            .index = 0x7000, .subindex = 1, .name = "Control word", .data_type = kUint16, .bit_length = 16},
        PdoEntryDescription{
            .index = 0x7000, .subindex = 2, .name = "Target position", .data_type = kInt32, .bit_length = 32}};
    constexpr std::array inputs{
        PdoEntryDescription{
            .index = 0x6000, .subindex = 1, .name = "Status word", .data_type = kUint16, .bit_length = 16},
        PdoEntryDescription{.index = 0x6000, .subindex = 2, .name = "Position", .data_type = kInt32, .bit_length = 32}};
    constexpr std::uint16_t kFlags = sii::pdo_flag::kMandatory | sii::pdo_flag::kFixedContent;
    const std::array rx{
        PdoDescription{.index = 0x1600, .sync_manager = 0, .name = "Command", .flags = kFlags, .entries = outputs}};
    const std::array tx{
        PdoDescription{.index = 0x1A00, .sync_manager = 1, .name = "Actual", .flags = kFlags, .entries = inputs}};
    constexpr std::array sync_managers{
        SmInfo{.start = 0x1000, .length_bytes = 6, .control = 0x64, .enable = 1, .type = SmType::outputs},
        SmInfo{.start = 0x1100, .length_bytes = 6, .control = 0x20, .enable = 1, .type = SmType::inputs}};
    constexpr std::array fmmus{FmmuUse::outputs, FmmuUse::inputs};
    const std::array modes{
        sii::DcDescription{.mode = {}, .name = "FreeRun", .description = "Free run"},
        sii::DcDescription{.mode = {.assign_activate = 0x0300}, .name = "DC", .description = "Synchronous to SYNC0"}};
    sii::Description d;
    d.configuration.pdi_control = 0x0C05;  // a processor connected by SPI, SYNC and latch units enabled
    d.configuration.sync_pulse_length_10ns = 1000;
    d.identity = {kVendorId, kPulseAxisProduct, 1, 0};
    d.group = "Motion";
    d.order = "MG2521";
    d.name = "Pulse train axis";
    d.general.physical_ports = ports(Port::mii, Port::mii);
    d.fmmus = fmmus;
    d.sync_managers = sync_managers;
    d.rx_pdos = rx;
    d.tx_pdos = tx;
    d.dc = modes;
    Device device;
    device.chip = ip_core();
    device.sii = image_of(d);
    return device;
}

// A device without process data and with device emulation needs no program.
std::unique_ptr<Firmware> firmware_for(Bytes image) {
    const auto model = read_sii_model(image);
    if (model.device_emulation() && model.areas.empty()) return nullptr;
    return std::make_unique<SiiFirmware>(image, model);
}

}  // namespace

std::unique_ptr<Esc> Device::assemble() && {
    auto esc = std::make_unique<Esc>(chip, std::move(sii));
    esc->set_firmware(std::move(firmware));
    return esc;
}

Device device_from_sii(std::vector<std::byte> image) {
    Device device;
    device.chip = read_sii_model(image).chip();
    device.firmware = firmware_for(image);
    device.sii = std::move(image);
    return device;
}

std::optional<Device> make_device(std::string_view name) {
    for (const auto* blueprint : blueprints())
        if (blueprint->name == name) return build(*blueprint);
    std::optional<Device> device;
    if (name == "coupler") {
        device = make_coupler(false);
    } else if (name == "junction") {
        device = make_coupler(true);
    } else if (name == "pulse_axis") {
        device = make_pulse_axis();
    } else {
        const auto found =
            std::find_if(kTerminals.begin(), kTerminals.end(), [&](const auto& t) { return t.name == name; });
        if (found == kTerminals.end()) return std::nullopt;
        device = make_terminal(*found);
    }
    device->firmware = firmware_for(device->sii);
    return device;
}

std::span<const std::string_view> device_names() {
    static const auto kAll = [] {
        std::vector<std::string_view> names(kNames.begin(), kNames.end());
        for (const auto* blueprint : blueprints()) names.push_back(blueprint->name);
        return names;
    }();
    return kAll;
}

std::optional<EscDescription> chip_by_name(std::string_view name) {
    if (name == "et1100") return et1100();
    if (name == "et1200") return et1200();
    if (name == "ip_core") return ip_core();
    if (name == "lan9252") return lan9252();
    if (name == "junction") return junction();
    return std::nullopt;
}

}  // namespace margay::sim
