// Counts round trips, and cycles of a running bus, for SDO reads of one slave and of many slaves at the same time.
//
// Slaves have mailboxes of 128 octets and answer at once. Without cycles, every burst of frames is a round trip of 100
// µs. With cycles, process data is exchanged every millisecond. Mailbox datagrams use the free space of the cycle's
// frames, and additional frames up to the budget (GroupConfiguration::acyclic_bytes). The promise: with a budget that
// is sufficient for all reads, many reads need as many cycles as one read. The result with the default budget of a
// group is printed, too: then the reads need more cycles, but process data is not delayed.
//
// And the payload of large values against the bound that the mailbox gives: as many round trips as the same number of
// messages need that are answered at once (reads of 4 octets), and each message full. The promise is 0.95 of the bound,
// for a value that is read and written by SDO, and for a file that is written and read by FoE.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/library/bootloader.hpp"
#include "wire/sii_writer.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

using namespace margay;
using namespace std::chrono_literals;
namespace sii = wire::sii;

[[noreturn]] void fail(const char* what, const Error& error = {}) {
    std::array<char, 400> text{};
    const auto words = describe(error, text);
    std::printf("%s: %.*s\n", what, static_cast<int>(words.size()), words.data());
    std::exit(1);
}

std::vector<std::byte> image() {
    const FmmuUse fmmus[] = {FmmuUse::outputs, FmmuUse::inputs, FmmuUse::mailbox_status};
    const SmInfo sms[] = {{0x1000, 128, 0x26, 1, SmType::mailbox_out},
                          {0x1080, 128, 0x22, 1, SmType::mailbox_in},
                          {0x1100, 2, 0x64, 1, SmType::outputs},
                          {0x1180, 2, 0x20, 1, SmType::inputs}};
    const sii::PdoEntryDescription out[] = {{.index = 0x7000, .subindex = 1, .name = "Out", .bit_length = 16}};
    const sii::PdoEntryDescription in[] = {{.index = 0x6000, .subindex = 1, .name = "In", .bit_length = 16}};
    const sii::PdoDescription rx[] = {{.index = 0x1600, .sync_manager = 2, .name = "Outputs", .entries = out}};
    const sii::PdoDescription tx[] = {{.index = 0x1A00, .sync_manager = 3, .name = "Inputs", .entries = in}};
    sii::Description description{.configuration = {.pdi_control = 0x0005},
                                 .identity = {0x4D47, 0x1234, 1, 77},
                                 .mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE},
                                 .name = "MG-BENCH, a slave with a mailbox and a long name",
                                 .fmmus = fmmus,
                                 .sync_managers = sms,
                                 .tx_pdos = tx,
                                 .rx_pdos = rx};
    description.general.coe_details = coe_detail::kSdo;
    std::vector<std::byte> bytes(2048);
    const auto written = sii::write_image(description, bytes);
    if (!written.ok()) fail("the SII cannot be made");
    return bytes;
}

struct Bus {
    explicit Bus(std::size_t slaves) : nic(segment, osal), ctx({.slaves = static_cast<std::uint16_t>(slaves)}) {
        for (std::size_t n = 0; n < slaves; ++n) {
            auto device = sim::device_from_sii(image());
            device.chip = sim::lan9252();
            add(std::move(device));
        }
        start();
    }
    // One device of the library.
    explicit Bus(const char* name) : nic(segment, osal), ctx({.slaves = 1}) {
        add(sim::make_device(name).value());
        start();
    }

    void add(sim::Device device) {
        const auto number = segment.add(std::move(device).assemble());
        (void)(number == 0 ? segment.connect_master({0, 0}) : segment.connect({number - 1, 1}, {number, 0}));
    }
    void start() {
        segment.power_up(osal.now());
        if (const auto ready = init(ctx, nic, osal); !ready) fail("init", ready.error());
        const auto found = config_init(ctx);
        if (!found || *found != segment.size()) fail("scan", found.error());
    }

