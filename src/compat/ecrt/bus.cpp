#include "compat/ecrt/bus.hpp"

#include "compat/ecrt/eoe_interfaces.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"
#include "compat/ecrt/segment.hpp"
#include "source/interface_nic.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>
#include <system_error>
#include <utility>

namespace margay::compat::ecrt {
namespace {

constexpr Limits kLimits{.slaves = 512,
                         .tasks = 512,
                         .frames = 128,
                         .groups = 64,
                         .process_frames = 96,
                         .emergencies = 32,
                         .errors = 256,
                         .events = 256};

// The interfaces that masters of this program have, with the number of the master.
struct OwnInterfaces {
    std::mutex mutex;
    std::map<std::string, unsigned> masters;
};
OwnInterfaces& own_interfaces() {
    static OwnInterfaces* const all = new OwnInterfaces;  // threads may still use it while the process ends
    return *all;
}

// Two programs on one interface would disturb each other. A socket with the name of the interface is the reservation:
// the system removes it when the program ends. Returns -1 with the reason in errno.
int reserve(const std::string& name) {
    const int socket_fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket_fd < 0) return -1;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = "margay-master-" + name;
    const std::size_t length = path.copy(address.sun_path + 1, sizeof address.sun_path - 2);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
    if (::bind(socket_fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return socket_fd;
    const int reason = errno;
    ::close(socket_fd);
    errno = reason;
    return -1;
}

// Each configuration has a ring of the size that the program has set. For use only while the master is active: before
// activation the program may be adding configurations, and no configuration has the number of its slave.
void keep_emergencies(Bus& bus, std::uint16_t slave) {
    EmergencyRing& ring = emergencies(*bus.ctx, slave);
    for (const auto& config : bus.configs) {
        if (config->number != slave || config->emergencies.capacity() == 0) continue;
        while (const auto one = ring.take()) (void)config->emergencies.add(*one);
    }
}

// The supervision keeps the last known state of slaves that do not respond. It reports that they respond again before
// it has read their states again.
void note_silence(Bus& bus, const Event& event) {
    const bool of_segment = event.slave == 0;
    if (event.kind == EventKind::unsupervised || (event.kind == EventKind::lost && of_segment)) {
        bus.silent = event.kind == EventKind::lost;
        bus.returning.waited_for = false;
    }
    if (event.kind != EventKind::found || !of_segment) return;
    bus.returning.waited_for = bus.active;
    bus.returning.reading = false;
    if (!bus.active) bus.silent = false;
}

// Slaves have changed, so their copies are out of date.
void changed(const Event& event, void* user) {
    Bus& bus = *static_cast<Bus*>(user);
    bus.dirty.store(true, std::memory_order_relaxed);
    bus.facts_at = bus.refresh_at = Time{};
    note_silence(bus, event);
    // Until the cyclic thread has checked all slaves, the state of each domain is computed from its own slaves.
    if (event.kind == EventKind::lost && bus.active)
        for (const auto& exchange : bus.exchanges) exchange->best = Answer::incomplete;
    if (event.kind == EventKind::slave_count) bus.answering = event.actual;
    if (bus.active && (event.kind == EventKind::stranger || event.kind == EventKind::other_slave))
        bus.strangers.push_back({.vendor = event.detail, .product = event.actual});
    if (bus.active && event.kind == EventKind::emergency) keep_emergencies(bus, event.slave);
    switch (event.kind) {
        case EventKind::slave_count:
        case EventKind::lost:
        case EventKind::found:
        case EventKind::other_slave:
        case EventKind::stranger:
        case EventKind::ambiguous:
            if (bus.active)
                bus.operation->note_change();
            else
                bus.scan_again();
            break;
        default: break;
    }
}

}  // namespace

// One interface, or both of a ring ("eth0+eth1"). AF_PACKET and AF_XDP on one interface disturb each other too.
bool Bus::lock_interfaces() {
    for (std::size_t begin = 0; begin <= source_name.size();) {
        const std::size_t end = std::min(source_name.find('+', begin), source_name.size());
        const std::string name = hosted::parse_interface(source_name.substr(begin, end - begin)).name;
        begin = end + 1;
        if (name.empty()) continue;  // open_source() says it
        if (!lock_interface(name)) return false;
    }
    return true;
}

bool Bus::lock_interface(const std::string& name) {
    OwnInterfaces& own = own_interfaces();
    const std::lock_guard lock(own.mutex);
    if (std::ranges::find(locked, name) != locked.end()) {
        say("master %u: %s: both ends of a ring are %s", index, source_name.c_str(), name.c_str());
        return false;
    }
    if (const auto user = own.masters.find(name); user != own.masters.end()) {
        say("master %u: master %u of this program uses %s", index, user->second, name.c_str());
        return false;
    }
    const int reservation = reserve(name);
    if (reservation < 0 && errno == EADDRINUSE) {
        say("master %u: another program uses %s", index, name.c_str());
        return false;
    }
    if (reservation < 0) {
        say("master %u: %s cannot be reserved: %s", index, name.c_str(),
            std::generic_category().message(errno).c_str());
        return false;
    }
    lock_sockets.push_back(reservation);
    locked.push_back(name);
    own.masters[name] = index;
    return true;
}

void Bus::unlock_interfaces() {
    OwnInterfaces& own = own_interfaces();
    const std::lock_guard lock(own.mutex);
    for (const std::string& name : locked) own.masters.erase(name);
    for (const int reservation : lock_sockets) ::close(reservation);
}

bool Bus::open() {
    const bool interfaces = !source_name.starts_with("sim:") && !source_name.starts_with("pcap:");
    if (interfaces && !lock_interfaces()) return false;
    auto opened = open_segment(source_name);
    if (!opened) {
        say("master %u: %s", index, opened.error().c_str());
        return false;
    }
    source = opened.take();
    ctx = std::make_unique<HostContext>(source->limits(kLimits));
    ctx->events().callback = changed;
    ctx->events().user = this;
    const auto ready = source->begin(*ctx);
    if (!ready) {
        say_error(*this, "init", ready.error());
        return false;
    }
    clocks = std::make_unique<ApplicationTime>(*ctx);
    facts.reserve(kLimits.slaves);
    strangers.reserve(kLimits.slaves);
    reporter = std::thread([this] { report_loop(); });
    start_idle();
    std::unique_lock lock(facts_mutex);
    scanned.wait(lock, [this] { return first_scan_over; });
    return true;
}

// The cycle prints no messages. This thread prints them.
void Bus::report_loop() {
    std::unique_lock lock(closing_mutex);
    for (bool last = false;;) {
        lock.unlock();
        report();
        lock.lock();
        if (last) return;
        last = closes.wait_for(lock, std::chrono::milliseconds(50), [this] { return closing; });
    }
}

void Bus::report() {
    while (const auto error = ctx->errors().take()) {
        // Slaves without a configuration stay in PREOP, and configurations wait for their slaves: no errors here.
        if (error->code == Errc::unexpected_slave) continue;
        // The program does not exchange this process data, see start_up.cpp.
        if (error->code == Errc::sizes_differ && error->expected == 0) continue;
        say_error(*this, error->code == Errc::missing_slave ? "waiting" : "error", *error);
    }
    std::vector<Failure> ended;
    unsigned more = 0;
    {
        const std::lock_guard lock(failures.mutex);
        more = std::exchange(failures.more, 0U);
        ended.assign(failures.list.begin(), failures.list.begin() + static_cast<std::ptrdiff_t>(failures.count));
        failures.count = 0;
    }
    for (const Failure& one : ended)
        if (one.error.code == Errc::capacity && one.error.step == Step{})  // the library has executed no request
            say("master %u: %s: its memory has less octets than are wanted, or none are", index, one.what.data());
        else
            say_error(*this, one.what.data(), one.error);
    if (more != 0) say("master %u: %u more requests have failed at the same time", index, more);
}

Bus::~Bus() {
    stop_idle();
    {
        const std::lock_guard lock(closing_mutex);
        closing = true;
    }
    closes.notify_all();
    if (reporter.joinable()) reporter.join();
    if (ctx != nullptr) {
        (void)take_ownership(*ctx);
        close_eoe_interfaces(*this);
        search.scan.cancel();
        search.watch.cancel();
        returning.states.cancel();
        if (operation != nullptr) operation->cancel();
    }
    operation.reset();
    clocks.reset();
    configs.clear();
    domains.clear();
    exchanges.clear();
    ctx.reset();
    old_operations.clear();
    old_configs.clear();
    unlock_interfaces();
}

}  // namespace margay::compat::ecrt
