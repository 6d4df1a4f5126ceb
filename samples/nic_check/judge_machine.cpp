#include "nic_check/findings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <linux/capability.h>

#include <algorithm>
#include <string_view>

namespace margay::nic_check {
namespace {

constexpr std::uint32_t kDeepSleep_us = 10;                       // wake-up latency of a sleep state that a cycle feels
constexpr std::uint64_t kEnoughLocked = std::uint64_t{64} << 20;  // octets: more than any sample locks
constexpr std::uint64_t kEnoughPriority = 80;

class Machine {
  public:
    explicit Machine(const MachineFacts& facts) : f_(facts) {}

    std::vector<Finding> judge() {
        kernel();
        processors();
        governor();
        sleep();
        clock();
        rights();
        return std::move(all_);
    }

  private:
    void good(const char* subject, std::string text) { all_.push_back({Verdict::good, subject, std::move(text), {}}); }
    void better(const char* subject, std::string text, std::string command = {}) {
        all_.push_back({Verdict::better, subject, std::move(text), std::move(command)});
    }
    void not_known(const char* subject, std::string text) {
        all_.push_back({Verdict::not_known, subject, std::move(text), {}});
    }
    [[nodiscard]] bool has(unsigned number) const { return f_.capabilities && (*f_.capabilities >> number & 1U) != 0; }

    void kernel() {
        if (!f_.preempt_rt)
            not_known("kernel", "its version is not readable");
        else if (*f_.preempt_rt)
            good("kernel", f_.kernel + " with PREEMPT_RT");
        else
            better("kernel",
                   fmt::format("{} without PREEMPT_RT{}: a wake-up can be late by milliseconds", f_.kernel,
                               f_.preemptible ? " (it is preemptible)" : ""),
                   "apt-get install linux-image-rt-$(dpkg --print-architecture)");
        if (!f_.realtime_runtime_us)
            not_known("real-time share", "sched_rt_runtime_us is not readable");
        else if (*f_.realtime_runtime_us < 0)
            good("real-time share", "not limited");
        else
            better(
                "real-time share",
                fmt::format("real-time threads are stopped after {} µs of each second (matters to a cycle with spin)",
                            *f_.realtime_runtime_us),
                "sysctl -w kernel.sched_rt_runtime_us=-1");
        if (f_.virtual_machine)
            better("hardware", "a virtual machine: the host can stop it at any time");
        else
            good("hardware", "no virtual machine");
    }

    void processors() {
        if (f_.processors < 2)
            better("isolated processors", "there is one processor: the cycle shares it with everything");
        else if (!f_.isolated)
            not_known("isolated processors", "the kernel does not say");
        else if (f_.isolated->empty())
            better("isolated processors",
                   fmt::format(
                       "none of {}: other programs run on the processor of the cycle. Add to the command line of the "
                       "kernel: isolcpus={} nohz_full={} rcu_nocbs={}",
                       f_.processors, f_.processors - 1, f_.processors - 1, f_.processors - 1));
        else
            good("isolated processors", *f_.isolated + ": give one to the program (--cpu)");
        if (f_.hyper_threading && *f_.hyper_threading)
            better("simultaneous multithreading", "on: the neighbour on the same core delays the cycle",
                   "echo off > /sys/devices/system/cpu/smt/control");
        else if (f_.hyper_threading)
            good("simultaneous multithreading", "off");
        else
            not_known("simultaneous multithreading", "the kernel does not say");
        if (f_.irqbalance)
            better("irqbalance", "runs: it moves the interrupts of the NIC", "systemctl disable --now irqbalance");
        else
            good("irqbalance", "does not run");
    }

    void governor() {
        if (!f_.governors) return not_known("frequency governor", "the kernel does not control the frequency");
        const bool performance =
            std::all_of(f_.governors->begin(), f_.governors->end(), [](const auto& g) { return g == "performance"; });
        if (performance)
            good("frequency governor", "performance");
        else
            better("frequency governor",
                   fmt::format("{}: the frequency follows the load", fmt::join(*f_.governors, ", ")),
                   "cpupower frequency-set -g performance");
    }

