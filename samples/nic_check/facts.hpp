// What nic_check has read of an interface and of the machine. A fact that could not be read has no value: the reasons
// are in `unread`.
#pragma once

#include "osal/duration_histogram.hpp"
#include "osal/linux/irq_threads.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace margay::nic_check {

struct Coalescing {
    std::uint32_t receive_us = 0;
    std::uint32_t receive_frames = 0;
    std::uint32_t send_us = 0;
    std::uint32_t send_frames = 0;
    bool adaptive_receive = false;
    bool adaptive_send = false;
};

struct TimeStamping {
    bool receive_software = false;
    bool send_software = false;
    bool receive_hardware = false;
    bool send_hardware = false;
    bool all_received = false;  // the hardware stamps every received frame, not only frames of PTP
    int clock = -1;             // number of /dev/ptpN; -1: none
};

struct Interrupt {
    unsigned number = 0;
    std::string name{};
    std::string cpus{};  // as the kernel writes it: "0-3"
};

// Whether frames can leave at a time (SO_TXTIME), by the queueing disciplines of the interface.
struct SendingAtATime {
    enum class Holder : std::uint8_t { nobody, kernel, nic };
    Holder holder = Holder::nobody;
    std::string qdisc{};  // the queueing discipline that decides; empty: there is none
    std::string why{};    // why frames are not held
};

struct InterfaceFacts {
    std::string name{};
    int index = 0;
    bool up = false;
    std::optional<bool> carrier{};
    int mtu = 0;
    std::optional<std::string> driver{};
    std::string kind{};    // of a virtual interface: veth, bridge, bond, vlan; empty: hardware
    std::string master{};  // the bridge or bond that it belongs to; empty: none
    bool wireless = false;
    std::optional<std::uint32_t> speed_mbit{};
    std::optional<bool> full_duplex{};
    std::optional<bool> gro{};    // generic receive offload
    std::optional<bool> lro{};    // large receive offload
    std::optional<bool> eee{};    // Energy Efficient Ethernet is active
    std::optional<bool> pause{};  // flow control
    std::optional<Coalescing> coalescing{};
    std::optional<std::vector<Interrupt>> interrupts{};
    std::optional<std::vector<IrqThread>> irq_threads{};  // of the interrupts; not only of this network namespace
    std::optional<std::string> qdisc{};
    std::optional<SendingAtATime> send_at{};
    std::optional<TimeStamping> time_stamping{};
    std::vector<std::string> addresses{};         // IP addresses, as text
    std::optional<bool> ipv6{};                   // IPv6 is on
    std::optional<bool> network_manager{};        // manages the interface
    std::optional<bool> systemd_networkd{};       // manages the interface
    std::optional<std::string> xdp_mode{};        // the best one that was accepted
    std::string xdp_refusal{};                    // why there is none; empty as well: not tried
    std::map<std::string, std::string> unread{};  // name of a fact, and why it was not read
};

struct SleepState {
    std::string name{};
    std::uint32_t latency_us = 0;
    bool disabled = false;
};

struct MachineFacts {
    std::string kernel{};  // release
    std::optional<bool> preempt_rt{};
    bool preemptible = false;                               // the next best kernel
    unsigned processors = 0;                                // online
    std::optional<std::string> isolated{};                  // list of processors; empty: none
    std::optional<std::vector<std::string>> governors{};    // each one once
    std::optional<std::vector<SleepState>> sleep_states{};  // of processor 0
    std::optional<bool> latency_settable{};                 // /dev/cpu_dma_latency can be written
    std::optional<long> realtime_runtime_us{};              // sched_rt_runtime_us; -1: no limit
    std::optional<bool> hyper_threading{};
    std::optional<std::string> clock_source{};
    bool virtual_machine = false;
    bool irqbalance = false;                             // runs
    std::optional<std::uint64_t> locked_memory_limit{};  // octets; UINT64_MAX: none
    std::optional<std::uint64_t> priority_limit{};       // RLIMIT_RTPRIO
    std::optional<std::uint64_t> capabilities{};         // effective, bits as in linux/capability.h
};

struct ProbeFacts {
    std::uint64_t sent = 0;
    std::uint64_t returned = 0;  // processed by at least one slave
    std::uint64_t echoes = 0;    // came back without having been processed
    std::uint16_t slaves = 0;    // working counter of the last reply
    DurationHistogram round_trip{};
    std::string problem{};  // why nothing was sent
};

struct Facts {
    InterfaceFacts interface {};
    MachineFacts machine{};
    std::optional<ProbeFacts> probe{};
};

}  // namespace margay::nic_check
