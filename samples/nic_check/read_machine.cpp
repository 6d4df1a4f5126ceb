#include "nic_check/files.hpp"
#include "nic_check/read.hpp"

#include <sys/resource.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <set>

namespace margay::nic_check {
namespace {

namespace fs = std::filesystem;

std::optional<std::uint64_t> limit(auto what) {
    rlimit now{};
    if (::getrlimit(what, &now) != 0) return {};
    return now.rlim_cur == RLIM_INFINITY ? UINT64_MAX : static_cast<std::uint64_t>(now.rlim_cur);
}

std::optional<std::vector<std::string>> read_governors(const fs::path& processors) {
    std::set<std::string> found;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(processors, ignored))
        if (const auto governor = text_of(entry.path() / "cpufreq/scaling_governor")) found.insert(*governor);
    if (found.empty()) return {};
    return std::vector<std::string>(found.begin(), found.end());
}

std::optional<std::vector<SleepState>> read_sleep_states(const fs::path& folder) {
    std::vector<SleepState> states;
    for (unsigned n = 0;; ++n) {
        const auto path = folder / ("state" + std::to_string(n));
        const auto name = text_of(path / "name");
        if (!name) break;
        states.push_back({*name, static_cast<std::uint32_t>(number_of(path / "latency").value_or(0)),
                          number_of(path / "disable").value_or(0) != 0});
    }
    if (states.empty()) return {};
    return states;
}

std::optional<std::uint64_t> read_capabilities(const std::string& status) {
    constexpr std::string_view kKey = "CapEff:";
    const auto at = status.find(kKey);
    if (at == std::string::npos) return {};
    return std::strtoull(status.c_str() + at + kKey.size(), nullptr, 16);
}

bool runs(const Places& places, const std::string& program) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(places.proc, ignored))
        if (const auto name = text_of(entry.path() / "comm"); name && *name == program) return true;
    return false;
}

}  // namespace

MachineFacts read_machine(const Places& places) {
    MachineFacts facts;
    const fs::path proc = places.proc;
    const fs::path sys = places.sys;
    const auto processors = sys / "devices/system/cpu";
    facts.kernel = text_of(proc / "sys/kernel/osrelease").value_or("");
    const auto version = text_of(proc / "sys/kernel/version");
    if (version) {
        facts.preempt_rt =
            version->find("PREEMPT_RT") != std::string::npos || number_of(sys / "kernel/realtime").value_or(0) == 1;
        facts.preemptible =
            version->find(" PREEMPT ") != std::string::npos || version->find("PREEMPT_DYNAMIC") != std::string::npos;
    }
    facts.processors = static_cast<unsigned>(std::max(1L, ::sysconf(_SC_NPROCESSORS_ONLN)));
    facts.isolated = text_of(processors / "isolated");
    facts.governors = read_governors(processors);
    facts.sleep_states = read_sleep_states(processors / "cpu0/cpuidle");
    const auto latency = fs::path(places.dev) / "cpu_dma_latency";
    std::error_code ignored;
    if (fs::exists(latency, ignored)) facts.latency_settable = ::access(latency.c_str(), W_OK) == 0;
    facts.realtime_runtime_us = number_of(proc / "sys/kernel/sched_rt_runtime_us");
    if (const auto active = number_of(processors / "smt/active")) facts.hyper_threading = *active == 1;
    facts.clock_source = text_of(sys / "devices/system/clocksource/clocksource0/current_clocksource");
    if (const auto information = text_of(proc / "cpuinfo"))
        facts.virtual_machine = information->find(" hypervisor") != std::string::npos;
    facts.irqbalance = runs(places, "irqbalance");
    facts.locked_memory_limit = limit(RLIMIT_MEMLOCK);
    facts.priority_limit = limit(RLIMIT_RTPRIO);
    if (const auto status = text_of(proc / "self/status")) facts.capabilities = read_capabilities(*status);
    return facts;
}

}  // namespace margay::nic_check
