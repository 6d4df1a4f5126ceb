// Only the expected machine gets outputs. Slaves that are wrong, unexpected, missing or not configured get no outputs,
// and every call reports them.
#include "process_data/line_of_three.hpp"

#include "sim/devices.hpp"

#include <margay/margay.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

using Words = std::vector<std::string>;

class Wanted : public LineOfThree {};

TEST_F(Wanted, ASlaveOfAnotherProductGetsNoOutputs) {
    const ExpectedSlave expected[] = {
        {.number = 1, .product = 0x100}, {.number = 2, .product = 0x1FF}, {.number = 3, .product = 0x102}};
    const auto found = scan(expected);
    EXPECT_EQ(words(found.error()),
              "slave 2: comparing with what is expected: another slave than expected (expected product 0x000001ff, got "
              "0x00000101 of vendor 0x00004d47)");
    EXPECT_EQ(ctx->slaves().size(), 3U) << "all that can be done has been done";
    EXPECT_EQ(ctx->slave(2).al.state, AlState::init) << "it has no mailbox";
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::other_slave);
    EXPECT_EQ(mapped.error().slave, 2);
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::safeop);
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0U, 0xA5U}));
    EXPECT_EQ(ctx->slave(2).al.state, AlState::init);
    const auto wkc = cycle();
    EXPECT_EQ(wkc.error().code, Errc::working_counter) << "slave 2 is wanted";
    EXPECT_EQ(wkc.error().slave, 2);
}

TEST_F(Wanted, ASlaveThatNobodyExpectsGetsNoOutputs) {
    const ExpectedSlave expected[] = {{.number = 1, .product = 0x100}, {.number = 2, .product = 0x101}};
    const auto found = scan(expected);
    EXPECT_EQ(words(found.error()),
              "slave 3: comparing with what is expected: the slave is not in the list of expected slaves");
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::unexpected_slave);
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0U}));
    EXPECT_EQ(ctx->slave(3).al.state, AlState::init);
    EXPECT_EQ(ctx->slave(3).image.outputs.bits, 0U);
    EXPECT_EQ(*cycle(), 6U) << "nothing of slave 3 is wanted in the image";
}

TEST_F(Wanted, AMissingSlaveIsSaidByEveryResult) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3}, {.number = 4}};
    const auto found = scan(expected);
    EXPECT_EQ(words(found.error()), "slave 4: comparing with what is expected: the slave is missing");
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::missing_slave);
    EXPECT_EQ(mapped.error().slave, 4);
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
    const auto wkc = cycle();
    EXPECT_EQ(wkc.error().code, Errc::working_counter) << "whatever slave 4 exchanges is not there";
    EXPECT_EQ(wkc.error().slave, 4);
}

// The slave was never read, so its features are unknown.
TEST_F(Wanted, ARequestToASlaveThatNeverAnsweredSaysThatItIsMissing) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3}, {.number = 4}};
    ASSERT_EQ(scan(expected).error().slave, 4);
    std::byte octets[4]{};
    EXPECT_EQ(words(SDOread<std::uint32_t>(*ctx, 4, 0x1000, 0).error()),
              "slave 4: SDO upload of 0x1000:0: the slave is missing");
    EXPECT_EQ(SDOwrite(*ctx, 4, 0x1000, 0, std::uint32_t{1}).error().code, Errc::missing_slave);
    EXPECT_EQ(read_object_description(*ctx, 4, 0x1000).error().code, Errc::missing_slave);
    EXPECT_EQ(SoEread<std::uint32_t>(*ctx, 4, 0, Idn{1}).error().code, Errc::missing_slave);
    EXPECT_EQ(FOEread(*ctx, 4, "file", 0, octets).error().code, Errc::missing_slave);
    EXPECT_EQ(SDOread<std::uint32_t>(*ctx, 3, 0x1000, 0).error().code, Errc::unsupported) << "it is known";
}

