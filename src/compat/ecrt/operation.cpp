#include "compat/ecrt/operation.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/start_up.hpp"

#include <algorithm>
#include <chrono>

namespace margay::compat::ecrt {

using namespace std::chrono_literals;

namespace {

constexpr unsigned kMostWaited = 500;  // cycles for the first application time
constexpr Duration kStarting = 5s;     // a slave that needs longer does not wait for frames

// SYNC0 starts where the time since the first application time is a multiple of both cycles together, plus the shift.
// All sums are modulo 2^64: the application time may have any origin.
std::uint64_t aligned_start(std::uint16_t slave, std::uint64_t proposed_ns, void* user) {
    const Bus& bus = *static_cast<const Bus*>(user);
    for (const auto& config : bus.configs) {
        if (config->number.load(std::memory_order_relaxed) != slave) continue;
        const std::uint64_t cycle = std::uint64_t{config->dc.sync0_cycle} + config->dc.sync1_cycle;
        if (cycle == 0) break;
        const auto shift = static_cast<std::uint64_t>(std::int64_t{config->dc.sync0_shift});
        const std::uint64_t since = proposed_ns - shift - bus.app_time.first_ns;
        const std::uint64_t rest = since % cycle;
        return rest == 0 ? proposed_ns : proposed_ns + cycle - rest;
    }
    return proposed_ns;
}

}  // namespace

bool Operation::wants_clock() const {
    for (const auto& config : bus_.configs)
        if (config->dc.set && config->dc.assign_activate != 0) return true;
    return bus_.app_time.known;
}

void Operation::step(Time now) {
    switch (stage_) {
        case Stage::scan:
            if (now < retry_) return;
            if (!submit(*bus_.ctx, scan_)) {
                retry_ = now + kRetry;
                return;
            }
            bus_.scan_busy = true;
            stage_ = Stage::scanning;
            return;
        case Stage::scanning:
            if (!scan_.busy()) end_scan(now);
            return;
        case Stage::clock:
            if (wants_clock())
                begin_clock(now);
            else
                stage_ = Stage::map;
            return;
        case Stage::clocking:
            if (clock_.busy()) return;
            has_clock_ = clock_.reference != 0;
            stage_ = Stage::map;
            if (clock_.state() == RequestState::error && clock_.error().code != Errc::no_clock) {
                if (is_scanned_again(now)) return;
                say_error(bus_, "clocks", clock_.error());
                if (clock_.settings.reference == 0) return;
                say("master %u: the first clock of the ring is the reference clock", bus_.index);
                first_clock_ = true;
                stage_ = Stage::clock;
            }
            return;
        case Stage::map:
            map_.group = bus_.exchanges[map_next_]->group;
            map_.image = bus_.exchanges[map_next_]->image;
            if (submit(*bus_.ctx, map_)) stage_ = Stage::mapping;
            return;
        case Stage::mapping:
            if (!map_.busy()) end_map(now);
            return;
        case Stage::supervise:
            for (const auto& config : bus_.configs)
                allow_start(bus_.ctx->slave(config->number.load(std::memory_order_relaxed)), *config);
            supervise_.target = target_;
            starting_until_ = now + kStarting;
            if (submit(*bus_.ctx, supervise_)) stage_ = Stage::running;
            return;
        case Stage::running: return;
    }
}

// The clocks were not synchronised, because frames were lost or slaves came and went: the scan finds the slaves that
// are there.
bool Operation::is_scanned_again(Time now) {
    const Errc code = clock_.error().code;
    if ((is_own_error(code) && code != Errc::unstable) || clock_tries_ == 0) return false;
    if (clock_tries_ == kMostClockTries) {
        say_error(bus_, "clocks", clock_.error());
        say("master %u: the clocks are not synchronised: the segment is scanned again", bus_.index);
    }
    --clock_tries_;
    forget_slaves();
    stage_ = Stage::scan;
    retry_ = now + kRetry;
    return true;
}

void Operation::forget_slaves() {
    has_clock_ = false;
    for (const auto& config : bus_.configs) {
        config->number = 0;
        config->state = 0;
        if (has_whole_lists(*config)) hold_downloads(*config);
    }
    bus_.dirty = true;
}

void Operation::end_scan(Time now) {
    bus_.scan_busy = false;
    bus_.old_operations.clear();
    bus_.old_configs.clear();
    empty_ = scan_.slaves == 0 || ctx_has_no_slaves();
    if (empty_) {
        clock_tries_ = kMostClockTries;
        retry_ = now + kRetry;
        stage_ = Stage::scan;
        return;
    }
    old_expected_ = {};
    bus_.strangers.clear();
    bus_.answering = 0;
    for (const auto& config : bus_.configs) config->number = 0;
    for (const Slave& slave : bus_.ctx->slaves()) {
        if (slave.wanted == nullptr || slave.wanted->config == nullptr) {
            // Slaves without a configuration stay in PREOP.
            slave.config.highest = AlState::preop;
            continue;
        }
        for (const auto& config : bus_.configs) {
            if (slave.wanted != config->expected) continue;
            config->number = slave.number;
            config->late = place_by_lists(slave, *config);
            config->start_up = config->late ? StartUp::before_init : StartUp::over;
            // The downloads may change the objects that the mapping reads.
            if (!config->late && slave.seen) give_downloads(*config);
            prepare_start_up(slave, *config);
        }
    }
    bus_.attach_mail();
    bus_.dirty = true;
    map_next_ = 0;
    stage_ = Stage::clock;
}

// All configured slaves that are present.
bool Operation::are_started() const {
    return std::ranges::all_of(bus_.configs, [this](const auto& config) {
        const Slave& slave = bus_.ctx->slave(config->number.load(std::memory_order_relaxed));
        return slave.number == 0 || slave.al.state == AlState::none || slave.al.state == AlState::op;
    });
}

bool Operation::ctx_has_no_slaves() const {
    for (const Slave& slave : bus_.ctx->slaves())
        if (slave.ring_position != 0) return false;
    return true;
}

void Operation::begin_clock(Time now) {
    if (!bus_.app_time.known && ++waited_ < kMostWaited) return;
    if (!bus_.app_time.known && !said_time_) {
        say("master %u: no application time: SYNC signals have an arbitrary phase", bus_.index);
        said_time_ = true;
    }
    const std::uint64_t time_ns = bus_.app_time.known ? bus_.app_time.at_ns : 0;
    const Time at = bus_.app_time.known ? bus_.app_time.at : now;
    clock_.settings = {};
    clock_.settings.reference =
        bus_.reference != nullptr && !first_clock_ ? bus_.reference->number.load() : std::uint16_t{0};
    clock_.settings.group = bus_.exchanges.front()->group;
    clock_.settings.burst_frames = 1000;
    clock_.settings.limit_ns = 10000;
    clock_.settings.timeout = 5s;
    clock_.settings.system_time_at_zero =
        Duration(static_cast<Duration::rep>(time_ns - static_cast<std::uint64_t>(at.time_since_epoch().count())));
    clock_.settings.start_time = aligned_start;
    clock_.settings.start_time_user = &bus_;
    if (submit(*bus_.ctx, clock_))
        stage_ = Stage::clocking;
    else
        stage_ = Stage::map;
}

void Operation::end_map(Time now) {
    Exchange& exchange = *bus_.exchanges[map_next_];
    exchange.mapped = bus_.ctx->group(exchange.group).mapped;
    if (!exchange.mapped && map_.state() == RequestState::error && map_.error().code != Errc::invalid_argument) {
        say_error(bus_, "process data", map_.error());
        retry_ = now + kRetry;
    }
    for (ec_domain* domain : exchange.domains) {
        plan_copies(bus_, *domain);
        if (again_) domain->outputs.execute();  // also for domains that are not queued now
    }
    for (const auto& config : bus_.configs) {
        const Slave& slave = bus_.ctx->slave(config->number.load(std::memory_order_relaxed));
        if (config->group != exchange.group || !slave.place_kept) continue;
        config->late = true;
        prepare_start_up(slave, *config);
    }
    bus_.dirty = true;
    ++map_next_;
    stage_ = map_next_ < bus_.exchanges.size() ? Stage::map : Stage::supervise;
}

void Operation::cancel() {
    scan_.cancel();
    clock_.cancel();
    map_.cancel();
    supervise_.cancel();
}

}  // namespace margay::compat::ecrt
