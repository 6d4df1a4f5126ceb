// Creates the SII image of a device from its description and its object dictionary, so that the author describes a
// device only once.
#pragma once

#include "subdevice/pdo_mapping.hpp"
#include "wire/sii_writer.hpp"

#include <optional>

namespace margay::subdevice {

// The pin of SYNC0 or SYNC1, which is a latch input otherwise, in register 0x0151 (ESC data sheets, "Sync/Latch PDI
// configuration").
struct SyncPin {
    bool output = false;  // true: SYNC output; false: latch input
    bool event = false;   // the signal is mapped to the AL event request (0x0220); without this, no run mode sees it
                          // except by Device::sync0() or sync1()
    bool active_high = false;
    bool open_drain = false;
    [[nodiscard]] constexpr unsigned bits() const {
        return (open_drain ? 1u : 0u) | (active_high ? 2u : 0u) | (output ? 4u : 0u) | (event ? 8u : 0u);
    }
};

// Hardware properties of the board that the description does not contain.
struct BoardDescription {
    // For register 0x0140: SPI; the high octet has more bits for register 0x0141. Bit 10 (DC SYNC unit) is added for a
    // device with DC; a device with latch inputs sets bit 11 (DC latch unit).
    std::uint16_t pdi_control = 0x0005;
    std::uint8_t pdi_configuration = 0;  // for register 0x0150
    // For register 0x0151. nullopt: a SYNC signal that DcDescription announces is an output and raises its AL event; a
    // pin without such a signal is a latch input. A board whose handlers call Device::sync0() and sync1() may leave
    // `event` out.
    std::optional<SyncPin> sync0{};
    std::optional<SyncPin> sync1{};
    // For register 0x0982. 0: acknowledge mode, the signal stays active until the stack reads its status. The AL events
    // of SYNC0 and SYNC1 work only in this mode; with another length, use the pins.
    std::uint16_t sync_pulse_length_10ns = 0;
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

// Writes the image into `eeprom` (the size is a multiple of 128 octets) and returns the number of used octets. Errors:
// as wire::sii::write_image() and wire::sii::mailbox_fault(), also Fault::sync_manager_outside when
// SyncManagers are not in the process RAM, Fault::sync_manager_overlap when two of them share memory or have one number
// (or a number above 15), Fault::mailbox_too_short when a mailbox has no room for an error reply (with CoE: for an SDO
// request), Fault::cycle_limits, and Fault::no_room when the workspace is too small. PDOs, their assignment and sizes
// are read from the current values of the dictionary: call this function before a master has changed the values.
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
