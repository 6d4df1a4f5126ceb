#include "network/scan.hpp"

#include "network/configure.hpp"
#include "network/expectation.hpp"
#include "network/places.hpp"
#include "network/preop.hpp"
#include "network/survey.hpp"
#include "network/topology.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
using wire::Command;
using wire::DatagramAddress;

constexpr DatagramAddress broadcast(wire::Register r) { return {std::uint16_t{0}, r.address}; }

Error segment_error(Errc code, Step step, std::uint32_t expected = 0, std::uint32_t actual = 0) {
    return {.code = code, .step = step, .expected = expected, .actual = actual};
}

Task<Result<>> wait_for_link(Network& network) {
    const Time give_up = later(network.engine.now(), network.settings.link_timeout);
    while (network.engine.link().nic().link_state() == LinkState::down) {
        if (network.engine.now() >= give_up) co_return segment_error(Errc::link_down, Step::wait_link);
        co_await network.engine.sleep_for(std::chrono::milliseconds(10));
    }
    co_return Nothing{};
}

// Writes to all slaves at once. Slaves without the register are not an error.
Task<Result<>> broadcast_write(Network& network, wire::Register place, std::uint16_t value) {
    std::array<std::byte, 2> data{};
    store_le<std::uint16_t>(data, 0, value);
    Datagram write(network.engine.link(), Command::BWR, broadcast(place), Bytes(data).first(place.length));
    auto reply = co_await write;
    if (!reply.ok()) co_return segment_error(reply.errc, Step::reset_slaves);
    co_return Nothing{};
}

// Waits until all slaves report INIT. A slave that does not report INIT is found later, when its own state is read.
Task<Result<bool>> wait_for_init(Network& network) {
    const Time give_up = later(network.engine.now(), network.settings.init_timeout);
    for (;;) {
        std::array<std::byte, 2> states{};
        Datagram look(network.engine.link(), Command::BRD, broadcast(reg::kAlStatus), MutableBytes(states));
        auto reply = co_await look;
        if (!reply.ok()) co_return segment_error(reply.errc, Step::reset_slaves);
        const auto all = load_le<std::uint16_t>(states);  // of all slaves, ORed
        const bool in_init = all == static_cast<unsigned>(AlState::init);
        if (in_init || network.engine.now() >= give_up) co_return in_init;
        co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    }
}

// Clears the configuration of an earlier master: FMMUs, SyncManagers, SYNC signals, the assignment of the EEPROM to the
// PDI, the use of the alias as a second station address (which may be the station address of another slave), and the
// station address. A slave whose replies never arrive must not execute commands for another slave.
Task<Result<>> clear_slaves(Network& network) {
    static constexpr std::array kForce{std::byte{wire::sii_config::kForceEcat}};
    Link& link = network.engine.link();
    const auto zeros = [](std::size_t count) { return Bytes(kClearedRegisters).first(count); };
    Datagram fmmus(link, Command::BWR, broadcast(reg::fmmu(0)), zeros(16 * reg::kFmmuStride));
    Datagram sms(link, Command::BWR, broadcast(reg::sync_manager(0)), zeros(16 * reg::kSyncManagerStride));
    Datagram sync(link, Command::BWR, broadcast(reg::kSyncActivation), zeros(reg::kSyncActivation.length));
    Datagram force(link, Command::BWR, broadcast(reg::kSiiConfig), Bytes(kForce));
    Datagram assign(link, Command::BWR, broadcast(reg::kSiiConfig), zeros(reg::kSiiConfig.length));
    Datagram alias(link, Command::BWR, broadcast(reg::kAliasEnable), zeros(reg::kAliasEnable.length));
    Datagram address(link, Command::BWR, broadcast(reg::kStationAddress), zeros(reg::kStationAddress.length));
    co_await together(fmmus, sms, sync, force, assign, alias, address);
    for (const Datagram* datagram : {&fmmus, &sms, &sync, &force, &assign, &alias, &address})
        if (!datagram->reply().ok()) co_return segment_error(datagram->reply().errc, Step::reset_slaves);
    co_return Nothing{};
}

Task<Result<>> assign_address(Network& network, Slave& slave) {
    std::array<std::byte, 2> address{};
    store_le<std::uint16_t>(address, 0, slave.station_address.value);
    if (slave.ring_position == 0) co_return Nothing{};
    const RingPosition place{static_cast<std::uint16_t>(slave.ring_position - 1)};
    Datagram write(network.engine.link(), Command::APWR, DatagramAddress(place, reg::kStationAddress.address),
                   Bytes(address));
    auto reply = co_await write;
    const Error error =
        error_of_reply(network.station(slave), reply, Step::assign_address, reg::kStationAddress.address);
    if (error.code != Errc::none) network.note(slave, error);
    co_return Nothing{};
}

// A held slave without a mailbox stays in INIT.
Task<Result<>> start_mailbox(Network& network, Slave& slave, FirstFault& faults) {
    if (slave.ring_position == 0 || (slave.held && !slave.mailbox.present())) co_return Nothing{};
    auto done = co_await bring_to_preop(network, slave);
    if (!done) faults.note(network, slave, done.error());
    co_return Nothing{};
}

}  // namespace

Task<Result<std::uint16_t>> count_slaves(Network& network) {
    std::array<std::byte, 1> type{};
    Datagram look(network.engine.link(), Command::BRD, broadcast(reg::kType), MutableBytes(type));
    auto reply = co_await look;
    const Error cabling = network.redundancy == nullptr ? Error{} : network.redundancy->check();
    if (cabling.code != Errc::none) co_return cabling;
    if (!reply.ok()) {
        Error error = segment_error(reply.errc, Step::count_slaves);
        error.detail = reply.detail();
        co_return error;
    }
    if (reply.wkc == 0) co_return segment_error(Errc::no_slaves, Step::count_slaves);
    co_return reply.wkc;
}

