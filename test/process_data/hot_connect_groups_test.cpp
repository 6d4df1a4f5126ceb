// Hot connect groups arrive and leave as a whole.
#include "process_data/hot_connect.hpp"

namespace margay {
namespace {

// Two groups of two slaves. Their first slaves are identified by alias 0x0010 and by device ID 7.
struct Groups {
    std::uint32_t a = 0, a2 = 0, b = 0, b2 = 0;
};
class HotConnectGroups : public HotConnectTest {
  protected:
    Groups g;
    std::array<ExpectedSlave, 7> expected{};
    void SetUp() override {
        HotConnectTest::SetUp();
        g.a = make({.product = 0x200, .alias = 0x0010});
        g.a2 = make({.product = 0x201});
        g.b = make({.product = 0x200, .flags = wire::sii::general_flag::kIdentAlStatus});
        program(g.b).set_device_id(7);
        g.b2 = make({.product = 0x201});
        ASSERT_TRUE(segment.connect({g.a, 1}, {g.a2, 0}));
        ASSERT_TRUE(segment.connect({g.b, 1}, {g.b2, 0}));
        expected = {at(1, 0x100), at(2, 0x101), at(3, 0x102), first(1), member(1), first(2), member(2)};
        expected[3].alias = std::uint16_t{0x0010};
        expected[5].device_id = std::uint16_t{7};
    }
    static ExpectedSlave first(std::uint8_t group) {
        return {.vendor = kVendor, .product = 0x200, .hot_connect = group, .config = &kIo};
    }
    static ExpectedSlave member(std::uint8_t group) {
        return {.vendor = kVendor, .product = 0x201, .hot_connect = group, .config = &kIo};
    }
    void expect_all_exchange() {
        const std::uint32_t numbers[] = {line[0], line[1], line[2], g.a, g.a2, g.b, g.b2};
        for (std::size_t n = 1; n <= 7; ++n) expect_exchanged(n, numbers[n - 1]);
        EXPECT_EQ(*cycle(), 21U);
    }
};

TEST_F(HotConnectGroups, AreFoundWhereverTheyHang) {
    plug({line[0], 2}, g.b);
    plug({line[2], 1}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    ASSERT_EQ(ctx->slaves().size(), 7U);
    run();
    expect_all_exchange();
    EXPECT_EQ(ctx->slave(6).parent, 1);
    EXPECT_EQ(ctx->slave(6).parent_port, 2);
    EXPECT_EQ(ctx->slave(7).parent, 6);
    EXPECT_EQ(ctx->slave(4).parent, 3);
}

TEST_F(HotConnectGroups, MayBeMissingAndComeDuringOp) {
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    EXPECT_EQ(*cycle(), 9U);
    plug({line[1], 2}, g.a);
    power(g.a, true);
    power(g.a2, true);
    ASSERT_TRUE(until([&] { return in_op(4) && in_op(5); })) << joined(events());
    EXPECT_EQ(*cycle(), 15U);
    plug({line[0], 2}, g.b);
    power(g.b, true);
    power(g.b2, true);
    ASSERT_TRUE(until([&] { return in_op(6) && in_op(7); })) << joined(events());
    expect_all_exchange();
    EXPECT_EQ(told(events(), "unexpected slave"), 0);
}

// Without this warning the application would get the error only when the tool is plugged in, during production.
TEST_F(HotConnectGroups, OfUnknownSizesAreWarnedOfAtTheMapping) {
    expected[4].config = nullptr;
    EXPECT_EQ(bring_up(expected), Sentences());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(
        warnings(),
        Sentences{"slave 5: mapping process data: no place in the image, the sizes of its process data are not known "
                  "(SlaveSetup::pdos): it can take part after the next config_map()"});
    EXPECT_TRUE(errors().empty());
}

// The other slaves lose only the cycles during which cables are pulled and plugged.
TEST_F(HotConnectGroups, SwapPortsDuringOp) {
    plug({line[0], 2}, g.a);
    plug({line[1], 2}, g.b);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    for (int round = 0; round < 4; ++round) {
        SCOPED_TRACE(round);
        pull(g.a);
        pull(g.b);
        cycles(round % 2 == 0 ? 30 : 400);
        EXPECT_EQ(*cycle(), 9U);
        // Some rounds remove the power, as on a docking machine.
        if (round < 2)
            for (const auto number : {g.a, g.a2, g.b, g.b2}) {
                power(number, false);
                power(number, true);
            }
        plug({line[round % 2 == 0 ? 1 : 0], 2}, g.a);
        plug({line[round % 2 == 0 ? 0 : 1], 2}, g.b);
        ASSERT_TRUE(until([&] { return in_op(4) && in_op(5) && in_op(6) && in_op(7); })) << joined(events());
        cycles(100);
        expect_all_exchange();
        EXPECT_EQ(ctx->slave(4).parent, round % 2 == 0 ? 2 : 1);
        EXPECT_EQ(ctx->slave(6).parent, round % 2 == 0 ? 1 : 2);
        EXPECT_EQ(ctx->slave(1).ports[2].neighbour, round % 2 == 0 ? 6 : 4);
        const auto story = events();
        EXPECT_EQ(told(story, "unexpected slave") + told(story, "another slave") + told(story, "failed"), 0)
            << joined(story);
        EXPECT_EQ(told(story, "lost, it was"), 4) << joined(story);
        EXPECT_EQ(told(story, "found again"), 4) << joined(story);
    }
}

TEST_F(HotConnectGroups, AWrongMemberIsNamed) {
    const auto wrong = make({.product = 0x2FF});
    segment.disconnect({g.a2, 0});
    ASSERT_TRUE(segment.connect({g.a, 1}, {wrong, 0}));
    plug({line[0], 2}, g.a);
    EXPECT_EQ(
        bring_up(expected),
        (Sentences{
            "slave 5: comparing with what is expected: another slave than expected (expected product 0x00000201, got "
            "0x000002ff of vendor 0x00004d47)"}));
    // The same change while the segment is in OP.
    pull(g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    plug({line[0], 2}, g.a);
    power(g.a, true);
    power(wrong, true);
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    cycles(2000);
    const auto story = events();
    EXPECT_EQ(
        told(story,
             "slave 5: another slave in its place (expected product 0x00000201, got 0x000002ff of vendor 0x00004d47)"),
        1)
        << joined(story);
    EXPECT_FALSE(in_op(5));
}

TEST_F(HotConnectGroups, AMissingMemberIsTold) {
    segment.disconnect({g.a2, 0});
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), (Sentences{"slave 5: comparing with what is expected: the slave is missing"}));
    pull(g.a);
    EXPECT_EQ(bring_up(expected), Sentences()) << "the whole group may be missing";
    run();
    plug({line[0], 2}, g.a);
    power(g.a, true);
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    cycles(2000);
    EXPECT_EQ(cycle().error(), (Error{.code = Errc::working_counter,
                                      .step = Step::exchange_process_data,
                                      .slave = 5,
                                      .detail = Error::kOthersFresh,
                                      .expected = 15,
                                      .actual = 12}));
    EXPECT_EQ(told(events(), "slave 5: missing, though the first slave of its group, slave 4, is there"), 1);
    // When the slave arrives, it belongs to the group.
    ASSERT_TRUE(segment.connect({g.a, 1}, {g.a2, 0}));
    power(g.a2, true);
    ASSERT_TRUE(until([&] { return in_op(5); })) << joined(events());
    expect_exchanged(5, g.a2);
}

// A member that is present and cannot be configured counts in the expected working counter, like a slave of the line.
TEST_F(HotConnectGroups, AMemberThatIsRefusedIsCounted) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    ctx->slave(5).config.highest = static_cast<AlState>(9);
    EXPECT_FALSE(config_map(*ctx, image).ok());
    EXPECT_EQ(ctx->group(0).expected_wkc, 15U);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    cycles(100);
    EXPECT_EQ(cycle().error().code, Errc::working_counter);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 5);
    // The same after the group was away and is back.
    pull(g.a);
    cycles(100);
    EXPECT_EQ(*cycle(), 9U) << "the whole group may be missing";
    plug({line[1], 2}, g.a);
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    cycles(2000);
    EXPECT_EQ(cycle().error().code, Errc::working_counter);
}