    void sleep() {
        if (!f_.sleep_states) return not_known("sleep states", "the kernel does not control them");
        std::vector<std::string> deep;
        for (const auto& state : *f_.sleep_states)
            if (!state.disabled && state.latency_us > kDeepSleep_us)
                deep.push_back(fmt::format("{} ({} µs)", state.name, state.latency_us));
        if (deep.empty())
            good("sleep states", fmt::format("none needs more than {} µs to wake up", kDeepSleep_us));
        else if (f_.latency_settable.value_or(false))
            good("sleep states",
                 fmt::format("{}: programs of Margay switch them off while they run (/dev/cpu_dma_latency)",
                             fmt::join(deep, ", ")));
        else
            better("sleep states",
                   fmt::format("{} to wake up, and this user may not switch them off by /dev/cpu_dma_latency",
                               fmt::join(deep, ", ")),
                   "cpupower idle-set -D 10");
    }

    void clock() {
        if (!f_.clock_source)
            not_known("clock source", "the kernel does not say");
        else if (*f_.clock_source == "hpet" || *f_.clock_source == "acpi_pm" || *f_.clock_source == "jiffies")
            better("clock source", *f_.clock_source + ": reading the time takes about a microsecond or is coarse",
                   "echo tsc > /sys/devices/system/clocksource/clocksource0/current_clocksource");
        else
            good("clock source", *f_.clock_source);
    }

    void rights() {
        if (!f_.capabilities) {
            not_known("capabilities", "/proc/self/status is not readable");
        } else {
            capability(CAP_NET_RAW, "CAP_NET_RAW", "this user cannot open the interface", "cap_net_raw");
            const bool xdp = has(CAP_NET_ADMIN) && has(CAP_BPF) && has(CAP_NET_RAW);
            if (xdp)
                good("rights of AF_XDP", "CAP_NET_ADMIN, CAP_BPF, CAP_NET_RAW");
            else
                better("rights of AF_XDP", "CAP_NET_ADMIN, CAP_BPF or CAP_NET_RAW is missing: xdp: is refused",
                       "setcap cap_bpf,cap_net_admin,cap_net_raw+ep PROGRAM");
        }
        limit("priority (RLIMIT_RTPRIO)", f_.priority_limit, kEnoughPriority, has(CAP_SYS_NICE), "rtprio 99",
              "no thread can be a real-time thread");
        limit("locked memory (RLIMIT_MEMLOCK)", f_.locked_memory_limit, kEnoughLocked, has(CAP_IPC_LOCK),
              "memlock unlimited", "memory can be swapped out, which stops a cycle for milliseconds");
    }

    void capability(unsigned number, const char* name, const char* why, const char* text) {
        if (has(number))
            good(name, "there");
        else
            better(name, fmt::format("missing: {}", why), fmt::format("setcap {}+ep PROGRAM", text));
    }

    void limit(const char* subject, const std::optional<std::uint64_t>& now, std::uint64_t enough, bool capable,
               const char* line, const char* why) {
        if (capable)
            good(subject, "a capability stands above the limit");
        else if (!now)
            not_known(subject, "the limit is not readable");
        else if (*now >= enough)
            good(subject, *now == UINT64_MAX ? std::string("not limited") : std::to_string(*now));
        else
            better(subject, fmt::format("{}: {}", *now, why),
                   fmt::format("echo \"$USER - {}\" | sudo tee -a /etc/security/limits.d/ethercat.conf", line));
    }

    const MachineFacts& f_;
    std::vector<Finding> all_;
};

}  // namespace

std::vector<Finding> judge_machine(const MachineFacts& facts) { return Machine(facts).judge(); }

}  // namespace margay::nic_check
