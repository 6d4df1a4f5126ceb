// The functions that return information about the segment. Any thread may call them.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"

#include <margay/coe.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

// Position of the slave with this number; 0xffff: none.
std::uint16_t position_of(const std::vector<Slave>& slaves, std::uint16_t number) {
    for (const Slave& slave : slaves)
        if (number != 0 && slave.number == number && slave.ring_position != 0)
            return static_cast<std::uint16_t>(slave.ring_position - 1);
    return 0xFFFF;
}

void fill_ports(Bus& bus, const Slave& slave, ec_slave_info_t& info) {
    const std::lock_guard lock(bus.facts_mutex);
    PortFacts facts;
    if (slave.number < bus.ports.size() && bus.ports[slave.number].identity == slave.identity)
        facts = bus.ports[slave.number];
    for (std::size_t n = 0; n < EC_MAX_PORTS; ++n) {
        const Port& port = slave.ports[n];
        auto& to = info.ports[n];
        to.desc = static_cast<ec_slave_port_desc_t>(port.type);
        to.link.link_up = port.link ? 1 : 0;
        to.link.loop_closed = port.open ? 0 : 1;
        to.link.signal_detected = port.link ? 1 : 0;
        to.next_slave = position_of(bus.facts, port.neighbour);
        to.receive_time = facts.received[n];
        to.delay_to_next_dc = facts.delay[n];
    }
}

// The number of objects in the dictionary of the slave. It is read from the slave once, before activation, because no
// cycle is needed then.
std::uint16_t objects_of(Bus& bus, const Slave& slave) {
    constexpr Duration kPatience = std::chrono::milliseconds(500);
    {
        const std::lock_guard lock(bus.known_mutex);
        const auto known = bus.known_objects.find(slave.ring_position);
        if (known != bus.known_objects.end() && known->second.first == slave.identity) return known->second.second;
    }
    const bool has_list = slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0 &&
                          (slave.coe_details & coe_detail::kSdoInformation) != 0;
    if (bus.active || !has_list || slave.al.state == AlState::init) return 0;
    const auto position = static_cast<std::uint16_t>(slave.ring_position - 1);
    const Passage passage(bus, position, Ready::for_mail);
    Slave present;  // slaves may have come meanwhile
    if (!bus.slave_at(position, present) || present.identity != slave.identity) return 0;
    ObjectListRequest request;
    request.slave = present.number;
    request.list = ObjectList::all;
    request.timeout = kPatience;
    if (bus.active || !submit(*bus.ctx, request)) return 0;
    const auto listed = wait(*bus.ctx, request);
    if (!listed && !is_answer(listed.error())) return 0;  // it is asked again
    const auto count = static_cast<std::uint16_t>(listed ? request.count : 0U);
    const std::lock_guard lock(bus.known_mutex);
    bus.known_objects[slave.ring_position] = {slave.identity, count};
    return count;
}

// A SyncManager of a slave with its PDOs; -ENOENT: no such slave or SyncManager, -EIO: the slave could not be asked.
int sync_at(Bus& bus, std::uint16_t position, std::uint8_t index, SyncWish& sync) {
    Slave slave;
    auto known = bus.slave_at(position, slave) ? kept_pdos(bus, slave) : nullptr;
    if (known == nullptr) {
        await_start(bus, position, Ready::read);
        if (!bus.slave_at(position, slave)) return -ENOENT;
        if (bus.active && !bus.cycling) {
            say("master %u: position %u: its PDOs can be asked for when the cycle has begun", bus.index, position);
            return -EIO;
        }
    }
    if (index >= slave.sm_count || index >= Slave::kSyncManagers) return -ENOENT;
    if (known == nullptr) known = pdos_of(bus, slave, true);
    if (known->unread.code != Errc::none) return -EIO;
    sync = known->syncs[index];
    return 0;
}

}  // namespace

