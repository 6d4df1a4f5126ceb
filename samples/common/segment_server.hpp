// Connects a simulated segment to a real network interface: receives the frames of a master, returns the answers,
// executes commands.
#pragma once

#include "common/outer_ports.hpp"
#include "common/segment_file.hpp"
#include "common/tap_nic.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "oshw/pcap/recorder.hpp"
#include "oshw/pcap/ring_recorder.hpp"

#include <array>
#include <map>
#include <optional>
#include <string>

namespace margay::samples {

struct ServerOptions {
    std::string interface {};  // or two, with '+' between their names, for both ends of a ring
    bool tap = false;
    std::string record{};
    std::string ports{};  // prefix of the TAP devices for the Ethernet ports of devices; empty: no TAP devices
    bool quiet = false;
};

class SegmentServer {
  public:
    ~SegmentServer();

    // Returns one sentence about an error; empty when there is none.
    [[nodiscard]] std::string open(const std::string& description, const ServerOptions& options);
    // Serves until SIGINT, SIGTERM or the command "quit". Returns false after an error.
    [[nodiscard]] bool run();

  private:
    // The interface at one end of the segment.
    struct End {
        PacketNic packet;
        TapNic tap;
        Nic* nic = nullptr;
        std::string name{};
        bool linked = true;
    };

    [[nodiscard]] std::string record_to(const std::string& file);
    [[nodiscard]] std::string open_ends(const ServerOptions& options);
    void look_at_links();
    void serve(unsigned port);
    void look(std::span<const std::byte> frame);
    void print_states();
    bool read_commands();
    bool handle_signal();
    void say(const std::string& text);

    LinuxOsal osal_;
    std::unique_ptr<SimulatedSegment> simulated_;
    std::array<End, 2> ends_;
    unsigned end_count_ = 0;
    OuterPorts ports_;
    std::vector<pollfd> files_;
    std::optional<PcapRecorder> recorder_;
    std::optional<PcapRingRecorder> ring_recorder_;  // for two interfaces
    int signals_ = -1;
    bool quiet_ = false;
    bool commands_open_ = true;
    std::string pending_;                 // the beginning of a command whose line is not complete
    std::map<MacAddress, Time> masters_;  // the time of the last frame of each master
    std::vector<std::string> states_;
    std::uint64_t answered_ = 0;
    std::uint64_t lost_ = 0;
};

}  // namespace margay::samples
