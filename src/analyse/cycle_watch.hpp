// Frames with process data: their intervals and their working counters.
#pragma once

#include "analyse/exchanges.hpp"
#include "analyse/interval_statistics.hpp"

namespace margay::analyse {

class CycleWatch {
  public:
    explicit CycleWatch(Analysis& analysis) : analysis_(analysis) {}
    // Call it when a frame was sent; in a recording with only replies, when it came back.
    void sent(const KeptFrame& request);
    // Call it when a frame has come back, or was given up.
    void frame(const KeptFrame& request, bool answered, bool late);
    // Call it for each datagram of the frame of the last call of frame().
    void datagram(const Exchanged& e);
    // Call it at the end of the recording.
    void finish();

  private:
    struct Track {
        std::size_t number = 0;  // in Analysis::cyclic
        IntervalStatistics intervals{};
        std::vector<std::optional<std::size_t>> shortfalls{};  // shortfalls that have not ended, by datagram
    };
    [[nodiscard]] Track* track_of(const KeptFrame& request);
    void short_of(Track& track, std::size_t datagram, const Exchanged& e);

    Analysis& analysis_;
    std::map<std::uint64_t, Track> tracks_{};
    Track* present_ = nullptr;
    std::size_t next_ = 0;  // datagram of the present frame
};

}  // namespace margay::analyse