TEST_F(HotConnectGroups, MayBeRemovedWithoutASupervision) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    EXPECT_EQ(*cycle(), 15U);
    pull(g.a);
    cycles(5);
    EXPECT_TRUE(readstate(*ctx).ok());
    EXPECT_EQ(*cycle(), 9U);
}

TEST_F(HotConnectGroups, AMemberMayBeMissingTwice) {
    segment.disconnect({g.a2, 0});
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    for (int time = 0; time < 2; ++time) {
        plug({line[0], 2}, g.a);
        power(g.a, true);
        ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
        cycles(2000);
        EXPECT_EQ(cycle().error().code, Errc::working_counter) << time;
        EXPECT_EQ(told(events(), "slave 5: missing, though the first slave of its group, slave 4, is there"), 1)
            << time;
        pull(g.a);
        cycles(100);
        EXPECT_EQ(*cycle(), 9U) << time;
    }
}

// The first slave comes back with its station address, because it has kept its power. Its member does not come back.
TEST_F(HotConnectGroups, AFirstSlaveThatKeptItsPowerComesWithoutItsMember) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    EXPECT_EQ(*cycle(), 15U);
    pull(g.a);
    segment.disconnect({g.a2, 0});
    cycles(100);
    EXPECT_EQ(*cycle(), 9U);
    (void)events();
    plug({line[0], 2}, g.a);
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    cycles(2000);
    const auto story = events();
    EXPECT_EQ(told(story, "slave 5: missing, though the first slave of its group, slave 4, is there"), 1)
        << joined(story);
    EXPECT_EQ(cycle().error().code, Errc::working_counter);
}

