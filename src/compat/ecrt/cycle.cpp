// The cyclic calls. None of them waits, and in the running state none allocates.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/requests.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

// A negative timeout: frames that have not returned stay on the wire.
constexpr Duration kDoNotWait{-1};

// Another thread has begun to exchange frames; the program has synchronised both.
// False: a handle that was only opened does not exchange process data.
[[gnu::noinline]] bool change_owner(const ec_master_t& master) {
    if (!master.reserved) return false;
    Bus& bus = *master.bus;
    (void)take_ownership(*bus.ctx);
    bus.steady.thread = 0;
    bus.owner.store(pthread_self(), std::memory_order_relaxed);
    bus.cycling = true;
    return true;
}
inline bool be_owner(const ec_master_t& master) {
    if (!master.bus->is_owner()) [[unlikely]]
        return change_owner(master);
    return true;
}

[[gnu::noinline]] void note_incomplete(Exchange& exchange, Errc error) {
    if (error == Errc::invalid_argument) return;  // still on the wire
    exchange.answer = Answer::incomplete;
    ++exchange.answers;
}

inline void receive_group(Context& ctx, Exchange& exchange, Duration timeout) {
    const auto counter = receive_processdata(ctx, timeout, exchange.group);
    if (!counter) [[unlikely]]
        return note_incomplete(exchange, counter.error().code);
    exchange.answer = exchange.best;
    ++exchange.answers;
}

// Gives up the frames of the last cycle, which are late.
[[gnu::noinline]] void give_up(Context& ctx, Exchange& exchange) { receive_group(ctx, exchange, Duration{0}); }

inline void send_frames(Context& ctx, Exchange& exchange, Time now) {
    if (!send_processdata(ctx, now, exchange.group)) [[unlikely]]
        return note_incomplete(exchange, Errc::nic);  // no frame was sent
    exchange.answer = Answer::on_wire;
}

bool is_sent(const Exchange& exchange) {
    return exchange.mapped && !exchange.held && (exchange.wanted || exchange.domains.empty());
}

// The frames of the first group carry the time of the reference clock. In a cycle without them a datagram does.
inline void carry_time(Bus& bus) {
    bus.clocks_due &= static_cast<std::uint8_t>(~Bus::kTimeWanted);
    bus.time_rides = is_sent(*bus.exchanges.front());
    if (bus.time_rides) [[likely]]
        return;
    bus.clocks_due |= Bus::kDatagramsWait;
    (void)bus.clocks->sync_slave_clocks();
}

void send_group(Bus& bus, Exchange& exchange, Time now) {
    if (exchange.answer == Answer::on_wire) [[unlikely]]
        give_up(*bus.ctx, exchange);
    for (ec_domain* domain : exchange.domains) {
        if (!domain->queued) continue;
        domain->queued = false;
        domain->outputs.execute();
    }
    exchange.wanted = false;
    send_frames(*bus.ctx, exchange, now);
}

[[gnu::noinline]] int process_incomplete(ec_domain& domain) {
    const Exchange& exchange = *domain.exchange;
    if (exchange.answer == Answer::on_wire) {  // nothing has come back
        domain.state = {};
    } else if (domain.seen != exchange.answers) {
        domain.seen = exchange.answers;
        judge(domain);
    }
    return 0;
}

// No cycle is sent any more: the domains are ZERO.
void rest(Context& ctx, Exchange& exchange) {
    if (exchange.answer == Answer::on_wire) give_up(ctx, exchange);
    exchange.answer = Answer::incomplete;
    ++exchange.answers;
}

// The calls of this thread may execute the fast path.
void be_steady(Bus& bus) {
    bus.steady.thread = 0;
    if (!bus.operation->running() || bus.operation->starting() || bus.exchanges.size() != 1) return;
    Exchange& exchange = *bus.exchanges.front();
    if (!exchange.mapped || exchange.held || exchange.domains.size() != 1) return;
    bus.ctx->group(exchange.group).config.acyclic_bytes = GroupConfiguration{}.acyclic_bytes;
    bus.steady = {.thread = this_thread(),
                  .ctx = bus.ctx.get(),
                  .osal = &bus.source->osal(),
                  .exchange = &exchange,
                  .domain = exchange.domains.front()};
}

