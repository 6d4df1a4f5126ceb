// Measures the time that the master adds to a cycle on a real interface: send_processdata() + receive_processdata(),
// compared alternately in one run with plain send() + recv() of the same frame through the same socket. Counts the
// system calls of a cycle. The far end of the cable returns frames at once.
//
//   bench_roundtrip           prints medians and ratios
//   bench_roundtrip check     fails when a cycle needs more than two system calls; measures no time
#include "common/far_end.hpp"
#include "common/mapped_bus.hpp"
#include "common/system_calls.hpp"
#include "oshw/linux/packet_nic.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

namespace {

using namespace margay;
using namespace margay::bench;

struct Load {
    std::uint32_t slaves;
    std::uint32_t bytes;  // per slave, in each direction
};

// A bus with one frame per cycle at the near end of the cable.
struct Near {
    MappedBus bus;
    PacketNic nic;
    std::unique_ptr<FarEnd> far;

    [[nodiscard]] bool open(const Load& load, std::string& why) {
        if (!bus.build(load.slaves, load.bytes, load.bytes)) why = "the segment could not be mapped";
        if (why.empty() && !nic.open(kNear)) why = nic.problem();
        if (!why.empty()) return false;
        const DatagramStatus& datagram = bus.ctx->group(0).datagrams[0];
        const Answer answer{bus.nic.last.size(), 14 + 2 + 10 + 2UL * load.bytes * load.slaves, datagram.expected};
        far = echo_by_xdp(answer, why);
        if (far == nullptr) far = echo_by_thread(answer, why);
        bus.plug_over(nic);
        return far != nullptr && cycle();
    }
    [[nodiscard]] bool cycle() {
        return send_processdata(*bus.ctx).ok() && receive_processdata(*bus.ctx, std::chrono::milliseconds(20)).ok();
    }
    // The same cycle in a task that has already read the clock.
    [[nodiscard]] bool cycle(Time now) {
        return send_processdata(*bus.ctx, now).ok() &&
               receive_processdata(*bus.ctx, std::chrono::milliseconds(20)).ok();
    }
    // The same cycle without a master.
    [[nodiscard]] bool bare() {
        static std::array<std::byte, 1518> got;
        const int socket = nic.wait_handle();
        const auto& frame = bus.nic.last;
        if (::send(socket, frame.data(), frame.size(), MSG_DONTWAIT) < 0) return false;
        while (::recv(socket, got.data(), got.size(), MSG_DONTWAIT) <= 0) {
            pollfd waiting{socket, POLLIN, 0};
            if (::poll(&waiting, 1, 20) <= 0) return false;
        }
        return true;
    }
};

double median(std::vector<double>& all) {
    std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
    return all[all.size() / 2];
}

// Calls `what` `count` times and measures each call.
template <class What>
bool measure(unsigned count, std::vector<double>& into, Osal& osal, What what) {
    for (unsigned n = 0; n < count; ++n) {
        const Time begin = osal.now();
        if (!what(begin)) return false;
        into.push_back(std::chrono::duration<double, std::micro>(osal.now() - begin).count());
    }
    return true;
}

bool compare(const Load& load, std::string& why) {
    constexpr unsigned kTurns = 300;
    constexpr unsigned kOfEach = 100;
    Near near;
    if (!near.open(load, why)) return false;
    std::vector<double> ours;
    std::vector<double> timed;
    std::vector<double> bare;
    for (unsigned turn = 0; turn < kTurns; ++turn) {
        const bool good = measure(kOfEach, ours, near.bus.osal, [&](Time) { return near.cycle(); }) &&
                          measure(kOfEach, timed, near.bus.osal, [&](Time now) { return near.cycle(now); }) &&
                          measure(kOfEach, bare, near.bus.osal, [&](Time) { return near.bare(); });
        if (!good) {
            why = "a frame did not come back";
            return false;
        }
    }
    const double b = median(bare);
    const double a = median(ours);
    const double t = median(timed);
    std::printf("%3u x %3u + %3u octets  %8.2f us %8.2f us %8.2f us %8.3f %8.3f    (%s)\n", load.slaves, load.bytes,
                load.bytes, a, t, b, a / b, t / b, near.far->name().c_str());
    return true;
}

// System calls per cycle; negative when nothing could be counted.
double calls_with(const Load& load) {
    return calls_per_cycle([&load]() -> std::function<bool()> {
        auto near = std::make_shared<Near>();
        std::string why;
        if (!near->open(load, why)) return {};
        return [near] { return near->cycle(); };
    });
}

constexpr Load kSmall{1, 16};
constexpr Load kLoads[] = {kSmall, {1, 743}, {10, 32}};

}  // namespace

int main(int argc, char** argv) {
    constexpr int kSkipped = 77;
    std::string why;
    if (!make_cable(why)) {
        std::printf("nothing was measured: %s\n", why.c_str());
        return kSkipped;
    }
    const double calls = calls_with(kSmall);
    if (argc == 2 && std::strcmp(argv[1], "check") == 0) return check_calls(calls, 2);
    std::printf("%-22s %11s %11s %11s %8s %8s\n", "", "margay", "told time", "bare", "ratio", "told time");
    bool good = true;
    for (const Load& load : kLoads) {
        why.clear();
        if (compare(load, why)) continue;
        std::printf("%u x %u octets: %s\n", load.slaves, load.bytes, why.c_str());
        good = false;
    }
    std::printf("system calls a cycle: %.3f\n", calls);
    return good ? 0 : 1;
}
