// Slaves that arrive later, leave, and return at another place: reserved places, and the topology after changes.
#include "process_data/hot_connect.hpp"

namespace margay {
namespace {

TEST_F(HotConnectTest, APlaceIsKeptForWhomIsMissingInTheMiddle) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x1FF, true), at(3, 0x101), at(4, 0x102)};
    EXPECT_EQ(bring_up(expected), Sentences());
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

    // A slave with its power supply is inserted. The slaves behind it are lost for a moment.
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

// The device in the place of slave 2 is not the expected slave; it is of the kind of slave 3. Both lose their supply,
// and only slave 2 comes back. It is slave 2 again, which is held, and not slave 3.
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
    EXPECT_EQ(bring_up(expected), (Sentences{"slave 5: comparing with what is expected: the slave is missing"}));
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

// The complete start-up: the SII, start-up lists, and a hook. The application has set the hook while the slave was
// absent. The hook is called again while it returns busy.
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
    EXPECT_EQ(bring_up(expected), Sentences());
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

// A slave with a mailbox: the application can read its objects after the slave has arrived.
TEST_F(HotConnectTest, AMailboxThatComesLaterIsUsed) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), {.number = 4, .optional = true}};
    EXPECT_EQ(bring_up(expected), Sentences());
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

// Without a configuration of its process data the slave has no place in the image. The slave goes only to PREOP, and an
// event reports this.
TEST_F(HotConnectTest, WithoutAPlaceInTheImageItStaysInPreop) {
    ExpectedSlave late = at(4, 0x103, true);
    late.config = nullptr;
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), late};
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    const auto fourth = make({.product = 0x103});
    plug({line[2], 1}, fourth);
    power(fourth, true);
    ASSERT_TRUE(until([&] { return ctx->slave(4).al.state == AlState::preop; })) << joined(events());
    cycles(1500);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(errors(),
              (Sentences{"slave 4: mapping process data: the slave has process data, but no place in the image "
                         "is reserved for it: call config_map() again"}));
    const auto story = events();
    EXPECT_EQ(told(story, "slave 4: recovered"), 0) << "it is not where it was wanted";
    EXPECT_EQ(told(story, "recovery failed: slave 4: mapping process data: the slave has process data, but no place"),
              1)
        << "once\n"
        << joined(story);
    // A new mapping gives the slave a place.
    supervision.cancel();
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(to_op().state, AlState::op);
    EXPECT_EQ(*cycle(), 12U);
}

TEST_F(HotConnectTest, TheWrongOneInAKeptPlaceIsAStranger) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), at(4, 0x103, true)};
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    const auto wrong = make({.product = 0x777});
    plug({line[2], 1}, wrong);
    power(wrong, true);
    cycles(3000);
    const auto story = events();
    EXPECT_EQ(told(story,
                   "an unexpected slave (product 0x00000777 of vendor 0x00004d47, "
                   "revision 0x00000000) is connected "
                   "to slave 3 port 1"),
              1)
        << joined(story);
    EXPECT_EQ(told(story, "4 slaves answer, it was 3"), 1) << joined(story);
    EXPECT_EQ(story.size(), 2U) << joined(story);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_EQ(ctx->slave(4).al.state, AlState::none);
    // After power off and on the wrong slave is reported again. The right slave in its place is accepted.
    power(wrong, false);
    cycles(20);
    power(wrong, true);
    cycles(1000);
    EXPECT_EQ(told(events(), "an unexpected slave"), 1);
    pull(wrong);
    cycles(20);
    const auto right = make({.product = 0x103});
    plug({line[2], 1}, right);
    power(right, true);
    EXPECT_TRUE(until([&] { return in_op(4); })) << joined(events());
}

// ------------------------------------------------------------------ groups

TEST_F(HotConnectTest, TheTreeFollowsWhoeverIsPluggedElsewhere) {
    EXPECT_EQ(bring_up({}), Sentences());
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

// A new scan finds the slaves that are present. No slave has to be switched off.
TEST_F(HotConnectTest, ScannedAnewOnRequest) {
    EXPECT_EQ(bring_up({}), Sentences());
    run();
    const auto fourth = make({.product = 0x103});
    plug({line[0], 2}, fourth);
    power(fourth, true);
    cycles(1000);
    EXPECT_EQ(told(events(),
                   "an unexpected slave (product 0x00000103 of vendor 0x00004d47, "
                   "revision 0x00000000) is connected "
                   "to slave 1 port 2"),
              1);
    supervision.cancel();
    EXPECT_EQ(bring_up({}), Sentences());
    ASSERT_EQ(ctx->slaves().size(), 4U);
    run();
    EXPECT_EQ(*cycle(), 12U);
    EXPECT_EQ(ctx->slave(4).parent, 1);
}

// A machine arrives with its own power and with station addresses from another master.
TEST_F(HotConnectTest, ForeignAddressesDeceiveNobody) {
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), at(4, 0x103, true)};
    EXPECT_EQ(bring_up(expected), Sentences());
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
        EXPECT_EQ(told(events(), "an unexpected slave"), 1);
        pull(foreign);
        cycles(50);
        (void)events();
    }
}

