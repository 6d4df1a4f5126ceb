// A master and a drive with the servodrive profile: parameters, telegrams, and procedure commands during cycles.
#include "segment/bench.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr Idn kHoming = Idn::standard(148);

class SoeDrives : public SegmentTest {
  protected:
    std::vector<std::byte> image = std::vector<std::byte>(256);
    struct Homed final : SoeListener {
        unsigned times = 0;
        void notified(std::uint16_t, const SoeNotification& told) override {
            if (!told.emergency && told.idn == kHoming) ++times;
        }
    } homed;

    void SetUp() override {
        plug_line({"coupler", "soe_drive"});
        switch_on();
        const auto found = bring_up();
        ASSERT_TRUE(found.ok());
        homed.only_slave = 2;
        ASSERT_TRUE(listen(ctx, homed).ok());
    }
    void cycle() {
        osal.advance(1ms);
        ASSERT_TRUE(send_processdata(ctx).ok());
        const auto wkc = receive_processdata(ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << words(wkc.error());
        (void)poll(ctx, osal.now());
    }
    void to_op() {
        const auto mapped = config_map(ctx, image);
        ASSERT_TRUE(mapped.ok()) << words(mapped.error());
        expect_all_in(AlState::safeop);
        WriteStateRequest request;
        request.wanted = AlState::op;
        ASSERT_TRUE(submit(ctx, request).ok());
        for (int n = 0; n < 100; ++n) cycle();
        EXPECT_EQ(request.state(), RequestState::success);
        ReadStateRequest states;
        ASSERT_TRUE(submit(ctx, states).ok());
        while (states.busy()) cycle();
        expect_all_in(AlState::op);
    }
    template <class R>
    void run(R& request) {
        ASSERT_TRUE(submit(ctx, request).ok());
        for (int n = 0; request.busy() && n < 20000; ++n) cycle();
        EXPECT_EQ(request.state(), RequestState::success) << words(request.error());
    }
};

TEST_F(SoeDrives, ParametersAndTextsOfBothAxes) {
    std::array<char, 64> text{};
    for (const std::uint8_t axis : {std::uint8_t{0}, std::uint8_t{1}}) {
        EXPECT_EQ(*SoEread_text(ctx, 2, axis, Idn::standard(30), soe_element::kValue, text), "Margay SoE drive 1.0");
        EXPECT_EQ(*SoEread_text(ctx, 2, axis, Idn::standard(51), soe_element::kName, text),
                  "Position feedback value 1");
        EXPECT_EQ(*SoEread_text(ctx, 2, axis, Idn::standard(51), soe_element::kUnit, text), "inc");
    }
    const auto attribute = SoEattribute(ctx, 2, 0, Idn::standard(84));
    ASSERT_TRUE(attribute.ok());
    EXPECT_EQ(attribute->bytes, 2);
    EXPECT_EQ(attribute->decimals, 1);
    EXPECT_EQ(SoEread<std::uint16_t>(ctx, 2, 2, Idn::standard(15)).error().detail, 0x800AU);
    // All parameters, from the list of all IDNs, with all their elements, in as many fragments as necessary.
    std::array<std::byte, 256> list{};
    const auto all = SoEread(ctx, 2, 1, Idn::standard(17), soe_element::kValue, list);
    ASSERT_TRUE(all.ok());
    EXPECT_EQ(*all, 4U + load_le<std::uint16_t>(list));
    EXPECT_GT(*all, 50U);
    for (std::size_t at = 4; at < *all; at += 2) {
        std::array<std::byte, 256> elements{};
        const Idn idn{load_le<std::uint16_t>(list, at)};
        const auto read =
            SoEread(ctx, 2, 1, idn, soe_element::kName | soe_element::kAttribute | soe_element::kValue, elements);
        EXPECT_TRUE(read.ok()) << words(read.error());
    }
}

TEST_F(SoeDrives, ProcessDataFollowsTheTelegram) {
    const auto bits = [&] { return std::pair(ctx.slave(2).image.outputs.bits, ctx.slave(2).image.inputs.bits); };
    to_op();
    EXPECT_EQ(ctx.slave(2).config.source, ConfigurationSource::soe);
    EXPECT_EQ(bits(), std::pair(96U, 160U));
    EXPECT_EQ(load_le<std::uint16_t>(ctx.slave(2).image.inputs.bytes), 0x8000);  // power on, no torque

    osal.advance(100ms);  // the cycles stop
    ASSERT_TRUE(writestate(ctx, 0, AlState::preop).ok());
    ASSERT_EQ(statecheck(ctx, 0, AlState::preop, 1s)->state, AlState::preop);
    ASSERT_TRUE(SoEwrite(ctx, 2, 0, Idn::standard(15), std::uint16_t{5}).ok());
    const std::array<std::byte, 6> torque{std::byte{2}, std::byte{0},  std::byte{0},
                                          std::byte{0}, std::byte{80}, std::byte{0}};
    ASSERT_TRUE(SoEwrite(ctx, 2, 1, Idn::standard(24), soe_element::kValue, torque).ok());
    ctx.slave(2).config = {};
    to_op();
    EXPECT_EQ(bits(), std::pair(16U + 64 + 16 + 16, 16U + 64 + 80));
    SoeWrite refused;
    refused.slave = 2;
    refused.idn = Idn::standard(15);
    refused.data = torque;
    ASSERT_TRUE(submit(ctx, refused).ok());
    while (refused.busy()) cycle();
    EXPECT_EQ(refused.error().code, Errc::soe_error);
}

TEST_F(SoeDrives, HomesAndMovesBesideTheCycle) {
    to_op();
    auto out = ctx.slave(2).image.outputs.bytes;
    auto in = ctx.slave(2).image.inputs.bytes;
    const auto position = [&] { return load_le<std::int32_t>(in, 2); };
    store_le(out, 2, position());
    store_le<std::uint16_t>(out, 0, 0xE000);
    for (int n = 0; n < 3; ++n) cycle();
    ASSERT_EQ(load_le<std::uint16_t>(in) & 0xC000, 0xC000);
    const std::int32_t before = position();

    SoeCommand homing;
    homing.slave = 2;
    homing.idn = kHoming;
    ASSERT_TRUE(submit(ctx, homing).ok());
    SoeRead telegram;
    std::array<std::byte, 64> name{};
    telegram.slave = 2;
    telegram.idn = Idn::standard(148);
    telegram.elements = soe_element::kName;
    telegram.data = name;
    run(telegram);  // during the command
    EXPECT_TRUE(homing.busy());
    for (int n = 0; homing.busy() && n < 5000; ++n) {
        store_le(out, 2, position());  // the target is the present position
        cycle();
    }
    EXPECT_EQ(homing.state(), RequestState::success) << words(homing.error());
    EXPECT_EQ(homed.times, 1U);
    EXPECT_NE(position(), before);
    for (int n = 0; n < 200; ++n) {
        store_le(out, 2, n * 1000);
        cycle();
    }
    for (int n = 0; n < 50; ++n) cycle();
    EXPECT_NEAR(position(), 199'000, 1000);
}

}  // namespace
}  // namespace margay
