// Collects the facts that the packets of one master show. Nothing is sent.
//
// The memory is bounded by the number of slaves and conversations, see the limits in analysis.hpp, and does not depend
// on the length of the recording. recording.hpp reads files.
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

// Deletes the numbers of lost frames, for a recording in which a missing reply does not mean a lost frame.
void forget_losses(Analysis& analysis);

class Analyser {
  public:
    Analyser();
    Analyser(const Analyser&) = delete;
    Analyser& operator=(const Analyser&) = delete;

    // Call it for each packet of the recording, in their order. `length_on_wire` is larger than the packet if the
    // recorder has cut the packet. Octets of any kind are accepted.
    void packet(Moment when, Bytes packet, std::size_t length_on_wire);
    // Call once, after all packets.
    [[nodiscard]] Analysis finish();
    // How many packets with EtherCAT frames were earlier than the previous one, and the number of the first of these
    // packets.
    [[nodiscard]] std::uint64_t steps_back() const { return steps_back_; }
    [[nodiscard]] std::uint64_t first_step_back() const { return first_step_back_; }

  private:
    void sent(const KeptFrame& request);
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
    std::uint64_t steps_back_ = 0;
    std::uint64_t first_step_back_ = 0;
};

}  // namespace margay::analyse
