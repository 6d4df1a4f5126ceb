// The functions of a master that a command needs. The interface passes plain data, so that a session can open a segment
// itself (standalone.hpp), or be attached to an application that is the master of the segment.
//
// Slaves are addressed by their position in the ring, the first is 0. All functions wait.
#pragma once

#include "common/program.hpp"

#include <margay/eoe.hpp>
#include <margay/files/esi.hpp>
#include <margay/idn.hpp>
#include <margay/slave.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace margay::ethercat {

// The reason of a failure: a sentence, and the exit code of the program.
struct Problem {
    std::string text{};
    int code = samples::exit_code::kSegment;
    bool refused = false;  // refused by the application that serves the socket, without an access to the slave
    bool aborted = false;  // the slave has answered an SDO request with an abort
};

// A value, or a problem.
template <class T = Nothing>
class [[nodiscard]] Answer {
  public:
    Answer() requires std::default_initializable<T> : value_(T{}) {}
    Answer(T value) : value_(std::move(value)) {}
    Answer(Problem problem) : problem_(std::move(problem)) {}

    [[nodiscard]] explicit operator bool() const { return value_.has_value(); }
    [[nodiscard]] T& operator*() { return *value_; }
    [[nodiscard]] const T& operator*() const { return *value_; }
    [[nodiscard]] T* operator->() { return &*value_; }
    [[nodiscard]] const T* operator->() const { return &*value_; }
    [[nodiscard]] const Problem& problem() const { return problem_; }

  private:
    std::optional<T> value_{};
    Problem problem_{};
};

using Octets = std::vector<std::byte>;

// ------------------------------------------------------------------ master and slaves

struct DeviceFacts {
    std::string name{};  // of the interface, or the source
    MacAddress mac{};
    bool link = false;
};

struct MasterFacts {
    std::string source{};
    bool active = false;  // an application runs it
    std::uint16_t slaves = 0;
    std::vector<DeviceFacts> devices{};
    std::uint64_t frames_sent = 0;
    std::uint64_t frames_received = 0;
    std::uint64_t bytes_on_wire = 0;
    std::uint64_t frames_lost = 0;
};

struct SlaveFacts {
    std::uint16_t position = 0;
    std::uint16_t alias = 0;
    std::uint16_t station_address = 0;
    std::string name{};
    Identity identity{};
    AlStatus al{};
    std::string problem{};  // why scan or configuration failed; empty: no error
    DlInformation dl{};
    std::array<Port, 4> ports{};  // `neighbour` is a position + 1
    std::array<bool, 4> signal{};
    std::optional<std::uint16_t> parent{};  // position; not set: the master
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    MailboxInfo mailbox{};
    MailboxInfo boot_mailbox{};
    std::uint8_t coe_details = 0;
    std::int16_t ebus_current_ma = 0;
};

// Data that only the SII contains.
struct SlaveTexts {
    std::string order{};
    std::string group{};
    std::string name{};
    bool enable_safeop = false;
    bool no_lrw = false;
};

struct ClockFacts {
    bool runs = false;       // the slave has a system time
    bool reference = false;  // it is the reference clock
    bool measured = false;   // the receive times were latched
    std::array<std::uint32_t, 4> receive_ns{};
    std::uint32_t delay_ns = 0;  // from the reference clock
};

// ESC registers 0x0300 to 0x0313.
struct ErrorCounters {
    std::array<std::uint8_t, 4> invalid_frames{};
    std::array<std::uint8_t, 4> rx_errors{};
    std::array<std::uint8_t, 4> forwarded{};
    std::array<std::uint8_t, 4> lost_links{};
    std::uint8_t processing_unit = 0;
    std::uint8_t pdi = 0;
};

// ------------------------------------------------------------------ process data

struct PdoEntryFacts {
    std::uint16_t index = 0;  // 0: a gap
    std::uint8_t subindex = 0;
    std::uint8_t bits = 0;
    std::string name{};
    std::uint16_t data_type = 0;  // CoE data type; 0: not known
};

struct PdoFacts {
    std::uint16_t index = 0;
    std::string name{};
    std::vector<PdoEntryFacts> entries{};
};

struct SyncManagerFacts {
    std::uint8_t number = 0;
    std::uint16_t start = 0;
    std::uint16_t default_bytes = 0;
    std::uint8_t control = 0;
    std::uint8_t enable = 0;
    bool mailbox = false;
    std::vector<PdoFacts> pdos{};
    // By the control octet: bits 2 and 3 are 1 for data from the master, bit 6 is the watchdog.
    [[nodiscard]] bool outputs() const { return (control & 0x0C) == 0x04; }
    [[nodiscard]] bool watchdog() const { return (control & 0x40) != 0; }
};

