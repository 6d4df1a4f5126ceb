// A cycle in real time over a cable: this process is the master, `virtual_segment` in another process the slaves, with
// a veth pair between them. CyclicRunner and a plain loop of clock_nanosleep run in turns, so that both have the same
// conditions, without load and with load beside them. Prints how late the wake-ups were, the round trips, and the lost
// cycles: deadlines left out, and cycles without a reply in half a period.
//
//   bench_cyclic [--cycles 2000] [--load none,all] [--period-us 1000] [--priority 80] [--spin-us 100] [--cpu -1]
//
// --cycles: of each loop with each load; 60000 is the whole measurement. --load: none, cpu, memory, network, all, or
// several of them ("none,cpu,all"). Nothing is judged, because the result depends on the machine: the targets at 1 ms
// are no lost cycle of 60 000 without load, and a 99th percentile of the wake-up of at most a tenth of the plain
// loop's.
#include "common/far_end.hpp"
#include "common/load.hpp"
#include "osal/duration_histogram.hpp"
#include "osal/linux/cyclic_runner.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace {

using namespace margay;
using namespace std::chrono_literals;

constexpr int kSkipped = 77;
constexpr std::uint64_t kCyclesOfATurn = 500;

struct Options {
    std::uint64_t cycles = 2000;
    std::vector<std::string> loads{"none", "all"};
    Duration period = 1ms;
    int priority = 80;
    Duration spin = 100us;
    int cpu = -1;
};

struct Figures {
    DurationHistogram wake_up;
    DurationHistogram round_trip;
    std::uint64_t cycles = 0;
    std::uint64_t left_out = 0;
    std::uint64_t without_reply = 0;
};

// The slaves: the program beside this program, with a real-time priority if the system grants it.
class Segment {
  public:
    explicit Segment(int priority) {
        const auto program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "virtual_segment";
        const pid_t parent = ::getpid();
        id_ = ::fork();
        if (id_ != 0) return;
        const sched_param wanted{.sched_priority = std::max(priority - 1, 1)};
        (void)::sched_setscheduler(0, SCHED_FIFO, &wanted);
        (void)std::freopen("/dev/null", "w", stdout);
        if (::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == parent)
            ::execl(program.c_str(), program.c_str(), "far", "demo", static_cast<char*>(nullptr));
        std::perror(program.c_str());
        ::_exit(1);
    }
    ~Segment() {
        if (id_ <= 0) return;
        (void)::kill(id_, SIGTERM);
        (void)::waitpid(id_, nullptr, 0);
    }
    Segment(const Segment&) = delete;
    Segment& operator=(const Segment&) = delete;
    [[nodiscard]] bool ended() const { return id_ <= 0 || ::waitpid(id_, nullptr, WNOHANG) != 0; }

  private:
    pid_t id_ = -1;
};

// The master and its cycle.
class Driver {
  public:
    // Brings the slaves to OP. Returns an empty text after success.
    [[nodiscard]] std::string start(const Segment& segment) {
        if (!nic_.open(bench::kNear)) return std::string(nic_.problem());
        if (const auto ready = init(ctx_, nic_, osal_); !ready) return words(ready.error());
        // The other process needs a moment to start.
        Result<std::uint16_t> found = config_init(ctx_);
        for (const Time until = osal_.now() + 10s; (!found || *found == 0) && osal_.now() < until;) {
            if (segment.ended()) return "virtual_segment has ended";
            found = config_init(ctx_);
        }
        if (!found) return words(found.error());
        if (const auto mapped = config_map(ctx_, image_); !mapped) return words(mapped.error());
        if (const auto op = reach(ctx_, AlState::op, 20s); !op) return words(op.error());
        slaves_ = *found;
        return {};
    }
    // Executes one cycle, which was due at `due`.
    void exchange(Time due, Duration timeout, Figures& figures) {
        const Time begun = osal_.now();
        figures.wake_up.record(begun - due);
        ++figures.cycles;
        const bool back = send_processdata(ctx_, begun).ok() && came(receive_processdata(ctx_, timeout));
        const Duration trip = osal_.now() - begun;
        if (back) figures.round_trip.record(trip);
        if (!back || trip > timeout) ++figures.without_reply;
        (void)poll(ctx_, osal_.now());
    }
    void take() { (void)take_ownership(ctx_); }
    [[nodiscard]] unsigned slaves() const { return slaves_; }

  private:
    // A frame with a wrong working counter has come back, too.
    static bool came(const Result<std::uint32_t>& received) {
        return received.ok() || received.error().code == Errc::working_counter;
    }
    static std::string words(const Error& error) {
        std::array<char, 256> text{};
        return std::string(describe(error, text));
    }

    LinuxOsal osal_;
    PacketNic nic_;
    HostContext ctx_{Limits{.slaves = 64}};
    std::array<std::byte, 4096> image_{};
    unsigned slaves_ = 0;
};

void plain_turn(Driver& master, const Options& options, std::uint64_t cycles, Figures& figures) {
    Time due = CyclicRunner::now() + options.period;
    for (std::uint64_t n = 0; n < cycles; ++n, due += options.period) {
        const auto late = (CyclicRunner::now() - due) / options.period;
        if (late > 0) figures.left_out += static_cast<std::uint64_t>(late);
        if (late > 0) due += late * options.period;
        const auto since = due.time_since_epoch().count();
        const timespec until{since / 1'000'000'000, since % 1'000'000'000};
        (void)::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
        master.exchange(due, options.period / 2, figures);
    }
}