TEST_F(Wanted, TheErrorOfAMissingOrHeldSlaveStaysInTheSlave) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x1FF}, {.number = 4}, {.number = 5}};
    ASSERT_TRUE(tolerate(*ctx, {.missing_slaves = true}).ok());
    EXPECT_EQ(scan(expected).error().code, Errc::other_slave);
    (void)errors();
    ASSERT_TRUE(tolerate(*ctx, {}).ok());
    for (int n = 0; n < 2; ++n) {
        EXPECT_EQ(config_map(*ctx, image).error().slave, 2);
        EXPECT_EQ(ctx->slave(2).error.code, Errc::other_slave);
        EXPECT_EQ(ctx->slave(3).error.code, Errc::unexpected_slave);
        EXPECT_EQ(ctx->slave(4).error.code, Errc::missing_slave);
        EXPECT_EQ(ctx->slave(5).error.code, Errc::missing_slave);
        const auto said = errors();
        EXPECT_EQ(std::ranges::count_if(said, [](const auto& one) { return one.ends_with("the slave is missing"); }),
                  n == 0 ? 2 : 0)
            << "tolerated at the scan, and said since";
    }
}

TEST_F(Wanted, ASlaveThatRefusesItsPdosIsSaidByEveryResult) {
    static constexpr PdoEntry kOther[] = {{0x7000, 1, 13}};
    static constexpr Pdo kRefused[] = {{0x1600, kOther}};
    static constexpr SmPdos kRefusedPdos[] = {{2, kRefused}};
    const SlaveSetup setup{.pdos = kRefusedPdos};
    const auto fourth = segment.add(std::move(*sim::make_device("digital_io_16")).assemble());
    ASSERT_TRUE(segment.connect({line[2], 1}, {fourth, 0}));
    power(fourth, true);
    ASSERT_TRUE(scan({}).ok());
    ctx->slave(4).config.setup = &setup;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().slave, 4) << words(mapped.error());
    EXPECT_EQ(mapped.error().step, Step::configure_pdos) << words(mapped.error());
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
    const auto wkc = cycle();
    EXPECT_EQ(wkc.error().code, Errc::working_counter);
    EXPECT_EQ(wkc.error().slave, 4);
}

// The SyncManager for outputs starts behind the memory of the chip. The other slaves are mapped.
TEST_F(Wanted, ASlaveWhoseSiiDescribesAnImpossibleSyncManagerIsSaidByEveryResult) {
    auto& sii = segment.slave(line[1]).sii().image();
    constexpr std::array kOutputsSm{std::byte{0x00}, std::byte{0x11}, std::byte{1}, std::byte{0}, std::byte{0x64}};
    const auto start = std::ranges::search(sii, kOutputsSm);
    ASSERT_EQ(start.size(), kOutputsSm.size());
    start[1] = std::byte{0x62};
    ASSERT_TRUE(scan({}).ok());
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(words(mapped.error()),
              "slave 2: mapping process data at SyncManager 0: outside the slave's process data memory, or on top of "
              "another SyncManager");
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0U, 0xA5U}));
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    const auto wkc = cycle();
    EXPECT_EQ(wkc.error().code, Errc::working_counter);
    EXPECT_EQ(wkc.error().slave, 2);
    EXPECT_FALSE(reach(*ctx, AlState::op, 1s).ok());

    start[1] = std::byte{0x11};
    supervision.cancel();
    (void)cycle();
    ASSERT_TRUE(scan({}).ok());
    EXPECT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
}

TEST_F(Wanted, PdosOfKnownSizesKeepAPlaceForADriveThatIsOffAtTheStart) {
    SlaveConfiguration config;
    config.setup = &kSetup;
    power(line[2], false);
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3, .config = &config}};
    EXPECT_EQ(scan(expected).error().code, Errc::missing_slave);
    EXPECT_EQ(config_map(*ctx, image).error().code, Errc::missing_slave);
    EXPECT_EQ(ctx->slave(3).image.outputs.bits, 8U);
    EXPECT_EQ(ctx->slave(3).image.inputs.bits, 8U);
    EXPECT_EQ(ctx->group(0).expected_wkc, 9U);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(300);
    EXPECT_EQ(cycle().error().slave, 3);
    power(line[2], true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    expect_exchanged(3, line[2]);
    EXPECT_EQ(*cycle(), 9U);
}

