#include "compat/ecrt/bus.hpp"

#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <chrono>
#include <cstddef>

namespace margay::compat::ecrt {
namespace {

constexpr Limits kLimits{.slaves = 512,
                         .tasks = 64,
                         .frames = 128,
                         .groups = 64,
                         .process_frames = 96,
                         .emergencies = 32,
                         .errors = 256,
                         .events = 256};

// Two programs on one interface would disturb each other. A socket with the name of the interface is the reservation:
// the system removes it when the program ends. Returns -1 when another program has it.
int lock_interface(const std::string& name) {
    const int socket_fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket_fd < 0) return -1;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = "margay-master-" + name;
    const std::size_t length = path.copy(address.sun_path + 1, sizeof address.sun_path - 2);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
    if (::bind(socket_fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return socket_fd;
    ::close(socket_fd);
    return -1;
}

// Slaves have changed: the copies of them are old.
void changed(const Event& event, void* user) {
    Bus& bus = *static_cast<Bus*>(user);
    bus.dirty.store(true, std::memory_order_relaxed);
    switch (event.kind) {
        case EventKind::slave_count:
        case EventKind::lost:
        case EventKind::found:
        case EventKind::other_slave:
        case EventKind::stranger: bus.search.again = true; break;
        default: break;
    }
}

}  // namespace

bool Bus::open() {
    const bool simulated = source_name.starts_with("sim:");
    if (!simulated) {
        lock_socket = lock_interface(source_name);
        if (lock_socket < 0) {
            say("master %u: another program uses %s", index, source_name.c_str());
            return false;
        }
    }
    auto opened = open_source(source_name);
    if (opened.source == nullptr) {
        say("master %u: %s", index, opened.error.c_str());
        return false;
    }
    source = std::move(opened.source);
    ctx = std::make_unique<HostContext>(kLimits);
    ctx->events().callback = changed;
    ctx->events().user = this;
    const auto ready = init(*ctx, source->nic(), source->osal());
    if (!ready) {
        say_error(index, "init", ready.error());
        return false;
    }
    clocks = std::make_unique<ApplicationTime>(*ctx);
    facts.reserve(kLimits.slaves);
    reporter = std::thread([this] { report_loop(); });
    start_idle();
    std::unique_lock lock(facts_mutex);
    scanned.wait(lock, [this] { return first_scan_over; });
    return true;
}

// The cycle says nothing: this thread does.
void Bus::report_loop() {
    while (!closing) {
        while (const auto error = ctx->errors().take()) say_error(index, "error", *error);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
}

Bus::~Bus() {
    stop_idle();
    closing = true;
    if (reporter.joinable()) reporter.join();
    if (ctx != nullptr) {
        (void)take_ownership(*ctx);
        search.scan.cancel();
        search.watch.cancel();
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
    if (lock_socket >= 0) ::close(lock_socket);
}

}  // namespace margay::compat::ecrt
