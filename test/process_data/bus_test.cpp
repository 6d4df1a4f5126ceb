// From a scan to OP on the simulated segment, and cycles in OP.
#include "process_data/bus.hpp"

#include "wire/fmmu.hpp"

#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

class BusTest : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(8192);
    HostContext& ctx() { return *bus.ctx; }
    std::string words(const Error& error) {
        std::array<char, 256> text{};
        return std::string(describe(error, text));
    }
};

TEST_F(BusTest, MapsWhatTheSiiSaysAndBringsToSafeop) {
    bus.add(16, 24);
    bus.add(0, 0);
    bus.add(600, 3);
    bus.start();
    const auto bytes = config_map(ctx(), image);
    ASSERT_TRUE(bytes.ok());
    EXPECT_EQ(*bytes, 2U + 75 + 3 + 1);
    EXPECT_EQ(bus.errors(), std::vector<std::string>());
    for (const Slave& slave : ctx().slaves())
        EXPECT_EQ(slave.al, (AlStatus{AlState::safeop, false, 0})) << slave.number;
    EXPECT_EQ(ctx().slave(1).config.source, ConfigurationSource::sii);
    EXPECT_EQ(ctx().slave(3).image.outputs.bits, 600U);
    EXPECT_EQ(ctx().slave(3).image.inputs.bits, 8U) << "whole octets";
    EXPECT_EQ(ctx().slave(3).config.sms[1].bits, 3U);
    EXPECT_EQ(ctx().group(0).expected_wkc, 3U + 3U);
    EXPECT_EQ(ctx().group(0).frames, 1);

    // The registers of the third slave.
    std::array<std::byte, 16> fmmu{};
    bus.segment.slave(2).read(0x0610, fmmu);
    EXPECT_EQ(wire::load_fmmu(fmmu), (wire::Fmmu{{80}, 1, 0, 7, 0x2000, 0, true, false, true}));
    std::array<std::byte, 8> sm{};
    bus.segment.slave(2).read(0x0800, sm);
    EXPECT_EQ(wire::load_sync_manager(sm), (wire::SyncManager{0x1100, 75, 0x64, 1}));
}

TEST_F(BusTest, ReachesOpAndExchanges) {
    for (int i = 0; i < 3; ++i) bus.add(16, 16);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(bus.to_op(), (AlStatus{AlState::op, false, 0}));
    for (std::size_t n = 1; n <= 3; ++n) {
        ctx().slave(n).image.outputs.bytes[0] = static_cast<std::byte>(n);
        ctx().slave(n).image.outputs.bytes[1] = static_cast<std::byte>(0xA0 + n);
        bus.device(n).inputs()[1] = static_cast<std::byte>(0x50 + n);
        bus.device(n).poke();
    }
    ASSERT_TRUE(bus.cycle().ok());
    const auto wkc = bus.cycle();
    ASSERT_TRUE(wkc.ok());
    EXPECT_EQ(*wkc, 9U);
    for (std::size_t n = 1; n <= 3; ++n) {
        EXPECT_EQ(bus.device(n).outputs()[0], static_cast<std::byte>(n));
        EXPECT_EQ(bus.device(n).outputs()[1], static_cast<std::byte>(0xA0 + n));
        EXPECT_EQ(ctx().slave(n).image.inputs.bytes[1], static_cast<std::byte>(0x50 + n));
    }
    ASSERT_EQ(ctx().group(0).datagrams.size(), 1U);
    EXPECT_TRUE(ctx().group(0).datagrams[0].right());
}

