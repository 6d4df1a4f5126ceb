// Creates the SII image of a device from its description and its object dictionary, so that the author describes a
// device only once.
#pragma once

#include "subdevice/pdo_mapping.hpp"
#include "wire/sii_writer.hpp"

namespace margay::subdevice {

// Hardware properties of the board that the description does not contain.
struct BoardDescription {
    // For register 0x0140: SPI; the high octet has more bits for register 0x0141.
    std::uint16_t pdi_control = 0x0005;
    std::uint16_t pdi_configuration = 0;       // for register 0x0150
    std::uint16_t sync_pulse_length_10ns = 0;  // for register 0x0982
    std::uint16_t alias = 0;
    // Four bits per port, see wire::sii::physical_port(); default: two MII ports.
    std::uint16_t physical_ports = 0x0011;
};

// Working memory of write_sii().
template <std::size_t Pdos, std::size_t Entries>
struct SiiWorkspace {
    std::array<wire::sii::PdoDescription, Pdos> pdos{};
    std::array<wire::sii::PdoEntryDescription, Entries> entries{};
};

// Writes the image into `eeprom` (the size is a multiple of 128 octets) and returns the number of used octets. Errors
// are those of wire::sii::write_image(), and Fault::no_room when the workspace is too small. PDOs, their assignment and
// sizes are read from the current values of the dictionary: call this function before a master has changed the values.
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

// CoE details (margay::coe_detail bits) that match the dictionary.
[[nodiscard]] std::uint8_t coe_details(const DeviceDescription& device, const ObjectDictionary& dictionary);

}  // namespace margay::subdevice
