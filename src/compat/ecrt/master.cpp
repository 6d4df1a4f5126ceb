// The life of a master: request, activate, deactivate, release.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"
#include "compat/ecrt/segment.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <map>
#include <thread>

using namespace margay;
using namespace margay::compat;
using namespace margay::compat::ecrt;

namespace {

constexpr unsigned kMostMasters = 32;

// A handle that was only opened can only read. Only the program that has requested the master can configure it.
bool may_configure(const ec_master_t& master, const char* function) {
    if (!master.reserved)
        say("master %u: %s() needs a requested master, not an opened one", master.bus->index, function);
    return master.reserved;
}

// The masters of this process that are open.
struct Open {
    std::mutex mutex;
    std::map<unsigned, std::weak_ptr<Bus>> buses;
};
Open& open_masters() {
    static Open* const all = new Open;  // threads may still use it while the process ends
    return *all;
}

std::shared_ptr<Bus> bus_of(unsigned index) {
    Open& all = open_masters();
    if (auto known = all.buses[index].lock()) return known;
    const std::string name = bound_source(index);
    if (name.empty()) {
        const char* const file = std::getenv("MARGAY_MASTERS");
        say("master %u: no segment is bound to it: set MARGAY_MASTER%u to a network interface (eth0) or a simulated "
            "segment (sim:demo), or write that into %s",
            index, index, file != nullptr ? file : "/etc/margay/masters.conf");
        return nullptr;
    }
    auto bus = std::make_shared<Bus>(index, name);
    if (!bus->open()) return nullptr;
    all.buses[index] = bus;
    return bus;
}

ec_master* open_handle(unsigned index, bool reserve) {
    if (index >= kMostMasters) {
        say("master %u: the highest number is %u", index, kMostMasters - 1);
        return nullptr;
    }
    const std::lock_guard lock(open_masters().mutex);
    auto bus = bus_of(index);
    if (bus == nullptr) return nullptr;
    if (reserve && bus->reserved) {
        say("master %u is reserved already", index);
        return nullptr;
    }
    if (reserve) bus->reserved = true;
    return new ec_master{std::move(bus), reserve};
}

// The slaves of the context point to lists of the configurations and of the operation until the next scan has ended.
void retire(Bus& bus) {
    for (auto& config : bus.configs) {
        config->sdo_requests.clear();
        config->soe_requests.clear();
        config->foe_requests.clear();
        config->voe_handlers.clear();
        config->reg_requests.clear();
        bus.old_configs.push_back(std::move(config));
    }
    bus.configs.clear();
    if (bus.operation != nullptr) bus.old_operations.push_back(std::move(bus.operation));
}

// Ends the operation: slaves go to PREOP, the objects of the program are gone, and the idle thread continues.
void end_operation(Bus& bus) {
    if (bus.active) {
        (void)take_ownership(*bus.ctx);
        bus.operation->cancel();
        if (!bus.ctx->slaves().empty()) (void)writestate(*bus.ctx, 0, AlState::preop);
    } else {
        bus.stop_idle();
    }
    // Behind this lock other threads may become the owner where the master is not active.
    const std::lock_guard lock(bus.config_mutex);
    bus.active = false;
    bus.search.scan.cancel();
    bus.search.watch.cancel();
    retire(bus);
    bus.steady = {};
    bus.domains.clear();
    bus.exchanges.clear();
    bus.reference = nullptr;
    bus.app_time.known = false;
    bus.clocks_due = 0;
    bus.search.scanning = false;
    bus.scan_again();
    (void)expect(*bus.ctx, {});
}

// The start-up would end transfers: they have 1 s to end by themselves. The transfers use the configurations during
// this time.
std::unique_lock<std::mutex> lock_after_transfers(Bus& bus) {
    std::unique_lock lock(bus.config_mutex);
    for (int n = 0; n < 1000 && are_under_way(bus); ++n) {
        lock.unlock();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        lock.lock();
    }
    return lock;
}

// The data that the program has written into the memory before activation is kept.
void give_memory(Bus& bus) {
    for (const auto& domain : bus.domains) {
        domain->memory.resize(std::max<std::size_t>(domain->size, 1), 0);
        domain->data = domain->memory.data();
    }
}

// The scan of the start-up takes some cycles. Until it is over, the states are those from before the start-up. The
// start-up writes the lists of the program.
void take_slaves(Bus& bus) {
    for (const auto& config : bus.configs) {
        Slave slave;
        const bool online = config->expected != nullptr && bus.slave_of(*config, slave);
        if (online) forget_changed_pdos(bus, slave, *config);
        config->state = online ? 1U | static_cast<std::uint32_t>(slave.al.state) << 4 : 0U;
    }
}

}  // namespace