// Only the first slave is lost for a moment, and its member continues. Afterwards a loss of the member is a fault
// again.
TEST_F(HotConnectGroups, AMemberThatWentOnWithoutTheFirstSlaveIsMissedLater) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    EXPECT_EQ(*cycle(), 15U);
    segment.slave(g.a).registers().set<std::uint16_t>(0x0010, 0);  // the first slave loses its address
    segment.reconsider();
    cycles(3000);
    EXPECT_EQ(told(events(), "slave 4: lost, it was in OP"), 1);
    ASSERT_TRUE(in_op(4));
    cycles(100);
    EXPECT_EQ(*cycle(), 15U);
    segment.disconnect({g.a2, 0});
    cycles(5000);
    EXPECT_EQ(ctx->group(0).expected_wkc, 15U);
    EXPECT_EQ(cycle().error().code, Errc::working_counter);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 5);
}

// A connector bounces: the member is back before the first slave is identified, then the group is disconnected again.
TEST_F(HotConnectGroups, AMemberThatComesBeforeTheFirstSlaveAndGoes) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    pull(g.a);
    cycles(500);
    EXPECT_EQ(ctx->group(0).expected_wkc, 9U);
    power(g.a, false);
    power(g.a, true);
    plug({line[0], 2}, g.a);
    ASSERT_TRUE(until([&] { return ctx->slave(5).al.state != AlState::none; }));
    pull(g.a);
    cycles(5000);
    EXPECT_EQ(*cycle(), 9U) << joined(events());
    EXPECT_TRUE(all_right(*ctx));
}

