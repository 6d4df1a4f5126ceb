// config_init() on simulated segments: the slaves that it finds, its behaviour on a bad line, and its errors for
// faulty slaves.
#include "oshw/filters/corrupt_nic.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/filters/duplicate_nic.hpp"
#include "segment/bench.hpp"
#include "wire/sii_writer.hpp"

#include <random>
#include <set>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Scan : public SegmentTest {
  protected:
    // The image of a library device, for the test to modify.
    static std::vector<std::byte> image_of(std::string_view name) { return sim::make_device(name)->sii; }
    // The same device with a processor at the PDI, and therefore with a state machine.
    static sim::Device with_processor(std::string_view name) {
        auto image = image_of(name);
        store_le<std::uint16_t>(image, 0, 0x0005);
        image[14] = std::byte{wire::sii::checksum(image)};
        return sim::device_from_sii(std::move(image));
    }
    // A coupler, a device with this EEPROM, and a terminal behind it.
    void bring_up_with(std::vector<std::byte> image) {
        plug("coupler");
        plug(sim::device_from_sii(std::move(image)));
        plug("digital_in_8");
        switch_on();
        const auto found = bring_up();
        EXPECT_EQ(ctx.slaves().size(), 3U);
        EXPECT_EQ(found.ok(), ctx.slave(2).al.state == AlState::preop) << words(found.error());
        EXPECT_EQ(found.error().slave, found.ok() ? 0 : 2) << words(found.error());
        EXPECT_EQ(ctx.slave(1).error.code, Errc::none);
        EXPECT_EQ(ctx.slave(3).error.code, Errc::none) << "the others are brought up all the same";
        EXPECT_EQ(ctx.slave(3).al.state, AlState::preop);
    }
};

TEST_F(Scan, FindsWhatIsThere) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "analog_in_4"});
    switch_on();
    const auto found = bring_up();
    ASSERT_TRUE(found) << words(found.error());
    ASSERT_EQ(*found, 4);
    expect_all_in(AlState::preop);
    EXPECT_EQ(ctx.slave(1).name(), "EtherCAT coupler");
    EXPECT_EQ(ctx.slave(2).name(), "8-channel digital input");
    EXPECT_EQ(ctx.slave(2).identity.vendor, sim::kVendorId);
    EXPECT_EQ(ctx.slave(2).station_address.value, 0x1002);
    EXPECT_EQ(ctx.slave(3).parent, 2);
    EXPECT_EQ(ctx.slave(5).number, 0) << "there is no fifth";
    EXPECT_EQ(ctx.slave(0).number, 0);
    EXPECT_FALSE(ctx.errors().take());
}

// The EEPROM of slave 2 cannot be read: the scan ends for this slave with an error, which the progress counts.
TEST_F(Scan, ShowsItsProgress) {
    plug("coupler");
    auto blank = sim::make_device("digital_in_8");
    blank->sii.assign(blank->sii.size(), std::byte{0xFF});
    plug(std::move(*blank));
    for (int n = 0; n < 10; ++n) plug("drive");
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    EXPECT_EQ(scan_progress(ctx).slaves, 0);
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    ScanProgress before;
    std::set<std::uint16_t> identified;
    std::set<std::uint16_t> started;
    while (scan.busy()) {
        const Time next = poll(ctx, osal.now());
        const ScanProgress now = scan_progress(ctx);
        EXPECT_GE(now.slaves, before.slaves);
        EXPECT_GE(now.identified, before.identified);
        EXPECT_GE(now.started, before.started);
        EXPECT_LE(now.started, now.identified);
        EXPECT_LE(now.identified, now.slaves);
        before = now;
        identified.insert(now.identified);
        started.insert(now.started);
        osal.wait(next, -1);
    }
    EXPECT_EQ(before.slaves, 12);
    EXPECT_EQ(before.identified, 12);
    EXPECT_EQ(before.started, 12);
    EXPECT_GT(identified.size(), 2U) << "there are values between none and all";
    EXPECT_GT(started.size(), 2U);
}

