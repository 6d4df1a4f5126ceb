// Slaves that are in the ring and cannot be read, or that are removed before they were read. Each call reports this.
#include "process_data/plant.hpp"

#include "sim/devices.hpp"

#include <margay/coe.hpp>
#include <margay/hooked_slave.hpp>
#include <margay/run.hpp>

#include <array>
#include <string>
#include <utility>

namespace margay {
namespace {

using namespace std::chrono_literals;

std::string said(const Error& error) {
    std::array<char, 400> buffer{};
    return std::string(describe(error, buffer));
}

// Two slaves in a line. The EEPROM of the second slave does not answer.
struct PairWithUnread : Plant {
    std::uint32_t first = make({.product = 0x100});
    std::uint32_t unread = make({.product = 0x101});
    PairWithUnread() {
        EXPECT_TRUE(segment.connect_master({first, 0}));
        EXPECT_TRUE(segment.connect({first, 1}, {unread, 0}));
        segment.slave(unread).sii().fail_next(1'000'000);
    }
    void let_read() { segment.slave(unread).sii().fail_next(0); }
};

// There is no list. The SII of slave 2 cannot be read by the scan, nor before the image is laid out. It can be read
// when the SyncManagers and FMMUs are written.
TEST(UnreadSlave, HasNoPlaceInItsFirstMapping) {
    PairWithUnread plant;
    EXPECT_FALSE(plant.bring_up({}).empty());
    ASSERT_EQ(plant.ctx->slaves().size(), 2U);
    ASSERT_FALSE(plant.ctx->slave(2).seen);
    bool in_hook = false;
    plant.ctx->slave(1).hooks.user = &in_hook;
    plant.ctx->slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        *static_cast<bool*>(user) = true;
        co_return co_await slave.sleep(500ms);
    };
    MapRequest map;
    map.image = plant.image;
    ASSERT_TRUE(submit(*plant.ctx, map).ok());
    const auto go_while = [&](auto holds) {
        for (int n = 0; n < 60'000 && holds(); ++n) {
            plant.osal.advance(1ms);
            (void)poll(*plant.ctx, plant.osal.now());
        }
    };
    go_while([&] { return !in_hook; });
    go_while([&, n = 0]() mutable { return ++n < 100; });
    ASSERT_TRUE(map.busy());
    plant.let_read();
    go_while([&] { return map.busy(); });
    EXPECT_EQ(map.error().step, Step::read_sii) << static_cast<int>(map.error().code);
    EXPECT_EQ(map.error().slave, 2U);
    const auto said = plant.errors();
    EXPECT_EQ(Plant::told(said, "slave 2: mapping process data: the slave has process data, but no place"), 1);
    EXPECT_EQ(Plant::told(said, "have changed since config_map()"), 0) << Plant::joined(said);
    EXPECT_TRUE(plant.ctx->slave(2).unplaced);
    EXPECT_EQ(plant.ctx->group(0).expected_wkc, 4U) << "three of slave 1, and one of slave 2";
    for (int n = 0; n < 20; ++n) EXPECT_EQ(plant.cycle().error().code, Errc::working_counter);
    EXPECT_FALSE(all_right(*plant.ctx));
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
    EXPECT_TRUE(reach(*plant.ctx, AlState::op, 5s).ok());
    plant.expect_exchanged(2, plant.unread);
    EXPECT_TRUE(plant.cycle().ok());
}

// Slave 2 has restarted after its PDOs were read, and the second mapping cannot read the slave. So the slave has no
// place.
TEST(UnreadSlave, ThatHasStartedAgainHasNoPlace) {
    Plant plant;
    const auto first = plant.make({.product = 0x100});
    const auto drive = plant.segment.add(std::move(*sim::make_device("drive")).assemble());
    ASSERT_TRUE(plant.segment.connect_master({first, 0}));
    ASSERT_TRUE(plant.segment.connect({first, 1}, {drive, 0}));
    ASSERT_TRUE(plant.bring_up({}).empty());
    ASSERT_TRUE(config_map(*plant.ctx, plant.image).ok());
    plant.power(drive, false);
    plant.osal.advance(100ms);
    plant.power(drive, true);
    ASSERT_TRUE(readstate(*plant.ctx).ok());
    ASSERT_TRUE(recover_slave(*plant.ctx, 2).ok());
    std::pair<Plant*, std::uint32_t> both{&plant, drive};
    plant.ctx->slave(2).hooks.user = &both;
    plant.ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave, void* user) -> Result<> {
        const auto& of = *static_cast<std::pair<Plant*, std::uint32_t>*>(user);
        of.first->power(of.second, false);
        return Result<>();
    };
    EXPECT_FALSE(config_map(*plant.ctx, plant.image).ok());
    ASSERT_TRUE(plant.ctx->slave(2).unplaced) << Plant::joined(plant.errors());
    plant.ctx->slave(2).hooks = {};
    plant.power(drive, true);
    ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
    plant.cycles(3000);
    EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::no_place);
    EXPECT_EQ(plant.ctx->slave(2).al.state, AlState::preop);
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
    EXPECT_TRUE(plant.until([&] { return plant.in_op(2); }));
}

