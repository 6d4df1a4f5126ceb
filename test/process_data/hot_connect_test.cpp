// Slaves that arrive later, leave, and return at another place: reserved places, hot connect groups, and the topology
// after changes.
#include "process_data/plant.hpp"

namespace margay {
namespace {

using Words = std::vector<std::string>;

constexpr std::uint32_t kVendor = 0x4D47;

// The process data of a slave in the line, as in its SII.
SlaveConfiguration io() {
    SlaveConfiguration config;
    config.source = ConfigurationSource::application;
    config.add({0, Direction::outputs, 0x64, 0x1100, 8});
    config.add({1, Direction::inputs, 0x20, 0x2000, 8});
    return config;
}
const SlaveConfiguration kIo = io();

class HotConnectTest : public testing::Test, protected Plant {
  protected:
    // A line of three slaves: 0x100, 0x101, 0x102.
    std::array<std::uint32_t, 3> line{};
    void SetUp() override {
        for (std::uint32_t n = 0; n < line.size(); ++n) {
            line[n] = make({.product = 0x100 + n});
            ASSERT_TRUE(n == 0 ? segment.connect_master({line[n], 0})
                               : segment.connect({line[n - 1], 1}, {line[n], 0}));
        }
    }
    static ExpectedSlave at(std::uint16_t number, std::uint32_t product, bool optional = false) {
        return {.number = number, .vendor = kVendor, .product = product, .optional = optional, .config = &kIo};
    }
};

TEST_F(HotConnectTest, APlaceIsKeptForWhomIsMissingInTheMiddle) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x1FF, true), at(3, 0x101), at(4, 0x102)};
    EXPECT_EQ(bring_up(expected), Words());
    ASSERT_EQ(ctx->slaves().size(), 4U);
    EXPECT_EQ(ctx->slave(3).identity.product, 0x101U) << "numbers are those of the whole line";
    EXPECT_EQ(ctx->slave(3).ring_position, 2);
    EXPECT_EQ(ctx->slave(2).ring_position, 0);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::none);
    EXPECT_FALSE(ctx->slave(2).seen);
    run();
    EXPECT_EQ(ctx->group(0).output_bytes, 4U);
    EXPECT_EQ(ctx->slave(2).image.inputs.bits, 8U);
    EXPECT_EQ(*cycle(), 9U) << "right without it";
    EXPECT_EQ(readstate(*ctx)->state, AlState::op);
    expect_exchanged(4, line[2]);

    // A slave is inserted with its power supply; the slaves behind it are lost for a moment.
    const auto late = make({.product = 0x1FF});
    pull(line[1]);
    cycles(20);
    plug({line[0], 1}, late);
    ASSERT_TRUE(segment.connect({late, 1}, {line[1], 0}));
    power(late, true);
    ASSERT_TRUE(until([&] { return in_op(2) && in_op(3) && in_op(4); })) << joined(events());
    cycles(100);
    EXPECT_EQ(*cycle(), 12U);
    for (const auto& [n, number] : {std::pair{1, line[0]}, {2, late}, {3, line[1]}, {4, line[2]}})
        expect_exchanged(static_cast<std::size_t>(n), number);
    EXPECT_EQ(ctx->slave(2).name(), "MG IO") << "all of its SII is known now";
    EXPECT_EQ(ctx->slave(2).parent, 1);
    EXPECT_EQ(ctx->slave(3).parent, 2);
    EXPECT_EQ(ctx->slave(4).ring_position, 4);
    const auto story = events();
    EXPECT_EQ(told(story, "slave 2: found again, in INIT"), 1) << joined(story);
    EXPECT_EQ(told(story, "slave 2: recovered, in OP"), 1) << joined(story);
    // The slave leaves: an event reports it, and its place is kept.
    pull(late);
    segment.disconnect({late, 1});
    ASSERT_TRUE(segment.connect({line[0], 1}, {line[1], 0}));
    cycles(50);
    EXPECT_EQ(told(events(), "slave 2: lost, it was in OP"), 1);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(ctx->slave(2).image.inputs.bits, 8U);
    EXPECT_EQ(ctx->slave(3).parent, 1);
}