// A configured slave.
struct ConfigFacts {
    struct Sdo {
        std::uint16_t index = 0;
        std::uint8_t subindex = 0;
        bool complete_access = false;
        Octets data{};
    };
    struct Parameter {
        std::uint8_t drive = 0;
        std::uint16_t idn = 0;
        Octets data{};
    };
    std::uint16_t alias = 0;
    std::uint16_t relative = 0;
    std::uint32_t vendor = 0;  // the expected one; of the slave where none is expected
    std::uint32_t product = 0;
    std::optional<std::uint16_t> position{};  // of the attached slave
    AlState state = AlState::none;
    std::vector<SyncManagerFacts> sync_managers{};
    std::string problem{};        // why the SyncManagers could not be read; empty: they were
    bool may_be_missing = false;  // an optional slave, or one of a hot connect group that is away
    std::vector<Sdo> sdos{};
    std::vector<Parameter> parameters{};
    std::optional<std::uint16_t> assign_activate{};
    std::int64_t sync0_cycle_ns = 0;
    std::int64_t sync0_shift_ns = 0;
    std::int64_t sync1_cycle_ns = 0;
};

struct FmmuFacts {
    std::uint16_t position = 0;  // of the slave
    std::uint8_t sync_manager = 0;
    bool input = false;
    std::uint32_t logical = 0;
    std::uint16_t bytes = 0;
    std::uint8_t start_bit = 0;     // of the first logical octet
    std::uint32_t bits = 0;         // that are mapped
    std::uint32_t offset_bits = 0;  // of the first mapped bit in the SyncManager
};
// The FMMUs that map a SyncManager of the slave, read from its registers from 0x0600 and from 0x0800.
[[nodiscard]] std::vector<FmmuFacts> mapped_fmmus(std::uint16_t position, std::span<const std::byte> fmmus,
                                                  std::span<const std::byte> sync_managers);

struct DomainFacts {
    std::uint16_t index = 0;
    std::uint32_t base = 0;  // logical address of the first octet
    std::uint32_t wkc = 0;
    std::uint32_t expected_wkc = 0;
    std::vector<FmmuFacts> fmmus{};
    Octets data{};
};

// ------------------------------------------------------------------ dictionary and files

struct DictionaryEntryFacts {
    std::uint8_t subindex = 0;
    std::uint16_t access = 0;  // as EntryDescription::access
    std::uint16_t data_type = 0;
    std::uint16_t bits = 0;
    std::string name{};
};

struct DictionaryObjectFacts {
    std::uint16_t index = 0;
    std::string name{};
    std::uint8_t code = 0;
    std::uint8_t max_subindex = 0;
    std::vector<DictionaryEntryFacts> entries{};
};

// The result of a scan.
struct RescanFacts {
    std::uint16_t slaves = 0;   // that answer
    bool whole = true;          // all slaves were scanned; false: compared with the slaves that the application knows
    std::uint16_t missing = 0;  // expected slaves that do not respond
    std::uint16_t unused = 0;   // slaves that respond, and that the application does not use
};

// A port. Its counters count modulo 2^32, like the counters of EoeStatistics.
struct EoeFacts {
    std::optional<std::uint16_t> position{};  // of the slave; not set: it is missing
    std::string interface {};                 // as eoe_bridge names it, or as the application does; empty: no name
    bool open = false;                        // the port exchanged frames
    std::uint32_t sent_octets = 0;
    std::uint32_t received_octets = 0;
    std::uint64_t sent_rate = 0;  // octets per second
    std::uint64_t received_rate = 0;
    std::uint32_t sent_frames = 0;
    std::uint32_t received_frames = 0;
    std::uint32_t dropped_frames = 0;  // of both directions
};

// Frames that were not passed on, of both directions.
[[nodiscard]] std::uint32_t dropped_frames(const EoeStatistics& counted);

// Called with the octets done and the octets in total (0: not known).
using TransferProgress = std::function<void(std::size_t done, std::size_t total)>;

// ------------------------------------------------------------------ the session