// The group was missing at config_map(), and the size of its member was unknown. No cycle succeeds while the group is
// present, however often it is plugged in.
TEST_F(HotConnectGroups, AMemberWithoutAPlaceIsMissedEachTime) {
    expected[3].config = expected[4].config = nullptr;
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    EXPECT_EQ(*cycle(), 9U);
    for (int time = 0; time < 3; ++time) {
        plug({line[0], 2}, g.a);
        power(g.a, true);
        power(g.a2, true);
        ASSERT_TRUE(until([&] { return ctx->slave(5).al.state == AlState::preop; })) << joined(events());
        cycles(200);
        EXPECT_EQ(cycle().error().code, Errc::working_counter) << time;
        pull(g.a);
        cycles(100);
        EXPECT_EQ(*cycle(), 9U) << time;
    }
}

// Without a supervision, a request finds that the first slave is lost.
TEST_F(HotConnectGroups, ARequestMayFindTheGroupRemoved) {
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_EQ(to_op().state, AlState::op);
    EXPECT_EQ(*cycle(), 15U);
    pull(g.a);
    for (const std::uint16_t slave : {std::uint16_t{5}, std::uint16_t{4}}) {
        StateRequest request;
        request.slave = slave;
        request.wanted = AlState::op;
        ASSERT_TRUE(submit(*ctx, request));
        ASSERT_TRUE(until([&] { return !request.busy(); }));
        EXPECT_FALSE(request.error().code == Errc::none);
    }
    cycles(4);  // poll() reads the states of the other slaves
    EXPECT_EQ(*cycle(), 9U);
}

// The cables of two members with their own power supplies are crossed. Each member belongs to the first slave in front
// of it now.
TEST_F(HotConnectGroups, MembersThatKeptTheirPowerMayChangePlaces) {
    plug({line[0], 2}, g.a);
    plug({line[1], 2}, g.b);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    segment.disconnect({g.a2, 0});
    segment.disconnect({g.b2, 0});
    cycles(500);
    ASSERT_TRUE(segment.connect({g.a, 1}, {g.b2, 0}));
    ASSERT_TRUE(segment.connect({g.b, 1}, {g.a2, 0}));
    ASSERT_TRUE(until([&] { return in_op(5) && in_op(7) && all_right(*ctx); }, 6000)) << joined(events());
    EXPECT_EQ(ctx->slave(5).parent, 4);
    EXPECT_EQ(ctx->slave(7).parent, 6);
    expect_exchanged(5, g.b2);
    expect_exchanged(7, g.a2);
}

TEST_F(HotConnectGroups, AMemberBehindTheOtherFirstSlaveIsNotThatOfItsOwnGroup) {
    plug({line[0], 2}, g.a);
    plug({line[1], 2}, g.b);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    segment.disconnect({g.a2, 0});
    segment.disconnect({g.b2, 0});
    cycles(500);
    ASSERT_TRUE(segment.connect({g.b, 1}, {g.a2, 0}));
    ASSERT_TRUE(until([&] { return in_op(7); }, 6000)) << joined(events());
    expect_exchanged(7, g.a2);
    EXPECT_EQ(ctx->slave(5).al.state, AlState::none);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 5);
}

// The member behind the first slave of a group of another machine gets no outputs, whatever state it had before.
TEST_F(HotConnectGroups, AMemberBehindAnUnknownFirstSlaveGetsNoOutputs) {
    const auto foreign = make({.product = 0x200, .alias = 0x0099});
    plug({line[0], 2}, g.a);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    segment.disconnect({g.a2, 0});
    pull(g.a);
    cycles(500);
    ASSERT_TRUE(segment.connect({foreign, 1}, {g.a2, 0}));
    plug({line[0], 2}, foreign);
    power(foreign, true);
    ctx->slave(5).image.outputs.bytes[0] = std::byte{0x77};
    cycles(4000);
    EXPECT_NE(program(g.a2).outputs()[0], std::byte{0x77});
    EXPECT_EQ(ctx->slave(5).al.state, AlState::none);
    EXPECT_EQ(*cycle(), 9U);
    // Behind the first slave of its own group the device is the member again.
    pull(foreign);
    segment.disconnect({g.a2, 0});
    ASSERT_TRUE(segment.connect({g.a, 1}, {g.a2, 0}));
    plug({line[0], 2}, g.a);
    ASSERT_TRUE(until([&] { return in_op(4) && in_op(5); }, 6000)) << joined(events());
    expect_exchanged(5, g.a2);
}