// The errors of an EEPROM that cannot be read: each call returns one error.
TEST(UnreadSlave, IsSaidOnceByEachCall) {
    for (const bool listed : {true, false}) {
        PairWithUnread plant;
        const ExpectedSlave list[] = {{.number = 1, .product = 0x100}, {.number = 2, .product = 0x101}};
        const auto expected = listed ? std::span<const ExpectedSlave>(list) : std::span<const ExpectedSlave>();
        const std::string cause = "slave 2: reading the SII at word 0x0000: the EEPROM did not acknowledge";
        const auto scanned = plant.bring_up(expected);
        EXPECT_EQ(Plant::told(scanned, cause), 1) << Plant::joined(scanned);
        EXPECT_EQ(plant.ctx->slave(2).error.step, Step::read_sii);
        EXPECT_EQ(config_map(*plant.ctx, plant.image).error().step, Step::read_sii);
        const auto mapped = plant.errors();
        EXPECT_EQ(Plant::told(mapped, cause), 1) << Plant::joined(mapped);
        EXPECT_EQ(plant.ctx->slave(2).error.step, Step::read_sii);
        EXPECT_EQ(reach(*plant.ctx, AlState::op, 3s).error().step, Step::read_sii);
        const auto reached = plant.errors();
        EXPECT_EQ(Plant::told(reached, cause), 1) << Plant::joined(reached);
        plant.let_read();
        EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok()) << "its sizes were not known";
        EXPECT_TRUE(reach(*plant.ctx, AlState::op, 3s).ok());
    }
}

TEST(UnreadSlave, IsNotSaidToSupportNoMail) {
    PairWithUnread plant;
    EXPECT_FALSE(plant.bring_up({}).empty());
    EXPECT_EQ(said(SDOread<std::uint32_t>(*plant.ctx, 2, 0x1000, 0).error()),
              "slave 2: SDO upload of 0x1000:0: not possible in this state (the mailbox of the slave is closed: the "
              "slave is in INIT, or was not read)");
    plant.let_read();
    ASSERT_TRUE(config_map(*plant.ctx, plant.image).ok());
    EXPECT_EQ(SDOread<std::uint32_t>(*plant.ctx, 2, 0x1000, 0).error().code, Errc::unsupported) << "it has no mailbox";
}

// ------------------------------------------------------------------ gone before it was read

