// ecrt_slave_config_…(): the settings of a slave, except PDOs (pdo_config.cpp) and requests.
#include "compat/ecrt/slave_config.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"

#include <cerrno>
#include <chrono>

using namespace margay;
using namespace margay::compat::ecrt;

ec_slave_config::ec_slave_config(Bus& owner, std::uint16_t its_alias, std::uint16_t its_position,
                                 std::uint32_t its_vendor, std::uint32_t its_product)
    : bus(owner), alias(its_alias), position(its_position), vendor(its_vendor), product(its_product) {}
ec_slave_config::~ec_slave_config() = default;

bool margay::compat::ecrt::refuse_active(const ec_slave_config& config) {
    if (config.bus.active) say("configuration %u:%u: the master is active", config.alias, config.position);
    return config.bus.active;
}

// While the master is active, the call waits for nothing.
Change::Change(ec_slave_config& config) {
    if (!config.bus.active) {
        before_activation_ = std::shared_lock(config.bus.configuring);
        alone_ = std::unique_lock(config.changing);
    }
    refused_ = refuse_active(config);
}

namespace {

int add_write(ec_slave_config& config, StartupWrite write, const std::uint8_t* data, std::size_t size) {
    if (data == nullptr && size != 0) {
        say("configuration %u:%u: 0x%04x: %zu octets are wanted, and there is no memory", config.alias, config.position,
            write.index, size);
        return -EINVAL;
    }
    if (!may_have(config, size)) return -ENOMEM;
    const Change change(config);
    if (change.refused()) return -EBUSY;
    const auto* octets = reinterpret_cast<const std::byte*>(data);
    write.data.assign(octets, octets + size);
    config.startup.push_back(std::move(write));
    return 0;
}

template <class T>
int add_value(ec_slave_config_t* sc, std::uint16_t index, std::uint8_t subindex, T value) {
    const auto octets = octets_of(value);
    return add_write(*sc, {.index = index, .subindex = subindex, .data = {}},
                     reinterpret_cast<const std::uint8_t*>(octets.data()), octets.size());
}

}  // namespace

extern "C" {

int ecrt_slave_config_watchdog(ec_slave_config_t* sc, uint16_t watchdog_divider, uint16_t watchdog_intervals) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    if (watchdog_divider != 0) sc->times.watchdog_divider = watchdog_divider;
    sc->watchdog_intervals = watchdog_intervals;
    return 0;
}

int ecrt_slave_config_dc(ec_slave_config_t* sc, uint16_t assign_activate, uint32_t sync0_cycle, int32_t sync0_shift,
                         uint32_t sync1_cycle, int32_t) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    sc->dc = {true, assign_activate, sync0_cycle, sync0_shift, sync1_cycle};
    return 0;
}

int ecrt_slave_config_sdo(ec_slave_config_t* sc, uint16_t index, uint8_t subindex, const uint8_t* data, size_t size) {
    return add_write(*sc, {.index = index, .subindex = subindex, .data = {}}, data, size);
}

int ecrt_slave_config_sdo8(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint8_t value) {
    return add_value(sc, sdo_index, sdo_subindex, value);
}

int ecrt_slave_config_sdo16(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint16_t value) {
    return add_value(sc, sdo_index, sdo_subindex, value);
}

int ecrt_slave_config_sdo32(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint32_t value) {
    return add_value(sc, sdo_index, sdo_subindex, value);
}

int ecrt_slave_config_complete_sdo(ec_slave_config_t* sc, uint16_t index, const uint8_t* data, size_t size) {
    return add_write(*sc, {.complete = true, .index = index, .data = {}}, data, size);
}

int ecrt_slave_config_idn(ec_slave_config_t* sc, uint8_t drive_no, uint16_t idn, ec_al_state_t state,
                          const uint8_t* data, size_t size) {
    if (drive_no > 7 || (state != EC_AL_STATE_PREOP && state != EC_AL_STATE_SAFEOP)) {
        if (drive_no > 7)
            say("configuration %u:%u: IDN 0x%04x: there is no drive %u", sc->alias, sc->position, idn, drive_no);
        else
            say("configuration %u:%u: IDN 0x%04x: it can be written in PREOP (2) or SAFEOP (4), not in %d", sc->alias,
                sc->position, idn, static_cast<int>(state));
        return -EINVAL;
    }
    return add_write(*sc, {.parameter = true, .index = idn, .subindex = drive_no, .state = state, .data = {}}, data,
                     size);
}

int ecrt_slave_config_emerg_size(ec_slave_config_t* sc, size_t elements) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    if (elements > EmergencyRing::kMost) {
        say("configuration %u:%u: %zu emergencies are wanted, %u are possible", sc->alias, sc->position, elements,
            EmergencyRing::kMost);
        return -ENOMEM;
    }
    sc->emergency_memory.assign(elements, {});
    sc->emergencies.use(sc->emergency_memory);
    return 0;
}

int ecrt_slave_config_emerg_pop(ec_slave_config_t* sc, uint8_t* target) {
    const auto one = sc->emergencies.take();
    if (!one) return -ENOENT;
    target[0] = static_cast<std::uint8_t>(one->code);
    target[1] = static_cast<std::uint8_t>(one->code >> 8);
    target[2] = one->error_register;
    for (std::size_t n = 0; n < one->data.size(); ++n) target[3 + n] = static_cast<std::uint8_t>(one->data[n]);
    return 0;
}

int ecrt_slave_config_emerg_clear(ec_slave_config_t* sc) {
    while (sc->emergencies.take()) {
    }
    sc->emergencies_cleared = sc->emergencies.dropped();
    return 0;
}

int ecrt_slave_config_emerg_overruns(const ec_slave_config_t* sc) {
    return static_cast<int>(sc->emergencies.dropped() - sc->emergencies_cleared);
}

int ecrt_slave_config_state(const ec_slave_config_t* sc, ec_slave_config_state_t* state) {
    std::uint32_t now = sc->state.load(std::memory_order_relaxed);
    if (!sc->bus.active) {
        Slave slave;
        const bool found = sc->bus.slave_of(*sc, slave);
        now = found ? 1U | static_cast<std::uint32_t>(slave.al.state) << 4 : 0;
    }
    state->online = now & 1U;
    state->operational = (now >> 1) & 1U;
    state->al_state = (now >> 4) & 0xFU;
    return 0;
}

int ecrt_slave_config_state_timeout(ec_slave_config_t* sc, ec_al_state_t from_state, ec_al_state_t to_state,
                                    unsigned int timeout_ms) {
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    const Duration time = std::chrono::milliseconds(timeout_ms);
    if (to_state < from_state)
        sc->times.down = time;
    else if (from_state == EC_AL_STATE_INIT && to_state == EC_AL_STATE_PREOP)
        sc->times.to_preop = time;
    else if (from_state == EC_AL_STATE_PREOP && to_state == EC_AL_STATE_SAFEOP)
        sc->times.to_safeop = time;
    else if (from_state == EC_AL_STATE_SAFEOP && to_state == EC_AL_STATE_OP)
        sc->times.to_op = time;
    else {
        say("configuration %u:%u: a slave does not go from state %d to state %d", sc->alias, sc->position,
            static_cast<int>(from_state), static_cast<int>(to_state));
        return -EINVAL;
    }
    return 0;
}

}  // extern "C"