TEST_F(Scan, SecondScanOfARunningSegmentStartsFromNothing) {
    plug("coupler");
    plug(with_processor("digital_in_8"));
    plug("digital_out_8");
    switch_on();
    ASSERT_TRUE(bring_up());
    // An earlier master left mappings, a station address that this scan assigns to another slave, and an error.
    segment.slave(2).registers().set<std::uint16_t>(wire::reg::kStationAddress.address, 0x1001);
    segment.slave(1).registers().set<std::uint8_t>(wire::reg::kFmmuBase + 12, 1);
    StateRequest wrong;
    wrong.slave = 2;
    wrong.wanted = AlState::op;
    ASSERT_TRUE(submit(ctx, wrong));
    EXPECT_FALSE(wait(ctx, wrong)) << "PREOP to OP is not allowed";
    EXPECT_TRUE(ctx.slave(2).al.error);
    const auto again = config_init(ctx);
    ASSERT_TRUE(again) << words(again.error());
    EXPECT_EQ(*again, 3);
    expect_all_in(AlState::preop);
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(wire::reg::kFmmuBase + 12), 0);
}

TEST_F(Scan, RefusedStateNamesSlaveStatesAndCode) {
    plug("coupler");
    plug(with_processor("digital_in_8"));
    switch_on();
    ASSERT_TRUE(bring_up());
    StateRequest request;
    request.slave = 2;
    request.wanted = AlState::op;
    ASSERT_TRUE(submit(ctx, request));
    const auto done = wait(ctx, request);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::al_status);
    EXPECT_EQ(done.error().detail, 0x0011U) << "invalid requested state change";
    EXPECT_EQ(words(done.error()).find("slave 2: requesting a state: the slave refused (wanted OP, is in PREOP"), 0U)
        << words(done.error());
    // The next request acknowledges the error.
    request.wanted = AlState::preop;
    ASSERT_TRUE(submit(ctx, request));
    EXPECT_TRUE(wait(ctx, request));
    EXPECT_FALSE(ctx.slave(2).al.error);
}

TEST_F(Scan, AcknowledgeIsNeverSentToASlaveThatMirrors) {
    plug_line({"coupler"});
    switch_on();
    ASSERT_TRUE(bring_up());
    ASSERT_TRUE(ctx.slave(1).device_emulation);
    EXPECT_EQ(segment.slave(0).registers().get<std::uint16_t>(wire::reg::kAlStatus.address), 0x0002);
}

// Wrong SII images: each gives an error with slave, place and cause, and the slave stays in the list.

TEST_F(Scan, BlankSii) {
    bring_up_with(std::vector<std::byte>(512, std::byte{0xFF}));
    EXPECT_EQ(ctx.slave(2).error.code, Errc::sii_blank);
    EXPECT_FALSE(ctx.slave(2).mailbox.present()) << "no mailbox of 65535 octets";
}

TEST_F(Scan, WrongChecksumIsReportedAndNotFatal) {
    auto image = image_of("digital_in_8");
    image[14] ^= std::byte{0x55};
    bring_up_with(image);
    EXPECT_EQ(ctx.slave(2).error.code, Errc::sii_checksum);
    EXPECT_EQ(ctx.slave(2).error.index, 7);
    EXPECT_EQ(ctx.slave(2).name(), "8-channel digital input");
}

TEST_F(Scan, CategoryPastTheEnd) {
    auto image = image_of("digital_in_8");
    image[0x82] = std::byte{0xFF};  // the length of the first category
    image[0x83] = std::byte{0x7F};
    bring_up_with(image);
    EXPECT_EQ(ctx.slave(2).error.code, Errc::sii_truncated);
    EXPECT_EQ(ctx.slave(2).error.index, 0x40);
}

TEST_F(Scan, CategoriesWithoutEnd) {
    auto image = image_of("digital_in_8");
    for (std::size_t i = 0x80; i < image.size(); ++i) image[i] = std::byte{0};
    bring_up_with(image);
    EXPECT_NE(ctx.slave(2).error.code, Errc::none);
    EXPECT_EQ(ctx.slave(2).error.step, Step::parse_sii);
    EXPECT_EQ(ctx.slave(2).identity.vendor, sim::kVendorId);
}

TEST_F(Scan, ZeroMailboxSizesWithAProtocol) {
    auto image = image_of("digital_in_8");
    image[wire::sii::word::kMailboxProtocols * 2] = std::byte{0x04};
    bring_up_with(image);
    EXPECT_EQ(ctx.slave(2).error.step, Step::parse_sii);
    EXPECT_FALSE(ctx.slave(2).mailbox.present());
    EXPECT_EQ(ctx.slave(2).al.state, AlState::preop);
}

