// The configuration of a segment: plain data, the same whether the slaves themselves, a file or the application provide
// it. config_map() applies it, and the library applies it again to a slave that comes back.
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

// The direction of process data: outputs go from the master to the slave, inputs from the slave to the master.
enum class Direction : std::uint8_t { outputs, inputs };

// A SyncManager that carries process data.
struct ProcessSm {
    std::uint8_t number = 0;  // number of the SyncManager in the slave
    Direction direction = Direction::outputs;
    std::uint8_t control = 0;  // control octet, ESC register 0x0804 + 8 · number
    std::uint16_t start = 0;   // address in the slave's memory
    std::uint32_t bits = 0;    // length; 0: the SyncManager is switched off
    [[nodiscard]] constexpr std::uint32_t bytes() const { return bits / 8 + (bits % 8 != 0 ? 1 : 0); }
    friend constexpr bool operator==(const ProcessSm&, const ProcessSm&) = default;
};

// The source of a slave's process data configuration. A later source in this list takes precedence over an earlier one.
enum class ConfigurationSource : std::uint8_t {
    none,         // not known yet: config_map() asks the slave
    sii,          // the slave's SII
    soe,          // the parameters of the slave's drives (SoE)
    coe,          // the slave's object dictionary
    file,         // a file, read for the application; the application makes its own settings after reading the file
    application,  // the application
};
[[nodiscard]] std::string_view to_text(ConfigurationSource source);

// Times of one slave. A time that is not set has its default.
struct SlaveTimes {
    // How long a transition to this state may take. Zero: the standard's time (ETG.1020: 3 s to PREOP, 10 s to SAFEOP,
    // 10 s to OP, and 5 s for each transition to a lower state).
    Duration to_preop{0};
    Duration to_safeop{0};
    Duration to_op{0};
    Duration down{0};
    // How long the slave may take to answer a mailbox message during its start-up; zero: 3 s.
    Duration mailbox{0};
    // ESC register 0x0400. The unit of the watchdogs is (value + 2) · 40 ns; 2498, the usual value, means 100 µs.
    std::optional<std::uint16_t> watchdog_divider{};
    // ESC register 0x0410: after this time without access the ESC regards the slave's processor as failed. At most
    // 6.5535 s with the usual divider; zero: never.
    std::optional<Duration> pdi_watchdog{};
};

namespace detail {
struct PdoPart;
struct StartupPart;
extern const PdoPart kPdoPart;
extern const StartupPart kStartupPart;
}  // namespace detail
using PdoLists = ListWithPart<SmPdos, detail::PdoPart, &detail::kPdoPart>;
using StartupCommands = ListWithPart<StartupCommand, detail::StartupPart, &detail::kStartupPart>;

// The SYNC signals that a slave needs (clocks.hpp). They are activated before the slave is requested to enter SAFEOP,
// and again when the slave comes back.
struct SyncSettings {
    enum class Source : std::uint8_t {
        none,         // no SYNC signals
        application,  // by the members below
        sii,          // by operation mode `sii_mode` of the DC category in the SII of the slave
    };
    Source source = Source::none;
    std::uint8_t sii_mode = 0;  // the first is 0
    // AssignActivate of the slave's ESI: the low octet for ESC register 0x0980, the high octet for 0x0981.
    std::uint16_t assign_activate = 0x0300;
    Duration sync0_cycle{-1};  // negative: ClockSettings::cycle; 0: a single pulse
    Duration sync1_cycle{0};   // ESC register 0x09A4. Some drives require 0 while they use SYNC0 only
    Duration shift{0};         // of SYNC0 against the grid, of either sign
    // How much longer a frame needs through this slave with its processing unit than without, in ns ("processing delay
    // minus forwarding delay" of the chip's data sheet). No register shows it, and receive times contain only the sum
    // of both. Half of an error here is an error of the delay of all slaves behind. Negative: 20 ns for ET1100 and
    // ET1200, 40 ns for all other chips.
    std::int16_t processing_ns = -1;
};

// The place of the data of a slave in the image of its group, if the application or a file (ENI) sets it. Logical
// addresses follow the image: the first output is at GroupConfiguration::start. If the group is overlapped, the first
// input has the same address; otherwise the inputs follow the outputs of all slaves.
struct ImagePlace {
    static constexpr std::uint32_t kNext = 0xFFFF'FFFF;  // behind the data of the slaves before it
    std::uint32_t outputs_bit = kNext;                   // first bit of its outputs in the outputs of the image
    std::uint32_t inputs_bit = kNext;                    // first bit of its inputs in the inputs of the image
};