// A group of the image has only a hot connect group that is away and whose sizes are unknown. The group has no frames.
TEST_F(HotConnectGroups, AnImageOfAbsentSlavesAloneDoesNotSayThatAllIsWell) {
    limits.groups = 2;
    expected[3].config = expected[4].config = nullptr;
    for (const std::uint8_t in_flight : {std::uint8_t{1}, std::uint8_t{2}}) {
        EXPECT_EQ(bring_up(expected), Sentences());
        for (const std::uint16_t tool : {std::uint16_t{4}, std::uint16_t{5}}) ctx->slave(tool).config.group = 1;
        ctx->group(1).config.cycles_in_flight = in_flight;
        std::vector<std::byte> second(64);
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(config_map(*ctx, second, 1).ok());
        ASSERT_EQ(ctx->group(1).frames, 0U);
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
        const auto of_the_tool = [&] {
            (void)send_processdata(*ctx, 1);
            return receive_processdata(*ctx, reply_timeout, 1);
        };
        for (int n = 0; n < 5; ++n) EXPECT_EQ(*of_the_tool(), 0U) << n;
        EXPECT_TRUE(all_right(*ctx));
        segment.set_noise({.lost = 1.0});
        cycles(20);
        EXPECT_EQ(of_the_tool().error().code, Errc::no_frame);
        EXPECT_FALSE(all_right(*ctx));
        segment.set_noise({});
        ASSERT_TRUE(until([&] { return all_in_op() && all_right(*ctx); })) << joined(events());
        EXPECT_TRUE(of_the_tool().ok());
        segment.disconnect({line[0], 0});
        segment.reconsider();
        cycles(20);
        EXPECT_EQ(of_the_tool().error().code, Errc::no_frame) << "the link is down";
        EXPECT_FALSE(all_right(*ctx));
        ASSERT_TRUE(segment.connect_master({line[0], 0}));
        segment.reconsider();
        ASSERT_TRUE(until([&] { return all_in_op() && all_right(*ctx); })) << joined(events());
        EXPECT_TRUE(of_the_tool().ok());
        supervision.cancel();
        cycles(3);
    }
}

// Counts the calls that ask for the link state. For an operating system such a call may take long.
class AskedNic final : public Nic {
  public:
    explicit AskedNic(Nic& nic) : nic_(nic) {}
    SendStatus send(Bytes frame) noexcept override { return nic_.send(frame); }
    std::size_t receive(MutableBytes buffer) noexcept override { return nic_.receive(buffer); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }
    LinkState link_state() noexcept override {
        ++asked;
        return nic_.link_state();
    }
    int asked = 0;

  private:
    Nic& nic_;
};

TEST_F(HotConnectGroups, TheCycleOfAnImageOfAbsentSlavesDoesNotAskForTheLink) {
    limits.groups = 2;
    expected[3].config = expected[4].config = nullptr;
    segment.power_up(osal.now());
    nic = std::make_unique<SimulatedNic>(segment, osal);
    AskedNic asked(*nic);
    ctx = std::make_unique<HostContext>(limits);
    ASSERT_TRUE(init(*ctx, asked, osal).ok());
    EXPECT_EQ(bring_up(expected), Sentences());
    for (const std::uint16_t tool : {std::uint16_t{4}, std::uint16_t{5}}) ctx->slave(tool).config.group = 1;
    std::vector<std::byte> second(64);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_map(*ctx, second, 1).ok());
    ASSERT_EQ(ctx->group(1).frames, 0U);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
    int by_cycles = 0;
    const auto both = [&] {
        osal.advance(std::chrono::milliseconds(1));
        const int before = asked.asked;
        (void)send_processdata(*ctx, 0);
        (void)send_processdata(*ctx, 1);
        (void)receive_processdata(*ctx, reply_timeout, 0);
        const auto second_one = receive_processdata(*ctx, reply_timeout, 1);
        by_cycles += asked.asked - before;
        (void)poll(*ctx, osal.now());
        return second_one;
    };
    const int at_first = asked.asked;
    for (int n = 0; n < 1000; ++n) EXPECT_TRUE(both().ok());
    EXPECT_EQ(by_cycles, 0);
    EXPECT_LE(asked.asked - at_first, 110) << "poll() asks as well, but seldom";
    segment.disconnect({line[0], 0});
    segment.reconsider();
    for (int n = 0; n < 12; ++n) (void)both();
    EXPECT_EQ(both().error().code, Errc::no_frame);
    EXPECT_EQ(by_cycles, 0);
    ctx.reset();
}

