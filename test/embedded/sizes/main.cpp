// A small master on a microcontroller. The program scans, maps, brings the slaves to OP and exchanges process data.
// Each definition WITH_… adds one feature. The program is made for the measurement of its size. QEMU can also execute
// it.
#include "mps2_an386/board.hpp"

#include <margay/margay.hpp>
#include <margay/parts/oshw/lan9118/lan9118.hpp>

using namespace margay;

namespace {

#if defined(WITH_SUPERVISION) || defined(WITH_REACH)
constexpr std::uint32_t kArenaBytes = 7168;  // the supervision brings slaves back beside its other work
#else
constexpr std::uint32_t kArenaBytes = 5632;
#endif

constexpr Limits kLimits{.slaves = 8,
                         .tasks = 1,
                         .frames = 4,
                         .groups = 1,
                         .process_frames = 1,
                         .emergencies = 0,
                         .errors = 8,
                         .events = 4,
                         .guests = 0,
                         .arena_bytes = kArenaBytes,
                         .clocks = false};

BareOsal osal(board::description());
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<kLimits> ctx;
[[maybe_unused]] std::byte image[256];
[[maybe_unused]] std::byte value[4];

void tell([[maybe_unused]] const Error& error) {
#ifdef WITH_TEXTS
    static char sentence[160];
    board::print(describe(error, sentence));
#endif
}

Result<> start() {
    if (const auto opened = nic.open(osal); !opened) return opened;
    board::allow_ethernet_interrupt();
#ifdef WITH_ALL_FEATURES
    return init(ctx, nic, osal);
#elif defined(WITH_DICTIONARY)
    return init(ctx, nic, osal, {.coe = &kCoeFeature});
#else
    return init(ctx, nic, osal, {});
#endif
}

[[maybe_unused]] Result<> exchange() {
    if (const auto sent = send_processdata(ctx); !sent) return sent;
    if (const auto received = receive_processdata(ctx, std::chrono::milliseconds(2)); !received)
        return received.error();
    return Result<>();
}

// Process data is exchanged from SAFEOP on, because the slaves enter OP only after they have received outputs.
[[maybe_unused]] Result<> bring_up() {
#ifdef WITH_EXPECTED
    static constexpr ExpectedSlave kExpected[] = {{.number = 1, .alias = 7}};
    if (const auto expected = expect(ctx, kExpected); !expected) return expected;
#endif
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
#ifdef WITH_PDO_WRITE
    static constexpr PdoEntry kEntries[] = {{.index = 0x6040, .bits = 16}};
    static constexpr Pdo kPdos[] = {{.index = 0x1600, .entries = kEntries}};
    static constexpr SmPdos kLists[] = {{.sync_manager = 2, .pdos = kPdos}};
    static constexpr SlaveSetup kLists4{.pdos = kLists};
    ctx.slave(4).config.setup = &kLists4;
#endif
#ifdef WITH_STARTUP
    static constexpr StartupCommand kCommands[] = {
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8})};
    static constexpr SlaveSetup kCommands3{.startup = kCommands};
    ctx.slave(3).config.setup = &kCommands3;
#endif
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
#ifdef WITH_REACH
    return reach(ctx, AlState::op, std::chrono::seconds(10), {.period = std::chrono::milliseconds(2)});
#else
    for (int cycle = 0; cycle < 100; ++cycle) (void)exchange();
    if (const auto asked = writestate(ctx, 0, AlState::op); !asked) return asked;
    for (int cycle = 0; cycle < 1000; ++cycle) {
        (void)exchange();
        const auto lowest = readstate(ctx);
        if (lowest && lowest->state == AlState::op) break;
    }
    return Result<>();
#endif
}

// One call of each function that a program with this feature needs.
[[maybe_unused]] Result<> use_features() {
#ifdef WITH_SDO
    if (const auto read = SDOread(ctx, 4, 0x1018, 1, false, value); !read) return read.error();
#endif
#ifdef WITH_SDO_WRITE
    if (const auto written = SDOwrite(ctx, 4, 0x6060, 0, false, value); !written) return written;
#endif
#ifdef WITH_SDO_INFORMATION
    const auto objects = read_object_list(ctx, 4, ObjectList::all, nullptr, nullptr);
    if (!objects) return objects.error();
#endif
#ifdef WITH_SOE
    if (const auto read = SoEread(ctx, 4, 0, Idn::standard(1), soe_element::kValue, value); !read) return read.error();
#endif
#ifdef WITH_EOE
    if (const auto set = EOEset_ip(ctx, 4, {.address = Ipv4Address{192, 168, 0, 4}}); !set) return set;
    static EoePortMemory<2, 2, 1> frames;
    static EoePort port(frames);
    port.slave = 4;
    if (const auto begun = submit(ctx, port); !begun) return begun;
    std::byte frame[60];
    if (port.receive(frame)) (void)port.send(frame);
#endif
    return Result<>();
}

#ifdef WITH_STEPS
// The first calls of the program. Each step adds one call.
Result<> run() {
#if WITH_STEPS > 0
    if (const auto slaves = config_init(ctx); !slaves) return slaves.error();
#endif
#if WITH_STEPS > 1
    if (const auto octets = config_map(ctx, image); !octets) return octets.error();
#endif
#if WITH_STEPS > 3
    if (const auto asked = writestate(ctx, 0, AlState::op); !asked) return asked;
#endif
    for (;;) {
#if WITH_STEPS > 2
        (void)exchange();
#endif
        const Time next = poll(ctx, osal.now());
        osal.wait(next, -1);
    }
}
#else
Result<> run() {
    if (const auto up = bring_up(); !up) return up;
    if (const auto done = use_features(); !done) return done;
#ifdef WITH_SUPERVISION
    static SuperviseRequest supervision;
    if (const auto begun = submit(ctx, supervision); !begun) return begun;
#endif
#ifdef WITH_REACH
    return run_cycle(ctx, {.period = std::chrono::milliseconds(2)}, [](const CycleInfo&) { return true; });
#else
    for (;;) {
        (void)exchange();
        const Time next = poll(ctx, osal.now());
        osal.wait(next, -1);
    }
#endif
}
#endif

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    if (const auto done = start(); !done) tell(done.error());
    for (;;) tell(run().error());
}