void runner_turn(Driver& master, const Options& options, std::uint64_t cycles, Figures& figures, bool tell) {
    CyclicRunner runner({.period = options.period,
                         .spin = options.spin,
                         .priority = options.priority,
                         .cpu = options.cpu,
                         .interface = bench::kNear});
    for (const auto& refusal : runner.prepare())
        if (tell) std::printf("not granted: %s\n", refusal.what);
    runner.start();
    for (std::uint64_t n = 0; n < cycles; ++n) {
        const auto tick = runner.wait();
        figures.left_out += tick.skipped;
        master.exchange(tick.deadline, options.period / 2, figures);
    }
}

void print_row(const char* name, const char* what, const DurationHistogram& all) {
    const auto us = [&all](double q) { return static_cast<double>(all.quantile(q).count()) / 1000; };
    std::printf("  %-22s %-10s p50 %9.2f   p99 %9.2f   p99.99 %9.2f   most %9.2f us\n", name, what, us(0.5), us(0.99),
                us(0.9999), static_cast<double>(all.max().count()) / 1000);
}

void print(const char* name, const Figures& figures) {
    print_row(name, "wake-up", figures.wake_up);
    print_row("", "round trip", figures.round_trip);
    const auto number = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
    std::printf("  %-22s lost       %llu of %llu cycles: %llu left out, %llu without a reply in time\n", "",
                number(figures.left_out + figures.without_reply), number(figures.cycles + figures.left_out),
                number(figures.left_out), number(figures.without_reply));
}

[[nodiscard]] bool measure(Driver& master, const Options& options, const std::string& kind) {
    bench::Load load;
    std::string why;
    const auto kinds = kind == "all"    ? std::vector<std::string>{"cpu", "memory", "network"}
                       : kind == "none" ? std::vector<std::string>{}
                                        : std::vector{kind};
    for (const auto& one : kinds)
        if (!load.start(one, why)) {
            std::printf("%s\n", why.c_str());
            return false;
        }
    Figures plain;
    Figures runner;
    for (std::uint64_t done = 0; done < options.cycles; done += kCyclesOfATurn) {
        const std::uint64_t cycles = std::min(kCyclesOfATurn, options.cycles - done);
        // Each loop has its own thread, because the scheduling policy stays with a thread.
        std::thread([&] {
            master.take();
            plain_turn(master, options, cycles, plain);
        }).join();
        std::thread([&] {
            master.take();
            runner_turn(master, options, cycles, runner, done == 0);
        }).join();
        master.take();
    }
    std::printf("load: %s\n", kind.c_str());
    print("plain clock_nanosleep", plain);
    print("CyclicRunner", runner);
    const auto p99 = [](const Figures& of) { return static_cast<double>(of.wake_up.quantile(0.99).count()); };
    std::printf("  p99 of the wake-up: the runner's is %.4f of the plain loop's\n", p99(runner) / p99(plain));
    return true;
}

// Returns false when an argument is wrong.
[[nodiscard]] bool read_options(int argc, char** argv, Options& options) {
    for (int n = 1; n + 1 < argc; n += 2) {
        const std::string_view name(argv[n]);
        const long number = std::strtol(argv[n + 1], nullptr, 10);
        if (name == "--cycles" && number > 0) {
            options.cycles = static_cast<std::uint64_t>(number);
        } else if (name == "--period-us" && number > 0) {
            options.period = std::chrono::microseconds(number);
        } else if (name == "--priority" && number > 0 && number < 100) {
            options.priority = static_cast<int>(number);
        } else if (name == "--spin-us" && number >= 0) {
            options.spin = std::chrono::microseconds(number);
        } else if (name == "--cpu" && number >= -1) {
            options.cpu = static_cast<int>(number);
        } else if (name == "--load") {
            options.loads.clear();
            std::string_view list(argv[n + 1]);
            for (std::size_t end = 0; end != std::string_view::npos;
                 list.remove_prefix(std::min(end + 1, list.size()))) {
                end = list.find(',');
                options.loads.emplace_back(list.substr(0, end));
            }
        } else {
            return false;
        }
    }
    return argc % 2 == 1;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    if (!read_options(argc, argv, options)) {
        std::printf(
            "usage: bench_cyclic [--cycles N] [--load none,cpu,memory,network,all] [--period-us N] [--priority N] "
            "[--spin-us N] [--cpu N]\n");
        return 2;
    }
    std::string why;
    if (!bench::make_cable(why)) {
        std::printf("nothing was measured: %s\n", why.c_str());
        return kSkipped;
    }
    const Segment segment(options.priority);
    Driver master;
    if (why = master.start(segment); !why.empty()) {
        std::printf("nothing was measured: %s\n", why.c_str());
        return 1;
    }
    std::printf(
        "%u slaves in another process, a cycle of %lld us; the targets are 0 lost of 60000 cycles without load, "
        "and a p99 of the wake-up of 0.1 of the plain loop's\n",
        master.slaves(), static_cast<long long>(options.period.count() / 1000));
    for (const auto& kind : options.loads)
        if (!measure(master, options, kind)) return 2;
    return 0;
}