// Any order of plugging and unplugging, with power kept or lost, at any port, with lost frames, and with memory for the
// start-up of all slaves at once or of one slave. In the end every slave is in OP and exchanges its own process data.
class HotConnectInAnyOrder : public HotConnectGroups, public testing::WithParamInterface<std::uint32_t> {};

TEST_P(HotConnectInAnyOrder, EverybodyIsWhoHeIsInTheEnd) {
    limits.tasks = GetParam() % 2 == 0 ? 1 : 0;
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    std::uint32_t random = GetParam();
    std::vector<std::string> story;
    const auto next = [&](std::uint32_t below) {
        random = random * 1664525 + 1013904223;
        return (random >> 16) % below;
    };
    std::array<bool, 2> plugged{};
    const std::array<std::uint32_t, 2> firsts{g.a, g.b};
    const std::array<std::uint32_t, 2> seconds{g.a2, g.b2};
    const sim::PortRef ports[] = {{line[0], 2}, {line[1], 2}, {line[2], 1}, {line[2], 2}, {line[0], 3}};
    for (const auto number : {g.a, g.a2, g.b, g.b2}) power(number, true);
    segment.set_noise({.lost = GetParam() % 3 == 0 ? 0.0 : 0.03, .seed = GetParam()});
    for (int step = 0; step < 60; ++step) {
        const std::size_t n = next(2);
        if (plugged[n]) pull(firsts[n]);
        plugged[n] = !plugged[n] && (segment.connect(ports[next(5)], {firsts[n], 0}) ||
                                     segment.connect(ports[next(5)], {firsts[n], 0}));
        if (next(3) == 0) {
            power(seconds[n], false);
            cycles(static_cast<int>(next(10)));
            power(seconds[n], true);
        }
        cycles(static_cast<int>(next(60)));
        for (const auto& event : events()) story.push_back(event);
    }
    segment.set_noise({});
    for (std::size_t n = 0; n < 2; ++n)
        for (const sim::PortRef& port : ports) plugged[n] = plugged[n] || segment.connect(port, {firsts[n], 0});
    const auto all = [&] { return in_op(4) && in_op(5) && in_op(6) && in_op(7); };
    const auto listen = [&] {
        for (const auto& event : events()) story.push_back(event);
        return all();
    };
    ASSERT_TRUE(until(listen, 5000)) << joined(story);
    ASSERT_TRUE(until([&] { return cycle().ok() && all_in_op(); }));
    expect_all_exchange();
    EXPECT_EQ(told(story, "unexpected slave") + told(story, "another slave"), 0) << joined(story);
}

INSTANTIATE_TEST_SUITE_P(Seeds, HotConnectInAnyOrder, testing::Range(1U, 41U));
// In these runs a slave got the address of another slave: a device that was disconnected while it was a newcomer came
// back and counted as the present newcomer.
INSTANTIATE_TEST_SUITE_P(OnceFailed, HotConnectInAnyOrder, testing::Values(247U, 722U, 800U, 910U, 996U));

// ------------------------------------------------------------------ topology

}  // namespace
}  // namespace margay