// The dictionary or SII of an arriving slave can differ from the lists that determined its place in the image.
TEST_F(Wanted, ASlaveThatComesWithOtherSizesThanItsPlaceHasIsNotSaidToHaveRecovered) {
    static constexpr SmPdos kOutputsOnly[] = {{0, kOutputs}};
    const SlaveSetup setup{.pdos = kOutputsOnly};
    SlaveConfiguration config;
    config.setup = &setup;
    power(line[2], false);
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3, .config = &config}};
    (void)scan(expected);
    (void)config_map(*ctx, image);
    EXPECT_EQ(ctx->slave(3).image.outputs.bits, 8U);
    EXPECT_EQ(ctx->slave(3).image.inputs.bits, 0U);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    power(line[2], true);
    cycles(3000);
    const auto story = events();
    EXPECT_EQ(told(story, "slave 3: recovered"), 0) << joined(story);
    EXPECT_EQ(told(story, "recovery failed: slave 3"), 1) << joined(story);
    EXPECT_LE(ctx->slave(3).al.state, AlState::preop);
    EXPECT_EQ(ctx->slave(3).image.inputs.bits, 0U);
    EXPECT_EQ(cycle().error().slave, 3);
}

TEST_F(Wanted, AGroupThatDoesNotExistIsSaidWhenMapping) {
    ASSERT_TRUE(scan({}).ok());
    ctx->slave(2).config.group = 200;
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(words(mapped.error()),
              "slave 2: mapping process data of group 200: there is no such group (Limits::groups is 4)");
    EXPECT_EQ(words(config_map(*ctx, image, 200).error()),
              "mapping process data of group 200: there is no such group (Limits::groups is 4)");
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::safeop);
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0U, 0xA5U}));
    EXPECT_EQ(words(what_is_wrong(*ctx)), words(mapped.error()));
}

TEST_F(Wanted, ARequestThatContradictsTheSupervisionIsRefused) {
    ASSERT_TRUE(scan({}).ok());
    run();
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::preop;
    const auto submitted = submit(*ctx, request);
    EXPECT_FALSE(request.busy());
    EXPECT_EQ(words(submitted.error()),
              "slave 2: requesting a state: the supervision keeps the slave in another state: call set_target() "
              "(wanted PREOP, the supervision keeps it in OP)");
    EXPECT_FALSE(writestate(*ctx, 0, AlState::safeop).ok());
    cycles(50);
    EXPECT_TRUE(all_in_op());
    EXPECT_EQ(events(), Words());
}

// ------------------------------------------------------------------ what is tolerated

TEST_F(Wanted, WhatTheApplicationToleratesOfOneSlaveIsDriven) {
    const ExpectedSlave expected[] = {{.number = 1, .product = 0x100},
                                      {.number = 2, .product = 0x1FF, .tolerate = true},
                                      {.number = 3, .product = 0x102}};
    ASSERT_TRUE(scan(expected).ok());
    EXPECT_EQ(errors().size(), 1U) << "it is told all the same";
    EXPECT_FALSE(ctx->slave(2).held);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

TEST_F(Wanted, ToleranceInGeneralHoldsAtOnceAndUntilItIsTakenBack) {
    const ExpectedSlave expected[] = {{.number = 1, .product = 0x1FF}, {.number = 2, .product = 0x101}};
    EXPECT_EQ(scan(expected).error().slave, 1);
    ASSERT_TRUE(tolerate(*ctx, {.other_slaves = true, .unexpected_slaves = true}));
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
    EXPECT_EQ(*cycle(), 9U);
    ASSERT_TRUE(tolerate(*ctx, {.other_slaves = true}));
    cycles(300);
    EXPECT_EQ(ctx->slave(3).al.state, AlState::init) << "brought down by the supervision";
    EXPECT_EQ(*cycle(), 6U) << "nobody wants it";
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::unexpected_slave);
    // The start-up commands of the held slave were not sent before. Now they are sent.
    ASSERT_TRUE(tolerate(*ctx, {.other_slaves = true, .unexpected_slaves = true}));
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
}

