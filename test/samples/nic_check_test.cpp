// nic_check: every verdict with made-up facts, and reading the facts from folders of the test.
#include "nic_check/findings.hpp"
#include "nic_check/read.hpp"

#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sched.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <functional>

namespace margay::nic_check {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t bit(unsigned capability) { return std::uint64_t{1} << capability; }

IrqThread irq_thread(int priority) {
    return {.id = 345, .irq = 34, .policy = SCHED_FIFO, .priority = priority, .name = {"irq/34-eth9-TxR"}};
}

// An interface and a machine without a finding.
Facts best() {
    Facts facts;
    facts.interface = {.name = "eth9",
                       .index = 9,
                       .up = true,
                       .carrier = true,
                       .mtu = 1500,
                       .driver = "igb",
                       .speed_mbit = 100,
                       .full_duplex = true,
                       .gro = false,
                       .lro = false,
                       .eee = false,
                       .pause = false,
                       .coalescing = Coalescing{},
                       .interrupts = std::vector<Interrupt>{{34, "eth9-TxRx-0", "3"}},
                       .irq_threads = std::vector{irq_thread(81)},
                       .qdisc = "mq",
                       .send_at = SendingAtATime{SendingAtATime::Holder::nic, "etf", ""},
                       .time_stamping = TimeStamping{true, true, true, true, true, 0},
                       .addresses = {"fe80::1"},
                       .ipv6 = false,
                       .network_manager = false,
                       .systemd_networkd = false,
                       .xdp_mode = "zero copy"};
    facts.machine = {.kernel = "6.1.0-rt",
                     .preempt_rt = true,
                     .processors = 4,
                     .isolated = "3",
                     .governors = std::vector<std::string>{"performance"},
                     .sleep_states = std::vector<SleepState>{{"POLL", 0, false}, {"C1", 2, false}, {"C6", 133, true}},
                     .latency_settable = false,
                     .realtime_runtime_us = -1,
                     .hyper_threading = false,
                     .clock_source = "tsc",
                     .locked_memory_limit = UINT64_MAX,
                     .priority_limit = 99,
                     .capabilities = bit(CAP_NET_RAW) | bit(CAP_NET_ADMIN) | bit(CAP_BPF)};
    return facts;
}

const Finding* find(const std::vector<Finding>& all, const std::string& subject) {
    for (const auto& one : all)
        if (one.subject == subject) return &one;
    return nullptr;
}

struct Row {
    const char* subject;
    Verdict verdict;
    const char* text;     // a part of the sentence
    const char* command;  // the command; "": none
    std::function<void(Facts&)> change;
};

void expect_rows(const std::vector<Row>& rows) {
    for (const auto& row : rows) {
        auto facts = best();
        row.change(facts);
        const auto all = judge(facts);
        const auto* one = find(all, row.subject);
        ASSERT_NE(one, nullptr) << row.subject;
        EXPECT_EQ(to_text(one->verdict), to_text(row.verdict)) << row.subject << ": " << one->text;
        EXPECT_NE(one->text.find(row.text), std::string::npos) << row.subject << ": " << one->text;
        EXPECT_EQ(one->command, row.command) << row.subject;
        // All other verdicts stay good, except the verdicts that depend on the same fact.
        std::size_t others = 0;
        for (const auto& other : all) others += other.verdict != Verdict::good ? 1U : 0U;
        EXPECT_LE(others, 2U) << row.subject << ": " << row.text;
    }
}

constexpr auto good = Verdict::good;
constexpr auto better = Verdict::better;
constexpr auto not_known = Verdict::not_known;

TEST(NicCheck, TheBestMachineHasNothingToMend) {
    const auto all = judge(best());
    EXPECT_GT(all.size(), 30U);
    for (const auto& one : all) {
        EXPECT_EQ(to_text(one.verdict), "good") << one.subject << ": " << one.text;
        EXPECT_EQ(one.command, "") << one.subject;
        EXPECT_NE(one.text, "") << one.subject;
    }
}

TEST(NicCheck, NothingIsKnownOfFactsThatWereNotRead) {
    Facts nothing;
    nothing.interface.name = "eth9";
    nothing.interface.unread["gro"] = "the driver does not say";
    for (const auto& one : judge(nothing)) {
        const bool by_default = one.verdict == good;  // the finding is that nothing bad was found
        EXPECT_TRUE(!by_default || one.subject == "IP addresses" || one.subject == "hardware" ||
                    one.subject == "irqbalance")
            << one.subject << ": " << one.text;
    }
    EXPECT_EQ(find(judge(nothing), "generic receive offload")->text, "the driver does not say");
}

TEST(NicCheck, JudgesTheInterface) {
    expect_rows({
        {"driver", better, "needs a cable", "", [](Facts& f) { f.interface.wireless = true; }},
        {"driver", better, "a virtual interface (veth)", "", [](Facts& f) { f.interface.kind = "veth"; }},
        {"driver", better, "virtual machine", "", [](Facts& f) { f.interface.driver = "virtio_net"; }},
        {"driver", better, "USB", "", [](Facts& f) { f.interface.driver = "r8152"; }},
        {"driver", not_known, "not read", "", [](Facts& f) { f.interface.driver.reset(); }},
        {"bridge", better, "belongs to br0", "ip link set dev eth9 nomaster",
         [](Facts& f) { f.interface.master = "br0"; }},
        {"link", better, "switched off", "ip link set dev eth9 up", [](Facts& f) { f.interface.up = false; }},
        {"link", better, "no link", "", [](Facts& f) { f.interface.carrier = false; }},
        {"link", not_known, "", "", [](Facts& f) { f.interface.carrier.reset(); }},
        {"MTU", better, "up to 1500", "ip link set dev eth9 mtu 1500", [](Facts& f) { f.interface.mtu = 1400; }},
        {"speed", better, "10 Mbit/s", "ethtool -s eth9 autoneg on advertise 0x008",
         [](Facts& f) { f.interface.speed_mbit = 10; }},
        {"speed", better, "something else is at the other end", "", [](Facts& f) { f.interface.speed_mbit = 1000; }},
        {"speed", not_known, "", "", [](Facts& f) { f.interface.speed_mbit.reset(); }},
        {"duplex", better, "half", "ethtool -s eth9 autoneg on advertise 0x008",
         [](Facts& f) { f.interface.full_duplex = false; }},
        {"duplex", not_known, "", "", [](Facts& f) { f.interface.full_duplex.reset(); }},
        {"large receive offload", better, "on", "ethtool -K eth9 lro off", [](Facts& f) { f.interface.lro = true; }},
        {"generic receive offload", better, "on", "ethtool -K eth9 gro off", [](Facts& f) { f.interface.gro = true; }},
        {"Energy Efficient Ethernet", better, "on", "ethtool --set-eee eth9 eee off",
         [](Facts& f) { f.interface.eee = true; }},
        {"flow control", better, "on", "ethtool -A eth9 autoneg off rx off tx off",
         [](Facts& f) { f.interface.pause = true; }},
        {"flow control", not_known, "", "", [](Facts& f) { f.interface.pause.reset(); }},
        {"interrupt coalescing", better, "up to 50 µs", "ethtool -C eth9 rx-usecs 0 tx-usecs 0",
         [](Facts& f) { f.interface.coalescing->receive_us = 50; }},
        {"interrupt coalescing", better, "adaptive",
         "ethtool -C eth9 adaptive-rx off adaptive-tx off rx-usecs 0 tx-usecs 0",
         [](Facts& f) { f.interface.coalescing->adaptive_receive = true; }},
        {"interrupt coalescing", good, "receive 3 µs", "", [](Facts& f) { f.interface.coalescing->receive_us = 3; }},
        {"interrupt coalescing", not_known, "", "", [](Facts& f) { f.interface.coalescing.reset(); }},
        {"interrupt 34 (eth9-TxRx-0)", better, "0-3", "echo N > /proc/irq/34/smp_affinity_list",
         [](Facts& f) { f.interface.interrupts->front().cpus = "0-3"; }},
        {"interrupts", not_known, "none", "", [](Facts& f) { f.interface.interrupts->clear(); }},
        {"interrupts", not_known, "", "", [](Facts& f) { f.interface.interrupts.reset(); }},
        {"queueing discipline", not_known, "", "", [](Facts& f) { f.interface.qdisc.reset(); }},
        {"AF_XDP", good, "generic mode", "", [](Facts& f) { f.interface.xdp_mode = "generic"; }},
        {"AF_XDP", better, "refused", "",
         [](Facts& f) {
             f.interface.xdp_mode.reset();
             f.interface.xdp_refusal = "its driver refused XDP";
         }},
        {"AF_XDP", not_known, "not tried", "nic_check eth9 --try-xdp", [](Facts& f) { f.interface.xdp_mode.reset(); }},
        {"times of sent frames", good, "/dev/ptp0", "", [](Facts&) {}},
        {"times of sent frames", better, "software only", "",
         [](Facts& f) { f.interface.time_stamping = TimeStamping{.send_software = true}; }},
        {"times of sent frames", better, "none", "", [](Facts& f) { f.interface.time_stamping = TimeStamping{}; }},
        {"times of sent frames", not_known, "", "", [](Facts& f) { f.interface.time_stamping.reset(); }},
        {"times of received frames", good, "/dev/ptp0", "", [](Facts&) {}},
        {"times of received frames", better, "the hardware notes those of PTP frames only", "",
         [](Facts& f) { f.interface.time_stamping->all_received = false; }},
        {"times of received frames", better, "none", "", [](Facts& f) { f.interface.time_stamping = TimeStamping{}; }},
        {"times of received frames", not_known, "", "", [](Facts& f) { f.interface.time_stamping.reset(); }},
        {"sending at a time", good, "the NIC holds frames until their time", "", [](Facts&) {}},
        {"sending at a time", better, "fq sends them by a timer of the kernel", "",
         [](Facts& f) {
             f.interface.send_at = SendingAtATime{SendingAtATime::Holder::kernel, "fq", ""};
         }},
        {"sending at a time", better, "not possible by its queueing discipline mq: it sends them at once",
         "tc qdisc replace dev eth9 root etf clockid CLOCK_TAI delta 200000",
         [](Facts& f) {
             f.interface.send_at = SendingAtATime{SendingAtATime::Holder::nobody, "mq", "it sends them at once"};
         }},
        {"sending at a time", not_known, "", "", [](Facts& f) { f.interface.send_at.reset(); }},
        {"priority of irq/34-eth9-TxR", good, "81, above that of a cycle (80)", "", [](Facts&) {}},
        {"priority of irq/34-eth9-TxR", better, "50, not above that of a cycle (80)", "chrt -f -p 81 345",
         [](Facts& f) { f.interface.irq_threads->front() = irq_thread(50); }},
        {"NetworkManager", better, "DHCP", "nmcli device set eth9 managed no",
         [](Facts& f) { f.interface.network_manager = true; }},
        {"NetworkManager", not_known, "", "", [](Facts& f) { f.interface.network_manager.reset(); }},
        {"systemd-networkd", not_known, "", "", [](Facts& f) { f.interface.systemd_networkd.reset(); }},
        {"IPv6", better, "solicitations", "sysctl -w net.ipv6.conf.eth9.disable_ipv6=1",
         [](Facts& f) { f.interface.ipv6 = true; }},
        {"IP addresses", better, "192.168.0.2", "ip address flush dev eth9",
         [](Facts& f) { f.interface.addresses.push_back("192.168.0.2"); }},
    });
    auto facts = best();
    facts.interface.systemd_networkd = true;
    EXPECT_NE(find(judge(facts), "systemd-networkd")->command.find("Name=eth9"), std::string::npos);
}

TEST(NicCheck, JudgesTheMachine) {
    expect_rows({
        {"kernel", better, "without PREEMPT_RT", "apt-get install linux-image-rt-$(dpkg --print-architecture)",
         [](Facts& f) { f.machine.preempt_rt = false; }},
        {"kernel", not_known, "", "", [](Facts& f) { f.machine.preempt_rt.reset(); }},
        {"real-time share", better, "950000", "sysctl -w kernel.sched_rt_runtime_us=-1",
         [](Facts& f) { f.machine.realtime_runtime_us = 950'000; }},
        {"hardware", better, "virtual machine", "", [](Facts& f) { f.machine.virtual_machine = true; }},
        {"isolated processors", better, "isolcpus=3", "", [](Facts& f) { f.machine.isolated = ""; }},
        {"isolated processors", better, "one processor", "", [](Facts& f) { f.machine.processors = 1; }},
        {"isolated processors", not_known, "", "", [](Facts& f) { f.machine.isolated.reset(); }},
        {"simultaneous multithreading", better, "on", "echo off > /sys/devices/system/cpu/smt/control",
         [](Facts& f) { f.machine.hyper_threading = true; }},
        {"irqbalance", better, "runs", "systemctl disable --now irqbalance",
         [](Facts& f) { f.machine.irqbalance = true; }},
        {"frequency governor", better, "performance, powersave", "cpupower frequency-set -g performance",
         [](Facts& f) { f.machine.governors->push_back("powersave"); }},
        {"frequency governor", not_known, "", "", [](Facts& f) { f.machine.governors.reset(); }},
        {"sleep states", better, "C6 (133 µs)", "cpupower idle-set -D 10",
         [](Facts& f) { f.machine.sleep_states->back().disabled = false; }},
        {"sleep states", good, "/dev/cpu_dma_latency", "",
         [](Facts& f) {
             f.machine.sleep_states->back().disabled = false;
             f.machine.latency_settable = true;
         }},
        {"clock source", better, "hpet", "echo tsc > /sys/devices/system/clocksource/clocksource0/current_clocksource",
         [](Facts& f) { f.machine.clock_source = "hpet"; }},
        {"CAP_NET_RAW", better, "missing", "setcap cap_net_raw+ep PROGRAM",
         [](Facts& f) { f.machine.capabilities = 0; }},
        {"rights of AF_XDP", better, "missing", "setcap cap_bpf,cap_net_admin,cap_net_raw+ep PROGRAM",
         [](Facts& f) { f.machine.capabilities = bit(CAP_NET_RAW); }},
        {"capabilities", not_known, "", "", [](Facts& f) { f.machine.capabilities.reset(); }},
        {"priority (RLIMIT_RTPRIO)", better,
         "0: ", "echo \"$USER - rtprio 99\" | sudo tee -a /etc/security/limits.d/ethercat.conf",
         [](Facts& f) { f.machine.priority_limit = 0; }},
        {"priority (RLIMIT_RTPRIO)", good, "capability", "",
         [](Facts& f) {
             f.machine.priority_limit = 0;
             *f.machine.capabilities |= bit(CAP_SYS_NICE);
         }},
        {"locked memory (RLIMIT_MEMLOCK)", better, "8388608",
         "echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/ethercat.conf",
         [](Facts& f) { f.machine.locked_memory_limit = 8U << 20; }},
    });
}

TEST(NicCheck, JudgesTheProbe) {
    const auto with = [](std::uint64_t sent, std::uint64_t returned, Duration each) {
        ProbeFacts probe;
        probe.sent = sent;
        probe.returned = returned;
        probe.slaves = 5;
        for (std::uint64_t n = 0; n < returned; ++n) probe.round_trip.record(each);
        return judge_probe(probe).front();
    };
    EXPECT_EQ(with(100, 100, 40us).verdict, good);
    EXPECT_NE(with(100, 100, 40us).text.find("5 slaves; min 40.0"), std::string::npos);
    EXPECT_EQ(with(100, 100, 900us).verdict, better);
    EXPECT_EQ(with(100, 98, 40us).verdict, better);
    EXPECT_NE(with(100, 98, 40us).text.find("2 of 100 frames were lost"), std::string::npos);
    EXPECT_NE(with(500, 499, 40us).text.find("1 of 500 frames was lost"), std::string::npos);
    EXPECT_EQ(with(100, 0, 0us).verdict, not_known);
    EXPECT_EQ(with(0, 0, 0us).verdict, not_known);
    ProbeFacts echo;
    echo.sent = echo.echoes = 10;
    EXPECT_NE(judge_probe(echo).front().text.find("without having passed a slave"), std::string::npos);
}

TEST(NicCheck, PrintsTheSameFindingsAsTextAndAsJson) {
    auto facts = best();
    facts.interface.gro = true;
    facts.interface.pause.reset();
    facts.probe.emplace();
    facts.probe->sent = facts.probe->returned = 2;
    facts.probe->slaves = 1;
    facts.probe->round_trip.record(10us);
    facts.probe->round_trip.record(100us);
    const auto findings = judge(facts);
    const auto text = findings_text(facts, findings);
    EXPECT_TRUE(text.starts_with("eth9: ")) << text;
    EXPECT_NE(text.find(" 1 could be better, 1 not known\n\ncould be better\n  generic receive offload: on"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("\n      ethtool -K eth9 gro off\n"), std::string::npos) << text;
    const auto json = nlohmann::json::parse(findings_json(facts, findings));
    EXPECT_EQ(json["interface"], "eth9");
    EXPECT_EQ(json["counts"]["could be better"], 1);
    EXPECT_EQ(json["findings"].size(), findings.size());
    EXPECT_EQ(json["probe"]["returned"], 2);
    EXPECT_EQ(json["probe"]["histogram"].size(), 2U);
    for (std::size_t n = 0; n < findings.size(); ++n) {
        EXPECT_EQ(json["findings"][n]["text"], findings[n].text);
        EXPECT_EQ(json["findings"][n].value("command", ""), findings[n].command);
    }
}

// ------------------------------------------------------------------ the reading

struct NicCheckReading : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-nic-check-" + std::to_string(::getpid()));
    Places places{.proc = folder / "proc", .sys = folder / "sys", .run = folder / "run", .dev = folder / "dev"};
    ~NicCheckReading() override {
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
    }
    void file(const std::string& path, const std::string& text) const {
        std::filesystem::create_directories((folder / path).parent_path());
        std::ofstream(folder / path) << text;
    }
};

TEST_F(NicCheckReading, AMachineByItsFiles) {
    file("proc/sys/kernel/osrelease", "6.1.0-13-rt-amd64\n");
    file("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.1.55-1 (2023-09-29)\n");
    file("proc/sys/kernel/sched_rt_runtime_us", "950000\n");
    file("proc/cpuinfo", "flags\t\t: fpu vme hypervisor lahf_lm\n");
    file("proc/self/status", "Name:\tx\nCapEff:\t0000000000002000\n");
    file("proc/77/comm", "irqbalance\n");
    file("sys/devices/system/cpu/isolated", "2-3\n");
    file("sys/devices/system/cpu/smt/active", "1\n");
    file("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
    file("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n");
    file("sys/devices/system/cpu/cpu0/cpuidle/state0/name", "POLL\n");
    file("sys/devices/system/cpu/cpu0/cpuidle/state1/name", "C6\n");
    file("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "133\n");
    file("sys/devices/system/cpu/cpu0/cpuidle/state1/disable", "1\n");
    file("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n");
    file("dev/cpu_dma_latency", "");
    const auto machine = read_machine(places);
    EXPECT_EQ(machine.kernel, "6.1.0-13-rt-amd64");
    EXPECT_EQ(machine.preempt_rt, true);
    EXPECT_EQ(machine.realtime_runtime_us, 950'000);
    EXPECT_TRUE(machine.virtual_machine);
    EXPECT_EQ(machine.capabilities, bit(CAP_NET_RAW));
    EXPECT_TRUE(machine.irqbalance);
    EXPECT_EQ(machine.isolated, "2-3");
    EXPECT_EQ(machine.hyper_threading, true);
    EXPECT_EQ(machine.governors, (std::vector<std::string>{"performance", "powersave"}));
    ASSERT_TRUE(machine.sleep_states);
    ASSERT_EQ(machine.sleep_states->size(), 2U);
    EXPECT_EQ(machine.sleep_states->back().latency_us, 133U);
    EXPECT_TRUE(machine.sleep_states->back().disabled);
    EXPECT_FALSE(machine.sleep_states->front().disabled);
    EXPECT_EQ(machine.clock_source, "tsc");
    EXPECT_EQ(machine.latency_settable, true);
}

TEST_F(NicCheckReading, AMachineWithoutFilesIsNotKnown) {
    const auto machine = read_machine(places);
    EXPECT_FALSE(machine.preempt_rt);
    EXPECT_FALSE(machine.isolated);
    EXPECT_FALSE(machine.governors);
    EXPECT_FALSE(machine.sleep_states);
    EXPECT_FALSE(machine.latency_settable);
    EXPECT_FALSE(machine.realtime_runtime_us);
    EXPECT_FALSE(machine.clock_source);
    EXPECT_FALSE(machine.capabilities);
}

TEST_F(NicCheckReading, AKernelWithoutPreemptRt) {
    file("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.55-1\n");
    EXPECT_EQ(read_machine(places).preempt_rt, false);
    EXPECT_TRUE(read_machine(places).preemptible);
    file("sys/kernel/realtime", "1\n");
    EXPECT_EQ(read_machine(places).preempt_rt, true) << "older patches say it here";
}

TEST_F(NicCheckReading, InterruptsByNameAndByDevice) {
    file("proc/interrupts",
         "           CPU0       CPU1\n"
         "  1:          0          9   IO-APIC   1-edge      i8042\n"
         " 24:          0          0   PCI-MSI 65536-edge      eth9\n"
         " 25:        100          0   PCI-MSI 65537-edge      eth9-TxRx-0\n"
         " 26:          7          0   PCI-MSI 65538-edge      virtio0-input.0\n"
         " 27:          7          0   PCI-MSI 65539-edge      eth99\n"
         "NMI:          0          0   Non-maskable interrupts\n");
    file("proc/irq/24/smp_affinity_list", "0-1\n");
    file("proc/irq/25/smp_affinity_list", "0-1\n");
    file("proc/irq/25/effective_affinity_list", "1\n");
    file("sys/class/net/eth9/device/msi_irqs/26", "msix\n");
    const auto found = read_interrupts("eth9", places);
    ASSERT_EQ(found.size(), 3U);
    EXPECT_EQ(found[0].number, 24U);
    EXPECT_EQ(found[0].cpus, "0-1");
    EXPECT_EQ(found[1].name, "eth9-TxRx-0");
    EXPECT_EQ(found[1].cpus, "1") << "the processor that is used";
    EXPECT_EQ(found[2].number, 26U);
    EXPECT_EQ(found[2].cpus, "");
}

}  // namespace
}  // namespace margay::nic_check
