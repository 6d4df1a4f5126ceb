// Collects the content of a report from a session. Values that cannot be read are noted in the report, and all other
// values are read.
#pragma once

#include "segment_report/report.hpp"

#include <functional>
#include <string>

namespace margay::segment_report {

struct CollectSettings {
    bool dictionaries = true;  // compare the dictionaries of alike slaves
    bool map = true;           // show the process image; a session of our own brings the slaves to SAFEOP for it
    // The slaves that are expected, to look for missing ones; empty: none are.
    std::function<ethercat::Answer<std::vector<ethercat::ConfigFacts>>()> expected{};
    // Runs cycles; empty: no cycles.
    std::function<Cycles()> cycles{};
    // Called with a text about the present step.
    std::function<void(const std::string&)> progress{};
};

// Fills in master, slaves, process image, cycles and messages. With `report.failure` the slaves could not be read.
void collect(ethercat::Session& session, const CollectSettings& settings, Report& report);

// The system that the program runs on, and its interfaces; changes nothing and sends nothing.
[[nodiscard]] Machine read_machine(const std::vector<std::string>& interfaces);

}  // namespace margay::segment_report
