// Finds out which master has made the recording, by habits that only one master has.
#pragma once

#include "analyse/slave_tracks.hpp"

#include <set>

namespace margay::analyse {

class Manners {
  public:
    explicit Manners(Analysis& analysis) : analysis_(analysis) {}
    void frame(Bytes request);  // a request; in a recording without requests, a reply
    void datagram(const Exchanged& e);
    void finish();

  private:
    Analysis& analysis_;
    std::set<std::array<std::uint8_t, 6>> addresses_{};
    std::uint8_t greatest_index_ = 0;
    std::optional<std::uint16_t> first_station_{};  // the first station address that was assigned
    std::uint64_t link_looks_ = 0;                  // FPRD of the octet 0x0111
    std::uint64_t status_looks_ = 0;                // FPRD of 6 octets from 0x0130
    std::uint64_t sii_triples_ = 0;                 // FPRD of 10 octets from 0x0502
    std::uint64_t sii_commands_ = 0;                // FPWR of 4 octets to 0x0502
    bool margay_reset_ = false;                     // a frame in which Margay resets all slaves
};

}  // namespace margay::analyse
