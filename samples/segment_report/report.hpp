// What a report contains: plain data, collected from a session (collect.hpp) or from a recording, and written as a page
// (page.hpp). Slaves are named by their position in the ring; the first is 0.
#pragma once

#include "analyse/analysis.hpp"
#include "common/clock_log_file.hpp"
#include "common/cycle_log_file.hpp"
#include "ethercat/session.hpp"
#include "nic_check/findings.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace margay::segment_report {

using ethercat::ClockFacts;
using ethercat::DictionaryObjectFacts;
using ethercat::DomainFacts;
using ethercat::ErrorCounters;
using ethercat::MasterFacts;
using ethercat::Octets;
using ethercat::SlaveFacts;
using ethercat::SlaveTexts;
using ethercat::SyncManagerFacts;

// The dictionary of a slave with its values.
struct Dictionary {
    std::vector<DictionaryObjectFacts> objects{};
    std::map<std::pair<std::uint16_t, std::uint8_t>, Octets> values{};  // by index and subindex
    std::set<std::pair<std::uint16_t, std::uint8_t>> unread{};          // entries whose value could not be read
    std::string problem{};                                              // why there is no dictionary
};

struct EepromContent {
    Octets used{};  // up to the end mark of the categories
    std::vector<std::string> findings{};
    bool checksum_wrong = false;
    std::uint16_t checksum = 0;  // word 7
    std::size_t size = 0;        // by word 0x3E; 0: not known
    std::string problem{};       // why it could not be read
};

struct ClockState {
    ClockFacts facts{};
    std::optional<std::int64_t> offset_ns{};     // register 0x0920
    std::optional<std::int32_t> deviation_ns{};  // register 0x092C; above 0: ahead of the reference clock
};

// Objects 0x1008, 0x1009 and 0x100A of a slave with CoE; empty: the slave has no such object.
struct DeviceVersions {
    std::string name{};
    std::string hardware{};
    std::string software{};
    std::set<std::uint16_t> unread{};  // their objects that could not be read: the slave need not have them
};

struct SlaveState {
    SlaveFacts facts{};
    std::optional<AlStatus> found{};  // before the program has written anything
    AlStatus now{};                   // at the end of the report
    SlaveTexts texts{};
    DeviceVersions versions{};
    std::optional<ErrorCounters> counters_before{};
    std::optional<ErrorCounters> counters{};  // at the end
    std::vector<SyncManagerFacts> sync_managers{};
    EepromContent eeprom{};
    ClockState clock{};
    std::optional<Dictionary> dictionary{};
    std::vector<std::string> problems{};  // what could not be read
};

struct Cycles {
    samples::CycleFigures figures{};
    unsigned period_us = 0;
    std::string problem{};  // why there are none, or why not all slaves have reached OP
};

struct Recording {
    std::string file{};        // as the page names it
    bool beside = false;       // the program has written it
    std::uint64_t octets = 0;  // size of the file
    analyse::Analysis analysis{};
};

struct Machine {
    std::string system{};  // name of the distribution
    std::string kernel{};  // name, release, version
    std::string processor{};
    std::vector<nic_check::InterfaceFacts> interfaces{};
    std::vector<std::string> interface_problems{};
    nic_check::MachineFacts facts{};
    std::vector<nic_check::Finding> findings{};
};

enum class Origin : std::uint8_t { segment, application, recording };

struct Report {
    Origin origin = Origin::segment;
    std::string version{};
    std::string source{};
    std::string command{};
    std::string begun{}, ended{};  // local time
    bool virtual_time = false;     // simulated, or replayed
    bool read_dictionaries = false;
    bool mapped = false;  // the process data was mapped for the report
    Machine machine{};
    std::string failure{};  // why there are no slaves
    int failure_code = 0;   // the exit code that belongs to it
    MasterFacts master{};
    std::vector<SlaveState> slaves{};
    std::vector<std::string> missing{};  // configured slaves that are not there
    std::vector<DomainFacts> domains{};
    std::string domains_problem{};
    std::optional<Cycles> cycles{};
    std::optional<samples::CycleFigures> cycle_log{};  // of the application, from a file
    std::string cycle_log_file{};
    std::optional<samples::ClockLog> clock_log{};
    std::string clock_log_file{};
    std::optional<Recording> recording{};
    std::vector<std::string> messages{};  // of the master
};

}  // namespace margay::segment_report