// Every layout of an image transfers the same data.
TEST_F(BusTest, EveryFormOfImageCarriesTheData) {
    const std::pair<std::uint32_t, std::uint32_t> sizes[] = {{4, 2}, {3, 7},    {0, 12},      {16, 0},
                                                             {2, 2}, {100, 60}, {4000, 5000}, {4, 9000}};
    for (const auto& [out, in] : sizes) bus.add(out, in);
    bus.start();
    std::mt19937 random(1);
    for (unsigned form = 0; form < 8; ++form) {
        GroupConfiguration& config = ctx().group(0).config;
        config.packing = (form & 1) != 0 ? Packing::bits : Packing::bytes;
        config.overlapped = (form & 2) != 0;
        config.block_lrw = (form & 4) != 0;
        ASSERT_TRUE(config_map(ctx(), image).ok()) << form;
        ASSERT_EQ(bus.to_op().state, AlState::op) << form;
        for (auto& octet : std::span(image).first(ctx().group(0).output_bytes))
            octet = static_cast<std::byte>(random());
        for (std::size_t n = 1; n <= std::size(sizes); ++n) {
            for (auto& octet : bus.device(n).inputs()) octet = static_cast<std::byte>(random());
            bus.device(n).poke();
        }
        for (int i = 0; i < 3; ++i) ASSERT_TRUE(bus.cycle().ok()) << form;
        for (std::size_t n = 1; n <= std::size(sizes); ++n) {
            const Slave& slave = ctx().slave(n);
            const auto same = [&](Bytes device, const ImagePart& part, std::uint32_t bits) {
                for (std::uint32_t i = 0; i < bits; ++i) {
                    const std::uint32_t at = part.offset_bits + i;
                    const auto here = (image[at / 8] >> (at % 8)) & std::byte{1};
                    if (((device[i / 8] >> (i % 8)) & std::byte{1}) != here) return false;
                }
                return true;
            };
            EXPECT_TRUE(same(bus.device(n).outputs(), slave.image.outputs, sizes[n - 1].first))
                << form << " slave " << n;
            EXPECT_TRUE(same(bus.device(n).inputs(), slave.image.inputs, sizes[n - 1].second))
                << form << " slave " << n;
        }
    }
    EXPECT_EQ(bus.errors(), std::vector<std::string>());
}

TEST_F(BusTest, LostFrameLeavesInputsAloneAndIsNamed) {
    bus.add(8, 8);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    bus.device(1).inputs()[0] = std::byte{0x11};
    bus.device(1).poke();
    ASSERT_TRUE(bus.cycle().ok());
    bus.device(1).inputs()[0] = std::byte{0x22};
    bus.device(1).poke();
    bus.segment.lose_next({0, 0});
    const auto lost = bus.cycle();
    EXPECT_EQ(words(lost.error()), "exchanging process data: the frame did not come back");
    EXPECT_EQ(ctx().slave(1).image.inputs.bytes[0], std::byte{0x11});
    EXPECT_FALSE(ctx().group(0).datagrams[0].came);
    ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(ctx().slave(1).image.inputs.bytes[0], std::byte{0x22});
}

TEST_F(BusTest, AnErrorOfACycleNamesItsGroup) {
    for (int n = 0; n < 2; ++n) bus.add(8, 8);
    bus.start({.slaves = 4, .groups = 2});
    ctx().slave(2).config.group = 1;
    std::vector<std::byte> second(64);
    ASSERT_TRUE(config_map(ctx(), image, 0).ok());
    ASSERT_TRUE(config_map(ctx(), second, 1).ok());
    ASSERT_TRUE(set_target(ctx(), 0, AlState::safeop).ok());
    ASSERT_TRUE(bus.cycle(0).ok());
    ASSERT_TRUE(bus.cycle(1).ok());
    ASSERT_TRUE(readstate(ctx()).ok());
    EXPECT_EQ(words(what_is_wrong(ctx())), "no error");
    bus.segment.lose_next({0, 0});
    EXPECT_EQ(words(bus.cycle(1).error()), "exchanging process data of group 1: the frame did not come back");
    ASSERT_TRUE(bus.cycle(0).ok());
    EXPECT_EQ(words(what_is_wrong(ctx())), "exchanging process data of group 1: the frame did not come back");
    EXPECT_EQ(words(receive_processdata(ctx(), 1ms, 1).error()),
              "exchanging process data of group 1: no cycle is on the wire: call send_processdata() before each "
              "receive_processdata()");
}

TEST_F(BusTest, ASecondReceiveWithoutASendIsAnError) {
    bus.add(8, 8);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(receive_processdata(ctx(), 500us).error().code, Errc::no_cycle) << "nothing was sent yet";
    ASSERT_EQ(bus.to_op().state, AlState::op);
    ASSERT_TRUE(bus.cycle().ok());
    const Time before = bus.osal.now();
    for (int n = 0; n < 3; ++n) EXPECT_EQ(receive_processdata(ctx(), 500us).error().code, Errc::no_cycle);
    EXPECT_EQ(bus.osal.now(), before) << "nothing is waited for";
    EXPECT_TRUE(inputs_fresh(ctx(), 1)) << "those of the last cycle still are";
    ASSERT_TRUE(bus.cycle().ok());
    // receive_processdata() also ends a lost cycle.
    bus.segment.lose_next({0, 0});
    EXPECT_EQ(bus.cycle().error().code, Errc::no_frame);
    EXPECT_EQ(receive_processdata(ctx(), 500us).error().code, Errc::no_cycle);
    ASSERT_TRUE(bus.cycle().ok());
}