// Without a list, all slaves that the scan has counted are wanted.
TEST(UnreadSlave, ThatIsGoneIsMissingInEachCall) {
    PairWithUnread plant;
    EXPECT_FALSE(plant.bring_up({}).empty());
    plant.power(plant.unread, false);
    const auto mapped = config_map(*plant.ctx, plant.image);
    EXPECT_EQ(mapped.error().code, Errc::missing_slave) << said(mapped.error());
    EXPECT_EQ(mapped.error().slave, 2);
    const auto reached = reach(*plant.ctx, AlState::op, 1s);
    EXPECT_EQ(reached.error().code, Errc::missing_slave) << said(reached.error());
    EXPECT_EQ(reached.error().slave, 2);
    EXPECT_TRUE(plant.in_op(1)) << "what can be done has been done";
    const auto cycle = plant.cycle();
    EXPECT_EQ(cycle.error().code, Errc::working_counter);
    EXPECT_EQ(cycle.error().detail, Error::kOthersFresh);
    EXPECT_TRUE(inputs_fresh(*plant.ctx, 1));
    EXPECT_FALSE(all_right(*plant.ctx));
    EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave);
    // The application continues without the slave when it makes the slave optional or scans again.
    plant.ctx->slave(2).config.optional = true;
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
    EXPECT_TRUE(reach(*plant.ctx, AlState::op, 1s).ok());
    EXPECT_TRUE(plant.cycle().ok());
    EXPECT_TRUE(all_right(*plant.ctx));
    EXPECT_TRUE(plant.bring_up({}).empty());
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
}

// ------------------------------------------------------------------ comes late, and cannot be read

// The awaited slave is present, and its EEPROM does not answer. The library reports this once, and does not report the
// slave as missing.
TEST(UnreadSlave, ThatComesLateIsNotCalledMissing) {
    for (const bool listed : {true, false}) {
        PairWithUnread plant;
        plant.let_read();
        const ExpectedSlave list[] = {{.number = 1, .product = 0x100}, {.number = 2, .product = 0x101}};
        const auto expected = listed ? std::span<const ExpectedSlave>(list) : std::span<const ExpectedSlave>();
        EXPECT_TRUE(plant.bring_up(expected).empty());
        EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
        ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
        plant.power(plant.unread, false);
        plant.cycles(300);
        EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave);
        plant.segment.slave(plant.unread).sii().fail_next(1'000'000);
        plant.power(plant.unread, true);
        (void)plant.errors();
        const auto reached = reach(*plant.ctx, AlState::op, 5s);
        EXPECT_EQ(reached.error().slave, 2);
        EXPECT_EQ(reached.error().code, Errc::sii_nack) << said(reached.error());
        const auto errors = plant.errors();
        const std::string cause = "slave 2: reading the SII at word 0x0008: the EEPROM did not acknowledge";
        EXPECT_EQ(Plant::told(errors, cause), 1) << Plant::joined(errors);
        EXPECT_EQ(said(plant.ctx->slave(2).error).find(cause), 0U) << said(plant.ctx->slave(2).error);
        plant.power(plant.unread, false);
        plant.cycles(600);  // the next search comes within SuperviseRequest::retry
        EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave) << said(what_is_wrong(*plant.ctx));
        plant.let_read();
        plant.power(plant.unread, true);
        EXPECT_TRUE(reach(*plant.ctx, AlState::op, 5s).ok());
        plant.expect_exchanged(2, plant.unread);
    }
}

// A slave is switched off, and a device whose EEPROM does not answer is connected at another place. The slave is still
// missing.
TEST(UnreadSlave, AtAnotherPlaceIsNotTheLostOne) {
    Plant plant;
    const auto head = plant.make({.product = 0x100});
    const auto lost = plant.make({.product = 0x101});
    const auto branch = plant.make({.product = 0x102});
    const auto stranger = plant.make({.product = 0x777});
    EXPECT_TRUE(plant.segment.connect_master({head, 0}));
    plant.plug({head, 1}, lost);
    plant.plug({head, 2}, branch);
    EXPECT_TRUE(plant.bring_up({}).empty());
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
    ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
    std::uint16_t number = 0;
    for (const Slave& slave : plant.ctx->slaves())
        if (slave.identity.product == 0x101) number = slave.number;
    plant.power(lost, false);
    plant.pull(lost);
    plant.cycles(300);
    ASSERT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave);
    (void)plant.errors();
    plant.segment.slave(stranger).sii().fail_next(1'000'000);
    plant.plug({branch, 1}, stranger);
    plant.cycles(3'000);
    EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave) << said(what_is_wrong(*plant.ctx));
    EXPECT_EQ(what_is_wrong(*plant.ctx).slave, number);
    const auto errors = plant.errors();
    EXPECT_EQ(Plant::told(errors, "slave " + std::to_string(number) + ": reading the SII"), 0) << Plant::joined(errors);
    EXPECT_EQ(Plant::told(errors, "reading the SII at word 0x0008: the EEPROM did not acknowledge"), 1)
        << Plant::joined(errors);
}

