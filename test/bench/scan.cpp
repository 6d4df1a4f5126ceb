// Measures the bus use and the duration of a scan, and compares them with lower bounds.
//
// Every slave has an SII of 2 KiB. A round trip lasts 100 µs, for any number of frames that are sent together. Two
// things are measured: config_init(), which reads only the parts that it needs, and reading the whole 2 KiB of all
// slaves at the same time. The bounds:
//   time      the EEPROM's time for the necessary blocks of 8 octets, and one round trip for each step of the scan that
//             depends on the step before;
//   bus time  the necessary datagrams, in full frames, at 80 ns per octet.
// The measured round trips are compared with the round trips that fit into the time bound. The last column is the time
// when frames also queue on the wire, as on a real cable. It has no target.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/segment.hpp"
#include "wire/sii_writer.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace margay;
using namespace std::chrono_literals;
namespace sii = wire::sii;

constexpr Duration kRoundTrip = 100us;
constexpr std::size_t kImageBytes = 2048;
constexpr std::size_t kBlock = 8;
// Steps: count, INIT twice, check that all are in INIT, clear, addresses, ESC information, count again, mailbox,
// EEPROM to PDI, request a state, check the state.
constexpr int kSteps = 12;

std::vector<std::byte> image() {
    std::vector<std::byte> bytes(kImageBytes);
    const FmmuUse fmmus[] = {FmmuUse::outputs, FmmuUse::inputs, FmmuUse::mailbox_status};
    const SmInfo sms[] = {{0x1000, 128, 0x26, 1, SmType::mailbox_out},
                          {0x1080, 128, 0x22, 1, SmType::mailbox_in},
                          {0x1100, 8, 0x64, 1, SmType::outputs},
                          {0x1180, 8, 0x20, 1, SmType::inputs}};
    std::vector<std::string> names;
    for (int i = 0; i < 60; ++i) names.push_back("entry number " + std::to_string(i));
    std::vector<sii::PdoEntryDescription> entries;
    for (const auto& name : names) entries.push_back({.index = 0x6000, .subindex = 1, .name = name, .bit_length = 1});
    const sii::PdoDescription tx[] = {{.index = 0x1A00, .sync_manager = 3, .name = "inputs", .entries = entries}};
    const auto written = sii::write_image({.configuration = {.pdi_control = 0x0100},  // device emulation: PREOP at once
                                           .identity = {0x4D47, 1, 1, 1},
                                           .mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE},
                                           .group = "Bench",
                                           .order = "MG-BENCH",
                                           .name = "MG-BENCH, a slave to be scanned",
                                           .fmmus = fmmus,
                                           .sync_managers = sms,
                                           .tx_pdos = tx},
                                          bytes);
    if (!written.ok()) {
        std::printf("the image cannot be made: %s\n", std::string(sii::to_text(written.fault)).c_str());
        std::exit(1);
    }
    return bytes;
}

// The number of blocks that a reader with complete knowledge of the content would read for a scan.
std::size_t needed_blocks(Bytes bytes) {
    std::vector<bool> needed(bytes.size() / 2);
    const auto mark = [&](std::size_t from, std::size_t octets) {
        for (std::size_t i = from / 2; i < (from + octets + 1) / 2; ++i) needed[i] = true;
    };
    mark(0, sii::kConfigurationBytes + sii::kIdentityBytes);
    mark(sii::word::kBootMailbox * 2, sii::kMailboxesBytes);
    mark(sii::word::kSize * 2, 2);
    sii::CategoryWalker walker(bytes);
    Bytes strings;
    std::size_t strings_at = 0;
    sii::General general;
    while (const auto category = walker.next()) {
        const std::size_t at = category->place.word * 2;
        if (category->place.type > sii::category::kSyncManager) break;
        mark(at - sii::kCategoryHeaderBytes, sii::kCategoryHeaderBytes);
        if (category->place.type == sii::category::kStrings) {
            strings = category->content;
            strings_at = at;
        } else {
            const bool is_general = category->place.type == sii::category::kGeneral;
            if (is_general) general = sii::parse_general(category->content).value;
            mark(at, is_general ? 14 : category->content.size());
        }
    }
    const auto name = sii::string(strings, general.name).value;
    mark(strings_at, static_cast<std::size_t>(name.data() - strings.data()) + name.size());
    std::size_t blocks = 0;
    for (std::size_t i = 0; i < needed.size();) {
        if (!needed[i]) {
            ++i;
            continue;
        }
        ++blocks;
        i += kBlock / 2;
    }
    return blocks;
}