// An application that sends cycles and receives none leaves the replies in the NIC. The index of a frame has 8 bits, so
// an old reply can have the index of a later cycle.
TEST_F(BusTest, AReplyThatTheApplicationNeverReceivedIsNoReplyToALaterCycle) {
    bus.add(8, 8);
    bus.nic_options.queue_frames = 2048;
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    const auto show = [this](int value) {
        bus.device(1).inputs()[0] = static_cast<std::byte>(value);
        bus.device(1).poke();
    };
    for (const int cycles : {1, 31, 32, 33, 127, 128, 129, 255, 256, 257, 300, 512, 1000}) {
        show(0x11);
        for (int n = 0; n < cycles; ++n) {
            bus.osal.advance(1ms);
            ASSERT_TRUE(send_processdata(ctx()).ok());
        }
        show(0x22);
        const auto wkc = bus.cycle();
        ASSERT_TRUE(wkc.ok()) << words(wkc.error());
        EXPECT_EQ(ctx().slave(1).image.inputs.bytes[0], std::byte{0x22}) << cycles << " cycles were not received";
    }
}

TEST_F(BusTest, ATaskThatKnowsTheTimeTellsIt) {
    bus.add(8, 8);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    const auto frames = ctx().statistics().frames_sent;
    for (int n = 0; n < 3; ++n) {
        bus.osal.advance(1ms);
        ctx().slave(1).image.outputs.bytes[0] = static_cast<std::byte>(n + 1);
        ASSERT_TRUE(send_processdata(ctx(), bus.osal.now()).ok());
        ASSERT_EQ(*receive_processdata(ctx(), 500us), ctx().group(0).expected_wkc);
        (void)poll(ctx(), bus.osal.now());
        EXPECT_EQ(bus.device(1).outputs()[0], static_cast<std::byte>(n)) << "the device has taken those before";
    }
    EXPECT_EQ(ctx().statistics().frames_sent - frames, 3U);
    EXPECT_EQ(send_processdata(ctx(), bus.osal.now(), 9).error().code, Errc::unknown_group);
}

TEST_F(BusTest, SlaveWithoutPowerIsShortAndNamed) {
    for (int i = 0; i < 3; ++i) bus.add(8, 8);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    bus.device(1).inputs()[0] = std::byte{0x33};
    bus.device(1).poke();
    bus.segment.set_power(2, false, bus.osal.now());
    auto short_one = bus.cycle();
    ASSERT_FALSE(short_one.ok());
    EXPECT_EQ(short_one.error().code, Errc::working_counter);
    EXPECT_EQ(short_one.error().expected, 9U);
    EXPECT_EQ(short_one.error().actual, 6U);
    EXPECT_EQ(ctx().slave(1).image.inputs.bytes[0], std::byte{0}) << "a datagram that fell short is not taken over";
    const auto states = readstate(ctx());
    ASSERT_TRUE(states.ok());
    EXPECT_EQ(states->state, AlState::none);
    EXPECT_EQ(ctx().slave(3).al.state, AlState::none) << "not its last state";
    EXPECT_EQ(ctx().slave(2).al.state, AlState::op);
    short_one = bus.cycle();
    EXPECT_EQ(
        words(short_one.error()),
        "slave 3: exchanging process data: wrong working counter (expected 9, got 6), the inputs of the other slaves "
        "are fresh");
}

TEST_F(BusTest, AcyclicDatagramsRideAlong) {
    for (int i = 0; i < 4; ++i) bus.add(8, 8);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(bus.cycle().ok());
    std::array<std::byte, 64> head{};
    SiiReadRequest read;
    read.slave = 2;
    read.data = head;
    ASSERT_TRUE(submit(ctx(), read).ok());
    const auto before = ctx().statistics();
    int cycles = 0;
    while (read.busy() && cycles < 200) {
        ASSERT_TRUE(bus.cycle().ok());
        ++cycles;
    }
    EXPECT_EQ(read.state(), RequestState::success);
    EXPECT_EQ(load_le<std::uint32_t>(head, 16), 0x00004D47U);
    EXPECT_GT(cycles, 3);
    EXPECT_EQ(ctx().statistics().frames_sent - before.frames_sent, static_cast<std::uint64_t>(cycles))
        << "not one frame of its own";
    // The requests end although the cycles stop.
    ASSERT_TRUE(submit(ctx(), read).ok());
    EXPECT_TRUE(wait(ctx(), read).ok());
}