// Slave 2 is not what is wanted there, but of the kind of slave 3. Both lose their supply, and slave 2 alone comes
// back: it is slave 2 again, which is held, and not slave 3.
TEST_F(HotConnectTest, AnOtherSlaveThatIsBackIsHeldAgainInItsOwnPlace) {
    const auto third = make({.product = 0x101});
    pull(line[2]);
    ASSERT_TRUE(segment.connect({line[1], 1}, {third, 0}));
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x1FF), at(3, 0x101)};
    (void)bring_up(expected);
    (void)config_map(*ctx, image);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return in_op(1) && in_op(3); })) << joined(events());
    EXPECT_TRUE(ctx->slave(2).held);
    power(third, false);
    power(line[1], false);
    cycles(50);
    (void)events();
    power(line[1], true);
    ASSERT_TRUE(until([&] { return ctx->slave(2).al.state != AlState::none; })) << joined(events());
    cycles(2000);
    EXPECT_TRUE(ctx->slave(2).held);
    EXPECT_LE(ctx->slave(2).al.state, AlState::preop);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::none);
    const auto story = events();
    EXPECT_EQ(told(story, "slave 3"), 0) << joined(story);
    power(third, true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    EXPECT_TRUE(ctx->slave(2).held);
}

TEST_F(HotConnectTest, WhoeverComesAtTheEndOfTheLineIsTakenIn) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), at(4, 0x103, true), at(5, 0x104)};
    EXPECT_EQ(bring_up(expected), (Words{"slave 5: comparing with what is expected: an expected slave is missing"}));
    run();
    EXPECT_EQ(cycle().error().code, Errc::working_counter) << "5 may not be missing";
    expect_exchanged(3, line[2]);
    // Slave 4 stays absent, slave 5 arrives.
    const auto fifth = make({.product = 0x104});
    plug({line[2], 1}, fifth);
    power(fifth, true);
    ASSERT_TRUE(until([&] { return in_op(5); })) << joined(events());
    EXPECT_EQ(*cycle(), 12U);
    expect_exchanged(5, fifth);
}

// The complete start-up: the SII, start-up lists, and a hook that was set while the slave was absent and is called
// again while it is busy.
TEST_F(HotConnectTest, WhoeverComesLaterGetsItsWholeStartUp) {
    static constexpr StartupCommand kList[] = {
        write_register(Transition::init_to_preop, 0x0F80, std::uint8_t{0x11}),
        write_register(Transition::preop_to_safeop, 0x0F81, std::uint8_t{0x22}),
        write_register(Transition::safeop_to_op, 0x0F82, std::uint8_t{0x33}),
    };
    static constexpr SlaveSetup kSetup{.startup = kList};
    SlaveConfiguration config = io();
    config.setup = &kSetup;
    config.process_data_watchdog = std::chrono::milliseconds(50);
    ExpectedSlave late = at(4, 0x103, true);
    late.config = &config;
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), late};
    EXPECT_EQ(bring_up(expected), Words());
    int calls = 0;
    ctx->slave(4).hooks.user = &calls;
    ctx->slave(4).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Result<> {
        EXPECT_EQ(slave.number(), 4);
        EXPECT_EQ(slave.slave().al.state, AlState::preop);
        return ++*static_cast<int*>(user) < 5 ? Result<>(Error{.code = Errc::busy}) : Result<>();
    };
    run();
    EXPECT_EQ(calls, 0) << "nobody is there to be asked about";
    const auto fourth = make({.product = 0x103});
    plug({line[2], 1}, fourth);
    power(fourth, true);
    ASSERT_TRUE(until([&] { return in_op(4); })) << joined(events());
    EXPECT_EQ(calls, 5);
    EXPECT_EQ(segment.slave(fourth).peek(0x0F80, 3), (std::vector{std::byte{0x11}, std::byte{0x22}, std::byte{0x33}}));
    EXPECT_EQ(segment.slave(fourth).registers().get<std::uint16_t>(0x0420), 500) << "its watchdog, in steps of 100 us";
    expect_exchanged(4, fourth);
}

