// Mistakes of new users before the cycle runs: wishes at the wrong time, impossible lists and arguments. An error or a
// warning names each of them.
#include "process_data/mistakes.hpp"

#include <thread>
#include <type_traits>

namespace margay {
namespace {

using namespace std::chrono_literals;

// The facts of a slave are read-only. Its wishes and the octets of its image are writable.
static_assert(std::is_same_v<decltype(std::declval<Context&>().slave(1)), const Slave&>);
static_assert(!std::is_assignable_v<decltype((std::declval<const Slave&>().al)), AlStatus>);
static_assert(std::is_assignable_v<decltype((std::declval<const Slave&>().config)), SlaveConfiguration>);
static_assert(std::is_assignable_v<decltype((std::declval<const Slave&>().hooks)), SlaveHooks>);

TEST_F(Mistakes, WishesWrittenBeforeTheScanAreWarnedOf) {
    ctx->slave(1).config.group = 1;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(all(ctx->warnings()),
              std::vector<std::string>{"counting slaves: config or hooks of a slave that does not exist were written: "
                                       "write them after config_init(), to slaves 1 and up, or use expect()"});
    EXPECT_EQ(ctx->slave(1).config.group, 0);
    ctx->slave(0).config.group = 1;  // slave 0 is not the first slave
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty()) << "reported once";
}

TEST_F(Mistakes, EachWishIsWarnedOf) {
    ctx->slave(1).config.unchecked_pdos = true;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
    ctx->slave(2).config.unchecked_pdos = true;
    ctx->slave(1).hooks.user = this;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 2U);
}

TEST_F(Mistakes, WishesForAGroupThatDoesNotExistAreWarnedOf) {
    const std::string wanted =
        "mapping process data: the config of a group that does not exist was written: write it after init(), to groups "
        "below Limits::groups";
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->group(42).config.packing = Packing::bits;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(all(ctx->warnings()), std::vector<std::string>{wanted});
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty()) << "reported once";
    HostContext early(limits);
    early.group(0).config.lost_inputs = LostInputs::zero;
    ctx.reset();
    ASSERT_TRUE(init(early, *nic, osal).ok());
    ASSERT_TRUE(config_init(early).ok());
    EXPECT_EQ(all(early.warnings()).size(), 1U);
    EXPECT_EQ(early.group(0).config.lost_inputs, LostInputs::keep);
}

TEST_F(Mistakes, WishesThatTheScanOfAnotherThreadDeletesAreWarnedOf) {
    ctx->slave(2).config.highest = AlState::preop;
    ScanRequest scan;
    std::thread([&] { EXPECT_TRUE(submit(*ctx, scan).ok()); }).join();
    ASSERT_TRUE(wait(*ctx, scan).ok());
    EXPECT_EQ(ctx->slave(2).config.highest, AlState::op);
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
}

// The scan has not begun, so it has deleted no wishes.
TEST_F(Mistakes, AScanThatDoesNotBeginWarnsOfNothing) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->slave(2).config.highest = AlState::preop;
    (void)all(ctx->warnings());
    ScanRequest scan;
    std::thread([&] { EXPECT_TRUE(submit(*ctx, scan).ok()); }).join();
    scan.cancel();
    EXPECT_EQ(wait(*ctx, scan).error().code, Errc::canceled);
    EXPECT_EQ(ctx->slave(2).config.highest, AlState::preop);
    EXPECT_TRUE(all(ctx->warnings()).empty());
}

// The error of a request that has not begun names no slave, because the request has not accessed a slave yet.
TEST(DescribeUnbegun, ARequestThatHasNotBegunNamesNoPlace) {
    std::array<char, 256> text{};
    for (const Step step : {Step::read_sii, Step::sdo_upload, Step::read_register})
        for (const Errc code : {Errc::timeout, Errc::capacity, Errc::canceled})
            EXPECT_EQ(describe({.code = code, .step = step, .slave = 2}, text).find("0x0000"), std::string_view::npos)
                << describe({.code = code, .step = step, .slave = 2}, text);
}

// The application repeats config_init() after config_map() has failed. The slaves start without their hooks and
// settings.
TEST_F(Mistakes, WishesThatASecondScanDeletesAreWarnedOf) {
    SlaveConfiguration listed;
    listed.highest = AlState::safeop;
    const ExpectedSlave expected[] = {{.number = 1, .config = &listed}, {.number = 2}};
    ASSERT_TRUE(expect(*ctx, expected).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty()) << "the list gives them again";
    ctx->slave(2).config.highest = AlState::preop;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(
        all(ctx->warnings()),
        std::vector<std::string>{"slave 2: counting slaves: the new scan has deleted its config and its hooks: set "
                                 "them again, or use expect()"});
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty());
}