TEST_F(Scan, EepromThatDoesNotAcknowledge) {
    plug_line({"coupler", "digital_in_8"});
    switch_on();
    segment.slave(1).sii().fail_next(1000);
    const auto found = bring_up();
    EXPECT_EQ(found.error().code, Errc::sii_nack) << "it could not be asked what it is";
    EXPECT_EQ(found.error().slave, 2);
    EXPECT_EQ(ctx.slaves().size(), 2U);
    EXPECT_EQ(ctx.slave(2).error.code, Errc::sii_nack);
    EXPECT_EQ(ctx.slave(2).error.step, Step::read_sii);
}

TEST_F(Scan, SurvivesAnyImage) {
    std::mt19937 random(3);
    const auto good = image_of("analog_in_4");
    plug("coupler");
    for (int i = 0; i < 60; ++i) {
        auto image = good;
        for (int hits = 0; hits <= i; ++hits) image[random() % image.size()] = static_cast<std::byte>(random());
        if (i % 3 == 0) image.resize(random() % image.size());
        plug(sim::device_from_sii(std::move(image)));
    }
    plug("digital_in_8");
    switch_on();
    const auto found = bring_up();
    EXPECT_NE(found.error().slave, 0) << "what it says is of one slave";
    EXPECT_EQ(ctx.slaves().size(), 62U);
    EXPECT_EQ(ctx.slave(62).error.code, Errc::none);
    for (const Slave& slave : ctx.slaves()) EXPECT_LE(slave.name().size(), Slave::kNameBytes);
}

// A bad line: the scan succeeds, or reports what failed.

TEST_F(Scan, OneFrameInTenLost) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "analog_in_4", "analog_out_2"});
    switch_on();
    std::uint64_t lost = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        DropNic drops(wire, {.seed = seed, .sent = Rate::percent(5), .received = Rate::percent(5)});
        HostContext other(Limits{.slaves = 8});
        ASSERT_TRUE(init(other, drops, osal));
        const auto found = config_init(other);
        ASSERT_TRUE(found) << seed << ": " << words(found.error());
        ASSERT_EQ(*found, 5);
        for (const Slave& slave : other.slaves())
            EXPECT_EQ(slave.al.state, AlState::preop) << seed << ": " << words(slave.error);
        EXPECT_EQ(other.slave(4).name(), "4-channel analogue input") << seed << words(other.slave(4).error);
        lost += other.statistics().lost;
    }
    EXPECT_GT(lost, 40U);
}

TEST_F(Scan, DuplicatesAndDamagedFramesAreNeverTakenForOthers) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "analog_in_4"});
    switch_on();
    DuplicateNic twice(wire, {.seed = 5, .received = Rate::percent(30)});
    // Only octets that a header check protects are damaged: a master cannot detect data that were changed behind the
    // FCS.
    CorruptNic damages(twice, {.seed = 6, .received = Rate::percent(10), .max_flips = 4, .cut = Rate::always()});
    const auto found = bring_up(damages);
    ASSERT_TRUE(found) << words(found.error());
    EXPECT_EQ(*found, 4);
    expect_all_in(AlState::preop);
    EXPECT_GT(ctx.statistics().unexpected, 0U);
    EXPECT_GT(ctx.statistics().malformed, 0U);
}

// A cable is connected or disconnected after the n-th frame of the scan.
class PluggingNic final : public FilterNic {
  public:
    PluggingNic(Nic& nic, sim::Segment& segment, sim::PortRef end, int after)
        : FilterNic(nic), segment_(segment), end_(end), left_(after) {}
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (left_-- == 0) segment_.set_cable(end_, heal_);
        return FilterNic::send(frame);
    }
    void heal() { heal_ = true; }

  private:
    sim::Segment& segment_;
    sim::PortRef end_;
    int left_;
    bool heal_ = false;
};

