// The checks of the conformance check: one table for each subject, one file for each table.
#pragma once

#include "subdevice_check/sdo_client.hpp"

#include <span>

namespace margay::samples::conformance {

struct Options {
    // Also writes the EEPROM: the alias, with the value that it has, and the word behind the content, which gets its
    // old value again.
    bool write_eeprom = false;
    // Only checks whose name begins with one of these, separated by commas; empty: all. The entries of the dictionary
    // are read in any case where a check needs them.
    std::string only{};
};

// Everything that a check needs. It lives for the whole run.
struct Session {
    Bench& bench;
    MailBench& mail;
    SdoClient& sdo;
    const Options& options;
    std::vector<std::byte> sii{};  // the content of the EEPROM up to its end mark
    std::string sii_fault{};       // why it could not be read
    bool lengths_known = false;    // find_process_data_lengths() has found them
    // Of SYNC0, as the slave tells it; 0: it does not. find_shortest_cycle() has found it.
    std::optional<Duration> shortest_cycle{};
    // The changes of a check that could not be undone; execute_check() reports and clears the text.
    std::string left_changed{};
};

// A check reports at most this many findings of one kind, and counts the others.
inline constexpr std::size_t kMostFindings = 5;

struct Check {
    std::string_view name;
    std::string_view what;
    std::string_view clause;  // of the findings that name none
    void (*run)(Session&);
};

// In the order of execution, because a check may use the results of earlier checks.
[[nodiscard]] std::span<const Check> eeprom_checks();
[[nodiscard]] std::span<const Check> state_checks();
[[nodiscard]] std::span<const Check> sync_manager_checks();
[[nodiscard]] std::span<const Check> mailbox_checks();
[[nodiscard]] std::span<const Check> information_checks();
[[nodiscard]] std::span<const Check> sdo_checks();
[[nodiscard]] std::span<const Check> complete_access_checks();
[[nodiscard]] std::span<const Check> segment_checks();
[[nodiscard]] std::span<const Check> pdo_checks();
[[nodiscard]] std::span<const Check> module_checks();
[[nodiscard]] std::span<const Check> sync_type_checks();
[[nodiscard]] std::span<const Check> watchdog_checks();
[[nodiscard]] std::span<const Check> clock_checks();
[[nodiscard]] std::span<const Check> message_checks();  // executed last, because they judge all messages of the run

// All tables in this order.
[[nodiscard]] std::vector<Check> all_checks();

// Finds the lengths of the process data in PREOP: by the objects of PDO assignment, or by the SII (pdos.cpp).
void find_process_data_lengths(Session& session);
// The PDOs that the SII assigns to a SyncManager, in their order, with their entries as mapping values.
struct SiiPdo {
    std::uint16_t index = 0;
    std::vector<std::uint32_t> entries{};
};
[[nodiscard]] std::vector<SiiPdo> sii_pdos(const Session& session, std::uint8_t sync_manager);
[[nodiscard]] std::size_t bits_of(const std::vector<SiiPdo>& pdos);

// Whether the SII has a DC operation mode with SYNC0. activate_clock() writes the SYNC unit by the first of them, in
// PREOP; with `attempt` from 1 on, where the SII leaves the cycle to the master, with another cycle (clocks.cpp).
// Returns the period of the frames.
[[nodiscard]] bool has_sync_mode(const Session& session);
[[nodiscard]] unsigned clock_attempts(const Session& session);  // the largest number of cycles
void find_shortest_cycle(Session& session);                     // in PREOP
[[nodiscard]] Duration activate_clock(Session& session, unsigned attempt);

// What most checks of the dictionary begin with: the slave has CoE, and goes to PREOP (sdos.cpp).
void begin_sdo_check(Session& session);

// Entries that can be written in PREOP with the value that they have, without an effect: configuration of the
// communication (sdos.cpp).
[[nodiscard]] std::vector<DictionaryEntry> harmless_entries(const Session& session);

// Scans the segment of `ctx`, which is initialised, and checks the slave with this number. `progress` is called with
// the name of each check before it begins. Returns an error as a sentence when there is no such slave.
struct Checked {
    Report report{};
    std::string error{};
    bool wrong_arguments = false;  // the error is one of NUMBER or of the names of checks
};
[[nodiscard]] Checked check_device(Context& ctx, Osal& osal, WaitHandles nics, std::uint16_t number,
                                   const Options& options = {},
                                   const std::function<void(std::string_view)>& progress = {});

}  // namespace margay::samples::conformance
