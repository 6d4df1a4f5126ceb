// Octets of Ethernet frames by EoE for each bus cycle, against the bound that the mailbox gives, for 1 and 20 slaves,
// beside process data that is checked in every cycle.
//
// A mailbox takes one message in each bus cycle, and a look for mail is a datagram of its own. Mailboxes of 1024 octets
// carry fragments of 992 octets, so that a frame of 1514 octets is two messages. Bounds, in bus cycles for one frame of
// a slave:
//
//     to the slave:   2, one for each message; looks for mail share the frame with a message
//     from the slave: 3, a look and two messages: the second one is fetched without a look
//     both at once:   4 for a frame in each direction: the looks share frames with messages to the slave
//
// The promise: at least 0.95 of the bound, with 1 and with 20 slaves, and all slaves have the same share. The budget
// for acyclic data is large enough for all slaves; with the default budget of a group it is the bound, which is
// printed.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/ethernet_port.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

namespace {

using namespace margay;
using namespace std::chrono_literals;

constexpr std::size_t kFrame = 1514;
constexpr unsigned kCycles = 600;

[[noreturn]] void fail(const char* what, const Error& error = {}) {
    std::array<char, 400> text{};
    const auto words = describe(error, text);
    std::printf("%s: %.*s\n", what, static_cast<int>(words.size()), words.data());
    std::exit(1);
}

struct Host final : sim::EthernetPeer {
    std::uint64_t octets = 0;
    void arrived(Bytes frame, Time) override { octets += frame.size(); }
};

struct Bus {
    Bus(std::size_t slaves, std::uint16_t budget)
        : nic(segment, osal), ctx({.slaves = static_cast<std::uint16_t>(slaves)}), hosts(slaves) {
        for (std::size_t n = 0; n < slaves; ++n) {
            const auto number = segment.add(sim::make_device("eoe_gateway").value().assemble());
            (void)(n == 0 ? segment.connect_master({number, 0}) : segment.connect({number - 1, 1}, {number, 0}));
        }
        segment.power_up(osal.now());
        if (const auto ready = init(ctx, nic, osal); !ready) fail("init", ready.error());
        if (const auto found = config_init(ctx); !found) fail("scan", found.error());
        ctx.group(0).config.acyclic_bytes = budget;
        if (const auto mapped = config_map(ctx, image); !mapped) fail("map", mapped.error());
        for (int n = 0; n < 5; ++n) cycle();
        if (const auto op = writestate(ctx, 0, AlState::op); !op) fail("OP", op.error());
        for (int n = 0; n < 100; ++n) cycle();
        for (std::size_t n = 0; n < slaves; ++n) {
            segment.slave(static_cast<std::uint32_t>(n)).ethernet()->connect(&hosts[n]);
            memory.push_back(std::make_unique<EoePortMemory<8, 8>>());
            ports.push_back(std::make_unique<EoePort>(*memory.back()));
            ports.back()->slave = static_cast<std::uint16_t>(n + 1);
            if (const auto begun = submit(ctx, *ports.back()); !begun) fail("port", begun.error());
        }
        checks = true;
    }
    void cycle() {
        osal.advance(1ms);
        segment.advance(osal.now());
        ++written;
        for (const Slave& slave : ctx.slaves()) store_le(slave.image.outputs.bytes, 0, written);
        if (!send_processdata(ctx)) fail("send");
        const auto wkc = receive_processdata(ctx, 500us);
        if (!wkc) fail("receive", wkc.error());
        for (const Slave& slave : ctx.slaves())
            if (checks && load_le<std::uint16_t>(slave.image.inputs.bytes) != written - 1) ++disturbed;
        (void)poll(ctx, osal.now());
    }
    void feed(bool to, bool from) {
        static const std::vector<std::byte> frame(kFrame, std::byte{2});
        std::array<std::byte, kEoeFrameBytes> buffer;
        for (std::size_t n = 0; n < ports.size(); ++n) {
            while (to && ports[n]->can_send()) (void)ports[n]->send(frame);
            auto& slave = *segment.slave(static_cast<std::uint32_t>(n)).ethernet();
            while (from && slave.has_room()) (void)slave.put(frame);
            if (from) segment.interrupt(static_cast<std::uint32_t>(n), osal.now());
            while (ports[n]->receive(buffer)) {
            }
        }
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic nic;
    HostContext ctx;
    std::vector<std::byte> image = std::vector<std::byte>(256);
    std::vector<Host> hosts;
    std::vector<std::unique_ptr<EoePortMemory<8, 8>>> memory;
    std::vector<std::unique_ptr<EoePort>> ports;
    std::uint16_t written = 0;
    std::uint64_t disturbed = 0;
    bool checks = false;
};

struct Measured {
    double to = 0;  // octets of all slaves per cycle
    double from = 0;
    double share = 1;  // the slave with the fewest frames divided by the slave with the most frames
    std::uint64_t disturbed = 0;
};

Measured measure(std::size_t slaves, bool to, bool from, std::uint16_t budget) {
    Bus bus(slaves, budget);
    const auto run = [&](unsigned cycles) {
        for (unsigned n = 0; n < cycles; ++n) {
            bus.feed(to, from);
            bus.cycle();
        }
    };
    run(50);
    std::vector<EoeStatistics> before;
    for (const auto& port : bus.ports) before.push_back(port->statistics());
    run(kCycles);
    Measured measured{.disturbed = bus.disturbed};
    std::uint64_t least = UINT64_MAX;
    std::uint64_t most = 0;
    for (std::size_t n = 0; n < slaves; ++n) {
        const auto now = bus.ports[n]->statistics();
        const std::uint64_t sent = now.sent_octets - before[n].sent_octets;
        const std::uint64_t received = now.received_octets - before[n].received_octets;
        measured.to += static_cast<double>(sent) / kCycles;
        measured.from += static_cast<double>(received) / kCycles;
        least = std::min(least, sent + received);
        most = std::max(most, sent + received);
    }
    measured.share = static_cast<double>(least) / static_cast<double>(most);
    return measured;
}

}  // namespace

int main() {
    struct Way {
        const char* name;
        bool to;
        bool from;
        double cycles;  // of a frame, or of one frame in each direction
    };
    constexpr Way kWays[] = {
        {"to the slave", true, false, 2}, {"from the slave", false, true, 3}, {"both", true, true, 4}};
    bool kept = true;
    std::printf("%-15s %6s | %14s %8s %15s | %s\n", "frames", "slaves", "octets a cycle", "of bound", "smallest share",
                "with the default budget");
    for (const Way& way : kWays)
        for (const std::size_t slaves : {std::size_t{1}, std::size_t{20}}) {
            const Measured all = measure(slaves, way.to, way.from, 0xFFFF);
            const Measured limited = measure(slaves, way.to, way.from, GroupConfiguration{}.acyclic_bytes);
            const double frames = way.to && way.from ? 2 : 1;
            const double bound = frames * static_cast<double>(kFrame * slaves) / way.cycles;
            const double ratio = (all.to + all.from) / bound;
            std::printf("%-15s %6zu | %14.0f %8.3f %15.2f | %6.0f octets, share %.2f\n", way.name, slaves,
                        all.to + all.from, ratio, all.share, limited.to + limited.from, limited.share);
            kept = kept && ratio >= 0.95 && all.share >= 0.95 && limited.share >= 0.9;
            if (all.disturbed + limited.disturbed != 0) {
                std::printf("process data was wrong %llu times\n",
                            static_cast<unsigned long long>(all.disturbed + limited.disturbed));
                kept = false;
            }
        }
    std::printf("%s\n", kept ? "the payload is that of the mailbox, and process data is undisturbed" : "NOT kept");
    return kept ? 0 : 1;
}