TEST_F(Mistakes, OneImageForTwoGroupsIsRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->slave(2).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(
        words(config_map(*ctx, image, 1).error()),
        "mapping process data: the image overlaps that of another group: give each group octets of its own (group "
        "0)");
    EXPECT_TRUE(config_map(*ctx, std::span(image).subspan(2), 1).ok()) << "the octets behind those that are used";
    EXPECT_TRUE(config_map(*ctx, second_image, 1).ok());
    EXPECT_TRUE(config_map(*ctx, second_image, 1).ok()) << "the same group again";
}

TEST_F(Mistakes, AGroupWithoutSlavesIsNamed) {
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(words(config_map(*ctx, image, 1).error()),
              "mapping process data: argument out of range: no slave has group 1 in SlaveConfiguration::group");
    ctx->slave(1).config.group = ctx->slave(2).config.group = 1;
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "mapping process data: argument out of range: no slave has group 0 in SlaveConfiguration::group");
    ctx->group(0).config.al_status = true;
    EXPECT_TRUE(config_map(*ctx, image).ok()) << "a group that reads a register";
}

TEST_F(Mistakes, WishesWrittenBeforeASubmittedScanAreWarnedOf) {
    ctx->slave(1).config.group = 1;
    ScanRequest scan;
    ASSERT_TRUE(submit(*ctx, scan).ok());
    ASSERT_TRUE(wait(*ctx, scan).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
    ctx->slave(9).hooks.preop_to_safeop = [](HookedSlave, void*) { return Result<>(); };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    ASSERT_TRUE(wait(*ctx, map).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
}

TEST_F(Mistakes, ValuesOutOfRangeAreRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ReadStateRequest look;
    look.priority = 4;
    EXPECT_EQ(submit(*ctx, look).error().code, Errc::invalid_argument);
    look.priority = 3;
    look.timeout = -1ms;
    EXPECT_EQ(submit(*ctx, look).error().code, Errc::invalid_argument);
    EXPECT_EQ(look.state(), RequestState::error) << "not the success of an earlier submission";
    EXPECT_EQ(wait(*ctx, look).error().code, Errc::invalid_argument);
    look.timeout = 0ms;
    EXPECT_TRUE(submit(*ctx, look).ok());
    const auto nothing = [](const CycleInfo&) { return false; };
    EXPECT_EQ(run_cycle(*ctx, {.period = 0ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_EQ(run_cycle(*ctx, {.reply_timeout = -1ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_EQ(reach(*ctx, AlState::op, 1s, {.period = -1ms}).error().code, Errc::invalid_argument);
    ASSERT_TRUE(allow_waiting(*ctx, false).ok());
    EXPECT_EQ(run_cycle(*ctx, {.period = 0ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_TRUE(run_cycle(*ctx, {}, nothing).ok()) << "the cycle of the owner is not forbidden";
    EXPECT_EQ(reach(*ctx, AlState::op, 1s).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(watch_mailboxes(*ctx, -1ms).error().code, Errc::invalid_argument);
}

TEST_F(Mistakes, ErrorsOfTheSegmentAreInTheLogToo) {
    power(0, false);
    const auto found = config_init(*ctx);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(all(ctx->errors()), std::vector<std::string>{words(found.error())});
    power(0, true);
    osal.advance(1s);
    ASSERT_TRUE(config_init(*ctx).ok());
    const auto mapped = config_map(*ctx, std::span(image).first(3));
    EXPECT_EQ(words(mapped.error()),
              "mapping process data: the process image is larger than the buffer (needed 4, there is room for 3)")
        << "no slave is named: the buffer is too small for all of them";
    EXPECT_EQ(all(ctx->errors()), std::vector<std::string>{words(mapped.error())});
}

TEST_F(Mistakes, AListThatNoSlaveCanHaveSaysWhy) {
    static constexpr PdoEntry kNoBits[] = {{0x7000, 1, 8}, {0x7000, 2, 0}};
    static constexpr PdoEntry kEight[] = {{0x7000, 1, 8}};
    static constexpr Pdo kEmptyEntry[] = {{0x1600, kNoBits}};
    static constexpr Pdo kObject[] = {{0x6000, kEight}};
    static constexpr Pdo kTwice[] = {{0x1600, kEight}, {0x1600, kEight}};
    static constexpr Pdo kOnce[] = {{0x1600, kEight}};
    static constexpr SmPdos kTwoLists[][2] = {
        {{0, kEmptyEntry}, {1, {}}}, {{0, kObject}, {1, {}}}, {{0, kTwice}, {1, {}}}, {{0, kOnce}, {0, kOnce}}};
    static constexpr SlaveSetup kSetups[] = {
        {.pdos = kTwoLists[0]}, {.pdos = kTwoLists[1]}, {.pdos = kTwoLists[2]}, {.pdos = kTwoLists[3]}};
    static constexpr std::string_view kSaid[] = {
        "slave 1: configuring PDOs of 0x1600:2: the list of PDOs is invalid (an entry has 0 bits)",
        "slave 1: configuring PDOs of 0x6000:0: the list of PDOs is invalid (PDOs are 0x1600 to 0x17FF and "
        "0x1A00 to 0x1BFF)",
        "slave 1: configuring PDOs of 0x1600:0: the list of PDOs is invalid (the PDO is listed twice)",
        "slave 1: configuring PDOs of SyncManager 0: the list of PDOs is invalid (two lists name this "
        "SyncManager)"};
    for (std::size_t n = 0; n < std::size(kSetups); ++n) {
        ASSERT_TRUE(config_init(*ctx).ok());
        ctx->slave(1).config.setup = &kSetups[n];
        EXPECT_EQ(words(config_map(*ctx, image).error()), kSaid[n]);
    }
}

TEST_F(Mistakes, ASyncManagerThatNoSlaveHasIsNamed) {
    for (const unsigned number : {8U, 15U, 16U, 31U, 200U, 255U}) {
        ASSERT_TRUE(config_init(*ctx).ok());
        SlaveConfiguration& config = ctx->slave(1).config;
        config.source = ConfigurationSource::application;
        config.add({static_cast<std::uint8_t>(number), Direction::outputs, 0x24, 0x1100, 8});
        const std::string said = words(config_map(*ctx, image).error());
        EXPECT_NE(said.find(" at SyncManager " + std::to_string(number) + ": "), std::string::npos) << said;
        SmPdos list{static_cast<std::uint8_t>(number), {}};
        const SlaveSetup setup{.pdos = {&list, 1}};
        ASSERT_TRUE(config_init(*ctx).ok());
        ctx->slave(1).config.setup = &setup;
        const std::string of_list = words(config_map(*ctx, image).error());
        EXPECT_NE(of_list.find(" of SyncManager " + std::to_string(number) + ": "), std::string::npos) << of_list;
        ctx->slave(1).config.setup = nullptr;
    }
}

TEST_F(Mistakes, AnEntryOfTheExpectedSlavesIsNamed) {
    const ExpectedSlave unknown[] = {{.number = 1}, {.product = 0x101}};
    EXPECT_EQ(
        words(expect(*ctx, unknown).error()),
        "comparing with what is expected: argument out of range (entry 2 of the list: without number, alias or "
        "device id, with the number or station address of another entry, with a reserved station address, or apart "
        "from its hot connect group)");
}

TEST_F(Mistakes, AnEntryOfASlaveThatDoesNotExistIsNamed) {
    Output<std::uint8_t> lamp{9, 0x7000, 1};
    EntryHandle* const entries[] = {&lamp};
    ctx->group(0).config.entries = entries;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 9: mapping process data of 0x7000:1: there is no such slave (there are 2)");
}

TEST_F(Mistakes, LimitsOutOfTheirRangeAreNamed) {
    const auto said = [&](const Limits& wrong) {
        HostContext other(wrong);
        return words(init(other, *nic, osal).error());
    };
    const std::string before = "opening the network interface: argument out of range: ";
    EXPECT_EQ(said({.slaves = 0}), before + "Limits::slaves is 0, it must be 1 to 65535");
    EXPECT_EQ(said({.frames = 0}), before + "Limits::frames is 0, it must be 1 to 128");
    EXPECT_EQ(said({.frames = 129}), before + "Limits::frames is 129, it must be 1 to 128");
    EXPECT_EQ(said({.groups = 0}), before + "Limits::groups is 0, it must be 1 to 256");
    EXPECT_EQ(said({.groups = 257}), before + "Limits::groups is 257, it must be 1 to 256");
    EXPECT_EQ(said({.process_frames = 0}), before + "Limits::process_frames is 0, it must be 1 to 65535");
    HostContext least(Limits{.slaves = 1, .frames = 1, .groups = 1, .process_frames = 1, .emergencies = 0});
    EXPECT_TRUE(init(least, *nic, osal).ok());
}

TEST_F(Mistakes, LinkSettingsOutOfTheirRangeAreNamed) {
    const auto said = [&](const LinkSettings& wrong) {
        HostContext other(limits);
        other.link_settings() = wrong;
        return words(init(other, *nic, osal).error());
    };
    const std::string before = "opening the network interface: argument out of range: ";
    EXPECT_EQ(said({.frame_timeout = 0ms}), before + "LinkSettings::frame_timeout must be above zero");
    EXPECT_EQ(said({.frame_timeout = -1ms}), before + "LinkSettings::frame_timeout must be above zero");
    EXPECT_EQ(said({.queue_timeout = 0ms}), before + "LinkSettings::queue_timeout must be above zero");
    EXPECT_EQ(said({.sendings = 0}), before + "LinkSettings::sendings must be at least 1");
    // After init() the defaults replace such values.
    ctx->link_settings() = {.frame_timeout = 0ms, .queue_timeout = -1ms, .sendings = 0};
    EXPECT_TRUE(config_init(*ctx).ok());
}

TEST_F(Mistakes, ASharedImageThatIsTooSmallSaysHowMuchItNeeds) {
    std::array<std::byte, 8> little{};
    SharedImage shared(little);
    ctx->group(0).config.shared = &shared;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "mapping process data: not enough memory: SharedImage (needed 12, there is room for 8)");
}

}  // namespace
}  // namespace margay
