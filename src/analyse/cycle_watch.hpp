// Frames with process data: their intervals and their working counters.
#pragma once

#include "analyse/exchanges.hpp"
#include "analyse/interval_statistics.hpp"

namespace margay::analyse {

class CycleWatch {
  public:
    explicit CycleWatch(Analysis& analysis) : analysis_(analysis) {}
    // A frame was sent; with replies only, it came back.
    void sent(const KeptFrame& request);
    // A frame has come back, or was given up.
    void frame(const KeptFrame& request, bool answered, bool late);
    // A datagram of the frame of the last call of frame().
    void datagram(const Exchanged& e);
    // The recording is over.
    void finish();

  private:
    struct Track {
        std::size_t number = 0;  // in Analysis::cyclic
        IntervalStatistics intervals{};
        std::vector<std::optional<std::size_t>> shortfalls{};  // that are not over, by datagram
    };
    [[nodiscard]] Track* track_of(const KeptFrame& request);
    void short_of(Track& track, std::size_t datagram, const Exchanged& e);

    Analysis& analysis_;
    std::map<std::uint64_t, Track> tracks_{};
    Track* present_ = nullptr;
    std::size_t next_ = 0;  // datagram of the present frame
};

}  // namespace margay::analyse
