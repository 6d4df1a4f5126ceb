#include "bench/common/attached_cycle.hpp"

#include "attach/client.hpp"
#include "bench/common/mapped_bus.hpp"

#include <margay/attach/server.hpp>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <thread>

extern char** environ;

namespace margay::bench {

// The names of these two classes are in the command line of callgrind. Callgrind switches counting on or off when a
// function begins, and back when the function ends: on for CountedCycle::run(), off for the functions of NotCounted
// within it. Each of these functions ends with an empty statement, so that the compiler cannot leave the function by a
// jump.
struct NotCounted {
    SimulatedNic& wire;
    SwitchOsal& osal;

    [[gnu::noinline]] SendStatus send(std::span<const std::byte> frame) {
        const SendStatus status = wire.send(frame);
        asm volatile("");
        return status;
    }
    // Each frame is back when the master first calls receive(), so the cycle always executes the same instructions.
    [[gnu::noinline]] std::size_t receive(std::span<std::byte> into) {
        osal.simulated.wait(wire.next_arrival(), wire.wait_handle());
        const std::size_t length = wire.receive(into);
        asm volatile("");
        return length;
    }
};

class CycleNic final : public Nic {
  public:
    CycleNic(SimulatedNic& wire, SwitchOsal& osal) : wire_(wire), far_{wire, osal} {}
    bool in_cycle = false;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        return in_cycle ? far_.send(frame) : wire_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        return in_cycle ? far_.receive(into) : wire_.receive(into);
    }
    Time next_arrival() const noexcept override { return wire_.next_arrival(); }

  private:
    SimulatedNic& wire_;
    NotCounted far_;
};

struct CountedCycle {
    Context& ctx;
    std::uint32_t expected;

    [[gnu::noinline]] bool run(Time now) const {
        if (!send_processdata(ctx, now)) return false;
        const auto wkc = receive_processdata(ctx, std::chrono::milliseconds(1));
        const bool right = wkc && *wkc == expected;
        asm volatile("");
        return right;
    }
};

namespace {

using namespace std::chrono_literals;
using attach::Operation;

constexpr std::size_t kClients = 4;
constexpr unsigned long kLeastRequests = 2000;
constexpr const char* kNames[] = {"none", "facts", "between", "in_cycle"};
constexpr const char* kTitles[] = {"no clients", "four clients read facts", "four clients, datagrams between cycles",
                                   "four clients, datagrams in the cycle"};

const char* name_of(Clients clients) { return kNames[static_cast<std::size_t>(clients)]; }
bool parse(std::string_view name, Clients& clients) {
    for (std::size_t n = 0; n < std::size(kNames); ++n)
        if (name == kNames[n]) {
            clients = static_cast<Clients>(n);
            return true;
        }
    return false;
}

// Sends one request after the other until the application ends. Returns 1 when the application refuses a request.
int hammer(const char* path, Clients kind) {
    attach::Client client;
    if (!client.connect(path).empty()) return 1;
    for (;;) {
        for (const auto operation : {Operation::master, Operation::slaves, Operation::group, Operation::events,
                                     Operation::eoe_ports, Operation::set_debug_level}) {
            const auto reply = client.call(operation, {});
            if (reply.status == attach::Status::failed) return 1;
            if (!reply.ok()) return 0;  // the application has ended
        }
        if (kind == Clients::facts) continue;
        for (const auto operation : {Operation::read_registers, Operation::read_sii, Operation::rescan}) {
            const auto reply = client.call(operation, {.slave = 1, .bytes = 64});
            if (reply.status == attach::Status::failed && reply.error.code != Errc::canceled) return 1;
            if (!reply.ok()) return 0;
        }
    }
}

class ClientProcesses {
  public:
    bool start(const char* self, const std::string& path, Clients kind) {
        for (pid_t& pid : pids_) {
            const std::string kind_name = name_of(kind);
            std::array<char*, 5> arguments{const_cast<char*>(self), const_cast<char*>("client"),
                                           const_cast<char*>(path.c_str()), const_cast<char*>(kind_name.c_str()),
                                           nullptr};
            if (::posix_spawn(&pid, self, nullptr, nullptr, arguments.data(), environ) != 0) return false;
            ++running_;
        }
        return true;
    }
    // Returns the number of clients that have failed.
    unsigned long wait() {
        unsigned long failed = 0;
        for (std::size_t n = 0; n < running_; ++n) {
            int status = 0;
            (void)::waitpid(pids_[n], &status, 0);
            failed += WIFEXITED(status) && WEXITSTATUS(status) == 0 ? 0 : 1;
        }
        running_ = 0;
        return failed;
    }