// Two slaves are lost, and one of them comes back. The library cannot determine which of them has come back.
TEST(UnreadSlave, ThatMayBeOneOfTwoIsSaidWithoutANumber) {
    PairWithUnread plant;
    const auto last = plant.make({.product = 0x102});
    plant.let_read();
    plant.plug({plant.unread, 1}, last);
    EXPECT_TRUE(plant.bring_up({}).empty());
    EXPECT_TRUE(config_map(*plant.ctx, plant.image).ok());
    ASSERT_TRUE(submit(*plant.ctx, plant.supervision).ok());
    plant.power(plant.unread, false);
    plant.cycles(300);
    plant.power(last, false);
    plant.segment.slave(plant.unread).sii().fail_next(1'000'000);
    plant.power(plant.unread, true);
    plant.cycles(3'000);
    const auto errors = plant.errors();
    EXPECT_EQ(Plant::told(errors, "reading the SII at word 0x0008: the EEPROM did not acknowledge"), 1)
        << Plant::joined(errors);
    EXPECT_EQ(Plant::told(errors, "slave 2: reading the SII"), 0) << Plant::joined(errors);
    EXPECT_EQ(what_is_wrong(*plant.ctx).code, Errc::missing_slave);
    plant.let_read();
    plant.power(last, true);
    EXPECT_TRUE(reach(*plant.ctx, AlState::op, 5s).ok());
}

// A contact bounces: the slave loses its power again while the supervision reads its PDOs by mail.
TEST(SlaveThatStartsTwice, IsNotAnUnexpectedOne) {
    for (int moment = 0; moment < 60; moment += 2) {
        Plant plant;
        const auto first = plant.make({.product = 0x100});
        const auto drive = plant.segment.add(std::move(*sim::make_device("drive")).assemble());
        ASSERT_TRUE(plant.segment.connect_master({first, 0}));
        ASSERT_TRUE(plant.segment.connect({first, 1}, {drive, 0}));
        ASSERT_TRUE(plant.bring_up({}).empty());
        plant.run();
        plant.power(drive, false);
        plant.cycles(100);
        plant.power(drive, true);
        plant.cycles(1 + moment);
        plant.power(drive, false);
        plant.cycles(50);
        plant.power(drive, true);
        EXPECT_TRUE(plant.until([&] { return plant.in_op(2); }, 10'000)) << moment;
        const auto told = plant.events();
        EXPECT_EQ(Plant::told(told, "unexpected"), 0) << moment << ": " << Plant::joined(told);
    }
}

// The same power supply also feeds a slave without a mailbox behind this slave.
TEST(SlaveThatStartsTwice, IsNotAnUnexpectedOneAndNeitherIsItsNeighbour) {
    for (int moment = 40; moment < 66; moment += 2) {
        Plant plant;
        const auto first = plant.make({.product = 0x100});
        const auto drive = plant.segment.add(std::move(*sim::make_device("drive")).assemble());
        const auto last = plant.make({.product = 0x200});
        ASSERT_TRUE(plant.segment.connect_master({first, 0}));
        ASSERT_TRUE(plant.segment.connect({first, 1}, {drive, 0}));
        ASSERT_TRUE(plant.segment.connect({drive, 1}, {last, 0}));
        ASSERT_TRUE(plant.bring_up({}).empty());
        plant.run();
        const auto supply = [&](bool on) {
            plant.power(drive, on);
            plant.power(last, on);
        };
        supply(false);
        plant.cycles(100);
        supply(true);
        plant.cycles(1 + moment);
        supply(false);
        plant.cycles(50);
        supply(true);
        EXPECT_TRUE(plant.until([&] { return plant.in_op(2) && plant.in_op(3); }, 10'000)) << moment;
        const auto told = plant.events();
        EXPECT_EQ(Plant::told(told, "unexpected"), 0) << moment << ": " << Plant::joined(told);
    }
}

}  // namespace
}  // namespace margay