TEST_F(Scan, SegmentThatChangesIsToldAndScannedAgain) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "digital_in_8"});
    switch_on();
    const sim::PortRef third{2, 0};
    for (const bool heals : {false, true}) {
        int unstable = 0;
        int whole = 0;
        for (int after = 0; after < 60; ++after) {
            segment.set_cable(third, !heals);
            PluggingNic nic(wire, segment, third, after);
            if (heals) nic.heal();
            HostContext master{Limits{.slaves = 8}};
            ASSERT_TRUE(init(master, nic, osal));
            const auto found = config_init(master);
            if (found) {
                EXPECT_TRUE(*found == 2 || *found == 4) << *found;
                ++whole;
                continue;
            }
            const std::string told = words(found.error());
            EXPECT_TRUE(found.error().code == Errc::unstable || found.error().code == Errc::working_counter ||
                        found.error().code == Errc::timeout)
                << told;
            if (found.error().code != Errc::unstable) continue;
            ++unstable;
            EXPECT_NE(told.find("have changed meanwhile"), std::string::npos) << told;
            EXPECT_EQ(found.error().expected, heals ? 2U : 4U) << told;
            EXPECT_EQ(found.error().actual, heals ? 4U : 2U) << told;
        }
        EXPECT_GT(unstable, 3) << (heals ? "plugged in" : "unplugged");
        EXPECT_GT(whole, 3) << (heals ? "plugged in" : "unplugged");
    }
    segment.set_cable(third, true);
    const auto found = bring_up();
    ASSERT_TRUE(found) << words(found.error());
    EXPECT_EQ(*found, 4);
    expect_all_in(AlState::preop);
}

TEST_F(Scan, ManyTasksOrOne) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "analog_in_4", "analog_out_2"});
    switch_on();
    HostContext narrow(Limits{.slaves = 8, .tasks = 1, .frames = 1});
    ASSERT_TRUE(init(narrow, wire, osal));
    const auto found = config_init(narrow);
    ASSERT_TRUE(found) << words(found.error());
    EXPECT_EQ(*found, 5);
    EXPECT_EQ(narrow.slave(5).name(), "2-channel analogue output");
    EXPECT_EQ(narrow.slave(5).al.state, AlState::preop);
}

// The arena memory that the bring-up of a slave needs; context_bytes() relies on it.
TEST_F(Scan, MemoryOfATask) {
    for (int i = 0; i < 64; ++i) plug(i == 0 ? "coupler" : "digital_in_8");
    switch_on();
    ASSERT_TRUE(bring_up());
    EXPECT_LE(ctx.arena_peak_bytes(), 64U * 4096U);
    EXPECT_GE(ctx.arena_peak_bytes(), 64U * 512U) << "all at once";
}

TEST_F(Scan, TwoMastersOnTwoSegments) {
    plug_line({"coupler", "digital_in_8"});
    switch_on();
    sim::Segment other_segment;
    const auto only = other_segment.add(std::move(*sim::make_device("digital_out_8")).assemble());
    ASSERT_TRUE(other_segment.connect_master({only, 0}));
    other_segment.power_up(osal.now());
    SimulatedNic other_wire(other_segment, osal);
    HostContext other(Limits{.slaves = 2});
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(init(other, other_wire, osal));
    ScanRequest here;
    ScanRequest there;
    ASSERT_TRUE(submit(ctx, here));
    ASSERT_TRUE(submit(other, there));
    while (here.busy() || there.busy()) {
        const Time next = std::min(poll(ctx, osal.now()), poll(other, osal.now()));
        osal.wait(next, -1);
    }
    EXPECT_EQ(here.slaves, 2);
    EXPECT_EQ(there.slaves, 1);
    EXPECT_EQ(other.slave(1).name(), "8-channel digital output");
    EXPECT_EQ(ctx.slave(1).name(), "EtherCAT coupler");
}

TEST_F(Scan, EepromIsWrittenAndReadThroughThePublicFunctions) {
    plug_line({"coupler", "digital_in_8"});
    switch_on();
    ASSERT_TRUE(bring_up());
    const std::array<std::byte, 4> text{std::byte{'a'}, std::byte{'b'}, std::byte{'c'}, std::byte{'d'}};
    ASSERT_TRUE(write_sii(ctx, 2, 0x20, text));
    std::array<std::byte, 8> back{};
    ASSERT_TRUE(read_sii(ctx, 2, 0x1F, back));
    EXPECT_TRUE(std::equal(text.begin(), text.end(), back.begin() + 2));
    std::array<std::byte, 3> odd{};
    EXPECT_EQ(read_sii(ctx, 2, 0, odd).error().code, Errc::invalid_argument);
    EXPECT_EQ(read_sii(ctx, 3, 0, back).error().code, Errc::unknown_slave);
}

}  // namespace
}  // namespace margay
