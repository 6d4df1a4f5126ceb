#include "subdevice/eeprom_emulation.hpp"

#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace control = wire::sii_control;

namespace {
// Octets from the start of the image.
constexpr std::size_t kConfigurationOffset = 1;  // ESC configuration, 0x0141
constexpr std::size_t kAliasOffset = 8;

// The values that the ESC loads at a reload (ESC register tables, 0x0508, emulation): the alias, bit 16 enhanced link
// detection of all ports (0x0141 bit 1), bits 17 to 20 that of each port (0x0141 bits 4 to 7).
std::array<std::byte, 4> reload_data(Bytes contents) {
    const auto links = std::to_integer<unsigned>(contents[kConfigurationOffset]);
    const auto bits = static_cast<std::byte>((links >> 1 & 1U) | (links >> 4) << 1);
    return {contents[kAliasOffset], contents[kAliasOffset + 1], bits, std::byte{0}};
}
}  // namespace

void EepromEmulation::step(std::uint32_t events) {
    if ((events & wire::al_event::kEeprom) == 0) return;
    const auto status = read_register<std::uint16_t>(esc_, reg::kSiiControl.address);
    const auto command = static_cast<std::uint16_t>(status & control::kCommandMask);
    const auto from = std::uint64_t{read_register<std::uint32_t>(esc_, reg::kSiiAddress.address)} * 2;
    std::uint16_t errors = 0;
    std::array<std::byte, 8> data{};
    if (command == control::kCommandRead && from < contents_.size()) {
        const std::size_t bytes = (status & control::kReads8Bytes) != 0 ? 8 : 4;
        const auto there = std::min(bytes, contents_.size() - static_cast<std::size_t>(from));
        std::copy_n(contents_.begin() + static_cast<std::ptrdiff_t>(from), there, data.begin());
        write_memory(esc_, reg::kSiiData.address, Bytes(data).first(bytes));
    } else if (command == control::kCommandWrite && from + 2 <= contents_.size()) {
        read_memory(esc_, reg::kSiiData.address, contents_.subspan(static_cast<std::size_t>(from), 2));
        written_ = true;
    } else if (command == control::kCommandReload && contents_.size() >= kAliasOffset + 2) {
        write_memory(esc_, reg::kSiiData.address, reload_data(contents_));
    } else {
        errors = control::kMissingAcknowledge;
    }
    // A write of the command to the control register reports that the command is finished.
    write_register(esc_, reg::kSiiControl.address, static_cast<std::uint16_t>(command | errors));
}

}  // namespace margay::subdevice