TEST_F(Wanted, MissingSlavesAreToleratedOnRequest) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3}, {.number = 4}};
    ASSERT_TRUE(tolerate(*ctx, {.missing_slaves = true}));
    ASSERT_TRUE(scan(expected).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(drive(), (std::vector{0xA5U, 0xA5U, 0xA5U}));
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    ASSERT_TRUE(tolerate(*ctx, {}));
    EXPECT_EQ(cycle().error().slave, 4);
}

// A slave that was held during the mapping has no place in the image.
TEST_F(Wanted, AHeldSlaveWithoutAPlaceStaysInPreopWhenItIsToleratedLater) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x1FF}, {.number = 3}};
    EXPECT_EQ(scan(expected).error().slave, 2);
    (void)config_map(*ctx, image);
    (void)drive();
    cycles(50);
    (void)events();
    ASSERT_TRUE(tolerate(*ctx, {.other_slaves = true}));
    cycles(2000);
    EXPECT_EQ(events(), (Words{"slave 2: INIT to PREOP",
                               "recovery failed: slave 2: mapping process data: the slave has process data, but no "
                               "place in the image is reserved for it: call config_map() again"}));
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::no_place);
    cycles(1000);
    EXPECT_EQ(events(), Words()) << "it is tried once";
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(until([&] { return in_op(2); })) << joined(events());
}

// No request brings a held slave to a higher state.
TEST_F(Wanted, RequestsForAHeldSlaveAreRefusedInWords) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x1FF}, {.number = 3}};
    EXPECT_EQ(scan(expected).error().slave, 2);
    (void)config_map(*ctx, image);
    const auto expect_held = [&](const Error& error) {
        EXPECT_EQ(
            words(error),
            "slave 2: requesting a state: another slave than expected (expected product 0x000001ff, got 0x00000101 "
            "of vendor 0x00004d47)");
    };
    expect_held(writestate(*ctx, 2, AlState::safeop).error());
    expect_held(writestate(*ctx, 0, AlState::op).error());
    expect_held(set_target(*ctx, 2, AlState::op).error());
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    ASSERT_TRUE(submit(*ctx, request).ok());
    expect_held(wait(*ctx, request).error());
    EXPECT_EQ(reconfigure_slave(*ctx, 2).error().code, Errc::other_slave);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::init);
}

// The wrong slave is removed and the right slave is connected.
TEST_F(Wanted, TheRightSlaveInPlaceOfAHeldOneIsTakenIn) {
    SlaveConfiguration config;
    config.setup = &kSetup;
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3, .product = 0x1FF, .config = &config}};
    EXPECT_EQ(scan(expected).error().slave, 3);
    (void)config_map(*ctx, image);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(100);
    pull(line[2]);
    cycles(50);
    const auto right = make({.product = 0x1FF});
    plug({line[1], 1}, right);
    power(right, true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    expect_exchanged(3, right);
    EXPECT_EQ(*cycle(), 9U);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

// ------------------------------------------------------------------ lost frames

// A NIC that loses the next frames on request.
class LossyNic final : public Nic {
  public:
    explicit LossyNic(Nic& inner) : inner_(inner) {}
    unsigned lose = 0;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (lose == 0) return inner_.send(frame);
        --lose;
        return SendStatus::sent;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override { return inner_.receive(into); }
    LinkState link_state() noexcept override { return inner_.link_state(); }
    MacAddress source_mac() const noexcept override { return inner_.source_mac(); }
    Time next_arrival() const noexcept override { return inner_.next_arrival(); }

  private:
    Nic& inner_;
};

class LostFramesOf : public Wanted {
  protected:
    std::unique_ptr<LossyNic> lossy;
    void SetUp() override {
        Wanted::SetUp();
        lossy = std::make_unique<LossyNic>(*nic);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *lossy, osal).ok());
        ASSERT_TRUE(scan({}).ok());
    }
    void TearDown() override { ctx.reset(); }
};

