// The identity of the slaves that answer. Another machine, or another device, at the addresses of known slaves gets no
// outputs, no matter which call finds it.
#include "process_data/identities.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {
namespace {

// The call that a program without a supervision executes first.
using First = void (*)(Identities& test);
constexpr std::pair<const char*, First> kFirst[] = {
    {"nothing", [](Identities&) {}},
    {"readstate", [](Identities& t) { (void)readstate(*t.ctx); }},
    {"recover one",
     [](Identities& t) { EXPECT_EQ(recover_slave(*t.ctx, 2).error().code, Errc::other_slave) << "of slave 2"; }},
    {"recover all", [](Identities& t) { (void)recover_slave(*t.ctx, 0); }},
    {"map", [](Identities& t) { EXPECT_EQ(config_map(*t.ctx, t.image).error().slave, 2); }},
    {"reconfigure", [](Identities& t) { EXPECT_EQ(reconfigure_slave(*t.ctx, 2).error().code, Errc::other_slave); }},
    {"set the target",
     [](Identities& t) {
         EXPECT_EQ(set_target(*t.ctx, 2, AlState::safeop).error().slave, 2);
         (void)set_target(*t.ctx, 2, AlState::none);
     }},
    {"write the state of one",
     [](Identities& t) {
         EXPECT_EQ(writestate(*t.ctx, 2, AlState::preop).error().code, Errc::other_slave);
         EXPECT_FALSE(writestate(*t.ctx, 2, AlState::safeop).ok());
     }},
    {"request the state",
     [](Identities& t) {
         StateRequest request;
         request.slave = 2;
         request.wanted = AlState::preop;
         ASSERT_TRUE(submit(*t.ctx, request).ok());
         EXPECT_EQ(wait(*t.ctx, request).error().code, Errc::other_slave);
     }},
    {"write the state", [](Identities& t) {
         (void)writestate(*t.ctx, 0, AlState::preop);
         (void)statecheck(*t.ctx, 0, AlState::preop, 100ms);
         (void)writestate(*t.ctx, 0, AlState::safeop);
     }}};

TEST(IdentitiesUnsupervised, AnotherDeviceAtTheAddressOfASlaveGetsNothing) {
    for (const bool noticed : {false, true})
        for (const auto& [name, first] : kFirst) {
            SCOPED_TRACE(std::string(name) + (noticed ? ", noticed before" : ""));
            struct One : Identities {
                void TestBody() override {}
            } one;
            one.build();
            one.take_out_slave_2();
            one.cycles(200);
            if (noticed) (void)readstate(*one.ctx);
            one.set(one.tool, 0x0010, 0x1002);
            one.put_in(one.tool);
            one.cycles(300);
            first(one);
            EXPECT_EQ(one.segment.slave(one.tool).peek(0x0130, 1)[0], std::byte{1}) << "it is not started";
            const auto reached = reach(*one.ctx, AlState::op, 2s);
            EXPECT_EQ(reached.error().slave, 2) << in_words(reached.error());
            one.expect_no_outputs(one.tool);
        }
}

// The SII of slave 2 has no vendor and no product. This does not make every other device equal to slave 2.
TEST(IdentitiesUnsupervised, ASlaveWhoseSiiHasNoIdentityIsNotAnyDevice) {
    for (const bool supervised : {true, false}) {
        SCOPED_TRACE(supervised);
        struct One : Identities {
            void TestBody() override {}
        } one;
        one.nameless = true;
        one.wanted[1].product.reset();
        one.build();
        if (supervised) {
            ASSERT_TRUE(submit(*one.ctx, one.supervision).ok());
            ASSERT_TRUE(reach(*one.ctx, AlState::op, 2s).ok());
        }
        one.take_out_slave_2();
        one.cycles(500);
        if (!supervised) (void)readstate(*one.ctx);
        one.set(one.tool, 0x0010, 0x1002);
        one.put_in(one.tool);
        one.cycles(5);
        if (!supervised) {
            EXPECT_FALSE(recover_slave(*one.ctx, 2).ok());
            EXPECT_FALSE(reach(*one.ctx, AlState::op, 2s).ok());
        }
        one.expect_no_outputs(one.tool);
        // The slave itself comes back.
        one.segment.disconnect({one.tool, 0});
        one.segment.disconnect({one.tool, 1});
        one.cycles(500);
        one.put_in(one.line[1]);
        if (!supervised) {
            one.cycles(5);
            (void)recover_slave(*one.ctx, 0);
            (void)reconfigure_slave(*one.ctx, 2);
            (void)reach(*one.ctx, AlState::op, 2s);
        }
        EXPECT_TRUE(one.until([&] { return one.in_op(2); })) << Plant::joined(one.events());
    }
}

// Nothing reads the slaves while the device in place 2 is exchanged for a device in the same state at the same address.
TEST(IdentitiesUnsupervised, ADeviceThatIsExchangedWhileNobodyLooksIsNoticed) {
    for (const AlState base : {AlState::init, AlState::preop})
        for (const bool maps : {false, true}) {
            SCOPED_TRACE(std::string(to_text(base)) + (maps ? ", mapped again" : ""));
            struct One : Identities {
                void TestBody() override {}
            } one;
            one.build();
            ASSERT_TRUE(writestate(*one.ctx, 0, AlState::preop).ok());
            ASSERT_TRUE(statecheck(*one.ctx, 0, AlState::preop, 1s).ok());
            ASSERT_TRUE(writestate(*one.ctx, 0, base).ok());
            ASSERT_TRUE(statecheck(*one.ctx, 0, base, 1s).ok());
            one.tool = one.make({.product = 0x200, .emulation = true});
            one.power(one.tool, true);
            one.set(one.tool, 0x0120, static_cast<std::uint16_t>(base));
            one.take_out_slave_2();
            one.osal.advance(2s);
            one.set(one.tool, 0x0010, 0x1002);
            one.put_in(one.tool);
            if (maps) {
                EXPECT_EQ(config_map(*one.ctx, one.image).error().slave, 2);
            } else {
                EXPECT_EQ(
                    writestate(*one.ctx, 0, base == AlState::init ? AlState::preop : AlState::safeop).error().slave, 2);
            }
            (void)reach(*one.ctx, AlState::op, 2s);
            one.expect_no_outputs(one.tool);
        }
}

TEST_F(Identities, AnotherMachineBehindTheCableGetsNothing) {
    const auto other = make({.product = 0x300});
    const auto next = make({.product = 0x301});
    segment.set_power(other, true, osal.now());
    segment.set_power(next, true, osal.now());
    ASSERT_TRUE(segment.connect({other, 1}, {next, 0}));
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    (void)events();
    segment.disconnect({line[0], 0});
    cycles(1'000);
    set(other, 0x0010, 0x1001);
    set(next, 0x0010, 0x1002);
    ASSERT_TRUE(segment.connect_master({other, 0}));
    segment.disconnect({next, 1});  // so that the segment updates its ports after the change of cables
    expect_no_outputs(other);
    expect_no_outputs(next);
    const auto said = events();
    EXPECT_EQ(told(said, "slave 1: another slave in its place (expected product 0x00000100, got 0x00000300"), 1)
        << joined(said);
    segment.disconnect({other, 0});
    ASSERT_TRUE(segment.connect_master({line[0], 0}));
    segment.disconnect({line[2], 1});
    EXPECT_TRUE(until([&] { return all_right(*ctx); })) << joined(events());
    for (std::size_t n = 1; n <= 3; ++n) expect_exchanged(n, line[n - 1]);
}

// A second machine with the same program gives its slaves the same addresses and FMMUs.
TEST_F(Identities, TheFmmusOfALostSlaveProveNothing) {
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    const auto fmmus = segment.slave(line[1]).peek(0x0600, 0x30);
    take_out_slave_2();
    cycles(500);
    (void)segment.slave(tool).ecat_write(0x0600, fmmus, osal.now());
    set(tool, 0x0010, 0x1002);
    put_in(tool);
    expect_no_outputs(tool);
}

// A device of the kind of a lost slave is in another place: at a free port, or behind the slaves that follow the lost
// slave.
TEST_F(Identities, ADeviceOfTheSameKindInAnotherPlaceIsNotTheLostSlave) {
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    segment.set_power(twin, true, osal.now());
    segment.disconnect({line[1], 0});
    segment.disconnect({line[1], 1});
    ASSERT_TRUE(segment.connect({line[0], 1}, {line[2], 0}));
    cycles(500);
    ASSERT_TRUE(segment.connect({line[2], 1}, {twin, 0}));
    expect_no_outputs(twin);
    segment.disconnect({twin, 0});
    cycles(500);
    // In the place of the lost slave the device is a spare part.
    segment.disconnect({line[2], 0});
    put_in(twin);
    EXPECT_TRUE(until([&] { return all_right(*ctx); })) << joined(events());
    expect_exchanged(2, twin);
}

// The application drives any device in place 2. The device is exchanged for a device with another alias.
TEST_F(Identities, AToleratedSlaveMayBeExchangedToo) {
    for (ExpectedSlave& one : wanted) one.tolerate = true;
    wanted[1].product = 0x1FF;
    EXPECT_EQ(bring_up(wanted).size(), 1U) << "another slave than expected";
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    take_out_slave_2();
    cycles(500);
    segment.set_power(twin, true, osal.now());
    put_in(twin);
    EXPECT_TRUE(until([&] { return all_right(*ctx); })) << joined(events());
    expect_exchanged(2, twin);
}

// A slave is inserted before the other slaves while a search reads the ring, one place per frame. The search sees one
// slave twice, and must not treat it as two slaves with one address.
TEST(IdentitiesInTheRing, ASlaveThatIsSeenTwiceKeepsItsAddress) {
    struct One : Identities {
        void TestBody() override {}
    } one;
    one.limits.tasks = 1;
    one.build();
    const auto front = one.make({.product = 0x500});
    one.segment.set_power(front, true, one.osal.now());
    int unstable = 0;
    for (int step = 0; step < 100; ++step) {
        one.osal.advance(50ms);  // no cycle is active that the search would wait for
        RecoverRequest search;
        ASSERT_TRUE(submit(*one.ctx, search).ok());
        for (int n = 0; search.busy() && n < 2'000; ++n) {
            if (n == 5 * step) {
                one.segment.disconnect({one.line[0], 0});
                ASSERT_TRUE(one.segment.connect_master({front, 0}));
                ASSERT_TRUE(one.segment.connect({front, 1}, {one.line[0], 0}));
            }
            (void)poll(*one.ctx, one.osal.now());
            one.osal.advance(1us);
        }
        unstable += search.error().code == Errc::unstable ? 1 : 0;
        for (std::uint16_t n = 0; n < 3; ++n)
            EXPECT_EQ(one.segment.slave(one.line[n]).peek(0x0010, 1)[0], static_cast<std::byte>(n + 1)) << step;
        one.segment.disconnect({one.line[0], 0});
        one.segment.disconnect({front, 0});
        ASSERT_TRUE(one.segment.connect_master({one.line[0], 0}));
        one.segment.reconsider();
        one.cycles(3);
    }
    EXPECT_GT(unstable, 0);
}

// Two equal slaves at two ports of a junction lose their power. The second slave is back first.
TEST_F(Identities, EqualSlavesAtTwoPortsAreKnownByTheirPorts) {
    const auto left = make({.product = 0x400});
    const auto right = make({.product = 0x400});
    for (const auto device : {left, right}) segment.set_power(device, true, osal.now());
    ASSERT_TRUE(segment.connect({line[2], 2}, {right, 0}));
    ASSERT_TRUE(segment.connect({line[2], 1}, {left, 0}));
    wanted.push_back({.number = 4, .product = 0x400});
    wanted.push_back({.number = 5, .product = 0x400});
    EXPECT_EQ(bring_up(wanted), std::vector<std::string>());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    const auto fourth = ctx->slave(4).parent_port == 1 ? left : right;
    const auto fifth = fourth == left ? right : left;
    for (const auto device : {fourth, fifth}) power(device, false);
    cycles(500);
    power(fifth, true);
    cycles(1'000);
    power(fourth, true);
    EXPECT_TRUE(until([&] { return all_right(*ctx); })) << joined(events());
    expect_exchanged(4, fourth);
    expect_exchanged(5, fifth);
}

// A program with its own order: it brings all slaves to INIT and back to PREOP, writes objects in PREOP, and maps.
TEST_F(Identities, ASlaveThatTheApplicationHasTakenToInitIsNotStartedAgainByTheMapping) {
    for (const AlState to : {AlState::init, AlState::preop}) {
        ASSERT_TRUE(writestate(*ctx, 0, to).ok());
        ASSERT_EQ(statecheck(*ctx, 0, to, 1s)->state, to);
    }
    int fell = 0;
    struct Count {
        static void call(const Event&, void* user) { ++*static_cast<int*>(user); }
    };
    ctx->events().callback = Count::call;
    ctx->events().user = &fell;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(fell, 0) << joined(events());
}

// A mapping that is cancelled leaves no slave in the exchange that it has not configured.
TEST_F(Identities, AMappingThatIsCutLeavesNoFreshInputsOfSlavesThatAreNotThere) {
    int cuts = 0;
    for (int at = 0; at < 40; ++at) {
        power(line[2], false);
        (void)readstate(*ctx);
        MapRequest map;
        map.image = image;
        map.timeout = 50us * at + 1us;
        ASSERT_TRUE(submit(*ctx, map).ok());
        (void)wait(*ctx, map);
        power(line[2], true);
        cuts += ctx->group(0).mapped && map.error().code == Errc::timeout ? 1 : 0;
        for (int n = 0; n < 5; ++n) (void)cycle();
        for (std::uint16_t n = 1; n <= 3; ++n) {
            const auto real = static_cast<AlState>(segment.slave(line[n - 1U]).peek(0x0130, 1)[0] & std::byte{0xF});
            EXPECT_FALSE(inputs_fresh(*ctx, n) && real < AlState::safeop)
                << "slave " << n << ", cut after 50 us * " << at;
        }
        (void)recover_slave(*ctx, 0);
    }
    EXPECT_GT(cuts, 3);
}

}  // namespace
}  // namespace margay
