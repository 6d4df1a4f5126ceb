// Distributed clocks. The cycle of the first group distributes the time of the reference clock to all other clocks. If
// no domain is exchanged, separate datagrams distribute it.
#include "compat/ecrt/bus.hpp"

#include <cerrno>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

bool cycle_carries_time(const Bus& bus) { return !bus.exchanges.empty() && bus.exchanges.front()->mapped; }
bool has_clock(const Bus& bus) { return bus.active && bus.operation->has_clock(); }

int sync_to(Bus& bus, std::uint64_t time_ns) {
    if (!has_clock(bus)) return 0;
    bus.clocks_due |= Bus::kDatagramsWait;
    const auto begun = bus.clocks->sync_reference_clock_to(time_ns);
    return begun || begun.error().code == Errc::busy ? 0 : -EIO;
}

}  // namespace

extern "C" {

int ecrt_master_application_time(ec_master_t* master, uint64_t app_time) {
    Bus& bus = *master->bus;
    bus.app_time.now_ns.store(app_time, std::memory_order_relaxed);
    if (bus.active && bus.operation->running()) [[likely]]
        return 0;
    bus.app_time.at = bus.source->osal().now();
    bus.app_time.at_ns = app_time;
    if (!bus.app_time.known) {
        bus.app_time.first_ns = app_time;
        bus.app_time.known = true;
    }
    return 0;
}

int ecrt_master_sync_reference_clock(ec_master_t* master) {
    return sync_to(*master->bus, master->bus->app_time.now_ns.load(std::memory_order_relaxed));
}

int ecrt_master_sync_reference_clock_to(ec_master_t* master, uint64_t sync_time) {
    return sync_to(*master->bus, sync_time);
}

int ecrt_master_sync_slave_clocks(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!has_clock(bus)) return 0;
    if (cycle_carries_time(bus)) {
        bus.clocks_due |= Bus::kTimeWanted;  // ecrt_master_send() knows whether the first domain is exchanged
        return 0;
    }
    bus.clocks_due |= Bus::kDatagramsWait;
    (void)bus.clocks->sync_slave_clocks();
    return 0;
}

int ecrt_master_reference_clock_time(const ec_master_t* master, uint32_t* time) {
    std::uint64_t all = 0;
    const int error = ecrt_master_64bit_reference_clock_time(const_cast<ec_master_t*>(master), &all);
    if (error == 0) *time = static_cast<std::uint32_t>(all);
    return error;
}

int ecrt_master_64bit_reference_clock_time(ec_master_t* master, uint64_t* time) {
    Bus& bus = *master->bus;
    if (!has_clock(bus)) return -ENXIO;
    if (cycle_carries_time(bus) && bus.time_rides) {
        const RegisterReading& reading = bus.ctx->group(bus.exchanges.front()->group).dc_time;
        if (!reading.came || reading.slaves == 0) return -EIO;
        *time = reading.value;
        return 0;
    }
    const auto read = bus.clocks->reference_clock_time64();
    if (!read) return read.error().code == Errc::no_clock ? -ENXIO : -EIO;
    *time = *read;
    return 0;
}

void ecrt_master_64bit_reference_clock_time_queue(ec_master_t* master) { (void)ecrt_master_sync_slave_clocks(master); }

int ecrt_master_sync_monitor_queue(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!has_clock(bus)) return 0;
    bus.clocks_due |= Bus::kDatagramsWait;
    (void)bus.clocks->queue_sync_monitor();
    return 0;
}

uint32_t ecrt_master_sync_monitor_process(const ec_master_t* master) {
    const Bus& bus = *master->bus;
    if (!has_clock(bus)) return 0xFFFFFFFF;
    const auto difference = bus.clocks->process_sync_monitor();
    return difference ? *difference & 0x7FFFFFFFU : 0xFFFFFFFFU;
}

}  // extern "C"
