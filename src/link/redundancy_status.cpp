// What both cables together are to the link and to the application.
#include "link/redundancy.hpp"

#include <algorithm>

namespace margay {

LinkState Redundancy::link_state() noexcept {
    const LinkState one = nics_[0]->link_state();
    const LinkState two = nics_[1]->link_state();
    if (one == LinkState::down) return two;
    return two == LinkState::down || two == one ? one : LinkState::up;
}

Time Redundancy::next_arrival() const noexcept { return std::min(nics_[0]->next_arrival(), nics_[1]->next_arrival()); }

int Redundancy::last_error() const noexcept {
    const int error = nics_[0]->last_error();
    return error != 0 ? error : nics_[1]->last_error();
}

bool Redundancy::counts_are_new() const noexcept { return count_is_new_[0] && count_is_new_[1]; }

RedundancyStatus Redundancy::status() const noexcept {
    RedundancyStatus status;
    status.redundant = true;
    status.ring = ring_;
    status.fault = fault_;
    status.swapped = head() == 1;
    status.breaks = breaks_;
    status.heals = heals_;
    status.merged = merged_;
    status.repeated = repeated_;
    for (unsigned nic = 0; nic < 2; ++nic) {
        const Counters& from = counters_[nic];
        status.cables[nic] = {.link = nics_[nic]->link_state(),
                              .slaves = reached_by(nic),
                              .sent = from.sent.load(std::memory_order_relaxed),
                              .refused = from.refused.load(std::memory_order_relaxed),
                              .received = from.received.load(std::memory_order_relaxed),
                              .lost = from.lost.load(std::memory_order_relaxed),
                              .late = from.late.load(std::memory_order_relaxed)};
    }
    return status;
}

}  // namespace margay