TEST_F(BusTest, RiderThatDoesNotFitGetsAFrameOfItsOwn) {
    bus.add(8, 11880);  // 1 + 1485 octets: the frame is full
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(ctx().group(0).frames, 1);
    ASSERT_EQ(bus.to_op().state, AlState::op);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(bus.cycle().ok());
    ReadStateRequest states;
    ASSERT_TRUE(submit(ctx(), states).ok());
    for (int i = 0; i < 5 && states.busy(); ++i) ASSERT_TRUE(bus.cycle().ok());
    EXPECT_EQ(states.state(), RequestState::success);
}

TEST_F(BusTest, GroupsAreExchangedForThemselves) {
    for (int i = 0; i < 4; ++i) bus.add(8, 8);
    bus.start();
    for (const std::size_t n : {2U, 4U}) ctx().slave(n).config.group = 1;
    std::array<std::byte, 4> other{};
    ASSERT_EQ(*config_map(ctx(), image), 4U);
    ASSERT_EQ(*config_map(ctx(), other, 1), 4U);
    EXPECT_EQ(*bus.cycle(0), 6U);
    EXPECT_EQ(*bus.cycle(1), 6U);
    // Two groups at the same logical address would overwrite each other's data.
    ctx().group(1).config.start = ctx().group(0).config.start;
    EXPECT_EQ(config_map(ctx(), other, 1).error().code, Errc::invalid_argument);
    EXPECT_EQ(bus.cycle(1).error().code, Errc::unknown_group);
    EXPECT_EQ(*bus.cycle(0), 6U) << "the others go on";
}

TEST_F(BusTest, TheApplicationsWordStands) {
    bus.add(16, 16);
    bus.start();
    ctx().slave(1).config.source = ConfigurationSource::application;
    ctx().slave(1).config.add({1, Direction::inputs, 0x20, 0x2000, 16});
    EXPECT_EQ(config_map(ctx(), image).error().code, Errc::al_status) << "it refuses what is wanted";
    EXPECT_EQ(ctx().group(0).image.size(), 2U);
    const auto warnings = bus.warnings();
    ASSERT_EQ(warnings.size(), 1U);
    EXPECT_EQ(warnings[0],
              "slave 1: finding the PDOs at SyncManager 0: sources differ by 16 bits (used: the application, 0 "
              "bits; the SII has 16 bits)");
    const auto errors = bus.errors();
    ASSERT_EQ(errors.size(), 1U) << "the device insists on its outputs";
    EXPECT_NE(
        errors[0].find("slave 1: requesting a state: the slave refused (wanted SAFEOP, is in PREOP, AL status code"),
        std::string::npos)
        << errors[0];
}

TEST_F(BusTest, HookIsCalledInPreopAndCanHoldTheSlaveBack) {
    bus.add(8, 8);
    bus.add(8, 8);
    bus.start();
    struct Seen {
        Context& ctx;
        int calls = 0;
        AlState state = AlState::none;
        Errc waiting = Errc::none;
    } seen{ctx()};
    ctx().slave(1).hooks.user = &seen;
    ctx().slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Result<> {
        auto& s = *static_cast<Seen*>(user);
        ++s.calls;
        s.waiting = readstate(s.ctx).error().code;
        s.state = slave.slave().al.state;
        return Result<>();
    };
    ctx().slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Result<> {
        return Error{.code = Errc::unsupported, .step = Step::sdo_download, .slave = slave.number()};
    };
    EXPECT_EQ(config_map(ctx(), image).error().code, Errc::unsupported) << "slave 2 is not where it is wanted";
    EXPECT_EQ(seen.calls, 1);
    EXPECT_EQ(seen.state, AlState::preop);
    EXPECT_EQ(seen.waiting, Errc::in_callback);
    ASSERT_TRUE(readstate(ctx()).ok());
    EXPECT_EQ(ctx().slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx().slave(2).al.state, AlState::preop);
    EXPECT_EQ(ctx().slave(2).error.code, Errc::unsupported);
}

