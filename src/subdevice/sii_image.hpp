// The SII image of a device out of its description and its object dictionary, so that a device is described
// once.
#pragma once

#include "subdevice/pdo_mapping.hpp"
#include "wire/sii_writer.hpp"

namespace margay::subdevice {

// What the board adds to what the device is.
struct BoardDescription {
    std::uint16_t pdi_control = 0x0005;        // to 0x0140: SPI; further bits in the high octet go to 0x0141
    std::uint16_t pdi_configuration = 0;       // to 0x0150
    std::uint16_t sync_pulse_length_10ns = 0;  // to 0x0982
    std::uint16_t alias = 0;
    std::uint16_t physical_ports = 0x0011;  // four bits a port, see wire::sii::physical_port(): two of MII
};

// Memory that write_sii() works in.
template <std::size_t Pdos, std::size_t Entries>
struct SiiWorkspace {
    std::array<wire::sii::PdoDescription, Pdos> pdos{};
    std::array<wire::sii::PdoEntryDescription, Entries> entries{};
};

// Writes the image into `eeprom` (a multiple of 128 octets) and returns the octets in use; faults are those
// of wire::sii::write_image(), and Fault::no_room when the workspace is too small. PDOs, their assignment and
// sizes are as the dictionary has them now: call it before a master has changed anything.
[[nodiscard]] wire::sii::Parsed<std::size_t> write_sii(const DeviceDescription& device, const BoardDescription& board,
                                                       const ObjectDictionary& dictionary,
                                                       std::span<wire::sii::PdoDescription> pdos,
                                                       std::span<wire::sii::PdoEntryDescription> entries,
                                                       MutableBytes eeprom);

template <std::size_t Pdos, std::size_t Entries>
[[nodiscard]] wire::sii::Parsed<std::size_t> write_sii(const DeviceDescription& device, const BoardDescription& board,
                                                       const ObjectDictionary& dictionary,
                                                       SiiWorkspace<Pdos, Entries>& workspace, MutableBytes eeprom) {
    return write_sii(device, board, dictionary, workspace.pdos, workspace.entries, eeprom);
}

// CoE details as the dictionary allows them (margay::coe_detail bits).
[[nodiscard]] std::uint8_t coe_details(const DeviceDescription& device, const ObjectDictionary& dictionary);

}  // namespace margay::subdevice