struct Bus {
    Bus(std::size_t slaves, Duration eeprom, bool wire_time)
        : nic(segment, osal, {.round_trip = kRoundTrip, .wire_time = wire_time}),
          ctx({.slaves = static_cast<std::uint16_t>(slaves)}) {
        const auto content = image();
        for (std::size_t i = 0; i < slaves; ++i) {
            auto description = sim::ip_core();
            description.sii.read = eeprom;
            description.sii.reads_8_bytes = true;
            const auto number = segment.add(std::make_unique<sim::Esc>(description, content));
            if (i == 0)
                (void)segment.connect_master({number, 0});
            else
                (void)segment.connect({number - 1, 1}, {number, 0});
        }
        segment.power_up(osal.now());
        osal.advance(10ms);
        if (!init(ctx, nic, osal)) std::exit(1);
    }
    void scan() {
        const auto found = config_init(ctx);
        if (!found || *found != ctx.limits().slaves) {
            std::printf("the scan failed\n");
            std::exit(1);
        }
    }
    void read_all() {
        std::vector<std::vector<std::byte>> images(ctx.slaves().size(), std::vector<std::byte>(kImageBytes));
        std::vector<SiiReadRequest> requests(ctx.slaves().size());
        for (std::size_t i = 0; i < requests.size(); ++i) {
            requests[i].slave = static_cast<std::uint16_t>(i + 1);
            requests[i].data = images[i];
            (void)submit(ctx, requests[i]);
        }
        const auto content = image();
        for (std::size_t i = 0; i < requests.size(); ++i)
            if (!wait(ctx, requests[i]) || images[i] != content) {
                std::printf("reading slave %zu failed\n", i + 1);
                std::exit(1);
            }
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic nic;
    HostContext ctx;
};

// The time on the wire of datagrams with this number of octets, in full frames.
Duration bus_time(std::size_t datagram_bytes) {
    const std::size_t frames = (datagram_bytes + wire::kMaxDatagramsBytes - 1) / wire::kMaxDatagramsBytes;
    return Duration(80) *
           static_cast<std::int64_t>(datagram_bytes + frames * (wire::kFramePrefixBytes + wire::kBusOverheadBytes));
}

// The octets that a slave needs on the bus. An FPWR of 6 octets requests each block, and an FPRD of 14 octets reads it.
// A scan also writes the station address (2), reads ESC information (10, 2, 2, 1), configures the mailbox (16), gives
// the EEPROM to the PDI (1), requests a state (2) and reads the state (6).
std::size_t needed_bytes(std::size_t blocks, bool whole) {
    constexpr std::size_t kOverhead = wire::kDatagramOverheadBytes;
    const std::size_t of_blocks = blocks * (2 * kOverhead + 6 + 14);
    return of_blocks + (whole ? 0 : 9 * kOverhead + 2 + 10 + 2 + 2 + 1 + 16 + 1 + 2 + 6);
}

struct Measured {
    std::uint64_t trips = 0;
    std::uint64_t frames = 0;
    Duration bus{0};
    Duration time{0};
};

Measured measure(std::size_t slaves, Duration eeprom, bool whole, bool wire_time) {
    Bus bus(slaves, eeprom, wire_time);
    Time start = bus.osal.now();
    LinkStatistics before{};
    bus.scan();
    if (whole) {
        before = bus.ctx.statistics();
        start = bus.osal.now();
        bus.read_all();
    }
    const auto& after = bus.ctx.statistics();
    return {after.bursts - before.bursts, after.frames_sent - before.frames_sent,
            Duration(80) * static_cast<std::int64_t>(after.bytes_on_wire - before.bytes_on_wire),
            bus.osal.now() - start};
}

double ms(Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

bool line(std::size_t slaves, Duration eeprom, bool whole) {
    const Measured plain = measure(slaves, eeprom, whole, false);
    const Measured queued = measure(slaves, eeprom, whole, true);
    const std::size_t blocks = whole ? kImageBytes / kBlock : needed_blocks(image());
    const int steps =
        (whole ? 2 : kSteps) + 1;  // whole: take the EEPROM back from the PDI; plus the request of the first block
    const Duration time_bound = std::max(eeprom, kRoundTrip) * static_cast<std::int64_t>(blocks) + kRoundTrip * steps;
    const Duration bus_bound = bus_time(slaves * needed_bytes(blocks, whole));
    const double trips_bound = static_cast<double>(time_bound.count()) / static_cast<double>(kRoundTrip.count());
    const double bound = ms(std::max(time_bound, bus_bound));
    const double ratio = std::max(ms(plain.time), ms(plain.bus)) / bound;
    const double bus_ratio = ms(plain.bus) / ms(bus_bound);
    std::printf("%-9s %6zu %6lld | %6llu %6.0f | %7llu %8.2f %8.2f %5.2f | %8.2f %8.2f %5.2f | %8.2f\n",
                whole ? "whole SII" : "scan", slaves, static_cast<long long>(eeprom.count() / 1000),
                static_cast<unsigned long long>(plain.trips), trips_bound,
                static_cast<unsigned long long>(plain.frames), ms(plain.bus), ms(bus_bound), bus_ratio, ms(plain.time),
                bound, ratio, ms(queued.time));
    return static_cast<double>(plain.trips) <= 1.25 * trips_bound && ratio <= 1.25;
}

}  // namespace

int main() {
    std::printf("%-9s %6s %6s | %6s %6s | %7s %8s %8s %5s | %8s %8s %5s | %8s\n", "", "slaves", "EEPROM", "round",
                "bound", "frames", "bus ms", "bound", "ratio", "time ms", "bound", "ratio", "queued");
    std::printf("%-9s %6s %6s | %6s\n", "", "", "us/8", "trips");
    bool within = true;
    for (const bool whole : {false, true})
        for (const Duration eeprom : {30us, 300us, 680us})
            for (const std::size_t slaves : {1U, 10U, 50U, 100U, 200U, 1000U})
                within = line(slaves, eeprom, whole) && within;
    const auto one = measure(1, 680us, false, false).trips;
    const auto hundred = measure(100, 680us, false, false).trips;
    std::printf("round trips for 100 slaves / for 1: %.2f\n", static_cast<double>(hundred) / static_cast<double>(one));
    within = within && hundred * 10 <= one * 12;
    std::printf("%s\n", within ? "all within 1.25 of the bounds" : "NOT all within 1.25 of the bounds");
    return within ? 0 : 1;
}
