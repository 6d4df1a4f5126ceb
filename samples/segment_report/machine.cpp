// The system that the program runs on.
#include "common/program.hpp"
#include "nic_check/read.hpp"
#include "segment_report/collect.hpp"

#include <fmt/format.h>

#include <sys/utsname.h>
#include <fstream>

namespace margay::segment_report {
namespace {

// The value behind `key` and a separator in a file of lines; empty: there is none.
std::string value_in(const char* file, std::string_view key) {
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        if (!line.starts_with(key)) continue;
        const auto from = line.find_first_not_of(" \t:=\"", key.size());
        if (from == std::string::npos) return {};
        return line.substr(from, line.find_last_not_of("\" \t\r") + 1 - from);
    }
    return {};
}

}  // namespace

Machine read_machine(const std::vector<std::string>& interfaces) {
    Machine machine;
    machine.system = value_in("/etc/os-release", "PRETTY_NAME");
    machine.processor = value_in("/proc/cpuinfo", "model name");
    utsname name{};
    if (::uname(&name) == 0)
        machine.kernel = fmt::format("{} {} {} {}", name.sysname, name.release, name.version, name.machine);
    machine.facts = nic_check::read_machine({});
    for (const auto& interface : interfaces) {
        nic_check::InterfaceFacts facts;
        const auto refusal = nic_check::read_interface(interface, {}, facts);
        if (!refusal.empty()) {
            machine.interface_problems.push_back(refusal);
            continue;
        }
        for (auto& finding : nic_check::judge_interface(facts)) machine.findings.push_back(std::move(finding));
        machine.interfaces.push_back(std::move(facts));
    }
    if (!interfaces.empty())
        for (auto& finding : nic_check::judge_machine(machine.facts)) machine.findings.push_back(std::move(finding));
    return machine;
}

}  // namespace margay::segment_report
