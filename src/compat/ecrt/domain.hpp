// Domains, and how their data is exchanged.
//
// A domain is memory of its own: SyncManagers one after the other, in the order in which the program registers their
// entries, so that the offset of an entry is known at once. The library exchanges groups. Domains that have a slave in
// common are exchanged by one group, because a slave belongs to one group; all others have a group each.
// ecrt_domain_process() copies inputs from the image of the group, and ecrt_master_send() copies outputs into it.
#pragma once

#include "compat/ecrt/copies.hpp"

#include <margay/result.hpp>
#include <margay/time.hpp>

#include <ecrt.h>

#include <atomic>
#include <cstdint>
#include <vector>

namespace margay::compat::ecrt {

class Bus;

// A SyncManager of a slave in a domain.
struct DomainPart {
    ec_slave_config* config = nullptr;
    std::uint8_t sync_manager = 0;
    bool output = false;
    std::uint32_t offset = 0;
    std::uint32_t bytes = 0;
    unsigned share = 0;   // share of the working counter, see plan_counters()
    bool placed = false;  // the image of the group contains its data
};

// The state of a domain after a cycle, as the program reads it.
struct Judgement {
    unsigned working_counter = 0;
    ec_wc_state_t wc_state = EC_WC_ZERO;
};

// The result of the last cycle of a group.
enum class Answer : std::uint8_t {
    complete,
    incomplete,  // or not sent
    on_wire,     // sent and not received yet
};

// The exchange of one group of the library, with the domains that it serves.
struct Exchange {
    std::uint8_t group = 0;
    bool mapped = false;
    bool held = false;    // a device has moved to another position, so nothing is sent: see moves.cpp
    bool wanted = false;  // a domain was queued since the last send
    Answer answer = Answer::complete;
    // Result of a cycle without errors: complete while all configurations of its domains take part.
    Answer best = Answer::incomplete;
    std::uint32_t answers = 0;
    std::vector<ec_domain*> domains;
    std::vector<std::byte> image;
};

}  // namespace margay::compat::ecrt

struct ec_domain {
    explicit ec_domain(margay::compat::ecrt::Bus& owner) : bus(owner) {}

    margay::compat::ecrt::Bus& bus;
    std::vector<margay::compat::ecrt::DomainPart> parts;
    std::atomic<std::uint32_t> size{0};        // changed with the parts; for all threads
    margay::compat::ecrt::Judgement complete;  // if all slaves take part

    // After activation.
    std::uint8_t* data = nullptr;
    std::vector<std::uint8_t> memory;
    margay::compat::ecrt::Exchange none;  // before activation
    margay::compat::ecrt::Exchange* exchange = &none;
    margay::compat::ecrt::Copies outputs;
    margay::compat::ecrt::Copies inputs;
    bool queued = false;
    std::uint32_t seen = 0;  // Exchange::answers at the last process
    margay::compat::ecrt::Judgement state;
};

namespace margay::compat::ecrt {

// Plans the copies of a domain, after the group was mapped. For the owner of the context.
void plan_copies(Bus& bus, ec_domain& domain);
// Counts `complete` as the interface does: a domain is cut into datagrams between SyncManagers; in
// a datagram with both directions a slave counts 2 for outputs and 1 for inputs, otherwise 1.
void plan_counters(ec_domain& domain);
// The state of a domain whose cycle is not complete. For the owner of the context.
void judge(ec_domain& domain);
// Sets Exchange::best. The library leaves slaves that may be away out of the working counters that it expects, and a
// domain is complete only with all its configurations. For the owner of the context.
void update_best(const Bus& bus, Exchange& exchange);

}  // namespace margay::compat::ecrt