extern "C" {

ec_master_t* ecrt_request_master(unsigned int master_index) { return open_handle(master_index, true); }
ec_master_t* ecrt_open_master(unsigned int master_index) { return open_handle(master_index, false); }

unsigned int ecrt_version_magic(void) { return ECRT_VERSION_MAGIC; }

int ecrt_master_reserve(ec_master_t* master) {
    const std::lock_guard lock(open_masters().mutex);
    if (master->reserved) return 0;
    if (master->bus->reserved) {
        say("master %u is reserved already", master->bus->index);
        return -EBUSY;
    }
    master->reserved = master->bus->reserved = true;
    return 0;
}

void ecrt_release_master(ec_master_t* master) {
    if (master == nullptr) return;
    const std::lock_guard lock(open_masters().mutex);
    if (master->reserved) {
        const std::lock_guard no_change(master->bus->configuring);
        const Turn turn(*master->bus);
        end_operation(*master->bus);
        master->bus->reserved = false;
        if (master->bus.use_count() > 1) master->bus->start_idle();
    }
    delete master;
}

ec_domain_t* ecrt_master_create_domain(ec_master_t* master) {
    if (!may_configure(*master, "ecrt_master_create_domain")) return nullptr;
    Bus& bus = *master->bus;
    const std::lock_guard lock(bus.config_mutex);
    if (bus.active) {
        say("master %u is active: no domain can be created", bus.index);
        return nullptr;
    }
    if (bus.domains.size() >= bus.ctx->limits().groups) {
        say("master %u: %zu domains at most", bus.index, bus.domains.size());
        return nullptr;
    }
    bus.domains.push_back(std::make_unique<ec_domain>(bus));
    return bus.domains.back().get();
}

ec_slave_config_t* ecrt_master_slave_config(ec_master_t* master, uint16_t alias, uint16_t position, uint32_t vendor_id,
                                            uint32_t product_code) {
    if (!may_configure(*master, "ecrt_master_slave_config")) return nullptr;
    Bus& bus = *master->bus;
    const std::lock_guard lock(bus.config_mutex);
    for (const auto& config : bus.configs) {
        if (config->alias != alias || config->position != position) continue;
        if (config->vendor == vendor_id && config->product == product_code) return config.get();
        say("configuration %u:%u is for 0x%08x/0x%08x, not for 0x%08x/0x%08x", alias, position, config->vendor,
            config->product, vendor_id, product_code);
        return nullptr;
    }
    if (bus.active) {
        say("master %u is active: no configuration can be created", bus.index);
        return nullptr;
    }
    bus.configs.push_back(std::make_unique<ec_slave_config>(bus, alias, position, vendor_id, product_code));
    return bus.configs.back().get();
}

int ecrt_master_select_reference_clock(ec_master_t* master, ec_slave_config_t* sc) {
    if (!may_configure(*master, "ecrt_master_select_reference_clock")) return -EPERM;
    Bus& bus = *master->bus;
    const std::lock_guard lock(bus.config_mutex);
    if (bus.active) {
        say("master %u is active: the reference clock stays", bus.index);
        return -EBUSY;
    }
    if (sc != nullptr && &sc->bus != &bus) {
        say("master %u: the reference clock must be one of its own slaves", bus.index);
        return -EINVAL;
    }
    bus.reference = sc;
    return 0;
}

int ecrt_master_set_send_interval(ec_master_t* master, size_t send_interval) {
    // The library measures the interval of the cycle itself.
    if (!may_configure(*master, "ecrt_master_set_send_interval")) return -EPERM;
    return send_interval == 0 ? -EINVAL : 0;
}

int ecrt_master_setup_domain_memory(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!may_configure(*master, "ecrt_master_setup_domain_memory")) return -EPERM;
    const std::lock_guard lock(bus.config_mutex);
    if (!bus.active) give_memory(bus);
    return 0;
}

int ecrt_master_activate(ec_master_t* master) {
    if (!may_configure(*master, "ecrt_master_activate")) return -EPERM;
    Bus& bus = *master->bus;
    const std::lock_guard no_change(bus.configuring);
    // The call may follow directly after ecrt_master_deactivate(). A scan that is interrupted has read no aliases, so
    // the positions would be wrong.
    bus.await_scan();
    const Turn turn(bus);
    if (bus.active) {
        say("master %u is active already", bus.index);
        return 0;
    }
    const std::unique_lock lock = lock_after_transfers(bus);
    bus.stop_idle();
    bus.search.scan.cancel();
    bus.search.watch.cancel();
    bus.exchanges.clear();
    bus.operation = std::make_unique<compat::ecrt::Operation>(bus);
    if (const int error = bus.operation->plan(); error != 0) {
        bus.operation.reset();
        bus.start_idle();
        return error;
    }
    take_slaves(bus);
    give_memory(bus);
    for (const auto& domain : bus.domains) {
        domain->state = {};
        plan_counters(*domain);
    }
    bool emergencies_wanted = false;
    for (const auto& config : bus.configs) emergencies_wanted |= config->emergencies.capacity() != 0;
    (void)watch_mailboxes(*bus.ctx, emergencies_wanted ? std::chrono::milliseconds(10) : std::chrono::milliseconds(0));
    // No thread polls until the cycle begins. A transfer of this thread must not poll, because the cyclic thread may
    // begin meanwhile. The thread that calls receive or send becomes the owner.
    bus.owner = pthread_t{};
    bus.cycling = false;
    std::thread([&bus] { (void)take_ownership(*bus.ctx); }).join();
    bus.active = true;
    return 0;
}

int ecrt_master_deactivate(ec_master_t* master) {
    if (!may_configure(*master, "ecrt_master_deactivate")) return -EPERM;
    Bus& bus = *master->bus;
    const std::lock_guard no_change(bus.configuring);
    if (!bus.active) {
        say("master %u is not active", bus.index);
        return -EINVAL;
    }
    const Turn turn(bus);
    end_operation(bus);
    bus.start_idle();
    return 0;
}

void ecrt_master_deactivate_slaves(ec_master_t* master) {
    Bus& bus = *master->bus;
    if (!master->reserved || !bus.active || !bus.operation->running()) return;
    if (!bus.is_owner()) return;
    bus.operation->lower();
    (void)set_target(*bus.ctx, 0, AlState::preop);
}

}  // extern "C"
