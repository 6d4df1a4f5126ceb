// A ring with two NICs, as the network sees it: where the ring is open, and at which end each slave hangs.
#pragma once

#include "link/redundancy.hpp"
#include "network/network.hpp"

namespace margay {

class RingWatch final : public RedundancyPart {
  public:
    explicit RingWatch(const Redundancy& ring) : ring_(ring) {}
    void watch(Network& network) override;
    [[nodiscard]] Error check() const override;
    [[nodiscard]] RingParts parts() const override;
    [[nodiscard]] std::uint32_t changes() const override { return ring_.changes(); }
    [[nodiscard]] Task<Result<>> read_ports_again(Network& network, std::uint32_t changes) const override;
    [[nodiscard]] const Redundancy& ring() const { return ring_; }

  private:
    void report_break(Network& network, const RedundancyStatus& now);
    void report_fault(Network& network, CablingFault fault);

    const Redundancy& ring_;
    RingState reported_ = RingState::unknown;
    CablingFault reported_fault_ = CablingFault::none;
    bool reported_swapped_ = false;
    std::uint16_t before_ = 0;  // the slaves of the last break
    std::uint16_t behind_ = 0;
};

}  // namespace margay