// A slave with a mailbox: its objects can be read after it has arrived.
TEST_F(HotConnectTest, AMailboxThatComesLaterIsUsed) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), {.number = 4, .optional = true}};
    EXPECT_EQ(bring_up(expected), Words());
    run();
    const auto fourth = segment.add(std::move(*sim::make_device("digital_io_16")).assemble());
    ASSERT_TRUE(segment.connect({line[2], 1}, {fourth, 0}));
    power(fourth, true);
    ASSERT_TRUE(until([&] { return ctx->slave(4).al.state == AlState::preop; })) << joined(events());
    std::array<std::byte, 4> vendor{};
    SdoUpload upload;
    upload.slave = 4;
    upload.index = 0x1018;
    upload.subindex = 1;
    upload.data = vendor;
    ASSERT_TRUE(submit(*ctx, upload).ok());
    ASSERT_TRUE(until([&] { return !upload.busy(); }));
    std::array<char, 256> text{};
    EXPECT_EQ(upload.state(), RequestState::success) << describe(upload.error(), text);
    EXPECT_EQ(vendor, (std::array{std::byte{0x47}, std::byte{0x4D}, std::byte{0}, std::byte{0}}));
    EXPECT_EQ(*cycle(), 9U);
}

// Without a configuration of its process data the slave has no place in the image. It goes to PREOP only, and an event
// reports it.
TEST_F(HotConnectTest, WithoutAPlaceInTheImageItStaysInPreop) {
    ExpectedSlave late = at(4, 0x103, true);
    late.config = nullptr;
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), late};
    EXPECT_EQ(bring_up(expected), Words());
    run();
    const auto fourth = make({.product = 0x103});
    plug({line[2], 1}, fourth);
    power(fourth, true);
    ASSERT_TRUE(until([&] { return ctx->slave(4).al.state == AlState::preop; })) << joined(events());
    cycles(1500);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(errors(), (Words{"slave 4: mapping process data: the slave has process data, but no place in the image "
                               "is reserved for it"}));
    const auto story = events();
    EXPECT_EQ(told(story, "slave 4: recovered"), 0) << "it is not where it was wanted";
    EXPECT_EQ(told(story, "recovery failed: slave 4: mapping process data: the slave has process data, but no place"),
              1)
        << "once\n"
        << joined(story);
    // A new mapping gives it a place.
    supervision.cancel();
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(to_op().state, AlState::op);
    EXPECT_EQ(*cycle(), 12U);
}

TEST_F(HotConnectTest, TheWrongOneInAKeptPlaceIsAStranger) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), at(4, 0x103, true)};
    EXPECT_EQ(bring_up(expected), Words());
    run();
    const auto wrong = make({.product = 0x777});
    plug({line[2], 1}, wrong);
    power(wrong, true);
    cycles(3000);
    const auto story = events();
    EXPECT_EQ(told(story,
                   "a slave that is not in the list of expected slaves (product 0x00000777 of vendor 0x00004d47, "
                   "revision 0x00000000) is connected "
                   "to slave 3 port 1"),
              1)
        << joined(story);
    EXPECT_EQ(told(story, "4 slaves answer, it was 3"), 1) << joined(story);
    EXPECT_EQ(story.size(), 2U) << joined(story);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(ctx->slave(4).al.state, AlState::none);
    // After power off and on the wrong slave is reported again; the right slave in its place is accepted.
    power(wrong, false);
    cycles(20);
    power(wrong, true);
    cycles(1000);
    EXPECT_EQ(told(events(), "a slave that is not in the list of expected slaves"), 1);
    pull(wrong);
    cycles(20);
    const auto right = make({.product = 0x103});
    plug({line[2], 1}, right);
    power(right, true);
    EXPECT_TRUE(until([&] { return in_op(4); })) << joined(events());
}

// ------------------------------------------------------------------ groups

// Two groups of two slaves. Their heads are identified by alias 0x0010 and by device ID 7.
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
        expected = {at(1, 0x100), at(2, 0x101), at(3, 0x102), head(1), member(1), head(2), member(2)};
        expected[3].alias = std::uint16_t{0x0010};
        expected[5].device_id = std::uint16_t{7};
    }
    static ExpectedSlave head(std::uint8_t group) {
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
    EXPECT_EQ(bring_up(expected), Words());
    ASSERT_EQ(ctx->slaves().size(), 7U);
    run();
    expect_all_exchange();
    EXPECT_EQ(ctx->slave(6).parent, 1);
    EXPECT_EQ(ctx->slave(6).parent_port, 2);
    EXPECT_EQ(ctx->slave(7).parent, 6);
    EXPECT_EQ(ctx->slave(4).parent, 3);
}