extern "C" {

int ecrt_master(ec_master_t* master, ec_master_info_t* master_info) {
    Bus& bus = *master->bus;
    master_info->slave_count = bus.responding;
    master_info->link_up = bus.link_up();
    master_info->scan_busy = bus.scan_busy ? 1 : 0;
    master_info->app_time = bus.app_time.now_ns;
    return 0;
}

int ecrt_master_scan_progress(ec_master_t* master, ec_master_scan_progress_t* progress) {
    Bus& bus = *master->bus;
    const bool busy = bus.scan_busy;
    progress->slave_count = busy ? bus.scan_slaves.load() : bus.responding.load();
    progress->scan_index = busy ? bus.scan_index.load() : progress->slave_count;
    return 0;
}

int ecrt_master_get_slave(ec_master_t* master, uint16_t slave_position, ec_slave_info_t* slave_info) {
    Bus& bus = *master->bus;
    Slave slave;
    if (!bus.slave_at(slave_position, slave) || is_unread(slave)) {
        await_start(bus, slave_position, Ready::read);
        if (!bus.slave_at(slave_position, slave)) return -ENOENT;
        if (is_unread(slave) && (bus.active || bus.scan_busy)) return -EAGAIN;  // in the cyclic thread
    }
    *slave_info = {};
    slave_info->position = slave_position;
    slave_info->vendor_id = slave.identity.vendor;
    slave_info->product_code = slave.identity.product;
    slave_info->revision_number = slave.identity.revision;
    slave_info->serial_number = slave.identity.serial;
    slave_info->alias = slave.alias;
    slave_info->current_on_ebus = slave.ebus_current_ma;
    slave_info->al_state = static_cast<std::uint8_t>(slave.al.state);
    slave_info->error_flag = slave.al.error || slave.error.code != Errc::none ? 1 : 0;
    slave_info->sync_count = slave.sm_count;
    slave_info->sdo_count = objects_of(bus, slave);
    slave.name().substr(0, EC_MAX_STRING_LENGTH - 1).copy(slave_info->name, EC_MAX_STRING_LENGTH - 1);
    fill_ports(bus, slave, *slave_info);
    return 0;
}

int ecrt_master_get_sync_manager(ec_master_t* master, uint16_t slave_position, uint8_t sync_index,
                                 ec_sync_info_t* sync) {
    SyncWish wish;
    if (const int error = sync_at(*master->bus, slave_position, sync_index, wish); error != 0) return error;
    *sync = {};
    sync->index = sync_index;
    sync->dir = wish.direction;
    sync->n_pdos = static_cast<unsigned int>(wish.pdos.size());
    sync->watchdog_mode = EC_WD_DEFAULT;
    return 0;
}

int ecrt_master_get_pdo(ec_master_t* master, uint16_t slave_position, uint8_t sync_index, uint16_t pos,
                        ec_pdo_info_t* pdo) {
    SyncWish wish;
    if (const int error = sync_at(*master->bus, slave_position, sync_index, wish); error != 0) return error;
    if (pos >= wish.pdos.size()) return -ENOENT;
    *pdo = {};
    pdo->index = wish.pdos[pos].index;
    pdo->n_entries = static_cast<unsigned int>(wish.pdos[pos].entries.size());
    return 0;
}

int ecrt_master_get_pdo_entry(ec_master_t* master, uint16_t slave_position, uint8_t sync_index, uint16_t pdo_pos,
                              uint16_t entry_pos, ec_pdo_entry_info_t* entry) {
    SyncWish wish;
    if (const int error = sync_at(*master->bus, slave_position, sync_index, wish); error != 0) return error;
    if (pdo_pos >= wish.pdos.size() || entry_pos >= wish.pdos[pdo_pos].entries.size()) return -ENOENT;
    const PdoEntry& known = wish.pdos[pdo_pos].entries[entry_pos];
    *entry = {known.index, known.subindex, known.bits};
    return 0;
}

int ecrt_master_rt_slave_requests(ec_master_t*, unsigned int rt_slave_requests) {
    // Requests always proceed inside receive and send.
    return rt_slave_requests <= 1 ? 0 : -EINVAL;
}
void ecrt_master_exec_slave_requests(ec_master_t*) {}

}  // extern "C"