// Settings beyond the sizes of the process data. One SlaveSetup may serve many slaves of the same kind. It and its
// lists are the caller's memory, and must live as long as the configuration of any slave points to it.
struct SlaveSetup {
    // The PDOs of SyncManagers. The library writes them into the slave's object dictionary before it reads the process
    // data, and again when the slave comes back; PDOs that are right already are not written. SyncManagers that are not
    // listed keep their PDOs. For a slave without CoE the lists only describe its process data.
    PdoLists pdos{};
    // Commands at transitions; see startup.hpp.
    StartupCommands startup{};
    SlaveTimes times{};
    SyncSettings dc{};
    // Takes effect with the next config_map(). config_map() refuses a place that overlaps the data of another slave of
    // the group, or that is no place for the data (data of 8 bits or more, and all data of a group that is not packed
    // bit by bit, begins on an octet): invalid_argument, Argument::image_place.
    ImagePlace place{};
};

// The configuration of one slave.
struct SlaveConfiguration {
    static constexpr std::size_t kProcessSms = 8;
    using Watchdog = std::chrono::duration<std::uint32_t, std::micro>;

    ConfigurationSource source = ConfigurationSource::none;  // the source of `sms`

    // The group that the slave is to belong to from the next config_map() of that group on. Until then it stays in the
    // group that it was mapped with (Slave::image.group). When it leaves, that group continues without it.
    std::uint8_t group = 0;
    bool block_lrw : 1 = false;  // this slave does not support LRW: its group uses LRD and LWR
    // A bit of the image, in a datagram of its own, says whether the slave's mailbox has a message to read.
    bool mailbox_status : 1 = false;
    bool optional : 1 = false;            // the slave may be missing: its absence does not make a cycle wrong
    bool no_mailbox : 1 = false;          // its mailbox is not used. Set this before the slave leaves INIT, by expect()
    bool no_complete_access : 1 = false;  // CoE objects are always read and written subindex by subindex
    bool fixed_pdos : 1 = false;  // the PDOs of `setup` describe what the slave has; the library writes none of them
    // When the slave starts up again, also with another revision, the library sets its SyncManagers and FMMUs as they
    // were mapped, and does not compare the PDOs of the slave. If the slave has other PDOs, outputs reach the wrong
    // objects. For an application whose preop_to_safeop writes the PDOs at each start-up.
    bool unchecked_pdos : 1 = false;
    // The highest state to which the library brings the slave: PREOP (no process data), SAFEOP or OP.
    AlState highest = AlState::op;
    // The SyncManagers in the order of their data in the image. Numbers, directions and sizes that are changed here,
    // and lists of PDOs that are changed in `setup`, take effect with the next config_map() of the group. Until then
    // the slave is exchanged as it was mapped; when it leaves SAFEOP meanwhile, it stays in PREOP with
    // Errc::remapping_needed. A slave also stays in PREOP with this error when the application has written its PDO
    // mapping or PDO assignment (0x1600 to 0x1BFF, 0x1C10 to 0x1C2F) by SDO, or a telegram (S-0-0015, S-0-0016,
    // S-0-0024) by SoEwrite(), or either of them by RawMail, unless the slave has refused the request. The same
    // happens, without unchecked_pdos, when the slave comes back with another revision. The library does not see what
    // AoE writes, and does not compare what a hook or a start-up command writes to these objects: a hook or command
    // must write the same values at each start-up.
    std::uint8_t sm_count = 0;
    std::array<ProcessSm, kProcessSms> sms{};
    // Timeout of the slave's process data watchdog: the time without outputs after which the watchdog expires. In
    // steps of the watchdogs' unit (SlaveTimes::watchdog_divider), at most 65535 of them: by default steps of 100 µs,
    // at most 6.5535 s. Zero switches the watchdog off. Not set: the slave keeps its own value. If it is set, all
    // SyncManagers of outputs trigger the watchdog, also where the SII does not enable it.
    std::optional<Watchdog> process_data_watchdog{};
    const SlaveSetup* setup = nullptr;

    [[nodiscard]] constexpr Borrowed<SmPdos> pdos() const {
        if (setup == nullptr) return {};
        return static_cast<const Borrowed<SmPdos>&>(setup->pdos);
    }
    [[nodiscard]] constexpr Borrowed<StartupCommand> startup() const {
        if (setup == nullptr) return {};
        return static_cast<const Borrowed<StartupCommand>&>(setup->startup);
    }
    [[nodiscard]] constexpr SlaveTimes times() const { return setup == nullptr ? SlaveTimes{} : setup->times; }
    // The first sm_count of `sms`.
    [[nodiscard]] constexpr std::span<const ProcessSm> used_sms() const {
        return std::span(sms).first(sm_count < kProcessSms ? sm_count : kProcessSms);
    }
    [[nodiscard]] constexpr ImagePlace place() const { return setup == nullptr ? ImagePlace{} : setup->place; }
    [[nodiscard]] constexpr SyncSettings dc() const { return setup == nullptr ? SyncSettings{} : setup->dc; }
    // Appends a SyncManager. Returns false if there are kProcessSms already.
    constexpr bool add(const ProcessSm& sm) {
        if (sm_count >= kProcessSms) return false;
        sms[sm_count++] = sm;
        return true;
    }
};