class Session {
  public:
    virtual ~Session() = default;
    Session() = default;
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] virtual Answer<MasterFacts> master() = 0;
    // In the order of the ring.
    [[nodiscard]] virtual Answer<std::vector<SlaveFacts>> slaves() = 0;
    [[nodiscard]] virtual Answer<SlaveTexts> texts(std::uint16_t position) = 0;
    // Measures the delays of all slaves at the first call. The clocks are set then.
    [[nodiscard]] virtual Answer<ClockFacts> clock(std::uint16_t position) = 0;
    [[nodiscard]] Answer<ErrorCounters> error_counters(std::uint16_t position);
    [[nodiscard]] Answer<> reset_error_counters(std::uint16_t position);

    // Scans again. With a running application: only what the application allows.
    [[nodiscard]] virtual Answer<RescanFacts> rescan() = 0;
    // 0: no messages, 1: errors and warnings of the master, 2: every datagram.
    [[nodiscard]] virtual Answer<> set_debug_level(unsigned level) = 0;
    // Brings these slaves to a state and waits for it.
    [[nodiscard]] virtual Answer<> set_states(std::span<const std::uint16_t> positions, AlState state) = 0;

    // SyncManagers with the PDOs that are assigned now.
    [[nodiscard]] virtual Answer<std::vector<SyncManagerFacts>> sync_managers(std::uint16_t position) = 0;
    [[nodiscard]] virtual Answer<std::vector<ConfigFacts>> configs() = 0;
    // The domains with the process data of the last cycle.
    [[nodiscard]] virtual Answer<std::vector<DomainFacts>> domains() = 0;

    // The objects; with `entries` also the entries of each of them.
    [[nodiscard]] virtual Answer<std::vector<DictionaryObjectFacts>> dictionary(std::uint16_t position,
                                                                                bool entries) = 0;
    [[nodiscard]] virtual Answer<DictionaryEntryFacts> dictionary_entry(std::uint16_t position, std::uint16_t index,
                                                                        std::uint8_t subindex) = 0;
    [[nodiscard]] virtual Answer<Octets> upload(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                                bool complete_access) = 0;
    [[nodiscard]] virtual Answer<> download(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                            bool complete_access, std::span<const std::byte> value) = 0;

    // `boot`: brings the slave to BOOT for the transfer, and to PREOP afterwards.
    struct FileTransfer {
        std::string name{};
        std::uint32_t password = 0;
        bool boot = false;
        TransferProgress progress{};
    };
    [[nodiscard]] virtual Answer<Octets> foe_read(std::uint16_t position, const FileTransfer& file) = 0;
    [[nodiscard]] virtual Answer<> foe_write(std::uint16_t position, const FileTransfer& file,
                                             std::span<const std::byte> content) = 0;

    [[nodiscard]] virtual Answer<Octets> soe_read(std::uint16_t position, std::uint8_t drive, Idn idn) = 0;
    [[nodiscard]] virtual Answer<SoeAttribute> soe_attribute(std::uint16_t position, std::uint8_t drive, Idn idn) = 0;
    [[nodiscard]] virtual Answer<> soe_write(std::uint16_t position, std::uint8_t drive, Idn idn,
                                             std::span<const std::byte> value) = 0;

    // Counters of all ports, with the rates in this time. On a source of its own the ports count from 0 then.
    [[nodiscard]] virtual Answer<std::vector<EoeFacts>> eoe(std::chrono::milliseconds during) = 0;
    [[nodiscard]] virtual Answer<> set_ip(std::uint16_t position, const EoeIp& ip) = 0;

    [[nodiscard]] virtual Answer<Octets> read_registers(std::uint16_t position, std::uint16_t address,
                                                        std::size_t bytes) = 0;
    [[nodiscard]] virtual Answer<> write_registers(std::uint16_t position, std::uint16_t address,
                                                   std::span<const std::byte> value, bool urgent) = 0;
    // Words of the SII; whole words.
    [[nodiscard]] virtual Answer<> read_sii(std::uint16_t position, std::uint32_t word, std::span<std::byte> into) = 0;
    [[nodiscard]] virtual Answer<> write_sii(std::uint16_t position, std::uint32_t word,
                                             std::span<const std::byte> value) = 0;
    // The slave as an ESI describes it: from its SII and its dictionary.
    struct Description {
        files::EsiDevice device{};
        std::vector<std::string> remarks{};
    };
    [[nodiscard]] virtual Answer<Description> describe(std::uint16_t position) = 0;

    // Waits, in the time of the session.
    virtual void pause(std::chrono::milliseconds time) = 0;
    // Messages of the master since the last call.
    [[nodiscard]] virtual std::vector<std::string> messages() = 0;
    // Adds a message, unless the list contains it already.
    void note(std::string text) {
        if (std::ranges::find(notes_, text) == notes_.end()) notes_.push_back(std::move(text));
    }
    // Ends the session. A remark about the session itself, for example an incomplete recording; empty: none.
    [[nodiscard]] virtual Answer<> close() = 0;

  protected:
    std::vector<std::string> notes_{};
};

}  // namespace margay::ethercat