  private:
    std::array<pid_t, kClients> pids_{};
    std::size_t running_ = 0;
};

// The application: executes cycles with an interval of 1 ms of virtual time, and poll() between them. Prints the
// counts.
int serve(const char* self, Clients kind, std::uint32_t slaves, std::uint32_t octets, unsigned long least_cycles) {
    static MappedBus bus;
    if (!bus.build(slaves, octets, octets)) return 1;
    CycleNic nic(*bus.simulated, bus.osal);
    bus.nic.to = &nic;
    HostContext& ctx = *bus.ctx;
    if (kind == Clients::between) ctx.group(0).config.acyclic_bytes = 0;
    if (!config_map(ctx, bus.image)) return 1;

    std::string folder = "/tmp/margay-bench-XXXXXX";
    if (::mkdtemp(folder.data()) == nullptr) return 1;
    const std::string path = folder + "/bench.sock";
    std::atomic<unsigned> debug_level{0};
    auto server = std::make_unique<AttachServer>(
        ctx, path, AttachSettings{.scan = AttachScan::search, .debug_level = &debug_level});
    ClientProcesses clients;
    if (!server->error().empty() || (kind != Clients::none && !clients.start(self, path, kind))) return 1;

    const CountedCycle cycle{ctx, ctx.group(0).expected_wkc};
    const auto lost_before = ctx.statistics().lost;
    unsigned long cycles = 0;
    unsigned long lost = 0;
    Time now = bus.osal.now();
    while (cycles < least_cycles || (kind != Clients::none && server->counts().requests < kLeastRequests)) {
        ++cycles;
        nic.in_cycle = true;
        lost += cycle.run(now) ? 0 : 1;
        nic.in_cycle = false;
        const Time next = now + 1ms;
        for (now = bus.osal.now(); now < next; now = bus.osal.now())
            bus.osal.wait(std::min({poll(ctx, now), next, std::max(nic.next_arrival(), now + 1ns)}), nic.wait_handle());
        std::this_thread::yield();  // valgrind executes one thread at a time
    }
    const auto requests = server->counts().requests;
    const bool frames_lost = ctx.statistics().lost != lost_before;
    server.reset();
    const auto failed = clients.wait();
    (void)::rmdir(folder.c_str());
    std::printf("attached %lu %lu %lu %lu\n", cycles, lost + (frames_lost ? 1 : 0),
                static_cast<unsigned long>(requests), failed);
    return 0;
}

}  // namespace

int attached_child(int argc, char** argv) {
    const std::string_view what = argc > 1 ? argv[1] : "";
    Clients kind{};
    if (what == "client" && argc == 4 && parse(argv[3], kind)) return hammer(argv[2], kind);
    if (what != "attached" || argc != 6 || !parse(argv[2], kind)) return -1;
    const auto number = [&](int n) { return static_cast<std::uint32_t>(std::strtoul(argv[n], nullptr, 10)); };
    return serve(argv[0], kind, number(3), number(4), number(5));
}

AttachedCount run_attached(const std::string& self, Clients clients, std::uint32_t slaves, std::uint32_t octets,
                           bool counted) {
    const std::string callgrind =
        "valgrind --tool=callgrind --callgrind-out-file=/dev/null --fair-sched=try "
        "'--toggle-collect=margay::bench::CountedCycle::run*' '--toggle-collect=margay::bench::NotCounted::*' ";
    const std::string command = (counted ? callgrind : "") + self + " attached " + name_of(clients) + " " +
                                std::to_string(slaves) + " " + std::to_string(octets) + " " +
                                (counted ? "1000" : "20000") + " 2>&1";
    AttachedCount result{.failed = 1};
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return result;
    double collected = -1;
    std::array<char, 256> line{};
    while (std::fgets(line.data(), line.size(), pipe) != nullptr) {
        if (const char* at = std::strstr(line.data(), "Collected : ")) collected = std::strtod(at + 12, nullptr);
        (void)std::sscanf(line.data(), "attached %lu %lu %lu %lu", &result.cycles, &result.lost, &result.requests,
                          &result.failed);
    }
    if (pclose(pipe) != 0 || result.cycles == 0) result.failed = 1;
    if (collected > 0 && result.cycles != 0) result.instructions = collected / static_cast<double>(result.cycles);
    return result;
}

bool check_attached(const std::string& self, bool counted) {
    constexpr std::uint32_t kSlaves = 10;
    constexpr std::uint32_t kOctets = 32;
    constexpr double kSame = 0.5;  // instructions per cycle
    bool good = true;
    double alone = -1;
    for (const Clients kind : {Clients::none, Clients::facts, Clients::between, Clients::in_cycle}) {
        const auto count = run_attached(self, kind, kSlaves, kOctets, counted);
        if (kind == Clients::none) alone = count.instructions;
        bool right = count.failed == 0 && count.lost == 0 && count.cycles != 0;
        right &= kind == Clients::none || count.requests >= kLeastRequests;
        if (counted) right &= count.instructions > 0;
        if (counted && kind == Clients::facts) right &= count.instructions <= alone + kSame;
        std::printf("%-40s", kTitles[static_cast<std::size_t>(kind)]);
        if (counted) std::printf(" %7.1f instructions a cycle,", count.instructions);
        std::printf(" %lu of %lu cycles lost, %lu requests%s\n", count.lost, count.cycles, count.requests,
                    right ? "" : ": WRONG");
        good &= right;
    }
    return good;
}

}  // namespace margay::bench