// Slaves respond again when the states of all have been read since the end of the silence. A reading that began before
// the end of the silence does not count. Neither does a reading that fails, for example because a frame was lost.
void read_after_silence(Bus& bus) {
    Bus::Return& back = bus.returning;
    if (back.states.busy()) return;
    if (!back.reading || back.states.state() != RequestState::success) {
        back.reading = submit(*bus.ctx, back.states).ok();
        return;
    }
    back.waited_for = false;
    bus.silent = false;
    bus.dirty = true;
}

[[gnu::noinline]] void step_up(Bus& bus, Time now) {
    if (!bus.operation->running())
        bus.operation->step(now);
    else
        bus.operation->check(now);
    for (const auto& exchange : bus.exchanges)
        if (exchange->held) rest(*bus.ctx, *exchange);
    if (bus.returning.waited_for) read_after_silence(bus);
    const bool changed = bus.dirty;
    if (changed || now >= bus.facts_at) bus.refresh_facts(now);
    begin_waiting(bus);
    bus.refresh_at = bus.returning.waited_for ? Time{} : std::min(bus.facts_at, bus.operation->look_at());
    for (const auto& exchange : bus.exchanges)
        if (changed || exchange->best != Answer::complete) update_best(bus, *exchange);
    be_steady(bus);
}

[[gnu::noinline]] int receive_all(const ec_master_t& master) {
    Bus& bus = *master.bus;
    if (!bus.active.load(std::memory_order_relaxed)) return 0;
    if (!be_owner(master)) return -EPERM;
    for (const auto& exchange : bus.exchanges)
        if (exchange->answer == Answer::on_wire) receive_group(*bus.ctx, *exchange, kDoNotWait);
    const Time now = bus.source->osal().now();
    poll(*bus.ctx, now);
    if (!bus.operation->running() || now >= bus.refresh_at) step_up(bus, now);
    return 0;
}

// Before the frames of the domains are sent.
[[gnu::noinline]] void send_for_clocks(Bus& bus, Time now) {
    if ((bus.clocks_due & Bus::kTimeWanted) != 0) carry_time(bus);
    if (bus.clocks_due == 0) return;
    bus.clocks_due = 0;
    poll(*bus.ctx, now);
}

// The number of octets that other datagrams may have in a cycle. While slaves start, with many mailbox messages, these
// datagrams may use half of the time that the domains leave between two cycles.
std::uint16_t room_beside(Bus& bus, Time now) {
    constexpr std::uint16_t kUsual = GroupConfiguration{}.acyclic_bytes;
    constexpr Duration kOctet{80};  // at 100 Mbit/s
    constexpr Duration::rep kFrame = 84;
    const Duration before = std::exchange(bus.interval, now - std::exchange(bus.sent_at, now));
    if (!bus.operation->starting()) return kUsual;
    Duration::rep left = std::min(before, bus.interval) / kOctet;
    for (const auto& exchange : bus.exchanges) {
        left -= kFrame;
        for (const ec_domain* domain : exchange->domains) left -= static_cast<Duration::rep>(domain->size);
    }
    return static_cast<std::uint16_t>(std::clamp<Duration::rep>(left / 2, kUsual, 6 * kUsual));
}

[[gnu::noinline]] int send_all(const ec_master_t& master) {
    Bus& bus = *master.bus;
    if (!bus.active.load(std::memory_order_relaxed)) return 0;
    if (!be_owner(master)) return -EPERM;
    const Time now = bus.source->osal().now();
    if (!bus.operation->running()) bus.clocks_due |= Bus::kDatagramsWait;  // the requests of the start-up
    send_for_clocks(bus, now);
    // This limit is for the other datagrams of all groups together, because the frames of a cycle must return before
    // the next cycle.
    std::uint16_t room = room_beside(bus, now);
    for (const auto& exchange : bus.exchanges) {
        if (!is_sent(*exchange)) continue;
        bus.ctx->group(exchange->group).config.acyclic_bytes = std::exchange(room, std::uint16_t{0});
        send_group(bus, *exchange, now);
    }
    return 0;
}

}  // namespace

