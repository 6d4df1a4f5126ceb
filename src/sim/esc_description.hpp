// The description of an ESC as data: size and features of the chip, timing of its EEPROM, its clock and its ports. The
// parts connected to the ESC (PDI, process data, mailboxes) are described by the SII image and the firmware.
#pragma once

#include "wire/esc.hpp"

#include <margay/time.hpp>

#include <array>
#include <cstdint>

namespace margay::sim {

inline constexpr unsigned kMaxPorts = 4;
inline constexpr unsigned kMaxFmmus = 16;
inline constexpr unsigned kMaxSyncManagers = 16;

enum class DcUnit : std::uint8_t {
    none,           // no clock
    receive_times,  // only port receive times
    bits32,
    bits64,
};

struct PortDescription {
    wire::PortKind kind = wire::PortKind::not_implemented;
    Duration delay{};  // delay between port and wire (the same in both directions), including half a cable hop
};

// Timing of the EEPROM. After a write command, the interface is busy until the word is sent to the EEPROM. Then the
// EEPROM stores the word and acknowledges no command until it has finished. (Recorded on an EK1100: 0.3 ms and 3.8 ms.)
struct SiiTiming {
    Duration read = std::chrono::microseconds(300);    // one read command of 4 or 8 octets
    Duration write = std::chrono::microseconds(3800);  // from a write command until the EEPROM has stored the word
    // From a write command until the interface is not busy; at most `write`.
    Duration write_busy = std::chrono::microseconds(300);
    Duration reload = std::chrono::microseconds(700);
    bool reads_8_bytes = true;
    unsigned nacks = 0;            // number of commands after power-up that the EEPROM does not acknowledge
    bool write_protected = false;  // the EEPROM acknowledges written words and does not store them
    bool emulated = false;         // EEPROM emulation: the firmware executes the commands
    // Additional bits that 0x0502 always shows: sii_control::kTwoByteAddressing (bit 7) on boards with a large EEPROM.
    std::uint16_t status_bits = 0;
};

struct ClockDescription {
    std::int32_t drift_ppb = 0;
    std::uint64_t start_ns = 0;  // local time at time zero of the segment
    // Times of frames: a real chip counts in steps of 10 ns, and its receiver adds a jitter of some nanoseconds of
    // either sign to the arrival. By default both are exact.
    std::uint8_t step_ns = 1;
    std::uint8_t jitter_ns = 0;
};

struct EscDescription {
    std::uint8_t type = 0x11;
    std::uint8_t revision = 0;
    std::uint16_t build = 3;
    std::uint8_t fmmus = 8;
    std::uint8_t sync_managers = 8;
    std::uint8_t ram_kib = 8;
    std::uint16_t features = 0x00FC;  // 0x0008, see wire::features
    DcUnit dc = DcUnit::bits64;
    bool dc_needs_enable = false;  // the DC registers exist only when 0x0141 switches SYNC or latch unit on
    bool mii_management = false;
    std::array<PortDescription, kMaxPorts> ports{};
    // From the port where the frame arrives to the port where it leaves, with and without the processing unit. Closed
    // ports between both cost nothing: recorded on E-bus terminals, the last terminal, with its closed port, turns a
    // frame 10 to 30 ns slower than the terminal before it forwards the same frame.
    Duration processing_delay = std::chrono::nanoseconds(120);
    Duration forwarding_delay = std::chrono::nanoseconds(20);
    Duration firmware_latency = std::chrono::microseconds(20);  // from an AL event to the next step of the firmware
    SiiTiming sii;
    ClockDescription clock;
    std::uint64_t product_id = 0;  // 0x0E00
    std::uint64_t vendor_id = 0;   // 0x0E08

    // Chip types that have no E-bus. In DL control they show 0x07 where chips with E-bus show 0xC7 (0x0102, recorded).
    [[nodiscard]] constexpr bool without_ebus() const { return type == 0x04 || type == 0x05 || type == 0xC0; }

    // The octet of register 0x0007 for these ports.
    [[nodiscard]] constexpr std::uint8_t port_descriptor() const {
        unsigned value = 0;
        for (unsigned p = 0; p < kMaxPorts; ++p) value |= static_cast<unsigned>(ports[p].kind) << (2 * p);
        return static_cast<std::uint8_t>(value);
    }
};

// Chips as in their data sheets. All values can be changed before an Esc is created.
[[nodiscard]] EscDescription
et1100();  // 4 ports, 8 FMMUs, 8 SMs, 8 KiB, DC 64 bits; a coupler: port 0 MII, other ports E-bus
[[nodiscard]] EscDescription et1200();    // 3 FMMUs, 4 SMs, 1 KiB; an E-bus terminal
[[nodiscard]] EscDescription ip_core();   // FPGA with two MII ports, DC 64 bits
[[nodiscard]] EscDescription lan9252();   // 3 FMMUs, 4 SMs, 4 KiB, two MII ports
[[nodiscard]] EscDescription junction();  // ET1100 with four MII ports

}  // namespace margay::sim
