// What a segment shall be: plain data, the same whether the slaves themselves, a file or the application said it. The
// mapping of process data executes it, and executes it again for a slave that comes back.
#pragma once

#include <margay/address.hpp>
#include <margay/al_state.hpp>
#include <margay/pdo.hpp>
#include <margay/startup.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

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

// Who said what the process data of a slave shall be; the word of the later ones stands above that of the earlier.
enum class ConfigurationSource : std::uint8_t {
    none,         // nobody yet: config_map() asks the slave
    sii,          // the slave's SII
    soe,          // the parameters of its drives
    coe,          // its object dictionary
    file,         // a file of the application's, by its reader: what the application sets itself it sets afterwards
    application,  // the application
};
[[nodiscard]] std::string_view to_text(ConfigurationSource source);

// Times of one slave. What is not set is as it is without them.
struct SlaveTimes {
    // How long a change to this state may take; zero: the standard's time (ETG.1020: 3 s, 10 s, 10 s, and 5 s for all
    // that goes down).
    Duration to_preop{0};
    Duration to_safeop{0};
    Duration to_op{0};
    Duration down{0};
    // How long an answer to a mailbox message may take while the slave starts up; zero: 3 s.
    Duration mailbox{0};
    // ESC register 0x0400: the unit of the watchdogs, less two, in 40 ns. process_data_watchdog is counted in this
    // unit.
    std::optional<std::uint16_t> watchdog_divider{};
    // ESC register 0x0410: after how long the slave's processor counts as dead, 6.5535 s at most with the usual
    // divider; zero: never.
    std::optional<Duration> pdi_watchdog{};
};

// What slaves of one kind want beyond the size of their process data; one of these may serve many slaves. The caller's
// memory, as are its lists; must live as long as a slave's configuration names it.
struct SlaveSetup {
    // The PDOs of SyncManagers, written into the slave's dictionary before its process data is looked at, and again
    // when it comes back; what is there already is not written. SyncManagers that are not listed keep theirs. Without
    // CoE they only tell what the slave has.
    Borrowed<SmPdos> pdos{};
    // Commands for transitions.
    Borrowed<StartupCommand> startup{};
    SlaveTimes times{};
};

// Of one slave.
struct SlaveConfiguration {
    static constexpr std::size_t kProcessSms = 8;
    using Watchdog = std::chrono::duration<std::uint32_t, std::micro>;

    ConfigurationSource source = ConfigurationSource::none;  // of `sms`

    std::uint8_t group = 0;
    bool block_lrw : 1 = false;       // this slave cannot do LRW: its group exchanges by LRD and LWR
    bool mailbox_status : 1 = false;  // a bit of the image, in a datagram of its own, says whether the slave has mail
    bool optional : 1 = false;        // may be missing: its group is right without it
    bool no_mailbox : 1 = false;      // its mailbox is left alone. To be set before it leaves INIT, by expect()
    bool no_complete_access : 1 = false;  // CoE objects are always read and written subindex by subindex
    bool fixed_pdos : 1 = false;          // the PDOs of `setup` tell what the slave has, nothing of them is written
    // The highest state that it is brought to: PREOP (no process data), SAFEOP or OP.
    AlState highest = AlState::op;
    std::uint8_t sm_count = 0;
    std::array<ProcessSm, kProcessSms> sms{};  // the data lies in the image in this order
    // After how long without outputs the slave's watchdog bites, in steps of 100 µs, 6.5535 s at most; zero switches it
    // off. Not set: what the slave has of its own. One that is set is fed by all outputs: their SyncManagers get the
    // watchdog trigger, also where the SII leaves it out.
    std::optional<Watchdog> process_data_watchdog{};
    const SlaveSetup* setup = nullptr;

    [[nodiscard]] constexpr Borrowed<SmPdos> pdos() const {
        return setup == nullptr ? Borrowed<SmPdos>() : setup->pdos;
    }
    [[nodiscard]] constexpr Borrowed<StartupCommand> startup() const {
        return setup == nullptr ? Borrowed<StartupCommand>() : setup->startup;
    }
    [[nodiscard]] constexpr SlaveTimes times() const { return setup == nullptr ? SlaveTimes{} : setup->times; }
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

// Some bits of one slave's inputs become another one's outputs, in each cycle: those that the last cycle has brought go
// out with the next. Slaves of one group; bits count from the start of the slave's data in the image.
struct SlaveToSlave {
    std::uint16_t from_slave = 0;
    std::uint16_t to_slave = 0;
    std::uint32_t from_bit = 0;
    std::uint32_t to_bit = 0;
    std::uint32_t bits = 0;
};

// What the inputs of a slave become in the image when it does not take part in the cycle any more.
enum class LostInputs : std::uint8_t {
    keep,  // they stay as the slave has sent them last: inputs_fresh() tells old ones from fresh ones
    zero,  // they are set to zero as soon as the slave is known to be lost, and stay zero until it is back
};

class EntryHandle;
class SharedImage;

// Of one group: slaves that share an image and are exchanged together.
struct GroupConfiguration {
    LogicalAddress start;  // of the image in the logical address space
    Packing packing = Packing::bytes;
    bool overlapped = false;  // inputs and outputs of a slave at the same logical address
    bool block_lrw = false;   // LRD and LWR in place of LRW
    // Datagrams that travel in the first frame of each cycle; what they bring is in Group::al_status and
    // Group::dc_time. The working counter of the cycle is that of the process data alone. A group that has one of them
    // may be without process data.
    bool al_status = false;  // reads the AL status of all slaves at once (BRD of ESC register 0x0130)
    // Number of the slave whose system time all others behind it take over (FRMW of 0x0910); 0: none. No slave before
    // it in the ring may have a clock.
    std::uint16_t dc_reference = 0;
    std::uint16_t reserve_bytes = 0;  // of the first frame, left free for other datagrams of the cycle
    // Octets of other datagrams (mailboxes, states …), with their headers, that may travel with a cycle: in the space
    // its frames have left, and in a frame of their own beyond that. One datagram always may. Zero: they do not wait
    // for cycles, each poll() sends them.
    std::uint16_t acyclic_bytes = 1498;
    // How many cycles may be on their way at once, kMostCyclesInFlight at most: with 2 the next one can be sent before
    // this one is received, also by another thread. See send_processdata(). Each takes prepared frames of its own
    // (limits().process_frames). From 2 on the datagrams of acyclic_bytes do not travel with the cycle; poll() sends
    // them.
    std::uint8_t cycles_in_flight = 1;
    static constexpr std::uint8_t kMostCyclesInFlight = 4;
    LostInputs lost_inputs = LostInputs::keep;
    Borrowed<SlaveToSlave> copies{};  // after the application has set its outputs. The caller's memory
    SharedImage* shared = nullptr;    // for another thread: see shared_image.hpp
    // Entries of process data that each config_map() finds: see entry.hpp. The caller's memory, both the list and what
    // it names.
    std::span<EntryHandle* const> entries{};
};

}  // namespace margay
