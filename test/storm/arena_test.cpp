// The arena holds the sequences of a master. Here it fails at each allocation in turn, once or from then on. No call
// may hang, every request must end, and afterwards everything must work.
//
// The linker wraps Arena::allocate() (storm.cmake), so that the library has no code for this test.
#include "api/master.hpp"
#include "storm/rig.hpp"

namespace {

std::size_t allocations = 0;
std::size_t first_failure = SIZE_MAX;
std::size_t failures = 0;

}  // namespace

extern "C" void* real_allocate(margay::Arena* arena, std::size_t bytes) noexcept
    asm("__real__ZN6margay5Arena8allocateEm");
extern "C" void* wrapped_allocate(margay::Arena* arena, std::size_t bytes) noexcept
    asm("__wrap__ZN6margay5Arena8allocateEm");
extern "C" void* wrapped_allocate(margay::Arena* arena, std::size_t bytes) noexcept {
    const std::size_t number = allocations++;
    if (number >= first_failure && number - first_failure < failures) return nullptr;
    return real_allocate(arena, bytes);
}

namespace margay::storm {
namespace {

using namespace std::chrono_literals;

// A phase of a run: the preparation, the action, and the check after it. `act` returns false when the action hangs.
struct Phase {
    void (*before)(Rig& rig);
    bool (*act)(Rig& rig);
};

void stop_failing() {
    first_failure = SIZE_MAX;
    failures = 0;
}

void plug_and_start(Rig& rig) {
    rig.plug_line({"coupler", "digital_io_16", "digital_out_8", "soe_drive"});
    rig.start({.slaves = 8});
}
void scanned(Rig& rig) {
    plug_and_start(rig);
    ASSERT_EQ(rig.scan().code, Errc::none);
}
void mapped(Rig& rig) {
    scanned(rig);
    ASSERT_EQ(rig.map().code, Errc::none);
    rig.cycling = true;
}

bool ended(const Error& error) { return error.code != Errc::busy; }

bool bring_up(Rig& rig) { return ended(rig.scan()); }
bool map(Rig& rig) { return ended(rig.map()); }

// A slave loses its power supply and gets it back.
bool recover(Rig& rig) {
    SuperviseRequest supervision;
    const auto taken = submit(*rig.ctx, supervision);
    if (!taken && taken.error().code != Errc::capacity) return false;
    rig.run_for(4ms);
    rig.segment.set_power(1, false, rig.osal.now());
    rig.run_for(3ms);
    rig.segment.set_power(1, true, rig.osal.now());
    rig.run_for(60ms);
    return true;
}

bool mail(Rig& rig) {
    std::array<std::byte, 256> data{};
    SdoUpload upload;
    upload.slave = 2;
    upload.index = 0x1008;
    upload.data = data;
    SdoUpload whole;
    whole.slave = 2;
    whole.index = 0x1018;
    whole.complete_access = true;
    whole.data = data;
    SdoDownload download;
    download.slave = 2;
    download.index = 0x3FFF;
    download.data = data;
    ObjectListRequest list;
    list.slave = 2;
    list.found = [](std::span<const std::uint16_t>, void*) {};
    SoeRead drive;
    drive.slave = 4;
    drive.idn = Idn::standard(17);
    drive.data = data;
    const auto all = [&](auto&... requests) {
        for (const auto& taken : {submit(*rig.ctx, requests)...})
            if (!taken && taken.error().code != Errc::capacity) return false;
        return rig.until([&] { return (... && !requests.busy()); }, 60s);
    };
    return all(upload, whole, download, list, drive);
}

// Checks that everything works again.
void expect_works(Rig& rig, std::size_t n) {
    rig.cycling = false;
    ASSERT_EQ(rig.scan().code, Errc::none) << n;
    ASSERT_EQ(rig.ctx->slaves().size(), 4U) << n;
    ASSERT_EQ(rig.map().code, Errc::none) << n;
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*rig.ctx, supervision).ok()) << n;
    rig.cycling = true;
    EXPECT_TRUE(rig.until([&] { return rig.all_in(AlState::op); }, 30s)) << n;
    supervision.cancel();
    rig.cycling = false;
    rig.run_for(1s);
    EXPECT_EQ(master_of(*rig.ctx)->network.arena().used_bytes(), 0U) << "allocation " << n;
}

void sweep(const Phase& phase, std::size_t how_many) {
    stop_failing();
    std::size_t count = 0;
    {
        Rig rig;
        phase.before(rig);
        const std::size_t before = allocations;
        ASSERT_TRUE(phase.act(rig));
        count = allocations - before;
    }
    ASSERT_GT(count, 4U);
    for (std::size_t n = 0; n < count; ++n) {
        Rig rig;
        phase.before(rig);
        first_failure = allocations + n;
        failures = how_many;
        EXPECT_TRUE(phase.act(rig)) << "something hangs when allocation " << n << " of " << count << " fails";
        stop_failing();
        rig.cycling = false;
        rig.run_for(5s);
        expect_works(rig, n);
        if (testing::Test::HasFailure()) return;
    }
}

TEST(ArenaFails, OnceAtEveryAllocationOfTheBringUp) { sweep({plug_and_start, bring_up}, 1); }
TEST(ArenaFails, FromEveryAllocationOfTheBringUpOn) { sweep({plug_and_start, bring_up}, SIZE_MAX / 2); }
TEST(ArenaFails, OnceAtEveryAllocationOfTheMapping) { sweep({scanned, map}, 1); }
TEST(ArenaFails, FromEveryAllocationOfTheMappingOn) { sweep({scanned, map}, SIZE_MAX / 2); }
TEST(ArenaFails, OnceAtEveryAllocationOfARecovery) { sweep({mapped, recover}, 1); }
TEST(ArenaFails, FromEveryAllocationOfARecoveryOn) { sweep({mapped, recover}, SIZE_MAX / 2); }
TEST(ArenaFails, OnceAtEveryAllocationOfMail) { sweep({scanned, mail}, 1); }
TEST(ArenaFails, FromEveryAllocationOfMailOn) { sweep({scanned, mail}, SIZE_MAX / 2); }

}  // namespace
}  // namespace margay::storm