// A tool from another machine has kept its power and its station address from that machine. In this segment the address
// belongs to another slave, and the tool comes before that slave in the ring.
TEST_F(HotConnectTest, AToolWithTheStationAddressOfAnotherSlave) {
    const auto tool = make({.product = 0x200, .alias = 7});
    ExpectedSlave head{.vendor = kVendor, .product = 0x200, .hot_connect = 1, .config = &kIo};
    head.alias = std::uint16_t{7};
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), head};
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    power(tool, true);
    for (const std::uint16_t clash : {std::uint16_t{2}, std::uint16_t{3}, std::uint16_t{1}, std::uint16_t{4}}) {
        SCOPED_TRACE(clash);
        const std::uint16_t address = ctx->slave(clash).station_address.value;
        const std::array octets{static_cast<std::byte>(address & 0xFF), static_cast<std::byte>(address >> 8)};
        (void)segment.slave(tool).ecat_write(0x0010, octets, osal.now());
        plug({line[0], 2}, tool);
        for (int n = 0; n < 1'500; ++n) {
            for (const Slave& slave : ctx->slaves())
                std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0xA0 + slave.number));
            cycles(1);
            const auto outputs = program(tool).outputs();
            const bool none = outputs.empty() || outputs[0] == std::byte{0};
            EXPECT_TRUE(none || outputs[0] == std::byte{0xA4}) << n << ": the outputs of another slave";
        }
        EXPECT_TRUE(all_right(*ctx));
        EXPECT_TRUE(in_op(4)) << joined(events());
        for (std::size_t n = 1; n <= line.size(); ++n) expect_exchanged(n, line[n - 1]);
        expect_exchanged(4, tool);
        pull(tool);
        cycles(500);
    }
}

// The same while the hook of that slave never ends. Neither the tool nor the slaves behind it wait for the hook.
TEST_F(HotConnectTest, AToolWithTheStationAddressOfASlaveInAHook) {
    const auto tool = make({.product = 0x200, .alias = 7});
    ExpectedSlave head{.vendor = kVendor, .product = 0x200, .hot_connect = 1, .config = &kIo};
    head.alias = std::uint16_t{7};
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), head};
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    bool waits = true;
    ctx->slave(2).hooks.user = &waits;
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        while (*static_cast<const bool*>(user)) {
            auto slept = co_await slave.sleep(std::chrono::milliseconds(5));
            if (!slept) co_return slept;
        }
        co_return Nothing{};
    };
    power(line[1], false);
    cycles(200);
    power(line[1], true);
    cycles(500);
    ASSERT_TRUE(in_op(3)) << joined(events());
    ASSERT_EQ(ctx->slave(2).al.state, AlState::preop) << "in its hook";
    power(tool, true);
    const std::uint16_t address = ctx->slave(2).station_address.value;
    const std::array octets{static_cast<std::byte>(address & 0xFF), static_cast<std::byte>(address >> 8)};
    (void)segment.slave(tool).ecat_write(0x0010, octets, osal.now());
    plug({line[0], 2}, tool);
    cycles(1'500);
    EXPECT_TRUE(in_op(4)) << joined(events());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop) << "in its hook again";
    waits = false;
    cycles(500);
    EXPECT_TRUE(all_right(*ctx));
    for (std::size_t n = 1; n <= line.size(); ++n) expect_exchanged(n, line[n - 1]);
    expect_exchanged(4, tool);
}

// A tool that is away during a mapping keeps its FMMUs and its power. When it is plugged in again, its FMMUs match no
// data.
TEST_F(HotConnectTest, AToolThatWasAwayDuringAMappingTakesNobodysOutputs) {
    const auto tool = make({.product = 0x200, .alias = 7});
    ExpectedSlave head{.vendor = kVendor, .product = 0x200, .hot_connect = 1, .config = &kIo};
    head.alias = std::uint16_t{7};
    const ExpectedSlave expected[] = {at(1, 0x100), at(2, 0x101), at(3, 0x102), head};
    limits.groups = 2;
    plug({line[0], 2}, tool);
    EXPECT_EQ(bring_up(expected), Sentences());
    run();
    std::vector<std::byte> second(64);
    for (std::uint8_t round = 0; round < 6; ++round) {
        SCOPED_TRACE(int{round});
        pull(tool);
        ctx->slave(4).config.group = round % 2 == 0 ? 1 : 0;
        ctx->slave(1).config.group = round % 2 == 0 ? 1 : 0;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        if (round % 2 == 0) {
            ASSERT_TRUE(config_map(*ctx, second, 1).ok());
        }
        const auto cycle_all = [&] {
            for (const Slave& slave : ctx->slaves())
                std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0xA0 + slave.number));
            cycles(1);
            if (ctx->group(1).mapped) (void)send_processdata(*ctx, 1);
            if (ctx->group(1).mapped) (void)receive_processdata(*ctx, std::chrono::microseconds(500), 1);
        };
        for (int n = 0; n < 20; ++n) cycle_all();
        plug({line[0], 2}, tool);
        for (int n = 0; n < 800; ++n) {
            cycle_all();
            const auto outputs = program(tool).outputs();
            const bool none = outputs.empty() || outputs[0] == std::byte{0};
            EXPECT_TRUE(none || outputs[0] == std::byte{0xA4}) << n << ": the outputs of another slave";
        }
        EXPECT_TRUE(in_op(4)) << joined(events());
    }
}

}  // namespace
}  // namespace margay