// How the data of the slaves of a group is packed into the image.
enum class Packing : std::uint8_t {
    bytes,  // every SyncManager begins on an octet
    bits,   // data of less than 8 bits follows without a gap; longer data begins on an octet
};

// Copies some bits of one slave's inputs to another slave's outputs in each cycle: the inputs of the last cycle are
// sent with the next one. Both slaves belong to one group. Bits count from the start of the slave's data in the image.
// While the first slave does not take part in the cycle, nothing is copied: the application's outputs are sent.
struct SlaveToSlave {
    std::uint16_t from_slave = 0;
    std::uint16_t to_slave = 0;
    std::uint32_t from_bit = 0;
    std::uint32_t to_bit = 0;
    std::uint32_t bits = 0;
};

// The inputs of a slave in the image after the slave has stopped taking part in the cycle.
enum class LostInputs : std::uint8_t {
    keep,  // they stay as the slave has sent them last: inputs_fresh() distinguishes old from fresh inputs
    zero,  // they are set to zero as soon as the slave is known to be lost, until it is back
};

class EntryHandle;
class SharedImage;

namespace detail {
struct EntryPart;
extern const EntryPart kEntryPart;
}  // namespace detail

// A list of entries; like a list of PDOs it names the part of the library that works with it.
class EntryList : public Borrowed<EntryHandle*> {
  public:
    constexpr EntryList() : part_(nullptr) {}
    using Borrowed<EntryHandle*>::Borrowed;
    // nullptr: there was never a list.
    [[nodiscard]] constexpr const detail::EntryPart* part() const { return empty() ? nullptr : part_; }

  private:
    const detail::EntryPart* part_ = &detail::kEntryPart;
};

// The configuration of one group: slaves that share an image and are exchanged together.
struct GroupConfiguration {
    static constexpr std::uint32_t kSpacing = 0x0100'0000;
    // Logical address of the image. The default is the number of the group times kSpacing: from there on each mapping
    // uses other addresses, so that the FMMUs of a slave that was away during a mapping match nothing. Another value is
    // used as it is.
    LogicalAddress start;
    Packing packing = Packing::bytes;
    bool overlapped = false;  // inputs and outputs of a slave have the same logical address
    bool block_lrw = false;   // use LRD and LWR instead of LRW; of a mapped group: see replan_processdata()
    // Datagrams in the first frame of each cycle; their results are in Group::al_status and Group::dc_time. The working
    // counter of the cycle does not include them. A group with one of these datagrams may be without process data.
    bool al_status = false;  // read the AL status of all slaves with one datagram (BRD of ESC register 0x0130)
    // Number of the slave whose system time all slaves behind it copy (FRMW of ESC register 0x0910). 0: the reference
    // clock of configdc() if ClockSettings::group is this group, otherwise none. config_map() refuses a slave without a
    // clock (invalid_argument), and a slave with another clock before it in the ring (clock_before_reference), unless
    // configdc() has chosen it (ClockSettings::reference): the clock before it would receive zeros as the time. While
    // the slave is lost, the cycle carries the time of the reference clock of configdc() instead; without configdc() it
    // carries no time until the next config_map().
    std::uint16_t dc_reference = 0;
    std::uint16_t reserve_bytes = 0;  // octets of the first frame that stay free for other datagrams of the cycle
    // How many octets of other datagrams (mailboxes, states …), headers included, may be sent with a cycle: first in
    // the space that its frames have left, then in a frame of their own. One datagram may always be sent. Zero: these
    // datagrams do not wait for cycles, each poll() sends them.
    std::uint16_t acyclic_bytes = 1498;
    // How many cycles may be on the wire at the same time, kMostCyclesInFlight at most. With 2 the next cycle can be
    // sent before this one is received, also by another thread: see send_processdata(). Each cycle needs its own
    // prepared frames (limits().process_frames). With 2 or more, the datagrams of acyclic_bytes are not sent with the
    // cycle; poll() sends them.
    std::uint8_t cycles_in_flight = 1;
    static constexpr std::uint8_t kMostCyclesInFlight = 4;
    LostInputs lost_inputs = LostInputs::keep;
    // Inputs in the image change only within receive_processdata() of this group. poll(), calls that wait, and
    // receive_processdata() of another group receive frames too: a reply of this group that such a call finds stays in
    // its frame until this group is received. For applications in which a thread reads the image while another thread
    // owns the context and polls. The inputs of a slave that is lost become zero (lost_inputs) only there, too. Takes
    // effect with the next config_map(). Always so where cycles_in_flight is 2 or more.
    bool hold_inputs = false;
    // Executed after the application has set its outputs. A copy is not executed when one of its slaves is in another
    // group since the mapping: see what_is_wrong(). The caller's memory.
    Borrowed<SlaveToSlave> copies{};
    SharedImage* shared = nullptr;  // lets another thread work on the image: see shared_image.hpp
    // Entries of process data that each config_map() finds: see entry.hpp. The list and the handles are the caller's
    // memory.
    EntryList entries{};
};

}  // namespace margay