TEST_F(LostFramesOf, AReadingOfStatesDoNotMakeSlavesLost) {
    ASSERT_TRUE(config_map(*ctx, image).ok());
    lossy->lose = 100;
    const auto states = readstate(*ctx);
    EXPECT_EQ(states.error().code, Errc::no_frame) << "that is what is known";
    for (const Slave& slave : ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::safeop) << slave.number;
    lossy->lose = 0;
    EXPECT_EQ(readstate(*ctx)->state, AlState::safeop);
}

TEST_F(LostFramesOf, AMappingDoNotMakeSlavesLost) {
    for (unsigned sent = 0; sent < 40; ++sent) {
        ASSERT_TRUE(config_init(*ctx).ok());
        (void)errors();
        ASSERT_TRUE(clear_error(*ctx, 1).ok());
        // The first frames of the mapping arrive. Then more frames are lost than there are retries.
        MapRequest request;
        request.image = image;
        ASSERT_TRUE(submit(*ctx, request).ok());
        for (unsigned n = 0; n < sent && request.busy(); ++n) {
            const Time next = poll(*ctx, osal.now());
            osal.wait(std::min(next, osal.now() + 1ms), lossy->wait_handle());
        }
        if (!request.busy()) break;
        lossy->lose = 30;
        (void)wait(*ctx, request);
        lossy->lose = 0;
        for (const Slave& slave : ctx->slaves()) EXPECT_NE(slave.al.state, AlState::none) << sent;
        for (const Slave& slave : ctx->slaves()) {
            if (request.state() != RequestState::success) continue;
            EXPECT_EQ(slave.al.state, AlState::safeop) << sent << ": the map request says that all is well";
        }
    }
}

// The library reads a slave that did not answer while its group was mapped again when the slave is back.
TEST_F(Wanted, ASlaveThatWasAwayWhileItWasMappedIsAskedWhenItIsBack) {
    SlaveConfiguration config;
    config.setup = &kSetup;
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2}, {.number = 3, .config = &config}};
    ASSERT_TRUE(scan(expected).ok());
    power(line[2], false);
    const auto mapped = config_map(*ctx, image);
    EXPECT_EQ(mapped.error().slave, 3) << words(mapped.error());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(50);
    power(line[2], true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    expect_exchanged(3, line[2]);
}

// ------------------------------------------------------------------ operations at the same time

TEST_F(Wanted, ASupervisionBesideAScanIsNoHarm) {
    ASSERT_TRUE(scan({}).ok());
    for (int at = 0; at < 300; at += 3) {
        ScanRequest again;
        ASSERT_TRUE(submit(*ctx, again).ok());
        for (int n = 0; n < at && again.busy(); ++n) {
            const Time next = poll(*ctx, osal.now());
            osal.wait(std::min(next, osal.now() + 1ms), nic->wait_handle());
        }
        SuperviseRequest beside;
        (void)submit(*ctx, beside);  // the request can be refused
        RecoverRequest recover;
        (void)submit(*ctx, recover);
        (void)wait(*ctx, again);
        beside.cancel();
        recover.cancel();
        const auto found = config_init(*ctx);
        ASSERT_TRUE(found.ok()) << at << words(found.error());
    }
}

TEST_F(Wanted, ASearchBesideAScanIsNoHarm) {
    ASSERT_TRUE(scan({}).ok());
    const auto stranger = make({.product = 0x777});
    plug({line[2], 1}, stranger);
    power(stranger, true);
    for (int at = 0; at < 300; at += 3) {
        RecoverRequest recover;
        ASSERT_TRUE(submit(*ctx, recover).ok());
        for (int n = 0; n < at && recover.busy(); ++n) {
            const Time next = poll(*ctx, osal.now());
            osal.wait(std::min(next, osal.now() + 1ms), nic->wait_handle());
        }
        ScanRequest again;
        (void)submit(*ctx, again);
        (void)wait(*ctx, recover);
        (void)wait(*ctx, again);
    }
    EXPECT_TRUE(config_init(*ctx).ok());
}

}  // namespace
}  // namespace margay
