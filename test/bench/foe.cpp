// The payload of file transfers against the bound that the mailbox gives, one slave against twenty slaves at once, and
// 16 MiB over a line that loses 1 % of its frames.
//
// The slaves have mailboxes of 1024 octets and answer at once; a burst of frames is a round trip of 100 µs. Bound: as
// many round trips as the same number of mailbox messages need that are answered at once (SDO uploads of 4 octets), and
// each message full. The promises: the payload is at least 0.95 of that bound, and twenty slaves take at most 1.3 times
// the bus time of one.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/library/bootloader.hpp"

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

constexpr std::size_t kPayload = 1024 - 12;  // octets of a full packet

[[noreturn]] void fail(const char* what, const Error& error = {}) {
    std::array<char, 400> text{};
    const auto words = describe(error, text);
    std::printf("%s: %.*s\n", what, static_cast<int>(words.size()), words.data());
    std::exit(1);
}

struct Bus {
    explicit Bus(std::size_t slaves, std::uint32_t percent_lost = 0)
        : cable(segment, osal),
          nic(cable, {.seed = 7, .received = Rate::percent(percent_lost)}),
          ctx({.slaves = static_cast<std::uint16_t>(slaves)}) {
        for (std::size_t n = 0; n < slaves; ++n) {
            const auto number = segment.add(sim::make_device("bootloader_open").value().assemble());
            (void)(n == 0 ? segment.connect_master({number, 0}) : segment.connect({number - 1, 1}, {number, 0}));
        }
        segment.power_up(osal.now());
        if (const auto ready = init(ctx, nic, osal); !ready) fail("init", ready.error());
        const auto found = config_init(ctx);
        if (!found || *found != slaves) fail("scan", found.error());
    }
    void to_boot() {
        for (const Slave& slave : ctx.slaves())
            if (const auto boot = set_target(ctx, slave.number, AlState::boot); !boot) fail("BOOT", boot.error());
    }
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic cable;
    DropNic nic;
    HostContext ctx;
};

// Round trips of one mailbox message with its answer.
double trips_of_a_message() {
    Bus bus(1);
    constexpr int kMessages = 200;
    if (const auto read = SDOread<std::uint32_t>(bus.ctx, 1, 0x1018, 1); !read) fail("SDO", read.error());
    const std::uint64_t before = bus.ctx.statistics().bursts;
    for (int n = 0; n < kMessages; ++n)
        if (const auto read = SDOread<std::uint32_t>(bus.ctx, 1, 0x1018, 1); !read) fail("SDO", read.error());
    return static_cast<double>(bus.ctx.statistics().bursts - before) / kMessages;
}

struct Flashed {
    std::uint64_t trips = 0;
    Duration time{0};
    double payload = 0;  // share of the bound
};

// Measures without the time in which the devices erase and check. This time is measured with a small file.
Flashed flash(std::size_t slaves, const std::vector<std::byte>& image) {
    Bus bus(slaves);
    bus.to_boot();
    const std::uint64_t before = bus.ctx.statistics().bursts;
    const Time begin = bus.osal.now();
    std::vector<std::unique_ptr<FoeWrite>> writes;
    for (std::size_t n = 0; n < slaves; ++n) {
        auto& write = *writes.emplace_back(std::make_unique<FoeWrite>());
        write.slave = static_cast<std::uint16_t>(n + 1);
        write.name = "firmware";
        write.data = image;
        if (const auto submitted = submit(bus.ctx, write); !submitted) fail("submit", submitted.error());
    }
    const auto any_busy = [&] { return std::ranges::any_of(writes, [](const auto& w) { return w->busy(); }); };
    while (any_busy()) {
        const Time next = poll(bus.ctx, bus.osal.now());
        if (any_busy()) bus.osal.wait(next, -1);
    }
    for (const auto& write : writes)
        if (write->state() != RequestState::success) fail("write", write->error());
    return {bus.ctx.statistics().bursts - before, bus.osal.now() - begin};
}

std::vector<std::byte> image(std::size_t bytes) {
    return sim::Bootloader::make_image(2, 1, bytes, sim::Bootloader::kOpenProduct);
}

bool over_a_bad_line(std::size_t bytes) {
    Bus bus(1, 1);
    bus.to_boot();
    const auto file = image(bytes);
    const Time begin = bus.osal.now();
    if (const auto written = FOEwrite(bus.ctx, 1, "firmware", 0, std::span<const std::byte>(file)); !written)
        fail("write", written.error());
    std::vector<std::byte> back(file.size());
    const auto read = FOEread(bus.ctx, 1, "firmware", 0, std::span(back));
    if (!read) fail("read", read.error());
    const bool same = *read == file.size() && back == file;
    std::printf("%zu octets there and back with 1 %% of the frames lost: %s, %.1f s of bus time, %llu frames lost\n",
                file.size(), same ? "identical" : "NOT identical",
                std::chrono::duration<double>(bus.osal.now() - begin).count(),
                static_cast<unsigned long long>(bus.ctx.statistics().lost));
    return same;
}

}  // namespace

int main() {
    const double message = trips_of_a_message();
    constexpr std::size_t kFile = 1'000'000;
    bool kept = true;
    std::printf("%.2f round trips for a mailbox message and its answer\n", message);
    std::printf("%6s %11s %9s %18s %10s\n", "slaves", "round trips", "time ms", "payload / bound", "of one");
    const Flashed idle = flash(1, image(100));  // the time for erasing and checking
    double of_one = 0;
    for (const std::size_t slaves : {1U, 5U, 20U}) {
        const Flashed whole = flash(slaves, image(kFile));
        const auto trips = static_cast<double>(whole.trips - idle.trips);
        const double packets = static_cast<double>(kFile) / kPayload;
        const double payload = packets * message / trips;
        if (slaves == 1) of_one = static_cast<double>(whole.trips);
        const double ratio = static_cast<double>(whole.trips) / of_one;
        std::printf("%6zu %11llu %9.1f %18.3f %10.2f\n", slaves, static_cast<unsigned long long>(whole.trips),
                    std::chrono::duration<double, std::milli>(whole.time).count(), payload, ratio);
        kept = kept && (slaves != 1 || payload >= 0.95) && ratio <= 1.3;
    }
    kept = over_a_bad_line(std::size_t{16} * 1024 * 1024) && kept;
    std::printf("%s\n", kept ? "the payload is that of the mailbox, for one slave and for twenty" : "NOT kept");
    return kept ? 0 : 1;
}
