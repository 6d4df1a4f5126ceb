// config_map() after a firmware update: the new firmware writes its revision into the EEPROM some time after its start.
#include "mailbox/foe_bus.hpp"

namespace margay {
namespace {

using sim::Bootloader;

unsigned hook_calls = 0;
Task<> count_call(HookedSlave, void*) {
    ++hook_calls;
    co_return Nothing{};
}

// Slave 1 is exchanged in group 0. Slave 2 gets other firmware and is exchanged in group 1.
struct AfterBoot : testing::Test {
    MailboxBus bus;
    std::array<std::byte, 64> image{};
    std::array<std::byte, 64> updated{};
    SuperviseRequest supervision;

    void start() {
        bus.add_device(sim::make_device("digital_io_16").value());
        bus.add_device(sim::make_device("bootloader_open").value());
        bus.start();
        bus.ctx->slave(2).config.group = 1;
        ASSERT_TRUE(config_map(*bus.ctx, image, 0).ok());
        ASSERT_TRUE(config_map(*bus.ctx, updated, 1).ok());
    }
    void update(std::uint16_t minor) {
        const auto firmware = Bootloader::make_image(2, minor, 4096, Bootloader::kOpenProduct);
        const auto written = FOEwrite(*bus.ctx, 2, "firmware", 0, Bytes(firmware));
        ASSERT_TRUE(written.ok()) << bus.words(written.error());
    }
    // Checks that one call maps the slave, and that the log contains no error that is over.
    void expect_mapped() {
        while (bus.ctx->errors().take()) continue;
        const auto mapped = config_map(*bus.ctx, updated, 1);
        EXPECT_TRUE(mapped.ok()) << bus.words(mapped.error());
        while (const auto error = bus.ctx->errors().take()) ADD_FAILURE() << bus.words(*error);
        EXPECT_EQ(bus.ctx->slave(2).error.code, Errc::none) << bus.words(bus.ctx->slave(2).error);
    }
    void expect_op() {
        const auto op = reach(*bus.ctx, AlState::op, 5s);
        EXPECT_TRUE(op.ok()) << bus.words(op.error());
        EXPECT_TRUE(inputs_fresh(*bus.ctx, 2));
    }
    void expect_revision(std::uint16_t minor) { EXPECT_EQ(bus.ctx->slave(2).identity.revision, 0x0002'0000U + minor); }
};

// Firmware 2.0 writes its revision when it has reached PREOP, and firmware 2.5 writes a part of it before. `pause`: the
// time between PREOP or INIT and config_map().
struct Update {
    std::uint16_t minor;
    Duration pause;
    AlState from;
};
// The name of the test: without it GoogleTest prints the octets of the object, with padding that differs in each build.
void PrintTo(const Update& update, std::ostream* out) {
    *out << "minor " << update.minor << " after " << update.pause / 1ms << " ms from " << to_text(update.from);
}
struct OneMapping : AfterBoot, testing::WithParamInterface<Update> {};

TEST_P(OneMapping, IsEnoughWithASupervision) {
    start();
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    ASSERT_TRUE(reach(*bus.ctx, AlState::op, 5s).ok());
    ASSERT_TRUE(set_target(*bus.ctx, 2, AlState::boot).ok());
    bus.idle(300ms);
    update(GetParam().minor);
    ASSERT_TRUE(set_target(*bus.ctx, 2, AlState::preop).ok());
    for (int n = 0; n < 3000 && bus.ctx->slave(2).al.state != AlState::preop; ++n) bus.idle(1ms);
    ASSERT_EQ(bus.ctx->slave(2).al.state, AlState::preop);
    bus.idle(GetParam().pause);
    expect_mapped();
    if (GetParam().pause >= 60ms) expect_revision(GetParam().minor);
    ASSERT_TRUE(set_target(*bus.ctx, 2, AlState::none).ok());
    expect_op();
}
TEST_P(OneMapping, IsEnoughWithoutASupervision) {
    start();
    ASSERT_EQ(bring(bus, AlState::boot, 2).code, Errc::none);
    update(GetParam().minor);
    ASSERT_EQ(bring(bus, AlState::init, 2).code, Errc::none);
    if (GetParam().from == AlState::preop) {
        ASSERT_EQ(bring(bus, AlState::preop, 2).code, Errc::none);
    }
    bus.idle(GetParam().pause);
    expect_mapped();
    if (GetParam().from == AlState::preop && GetParam().pause >= 60ms) expect_revision(GetParam().minor);
    expect_op();
}
std::vector<Update> updates() {
    std::vector<Update> all;
    for (const std::uint16_t minor : {std::uint16_t{0}, std::uint16_t{5}})
        for (const auto pause : {0ms, 1ms, 2ms, 3ms, 5ms, 8ms, 13ms, 20ms, 60ms, 500ms})
            for (const AlState from : {AlState::init, AlState::preop}) all.push_back({minor, pause, from});
    return all;
}
INSTANTIATE_TEST_SUITE_P(Pauses, OneMapping, testing::ValuesIn(updates()));

// If the revision is present before the mapping, the group is mapped once.
TEST_F(AfterBoot, ARevisionThatIsThereAlreadyNeedsNoSecondMapping) {
    start();
    ASSERT_EQ(bring(bus, AlState::boot, 2).code, Errc::none);
    update(0);
    ASSERT_EQ(bring(bus, AlState::preop, 2).code, Errc::none);
    bus.idle(500ms);
    bus.ctx->slave(2).hooks.preop_to_safeop = count_call;
    hook_calls = 0;
    const auto before = bus.ctx->group(1).mappings;
    expect_mapped();
    expect_revision(0);
    EXPECT_EQ(bus.ctx->group(1).mappings, before + 1);
    EXPECT_EQ(hook_calls, 1U);
    expect_op();
}

// Each mapping calls the function that provides the memory again.
TEST_F(AfterBoot, TheSecondMappingAsksForItsMemoryAgain) {
    struct Memory {
        std::array<std::array<std::byte, 64>, 2> images{};
        unsigned asked = 0;
        static std::span<std::byte> give(std::size_t, void* user) {
            auto& self = *static_cast<Memory*>(user);
            return self.images[self.asked++ % 2];
        }
    } memory;
    start();
    ASSERT_EQ(bring(bus, AlState::boot, 2).code, Errc::none);
    update(0);
    ASSERT_EQ(bring(bus, AlState::preop, 2).code, Errc::none);
    MapRequest request;
    request.group = 1;
    request.memory = Memory::give;
    request.memory_user = &memory;
    const auto before = bus.ctx->group(1).mappings;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    const auto mapped = wait(*bus.ctx, request);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    EXPECT_EQ(bus.ctx->group(1).mappings, before + 2);
    EXPECT_EQ(memory.asked, 2U);
    EXPECT_EQ(bus.ctx->group(1).image.data(), memory.images[1].data());
    expect_op();
}

// ------------------------------------------------------------------ the way down beside the cycle

// The write that clears the FMMUs is in the frame of group 0. The frame of group 1 follows at once.
struct Lowered : testing::TestWithParam<AlState> {
    MailboxBus bus;
    std::array<std::byte, 64> image{};
    std::array<std::byte, 64> other{};
    SuperviseRequest supervision;
};
TEST_P(Lowered, TheSlavesAreNotMissedInAnyCycle) {
    for (const char* name : {"digital_io_16", "digital_io_16", "bootloader_open", "bootloader_open", "bootloader_open"})
        bus.add_device(sim::make_device(name).value());
    bus.start();
    for (std::size_t n = 2; n <= 5; ++n) bus.ctx->slave(n).config.group = 1;
    ASSERT_TRUE(config_map(*bus.ctx, image, 0).ok());
    ASSERT_TRUE(config_map(*bus.ctx, other, 1).ok());
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    ASSERT_TRUE(reach(*bus.ctx, AlState::op, 5s).ok());
    while (bus.ctx->events().take()) continue;
    const auto down = [&] {
        for (std::size_t n = 3; n <= 5; ++n)
            if (bus.ctx->slave(n).al.state != GetParam()) return false;
        return true;
    };
    unsigned wrong = 0;
    unsigned stale = 0;
    unsigned after = 0;
    const auto end = run_cycle(*bus.ctx, {.period = 1ms}, [&](const CycleInfo& cycle) {
        if (cycle.error.code != Errc::none) {
            ++wrong;
            ADD_FAILURE() << "cycle " << cycle.number << ": " << bus.words(cycle.error);
        }
        stale += cycle.number > 5 && !(inputs_fresh(*bus.ctx, 1) && inputs_fresh(*bus.ctx, 2)) ? 1 : 0;
        if (cycle.number == 20) {
            EXPECT_TRUE(set_target(*bus.ctx, 3, GetParam()).ok());
        }
        if (cycle.number == 23) {  // two at once
            EXPECT_TRUE(set_target(*bus.ctx, 4, GetParam()).ok());
            EXPECT_TRUE(set_target(*bus.ctx, 5, GetParam()).ok());
        }
        after += down() ? 1 : 0;
        return after < 20 && cycle.number < 2000;
    });
    EXPECT_TRUE(end.ok()) << bus.words(end.error());
    EXPECT_TRUE(down());
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(stale, 0U) << "cycles without fresh inputs of the slaves that stay";
    while (const auto event = bus.ctx->events().take()) EXPECT_EQ(event->kind, EventKind::state);
}
INSTANTIATE_TEST_SUITE_P(To, Lowered, testing::Values(AlState::boot, AlState::preop, AlState::init));

}  // namespace
}  // namespace margay