Task<Result<bool>> reset_slaves(Network& network) {
    constexpr auto kInit = static_cast<std::uint16_t>(AlState::init);
    constexpr std::uint16_t kAndAcknowledge = wire::al::kErrorAcknowledge;
    // Requests INIT with the acknowledge bit, then without it: slaves that mirror AL control would show the acknowledge
    // bit as an error, and some old slaves require the second write.
    for (const int state : {kInit | kAndAcknowledge, +kInit}) {
        co_await required(broadcast_write(network, reg::kAlControl, static_cast<std::uint16_t>(state)));
    }
    auto in_init = co_await wait_for_init(network);
    if (!in_init) co_return in_init;
    auto cleared = co_await clear_slaves(network);
    co_return cleared ? in_init : Result<bool>(cleared.error());
}

namespace {

// Fills the table after counting. The number of each slave is its place in the ring for now.
void begin_table(Network& network, std::uint16_t count, bool in_init) {
    network.count = count;
    for (std::uint16_t i = 1; i <= count; ++i) {
        Slave& slave = network.slave(i);
        slave = Slave{};
        network.marks(i) = SlaveMarks{};
        slave.number = i;
        slave.ring_position = i;
        if (in_init) slave.al.state = AlState::init;
        slave.station_address = network.station_address(i);
    }
}

// Computes the topology, compares with the expected slaves, and assigns the station addresses again if some have
// changed.
Task<Result<>> arrange(Network& network) {
    for (Slave& slave : network.slaves()) {
        // An earlier reading of the ring may have found that the slave is absent.
        if (slave.ring_position == 0 || slave.ring_position > network.ring.size()) continue;
        network.ring[slave.ring_position - 1U] = {.slave = slave.number, .dl_status = slave.dl_status};
    }
    network.ring_count = network.count;
    network.parts_read = network.ring_parts();
    const auto topology = find_topology(network.seen_ring(), network.parts_read);
    if (!topology) network.note(topology.error());
    Result<bool> moved = false;
    if (!network.expected.empty()) moved = network.expectation->number(network);
    if (!moved) co_return moved.error();
    store_topology(network.seen_ring(), network.slaves());
    remember_places(network);
    if (!*moved) co_return Nothing{};
    const auto assign = [&network](Slave& s) { return assign_address(network, s); };
    co_return co_await required(for_each_slave(network, assign));
}

// The table is valid only after a complete scan: the destructor clears it otherwise.
class Scanning {
  public:
    explicit Scanning(Network& network) : network_(network) { begin(); }
    Scanning(const Scanning&) = delete;
    Scanning& operator=(const Scanning&) = delete;
    ~Scanning() {
        if (!done_) begin();
    }
    void done() { done_ = true; }

  private:
    void begin() {
        ++network_.scans;
        network_.mailboxes.forget_all();
        for (ClockEntry& entry : network_.clocks.entries) entry.sync_set = false;
        network_.clocks.forget();
        network_.count = 0;
        network_.ring_count = 0;
        network_.target = AlState::op;
    }
    Network& network_;
    bool done_ = false;
};

// Reports the slaves whose identity could not be read.
void keep_unasked(Network& network, FirstFault& faults) {
    for (const Slave& slave : network.slaves())
        if (slave.ring_position != 0 && !slave.seen) faults.keep(slave.error);
}

}  // namespace

Task<Result<std::uint16_t>> scan(Network& network) {
    Scanning scanning(network);
    network.expected = network.expected_next;
    network.expected_is_new = false;
    for (ProcessGroup& group : network.process.groups) {
        unprepare(group, network.engine.link(), network.engine.now());
        group.was_mapped &= network.in_run_cycle;
    }
    co_await required(wait_for_link(network));
    const auto count = co_await required(count_slaves(network));
    if (count > network.table.size())
        co_return segment_error(Errc::capacity, Step::count_slaves, count,
                                static_cast<std::uint32_t>(network.table.size()));
    const auto reset = co_await required(reset_slaves(network));
    begin_table(network, count, reset);
    if (network.redundancy != nullptr) co_await required(network.redundancy->find_beginning(network));
    const auto assign = [&network](Slave& s) { return assign_address(network, s); };
    co_await required(for_each_slave(network, assign));
    const std::uint32_t changes = network.redundancy == nullptr ? 0 : network.redundancy->changes();
    const auto identify = [&network](Slave& s) { return survey(network, s); };
    co_await required(for_each_slave(network, identify));
    co_await required(broadcast_write(network, reg::kSiiConfig, wire::sii_config::kOfferedToPdi));
    const auto again = co_await required(count_slaves(network));
    if (again != count) co_return segment_error(Errc::unstable, Step::count_slaves, count, again);
    if (network.redundancy != nullptr) co_await required(network.redundancy->read_ports_again(network, changes));
    co_await required(arrange(network));
    FirstFault faults;
    keep_unasked(network, faults);
    if (!network.expected.empty()) network.expectation->compare(network, faults);
    const auto start = [&network, &faults](Slave& s) { return start_mailbox(network, s, faults); };
    co_await required(for_each_slave(network, start));
    scanning.done();
    network.states_read = network.compared = network.engine.now();
    (void)network.engine.link().take_longest_silence();
    if (faults.error().code != Errc::none) co_return faults.error();
    co_return count;
}

}  // namespace margay
