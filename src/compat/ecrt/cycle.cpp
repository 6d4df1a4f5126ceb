// The cyclic calls. None of them waits, and in the running state none allocates.
#include "compat/ecrt/bus.hpp"

#include <cerrno>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

// A negative timeout: what is not back stays on the wire.
constexpr Duration kDoNotWait{-1};

// Another thread has begun to exchange frames; the program has synchronised both.
[[gnu::noinline]] void change_owner(Bus& bus) {
    (void)take_ownership(*bus.ctx);
    bus.owner = pthread_self();
    bus.cycling = true;
}
inline void be_owner(Bus& bus) {
    if (pthread_equal(bus.owner, pthread_self()) == 0) [[unlikely]]
        change_owner(bus);
}

inline void receive_group(Bus& bus, Exchange& exchange, Duration timeout) {
    const auto counter = receive_processdata(*bus.ctx, timeout, exchange.group);
    if (!counter && counter.error().code == Errc::invalid_argument) return;  // still on the wire
    exchange.on_wire = false;
    exchange.complete = counter.ok();
    ++exchange.answers;
}

void send_group(Bus& bus, Exchange& exchange, Time now) {
    if (exchange.on_wire) [[unlikely]]
        receive_group(bus, exchange, Duration{0});  // it comes too late
    for (ec_domain* domain : exchange.domains) {
        if (!domain->queued) continue;
        domain->queued = false;
        domain->outputs.execute();
    }
    exchange.wanted = false;
    exchange.on_wire = send_processdata(*bus.ctx, now, exchange.group).ok();
}

[[gnu::noinline]] void step_up(Bus& bus, Time now) {
    if (!bus.operation->running())
        bus.operation->step(now);
    else
        bus.operation->check(now);
    if (bus.dirty || now >= bus.refresh_at) bus.refresh_facts(now);
}

}  // namespace

extern "C" {

int ecrt_master_receive(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!bus.active.load(std::memory_order_relaxed)) return 0;
    be_owner(bus);
    for (const auto& exchange : bus.exchanges)
        if (exchange->on_wire) receive_group(bus, *exchange, kDoNotWait);
    const Time now = bus.source->osal().now();
    poll(*bus.ctx, now);
    if (!bus.operation->running() || bus.dirty.load(std::memory_order_relaxed) || now >= bus.refresh_at) [[unlikely]]
        step_up(bus, now);
    return 0;
}

int ecrt_master_send(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!bus.active.load(std::memory_order_relaxed)) return 0;
    be_owner(bus);
    const Time now = bus.source->osal().now();
    if (bus.clocks_pending || !bus.operation->running()) {
        bus.clocks_pending = false;
        poll(*bus.ctx, now);
    }
    for (const auto& exchange : bus.exchanges)
        if (exchange->mapped && (exchange->wanted || exchange->domains.empty())) send_group(bus, *exchange, now);
    return 0;
}

int ecrt_domain_queue(ec_domain_t* domain) {
    if (domain->exchange == nullptr) return 0;
    domain->queued = true;
    domain->exchange->wanted = true;
    return 0;
}

int ecrt_domain_process(ec_domain_t* domain) {
    const Exchange* exchange = domain->exchange;
    if (exchange == nullptr) return 0;
    if (exchange->on_wire) [[unlikely]] {  // nothing has come back
        domain->state.working_counter = 0;
        domain->state.wc_state = EC_WC_ZERO;
        return 0;
    }
    if (domain->seen == exchange->answers) return 0;
    domain->seen = exchange->answers;
    if (exchange->complete) {
        domain->inputs.execute();
        domain->state.working_counter = domain->expected;
        domain->state.wc_state = domain->expected != 0 ? EC_WC_COMPLETE : EC_WC_ZERO;
    } else {
        judge(*domain);
    }
    return 0;
}

int ecrt_domain_state(const ec_domain_t* domain, ec_domain_state_t* state) {
    *state = domain->state;
    return 0;
}

size_t ecrt_domain_size(const ec_domain_t* domain) { return domain->size; }

uint8_t* ecrt_domain_data(const ec_domain_t* domain) { return domain->data; }

int ecrt_master_state(const ec_master_t* master, ec_master_state_t* state) {
    const Bus& bus = *master->bus;
    state->slaves_responding = bus.responding.load(std::memory_order_relaxed);
    state->al_states = bus.al_states.load(std::memory_order_relaxed) & 0xFU;
    state->link_up = bus.link_up.load(std::memory_order_relaxed);
    return 0;
}

int ecrt_master_link_state(const ec_master_t* master, unsigned int dev_idx, ec_master_link_state_t* state) {
    if (dev_idx != 0) return -EINVAL;  // there is no second link
    const Bus& bus = *master->bus;
    state->slaves_responding = bus.responding.load(std::memory_order_relaxed);
    state->al_states = bus.al_states.load(std::memory_order_relaxed) & 0xFU;
    state->link_up = bus.link_up.load(std::memory_order_relaxed);
    return 0;
}

// The supervision configures slaves with errors again and again. Before activation: a new scan.
int ecrt_master_reset(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!bus.active) bus.as_owner([&] { bus.search.again = true; });
    return 0;
}

}  // extern "C"