TEST_F(HotConnectGroups, MayBeMissingAndComeDuringOp) {
    EXPECT_EQ(bring_up(expected), Words());
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
    EXPECT_EQ(told(events(), "not in the list of expected slaves"), 0);
}

// The other slaves lose only the cycles during which cables are pulled and plugged.
TEST_F(HotConnectGroups, SwapPortsDuringOp) {
    plug({line[0], 2}, g.a);
    plug({line[1], 2}, g.b);
    EXPECT_EQ(bring_up(expected), Words());
    run();
    for (int round = 0; round < 4; ++round) {
        SCOPED_TRACE(round);
        pull(g.a);
        pull(g.b);
        cycles(round % 2 == 0 ? 30 : 400);
        EXPECT_EQ(*cycle(), 9U);
        // With loss of power, as on a docking machine, or without.
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
        EXPECT_EQ(
            told(story, "not in the list of expected slaves") + told(story, "another slave") + told(story, "failed"), 0)
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
        (Words{
            "slave 5: comparing with what is expected: another slave than expected (expected product 0x00000201, got "
            "0x000002ff of vendor 0x00004d47)"}));
    // The same while the segment is in OP.
    pull(g.a);
    EXPECT_EQ(bring_up(expected), Words());
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
    EXPECT_EQ(bring_up(expected), (Words{"slave 5: comparing with what is expected: an expected slave is missing"}));
    pull(g.a);
    EXPECT_EQ(bring_up(expected), Words()) << "the whole group may be missing";
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
    EXPECT_EQ(told(events(), "slave 5: missing, though the head of its group, slave 4, is there"), 1);
    // When the slave arrives, it belongs to the group.
    ASSERT_TRUE(segment.connect({g.a, 1}, {g.a2, 0}));
    power(g.a2, true);
    ASSERT_TRUE(until([&] { return in_op(5); })) << joined(events());
    expect_exchanged(5, g.a2);
}

// Any order of pulling and plugging, power kept or lost, any port, lost frames, and memory for all slaves at once or
// for one. In the end every slave is in OP and exchanges its own process data.
class HotConnectInAnyOrder : public HotConnectGroups, public testing::WithParamInterface<std::uint32_t> {};

