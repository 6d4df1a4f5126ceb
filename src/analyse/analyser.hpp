// Reads a recording of EtherCAT traffic of any master and collects what it shows. Nothing is sent.
//
//     const auto analysis = analyse::analyse_file("recording.pcapng");
//     if (!analysis.problem.empty()) …;
//
// The memory is bounded by the number of slaves and conversations, see the limits in analysis.hpp, and does not depend
// on the length of the recording, except for eight octets a packet of a pcapng file.
#pragma once

#include "analyse/clock_watch.hpp"
#include "analyse/cycle_watch.hpp"
#include "analyse/ethercat_frame.hpp"
#include "analyse/exchanges.hpp"
#include "analyse/mail_watch.hpp"
#include "analyse/manners.hpp"
#include "analyse/slave_tracks.hpp"
#include "analyse/state_watch.hpp"

namespace margay::analyse {

class Analyser {
  public:
    Analyser();
    Analyser(const Analyser&) = delete;
    Analyser& operator=(const Analyser&) = delete;

    // A packet of the recording, in their order. `length_on_wire` is larger than the packet where the recorder has cut
    // it. Octets of any kind are accepted.
    void packet(Moment when, Bytes packet, std::size_t length_on_wire);
    // Call once, after all packets.
    [[nodiscard]] Analysis finish();

  private:
    void datagram(const Exchanged& e);

    Analysis analysis_{};
    FrameFinder finder_{};
    SlaveTracks slaves_;
    StateWatch states_;
    MailWatch mail_;
    CycleWatch cycles_;
    ClockWatch clocks_;
    Manners manners_;
    Exchanges exchanges_;
    Moment last_{};
    bool any_ = false;
    std::uint64_t steps_back_ = 0;  // EtherCAT packets that are earlier than the one before
    std::uint64_t first_step_back_ = 0;
};

// Reads a pcap or pcapng file. A file that ends in the middle of a packet is read up to there, and `remark` says so. A
// file that cannot be read, or has no EtherCAT frame, has a `problem`.
[[nodiscard]] Analysis analyse_file(const std::string& path);

}  // namespace margay::analyse
