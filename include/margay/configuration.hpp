// What a segment shall be: plain data, the same whether the slaves themselves, a file or the application said it. The mapping of process
// data executes it, and executes it again for a slave that comes back.
#pragma once

#include <margay/address.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay {

// Which way process data goes: outputs from the master to the slave, inputs from the slave to the master.
enum class Direction : std::uint8_t { outputs, inputs };

// A SyncManager that carries process data.
struct ProcessSm {
    std::uint8_t number = 0;  // which of the slave's SyncManagers
    Direction direction = Direction::outputs;
    std::uint8_t control = 0;  // its control octet, ESC register 0x0804 + 8 · number
    std::uint16_t start = 0;   // in the slave's memory
    std::uint32_t bits = 0;    // length; 0: the SyncManager is switched off
    [[nodiscard]] constexpr std::uint32_t bytes() const { return bits / 8 + (bits % 8 != 0 ? 1 : 0); }
    friend constexpr bool operator==(const ProcessSm&, const ProcessSm&) = default;
};

// Who said what the process data of a slave shall be.
enum class ConfigurationSource : std::uint8_t {
    none,         // nobody yet: config_map() asks the slave
    sii,          // the slave's SII
    soe,          // the parameters of its drives
    coe,          // its object dictionary
    application,  // the application, whose word stands
};

// A change of state on the way up, by its initials in the standard.
enum class Transition : std::uint8_t {
    init_to_preop,    // IP
    preop_to_safeop,  // PS: after the slave's SyncManagers and FMMUs are written
    safeop_to_op,     // SO
};

// A register to be written before a transition is asked for.
struct RegisterWrite {
    Transition transition = Transition::preop_to_safeop;
    std::uint16_t address = 0;
    std::uint8_t length = 0;            // octets of value, 8 at most
    std::array<std::byte, 8> value{};   // as they go onto the wire, little-endian
};

// Of one slave.
struct SlaveConfiguration {
    static constexpr std::size_t kProcessSms = 8;

    ConfigurationSource source = ConfigurationSource::none;

    std::uint8_t group = 0;
    bool block_lrw = false;       // this slave cannot do LRW: its group exchanges by LRD and LWR
    bool mailbox_status = false;  // a bit of the image says whether the slave's mailbox has something to read
    bool optional = false;        // may be missing: its group is right without it
    std::uint8_t sm_count = 0;
    std::array<ProcessSm, kProcessSms> sms{};  // the data lies in the image in this order
    // After how long without outputs the slave's watchdog bites, in steps of 100 µs, 6.5535 s at most; zero switches it off. Not
    // set: what the slave has of its own.
    std::optional<Duration> process_data_watchdog;
    // Written in this order at each start-up, the first one and every one after. The caller's memory.
    std::span<const RegisterWrite> startup_registers;

    // Appends a SyncManager. False when there are kProcessSms already.
    constexpr bool add(const ProcessSm& sm) {
        if (sm_count == kProcessSms) return false;
        sms[sm_count++] = sm;
        return true;
    }
};

// How the data of the slaves of a group lies in its image.
enum class Packing : std::uint8_t {
    bytes,  // every SyncManager begins on an octet
    bits,   // what has less than 8 bits follows without a gap; what has more begins on an octet
};

// Some bits of one slave's inputs become another one's outputs, in each cycle: those that the last cycle has brought go out with the next. Slaves of one
// group; bits count from the start of the slave's data in the image.
struct SlaveToSlave {
    std::uint16_t from_slave = 0;
    std::uint16_t to_slave = 0;
    std::uint32_t from_bit = 0;
    std::uint32_t to_bit = 0;
    std::uint32_t bits = 0;
};

class SharedImage;

// Of one group: slaves that share an image and are exchanged together.
struct GroupConfiguration {
    LogicalAddress start;                // of the image in the logical address space
    Packing packing = Packing::bytes;
    bool overlapped = false;             // inputs and outputs of a slave at the same logical address
    bool block_lrw = false;              // LRD and LWR in place of LRW
    // Datagrams that travel in the first frame of each cycle; what they bring is in Group::al_status and Group::dc_time. The working counter of the cycle
    // is that of the process data alone. A group that has one of them may be without process data.
    bool al_status = false;              // reads the AL status of all slaves at once (BRD of ESC register 0x0130)
    // Number of the slave whose system time all others behind it take over (FRMW of 0x0910); 0: none. No slave before it in the ring may have a clock.
    std::uint16_t dc_reference = 0;
    std::uint16_t reserve_bytes = 0;     // of the first frame, left free for other datagrams of the cycle
    // Octets of other datagrams (mailboxes, states …), with their headers, that may travel with a cycle: in the space its frames have
    // left, and in a frame of their own beyond that. One datagram always may. Zero: they do not wait for cycles, each poll() sends them.
    std::uint16_t acyclic_bytes = 1498;
    // How many cycles may be on their way at once, kMostCyclesInFlight at most: with 2 the next one can be sent before this one is received, also by another
    // thread. See send_processdata(). Each takes prepared frames of its own (limits().process_frames). From 2 on the datagrams of acyclic_bytes do not travel
    // with the cycle; poll() sends them.
    std::uint8_t cycles_in_flight = 1;
    static constexpr std::uint8_t kMostCyclesInFlight = 4;
    std::span<const SlaveToSlave> copies{};  // after the application has set its outputs. The caller's memory
    SharedImage* shared = nullptr;         // for another thread: see shared_image.hpp
};

}  // namespace margay