    void cycle() {
        osal.advance(1ms);
        if (!send_processdata(ctx)) fail("send");
        const auto wkc = receive_processdata(ctx, 500us);
        if (!wkc) fail("receive", wkc.error());
        (void)poll(ctx, osal.now());
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic nic;
    HostContext ctx;
};

// One read per slave. All reads are submitted at the same time.
struct Reads {
    explicit Reads(Bus& b) : bus(b), requests(b.ctx.slaves().size()), values(requests.size()) {}
    void submit_all(std::uint16_t index, std::uint8_t subindex) {
        for (std::size_t n = 0; n < requests.size(); ++n) {
            requests[n].slave = static_cast<std::uint16_t>(n + 1);
            requests[n].index = index;
            requests[n].subindex = subindex;
            requests[n].data = values[n];
            if (const auto submitted = submit(bus.ctx, requests[n]); !submitted) fail("submit", submitted.error());
        }
    }
    [[nodiscard]] bool busy() const {
        return std::ranges::any_of(requests, [](const SdoUpload& r) { return r.busy(); });
    }
    void check() const {
        for (const auto& r : requests)
            if (r.state() != RequestState::success) fail("read", r.error());
    }
    Bus& bus;
    std::vector<SdoUpload> requests;
    std::vector<std::array<std::byte, 128>> values;
};

struct Measured {
    std::uint64_t trips = 0;
    std::uint64_t frames = 0;
    Duration time{0};
};

Measured beside(std::size_t slaves, std::uint16_t index, std::uint8_t subindex) {
    Bus bus(slaves);
    Reads reads(bus);
    Measured measured;
    for (int round = 0; round < 2; ++round) {  // the first round also checks the mailboxes for old messages
        const LinkStatistics before = bus.ctx.statistics();
        const Time begin = bus.osal.now();
        reads.submit_all(index, subindex);
        while (reads.busy()) {
            const Time next = poll(bus.ctx, bus.osal.now());
            if (reads.busy()) bus.osal.wait(next, -1);
        }
        reads.check();
        const LinkStatistics& after = bus.ctx.statistics();
        measured = {after.bursts - before.bursts, after.frames_sent - before.frames_sent, bus.osal.now() - begin};
    }
    return measured;
}

// Cycles from submit() to the last value.
unsigned in_cycle(std::size_t slaves, std::uint16_t index, std::uint8_t subindex, std::uint16_t budget) {
    Bus bus(slaves);
    std::vector<std::byte> process_image(8 * slaves);
    bus.ctx.group(0).config.acyclic_bytes = budget;
    if (const auto mapped = config_map(bus.ctx, process_image); !mapped) fail("map", mapped.error());
    for (int n = 0; n < 5; ++n) bus.cycle();
    Reads reads(bus);
    unsigned cycles = 0;
    for (int round = 0; round < 2; ++round) {
        reads.submit_all(index, subindex);
        (void)poll(bus.ctx, bus.osal.now());
        for (cycles = 0; reads.busy(); ++cycles) bus.cycle();
        reads.check();
    }
    return cycles;
}

// ------------------------------------------------------------------ payload

// Round trips of `transfer`.
template <class Transfer>
double trips_of(Bus& bus, Transfer transfer) {
    const std::uint64_t before = bus.ctx.statistics().bursts;
    if (const auto done = transfer(); !done) fail("transfer", done.error());
    return static_cast<double>(bus.ctx.statistics().bursts - before);
}

// Round trips of a message and its answer.
double trips_of_a_message(Bus& bus) {
    constexpr int kMessages = 100;
    const auto read = [&] { return SDOread<std::uint32_t>(bus.ctx, 1, 0x1018, 1); };
    (void)trips_of(bus, read);  // now the channel has checked the mailbox for old mail
    double trips = 0;
    for (int n = 0; n < kMessages; ++n) trips += trips_of(bus, read);
    return trips / kMessages;
}

// `full`: octets of a full message; `per_message`: round trips of one.
bool reaches_bound(const char* what, std::size_t bytes, std::size_t full, double per_message, double trips) {
    const double messages = static_cast<double>(bytes) / static_cast<double>(full);
    const double share = messages * per_message / trips;
    std::printf("%-9s %8zu octets, %4zu a message: %6.0f round trips, payload / bound %.3f\n", what, bytes, full, trips,
                share);
    return share >= 0.95;
}

bool sdo_payload() {
    constexpr std::size_t kSegment = 128 - 6 - 2 - 1;  // mailbox, its header, CoE header, SDO command
    constexpr std::uint16_t kBlock = 0x2000;
    Bus bus("odd_device");
    const double message = trips_of_a_message(bus);
    std::vector<std::byte> value(1024);
    for (std::size_t n = 0; n < value.size(); ++n) value[n] = static_cast<std::byte>(n * 7);
    std::vector<std::byte> back(value.size());
    const double down =
        trips_of(bus, [&] { return SDOwrite(bus.ctx, 1, kBlock, 0, false, std::span<const std::byte>(value)); });
    const double up = trips_of(bus, [&] { return SDOread(bus.ctx, 1, kBlock, 0, false, std::span(back)); });
    if (back != value) fail("the value is another one");
    const bool wrote = reaches_bound("SDO write", value.size(), kSegment, message, down);
    return reaches_bound("SDO read", value.size(), kSegment, message, up) && wrote;
}

// Measures without the time in which the device erases and checks. This time is measured with a small file.
bool foe_payload() {
    constexpr std::size_t kPacket = 1024 - 6 - 6;  // mailbox, its header, FoE header
    const auto image_of = [](std::size_t bytes) {
        return sim::Bootloader::make_image(2, 1, bytes, sim::Bootloader::kOpenProduct);
    };
    Bus bus("bootloader_open");
    const double message = trips_of_a_message(bus);
    if (const auto boot = set_target(bus.ctx, 1, AlState::boot); !boot) fail("BOOT", boot.error());
    const auto write = [&](const std::vector<std::byte>& file) {
        return trips_of(bus, [&] { return FOEwrite(bus.ctx, 1, "firmware", 0, std::span<const std::byte>(file)); });
    };
    (void)write(image_of(100));
    const double idle = write(image_of(100));
    const auto file = image_of(250'000);
    const double written = write(file) - idle;
    std::vector<std::byte> back(file.size());
    const auto read_back = [&] { return FOEread(bus.ctx, 1, "firmware", 0, std::span(back)); };
    (void)trips_of(bus, read_back);  // this read waits for a second answer of the device, which was busy
    const double read = trips_of(bus, read_back);
    if (back != file) fail("the file is another one");
    const bool wrote = reaches_bound("FoE write", file.size(), kPacket, message, written);
    return reaches_bound("FoE read", file.size(), kPacket, message, read) && wrote;
}

}  // namespace

int main() {
    struct What {
        const char* name;
        std::uint16_t index;
        std::uint8_t subindex;
    };
    constexpr What kWhat[] = {{"4 octets", 0x1018, 2}, {"a name", 0x1008, 0}};
    bool kept = true;
    std::printf("%-9s %6s | %11s %6s %8s | %19s %14s\n", "SDO read", "slaves", "round trips", "frames", "time ms",
                "cycles, room for all", "default budget");
    for (const What& what : kWhat) {
        std::uint64_t trips_of_one = 0;
        unsigned cycles_of_one = 0;
        for (const std::size_t slaves : {1U, 10U, 50U, 100U}) {
            const Measured measured = beside(slaves, what.index, what.subindex);
            const unsigned cycles = in_cycle(slaves, what.index, what.subindex, 0xFFFF);
            const unsigned by_default = in_cycle(slaves, what.index, what.subindex, GroupConfiguration{}.acyclic_bytes);
            std::printf("%-9s %6zu | %11llu %6llu %8.2f | %19u %14u\n", what.name, slaves,
                        static_cast<unsigned long long>(measured.trips),
                        static_cast<unsigned long long>(measured.frames),
                        std::chrono::duration<double, std::milli>(measured.time).count(), cycles, by_default);
            if (slaves == 1) {
                trips_of_one = measured.trips;
                cycles_of_one = cycles;
            }
            kept = kept && measured.trips == trips_of_one && cycles == cycles_of_one;
        }
    }
    std::printf("%s\n",
                kept ? "reads on many slaves take the round trips and the cycles of one" : "NOT as many as for one");
    const bool sdo = sdo_payload();
    const bool full = foe_payload() && sdo;
    std::printf("%s\n", full ? "large values fill the messages that the mailbox allows" : "NOT 0.95 of the bound");
    return kept && full ? 0 : 1;
}
