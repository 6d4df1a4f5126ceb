// Distributed clocks: settings, deviations, and the system time that is distributed.
#pragma once

#include "analyse/slave_tracks.hpp"

namespace margay::analyse {

class ClockWatch {
  public:
    ClockWatch(Analysis& analysis, SlaveTracks& slaves) : analysis_(analysis), slaves_(slaves) {}
    void look(const Exchanged& e, SlaveTrack* slave);
    void finish();

  private:
    void look_at_reference(const Exchanged& e, const SlaveTrack* slave);
    void add(Deviation& deviation, std::uint32_t word, Moment at);

    Analysis& analysis_;
    SlaveTracks& slaves_;
};

}  // namespace margay::analyse