extern "C" {

int ecrt_master_receive(ec_master_t* master) {
    Bus& bus = *master->bus;
    const Steady& steady = bus.steady;
    if (steady.thread != this_thread()) [[unlikely]]
        return receive_all(*master);
    if (steady.exchange->answer == Answer::on_wire) [[likely]]
        receive_group(*steady.ctx, *steady.exchange, kDoNotWait);
    const Duration now = steady.osal->now().time_since_epoch();
    poll(*steady.ctx, Time(now));
    if (now >= bus.refresh_at.time_since_epoch()) [[unlikely]]
        step_up(bus, Time(now));
    return 0;
}

int ecrt_master_send(ec_master_t* master) {
    Bus& bus = *master->bus;
    const Steady& steady = bus.steady;
    if (steady.thread != this_thread()) [[unlikely]]
        return send_all(*master);
    if (bus.clocks_due != 0) [[unlikely]]
        send_for_clocks(bus, steady.osal->now());
    Exchange& exchange = *steady.exchange;
    if (!exchange.wanted) [[unlikely]]
        return 0;
    if (exchange.answer == Answer::on_wire) [[unlikely]]
        give_up(*steady.ctx, exchange);
    steady.domain->outputs.execute();
    exchange.wanted = false;
    send_frames(*steady.ctx, exchange, steady.osal->now());
    return 0;
}

int ecrt_domain_queue(ec_domain_t* domain) {
    domain->queued = true;
    domain->exchange->wanted = true;
    return 0;
}

int ecrt_domain_process(ec_domain_t* domain) {
    const Exchange* exchange = domain->exchange;
    if (exchange->answer != Answer::complete) [[unlikely]]
        return process_incomplete(*domain);
    if (domain->seen == exchange->answers) return 0;
    domain->seen = exchange->answers;
    domain->state = domain->complete;
    return domain->inputs.execute();
}

int ecrt_domain_state(const ec_domain_t* domain, ec_domain_state_t* state) {
    state->working_counter = domain->state.working_counter;
    state->wc_state = domain->state.wc_state;
    state->redundancy_active = domain->bus.ring_broken.load(std::memory_order_relaxed);
    return 0;
}

size_t ecrt_domain_size(const ec_domain_t* domain) { return domain->size; }

uint8_t* ecrt_domain_data(const ec_domain_t* domain) { return domain->data; }

int ecrt_master_state(const ec_master_t* master, ec_master_state_t* state) {
    const Bus& bus = *master->bus;
    state->slaves_responding = bus.responding.load(std::memory_order_relaxed);
    state->al_states = bus.al_states.load(std::memory_order_relaxed) & 0xFU;
    state->link_up = bus.link_up();
    return 0;
}

int ecrt_master_link_state(const ec_master_t* master, unsigned int dev_idx, ec_master_link_state_t* state) {
    const Bus& bus = *master->bus;
    if (dev_idx > 1 || (dev_idx == 1 && bus.source->second() == nullptr)) return -EINVAL;
    state->slaves_responding = bus.links[dev_idx].slaves.load(std::memory_order_relaxed);
    state->al_states = state->slaves_responding != 0 ? bus.al_states.load(std::memory_order_relaxed) & 0xFU : 0U;
    state->link_up = bus.links[dev_idx].up.load(std::memory_order_relaxed);
    return 0;
}

// The supervision configures slaves with errors again and again. Before activation: a new scan.
int ecrt_master_reset(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!bus.active) bus.ask_for_scan();
    return 0;
}

}  // extern "C"
