// What other threads, and calls that must not wait, know about the slaves.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/start_up.hpp"

#include <margay/redundancy.hpp>

#include <algorithm>
#include <chrono>

namespace margay::compat::ecrt {

using namespace std::chrono_literals;

namespace {

bool present(const Slave& slave) { return slave.ring_position != 0 && slave.al.state != AlState::none; }

bool same_device(const ec_slave_config& config, const Slave& slave) {
    return slave.identity.vendor == config.vendor && slave.identity.product == config.product;
}

std::uint32_t state_of(const Slave& slave, bool online, bool active) {
    if (!online) return 0;
    const auto state = static_cast<std::uint32_t>(slave.al.state);
    const bool operational = active && slave.al.state == AlState::op && !slave.al.error && !slave.held;
    return 1U | (operational ? 2U : 0U) | state << 4;
}

}  // namespace

void Bus::refresh_facts(Time now) {
    std::unique_lock lock(facts_mutex, std::try_to_lock);
    if (!lock.owns_lock()) return;  // the next call does it
    dirty = false;
    // The next regular copy is only for the link state, because all other changes are reported by events.
    facts_at = refresh_at = now + (active && operation != nullptr && operation->running() ? 500ms : 10ms);
    const auto slaves = ctx->slaves();
    if (scan_busy.load(std::memory_order_relaxed)) {
        scan_slaves.store(static_cast<std::uint32_t>(slaves.size()), std::memory_order_relaxed);
        const auto read = std::ranges::count_if(slaves, [](const Slave& slave) { return slave.seen; });
        scan_index.store(static_cast<std::uint32_t>(read), std::memory_order_relaxed);
    }
    // A scan begins with no slaves: until it is over, they are those of the scan before.
    const bool scanning = active ? operation->scanning() : search.scanning;
    if (scanning && !silent) return refresh_links(responding.load(std::memory_order_relaxed));
    facts.assign(slaves.begin(), slaves.end());
    std::uint32_t count = 0;
    std::uint32_t states = 0;
    for (const Slave& slave : slaves) {
        if (!present(slave) || silent) continue;
        ++count;
        states |= static_cast<std::uint32_t>(slave.al.state);
    }
    if (active && !silent && !strangers.empty() && answering > count) {
        count = answering;
        states |= static_cast<std::uint32_t>(AlState::init);  // they stay in INIT
    }
    responding.store(count, std::memory_order_relaxed);
    al_states.store(states, std::memory_order_relaxed);
    refresh_links(count);
    lock.unlock();
    if (!active) return;  // a program may be adding configurations; ecrt_slave_config_state() looks them up
    for (const auto& config : configs) {
        const Slave& slave = ctx->slave(config->number.load(std::memory_order_relaxed));
        const bool online =
            slave.number != 0 && present(slave) && !silent && !slave.held && same_device(*config, slave);
        config->state.store(state_of(slave, online, true), std::memory_order_relaxed);
        note_start(slave, *config);
    }
}

// `count`: slaves that are there.
void Bus::refresh_links(std::uint32_t count) {
    if (source->second() == nullptr) {
        links[0].up.store(count != 0 || source->nic().link_state() == LinkState::up, std::memory_order_relaxed);
        links[0].slaves.store(count, std::memory_order_relaxed);
        return;
    }
    const RedundancyStatus status = redundancy(*ctx);
    for (std::size_t n = 0; n < links.size(); ++n) {
        const CableStatus& cable = status.cables[n];
        links[n].up.store(cable.slaves != 0 || cable.link == LinkState::up, std::memory_order_relaxed);
        links[n].slaves.store(cable.slaves, std::memory_order_relaxed);
    }
    ring_broken.store(status.ring == RingState::broken ? 1U : 0U, std::memory_order_relaxed);
}

std::uint16_t Bus::number_at(std::uint16_t position) {
    const std::lock_guard lock(facts_mutex);
    for (const Slave& slave : facts)
        if (slave.ring_position == position + 1 && present(slave)) return slave.number;
    return 0;
}

std::string Bus::place_of(const Error& error) {
    if (error.slave == 0) return {};
    const bool anywhere =
        error.code == Errc::missing_slave && error.subindex == static_cast<unsigned>(IdentityField::alias);
    if (anywhere) return {};
    const std::lock_guard lock(facts_mutex);
    const auto found = std::ranges::find(facts, error.slave, &Slave::number);
    const bool placed = found != facts.end() && found->ring_position != 0;
    return "position " + std::to_string((placed ? found->ring_position : error.slave) - 1);
}

bool Bus::slave_at(std::uint16_t position, Slave& copy) {
    const std::lock_guard lock(facts_mutex);
    for (const Slave& slave : facts)
        if (slave.ring_position == position + 1 && present(slave)) {
            copy = slave;
            return true;
        }
    return false;
}

std::uint16_t Bus::first_with(std::uint16_t alias) {
    const std::lock_guard lock(facts_mutex);
    std::uint16_t first = 0;
    for (const Slave& slave : facts)
        if (slave.alias == alias && slave.ring_position != 0 && (first == 0 || slave.ring_position < first))
            first = slave.ring_position;
    return first;
}

bool Bus::slave_of(const ec_slave_config& config, Slave& copy) {
    const std::lock_guard lock(facts_mutex);
    if (active) {
        const std::uint16_t number = config.number.load(std::memory_order_relaxed);
        for (const Slave& slave : facts)
            if (number != 0 && slave.number == number && present(slave) && same_device(config, slave)) {
                copy = slave;
                return true;
            }
        return false;
    }
    int first = 0;  // position of the slave from which the configuration counts
    if (config.alias != 0) {
        first = -1;
        for (const Slave& slave : facts)
            if (slave.alias == config.alias && present(slave) && (first < 0 || slave.ring_position <= first))
                first = slave.ring_position - 1;
        if (first < 0) return false;
    }
    for (const Slave& slave : facts)
        if (slave.ring_position == first + config.position + 1 && present(slave) && same_device(config, slave)) {
            copy = slave;
            return true;
        }
    return false;
}

}  // namespace margay::compat::ecrt