TEST_F(BusTest, AHookThatIsTakenAwayWhileItsSlaveGoesBackToPreopIsNotCalled) {
    bus.add(8, 8);
    bus.start();
    const auto hook = [](HookedSlave, void*) -> Result<> { return Result<>(); };
    for (int polls = 1; polls < 40; ++polls) {
        ctx().slave(1).hooks.preop_to_safeop = hook;
        ASSERT_TRUE(config_map(ctx(), image).ok());
        MapRequest again;
        again.image = image;
        ASSERT_TRUE(submit(ctx(), again).ok());
        for (int n = 0; again.busy(); ++n) {
            if (n == polls) ctx().slave(1).hooks.preop_to_safeop = nullptr;
            (void)poll(ctx(), bus.osal.now());
            bus.osal.advance(100us);
        }
        EXPECT_EQ(again.error().code, Errc::none) << polls;
    }
}

TEST_F(BusTest, WatchdogIsWritten) {
    bus.add(8, 0);
    bus.start();
    ctx().slave(1).config.process_data_watchdog = 25ms;
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(bus.segment.slave(0).registers().get<std::uint16_t>(0x0400), 2498);
    EXPECT_EQ(bus.segment.slave(0).registers().get<std::uint16_t>(0x0420), 250);
}

// A wrong argument gives an error that names it, and the context can still be used.
TEST_F(BusTest, WrongCallsAreRefused) {
    HostContext fresh;
    EXPECT_EQ(config_map(fresh, image).error().code, Errc::wrong_state);
    EXPECT_EQ(send_processdata(fresh).error().code, Errc::wrong_state);
    EXPECT_EQ(receive_processdata(fresh, 1ms).error().code, Errc::wrong_state);
    EXPECT_EQ(readstate(fresh).error().code, Errc::wrong_state);
    EXPECT_FALSE(fresh.group(0).mapped);

    bus.add(8, 8);
    bus.start({.slaves = 4, .groups = 2, .process_frames = 1});
    EXPECT_EQ(words(send_processdata(ctx(), 1).error()),
              "exchanging process data of group 1: there is no such group, or nothing is mapped in it: call "
              "config_map()");
    EXPECT_EQ(words(receive_processdata(ctx(), 1ms, 2).error()),
              "exchanging process data of group 2: there is no such group (Limits::groups is 2)");
    EXPECT_EQ(config_map(ctx(), image, 2).error().code, Errc::unknown_group);
    EXPECT_EQ(config_map(ctx(), std::span(image).first(1)).error().code, Errc::image_too_large);
    EXPECT_EQ(writestate(ctx(), 2, AlState::op).error().code, Errc::unknown_slave);
    EXPECT_EQ(statecheck(ctx(), 2, AlState::op, 1ms).error().code, Errc::unknown_slave);
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(*bus.cycle(), 3U);
    EXPECT_EQ(*config_init(ctx()), 1U) << "a new scan forgets what was mapped";
    EXPECT_EQ(send_processdata(ctx()).error().code, Errc::unknown_group);
}

// The library repeats the request for a state that a slave does not accept, because the slave may still process the
// previous request. It does not repeat the request for a slave that is away.
TEST_F(BusTest, AStateIsRequestedOnceOfASlaveThatIsAway) {
    for (int i = 0; i < 3; ++i) bus.add(16, 16);
    bus.start();
    ASSERT_TRUE(config_map(ctx(), image).ok());
    EXPECT_EQ(bus.to_op().state, AlState::op);
    bus.segment.set_power(2, false, bus.osal.now());
    const Time begin = bus.osal.now();
    EXPECT_EQ(words(writestate(ctx(), 0, AlState::safeop).error()),
              "slave 3: requesting a state at register 0x0120: wrong working counter (expected 1, got 0): the slave "
              "does not answer");
    EXPECT_LT(bus.osal.now() - begin, 2ms);
    EXPECT_EQ(statecheck(ctx(), 2, AlState::safeop, 100ms)->state, AlState::safeop);
    EXPECT_FALSE(writestate(ctx(), 3, AlState::safeop).ok());
    EXPECT_LT(bus.osal.now() - begin, 4ms);
}

TEST_F(BusTest, TooManyFramesIsNamed) {
    bus.add(8, 12000);
    bus.start({.slaves = 4, .process_frames = 1});
    const auto mapped = config_map(ctx(), image);
    EXPECT_EQ(mapped.error().code, Errc::too_many_frames);
    EXPECT_EQ(ctx().slave(1).image.inputs.bits, 0U);
}

}  // namespace
}  // namespace margay