TEST_P(HotConnectInAnyOrder, EverybodyIsWhoHeIsInTheEnd) {
    limits.tasks = GetParam() % 2 == 0 ? 1 : 0;
    EXPECT_EQ(bring_up(expected), Words());
    run();
    std::uint32_t random = GetParam();
    std::vector<std::string> story;
    const auto next = [&](std::uint32_t below) {
        random = random * 1664525 + 1013904223;
        return (random >> 16) % below;
    };
    std::array<bool, 2> plugged{};
    const std::array<std::uint32_t, 2> heads{g.a, g.b};
    const std::array<std::uint32_t, 2> seconds{g.a2, g.b2};
    const sim::PortRef ports[] = {{line[0], 2}, {line[1], 2}, {line[2], 1}, {line[2], 2}, {line[0], 3}};
    for (const auto number : {g.a, g.a2, g.b, g.b2}) power(number, true);
    segment.set_noise({.lost = GetParam() % 3 == 0 ? 0.0 : 0.03, .seed = GetParam()});
    for (int step = 0; step < 60; ++step) {
        const std::size_t n = next(2);
        if (plugged[n]) pull(heads[n]);
        plugged[n] = !plugged[n] &&
                     (segment.connect(ports[next(5)], {heads[n], 0}) || segment.connect(ports[next(5)], {heads[n], 0}));
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
        for (const sim::PortRef& port : ports) plugged[n] = plugged[n] || segment.connect(port, {heads[n], 0});
    const auto all = [&] { return in_op(4) && in_op(5) && in_op(6) && in_op(7); };
    const auto listen = [&] {
        for (const auto& event : events()) story.push_back(event);
        return all();
    };
    ASSERT_TRUE(until(listen, 5000)) << joined(story);
    ASSERT_TRUE(until([&] { return cycle().ok() && all_in_op(); }));
    expect_all_exchange();
    EXPECT_EQ(told(story, "not in the list of expected slaves") + told(story, "another slave"), 0) << joined(story);
}

INSTANTIATE_TEST_SUITE_P(Seeds, HotConnectInAnyOrder, testing::Range(1U, 41U));
// A slave got the address of another one: a device that was disconnected as a newcomer came back as the present one.
INSTANTIATE_TEST_SUITE_P(OnceFailed, HotConnectInAnyOrder, testing::Values(247U, 722U, 800U, 910U, 996U));

// ------------------------------------------------------------------ topology

TEST_F(HotConnectTest, TheTreeFollowsWhoeverIsPluggedElsewhere) {
    EXPECT_EQ(bring_up({}), Words());
    run();
    EXPECT_EQ(ctx->slave(3).parent, 2);
    pull(line[2]);
    cycles(20);
    EXPECT_EQ(ctx->slave(3).ring_position, 0);
    EXPECT_FALSE(ctx->slave(2).ports[1].open);
    plug({line[0], 3}, line[2]);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    cycles(20);
    EXPECT_EQ(ctx->slave(3).parent, 1);
    EXPECT_EQ(ctx->slave(3).parent_port, 3);
    EXPECT_EQ(ctx->slave(3).ring_position, 2);
    EXPECT_EQ(ctx->slave(2).ring_position, 3);
    EXPECT_EQ(ctx->slave(1).ports[3].neighbour, 3);
    EXPECT_EQ(ctx->slave(2).ports[1].neighbour, 0);
    EXPECT_EQ(*cycle(), 9U);
}

// A new scan finds the slaves that are present; no slave has to be switched off.
TEST_F(HotConnectTest, ScannedAnewOnRequest) {
    EXPECT_EQ(bring_up({}), Words());
    run();
    const auto fourth = make({.product = 0x103});
    plug({line[0], 2}, fourth);
    power(fourth, true);
    cycles(1000);
    EXPECT_EQ(told(events(),
                   "a slave that is not in the list of expected slaves (product 0x00000103 of vendor 0x00004d47, "
                   "revision 0x00000000) is connected "
                   "to slave 1 port 2"),
              1);
    supervision.cancel();
    EXPECT_EQ(bring_up({}), Words());
    ASSERT_EQ(ctx->slaves().size(), 4U);
    run();
    EXPECT_EQ(*cycle(), 12U);
    EXPECT_EQ(ctx->slave(4).parent, 1);
}

// A machine arrives with power of its own and with station addresses from another master.
TEST_F(HotConnectTest, ForeignAddressesDeceiveNobody) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), at(4, 0x103, true)};
    EXPECT_EQ(bring_up(expected), Words());
    run();
    for (const std::uint16_t address : {std::uint16_t{0x1002}, std::uint16_t{0x1004}, std::uint16_t{0x0D01}}) {
        SCOPED_TRACE(address);
        const auto foreign = make({.product = 0x900});
        power(foreign, true);
        segment.slave(foreign).registers().set<std::uint16_t>(0x0010, address);
        for (std::uint16_t octet = 0; octet < 16;
             ++octet) {  // as if it came from the place of slave 3 in another machine
            std::array<std::byte, 1> value{};
            segment.slave(line[2]).read(static_cast<std::uint16_t>(0x0600 + octet), value);
            segment.slave(foreign).registers().set<std::uint8_t>(static_cast<std::uint16_t>(0x0600 + octet),
                                                                 std::to_integer<std::uint8_t>(value[0]));
        }
        plug({line[2], 1}, foreign);
        segment.reconsider();
        cycles(2000);
        EXPECT_EQ(*cycle(), 9U);
        std::array<std::byte, 1> active{};
        segment.slave(foreign).read(0x060C, active);
        EXPECT_EQ(active[0], std::byte{0}) << "an unknown slave gets no outputs";
        EXPECT_TRUE(in_op(1) && in_op(2) && in_op(3)) << joined(events());
        EXPECT_FALSE(ctx->slave(4).seen);
        EXPECT_EQ(told(events(), "a slave that is not in the list of expected slaves"), 1);
        pull(foreign);
        cycles(50);
        (void)events();
    }
}

}  // namespace
}  // namespace margay
