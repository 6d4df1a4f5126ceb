// Compares a cycle by the AF_XDP NIC with one by the AF_PACKET NIC, alternately in one run, against the same XDP
// program at the far end of a cable, which returns the frames. Counts the system calls of a cycle.
//
//   bench_xdp           prints medians, the ratio and the counts
//   bench_xdp check     fails when a cycle by AF_XDP needs more than one system call; measures no time
#include "common/far_end.hpp"
#include "common/mapped_bus.hpp"
#include "common/system_calls.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "oshw/xdp/xdp_nic.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>

namespace {

using namespace margay;
using namespace margay::bench;

struct Load {
    std::uint32_t slaves;
    std::uint32_t bytes;  // per slave, in each direction
};

// A bus with one frame per cycle at the near end of the cable, by one of the two NICs.
struct Near {
    MappedBus bus;
    PacketNic packet;
    XdpNic xdp;
    std::unique_ptr<FarEnd> far;

    [[nodiscard]] bool build(const Load& load, std::string& why) {
        if (!bus.build(load.slaves, load.bytes, load.bytes)) {
            why = "the segment could not be mapped";
            return false;
        }
        const DatagramStatus& datagram = bus.ctx->group(0).datagrams[0];
        const Answer answer{bus.nic.last.size(), 14 + 2 + 10 + 2UL * load.bytes * load.slaves, datagram.expected};
        far = echo_by_xdp(answer, why);
        return far != nullptr;
    }
    [[nodiscard]] bool use(bool by_xdp, XdpNic::Mode mode, std::string& why) {
        packet.close();
        xdp.close();
        const bool open = by_xdp ? xdp.open(kNear, {.mode = mode}).ok() : packet.open(kNear).ok();
        why = by_xdp ? xdp.problem() : packet.problem();
        bus.plug_over(by_xdp ? static_cast<Nic&>(xdp) : packet);
        return open && cycle();
    }
    [[nodiscard]] bool cycle() {
        return send_processdata(*bus.ctx).ok() && receive_processdata(*bus.ctx, std::chrono::milliseconds(20)).ok();
    }
};

double median(std::vector<double>& all) {
    std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
    return all[all.size() / 2];
}

bool compare(const Load& load, XdpNic::Mode mode, std::string& why) {
    constexpr unsigned kTurns = 20;
    constexpr unsigned kOfEach = 1500;
    Near near;
    if (!near.build(load, why)) return false;
    std::array<std::vector<double>, 2> times;
    for (unsigned turn = 0; turn < 2 * kTurns; ++turn) {
        const bool by_xdp = turn % 2 != 0;
        if (!near.use(by_xdp, mode, why)) return false;
        for (unsigned n = 0; n < kOfEach; ++n) {
            const Time begin = near.bus.osal.now();
            if (!near.cycle()) {
                why = "a frame did not come back";
                return false;
            }
            times[by_xdp].push_back(std::chrono::duration<double, std::micro>(near.bus.osal.now() - begin).count());
        }
    }
    const double packet = median(times[0]);
    const double xdp = median(times[1]);
    std::printf("%3u x %3u + %3u octets  %-8s %8.2f us %8.2f us %8.3f\n", load.slaves, load.bytes, load.bytes,
                std::string(to_text(mode)).c_str(), packet, xdp, xdp / packet);
    return true;
}

double calls_by(bool xdp) {
    return calls_per_cycle([xdp]() -> std::function<bool()> {
        auto near = std::make_shared<Near>();
        std::string why;
        if (!near->build({1, 16}, why) || !near->use(xdp, XdpNic::Mode::automatic, why)) return {};
        return [near] { return near->cycle(); };
    });
}

}  // namespace

int main(int argc, char** argv) {
    constexpr int kSkipped = 77;
    std::string why;
    if (!make_cable(why)) {
        std::printf("nothing was measured: %s\n", why.c_str());
        return kSkipped;
    }
    const double calls = calls_by(true);
    if (argc == 2 && std::strcmp(argv[1], "check") == 0) return check_calls(calls, 1);
    std::printf("%-31s %11s %11s %8s\n", "", "AF_PACKET", "AF_XDP", "ratio");
    bool good = true;
    for (const auto mode : {XdpNic::Mode::copy, XdpNic::Mode::generic}) {
        for (const Load& load : {Load{1, 16}, Load{1, 743}, Load{10, 32}}) {
            why.clear();
            if (compare(load, mode, why)) continue;
            std::printf("%u x %u octets: %s\n", load.slaves, load.bytes, why.c_str());
            good = false;
        }
    }
    std::printf("system calls a cycle: AF_PACKET %.3f, AF_XDP %.3f\n", calls_by(false), calls);
    return good ? 0 : 1;
}
