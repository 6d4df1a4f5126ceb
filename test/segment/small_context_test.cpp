// A context for a small system: limits as low as possible, and no feature that the slaves do not need.
#include "segment/bench.hpp"
#include "sim/library/quirks.hpp"

#include <margay/features.hpp>

namespace margay {
namespace {

class SmallContext : public SegmentTest {
  protected:
    // The limits of test/embedded/sizes.
    static Limits limits(std::uint32_t arena_bytes) {
        return {.slaves = 8,
                .tasks = 1,
                .frames = 4,
                .groups = 1,
                .process_frames = 1,
                .emergencies = 0,
                .errors = 8,
                .events = 4,
                .guests = 0,
                .arena_bytes = arena_bytes};
    }
    // Scans, maps, reads an object of slave 4, and asks for OP.
    Error first_error(std::uint32_t arena_bytes) { return first_error(limits(arena_bytes)); }
    Error first_error(const Limits& all) {
        HostContext small(all);
        std::array<std::byte, 512> image{};
        std::array<std::byte, 4> vendor{};
        if (const auto begun = init(small, wire, osal, {.coe = &kCoeFeature}); !begun) return begun.error();
        if (const auto found = config_init(small); !found) return found.error();
        if (const auto mapped = config_map(small, image); !mapped) return mapped.error();
        if (const auto read = SDOread(small, 4, 0x1018, 1, false, vendor); !read) return read.error();
        return {};
    }
};

// A processor with pointers of 32 bits needs less memory, but more than half: see Limits::arena_bytes in
// test/embedded/sizes.
TEST_F(SmallContext, TheDeepestSequenceOfABringUpFitsTheArenaOfTheSmallPrograms) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "odd_device", "odd_device", "digital_in_8", "analog_in_4"});
    switch_on();
    std::uint32_t least = 2048;
    while (least < 65536 && first_error(least).code != Errc::none) least += 1024;
    RecordProperty("arena_bytes", static_cast<int>(least));
#if defined(NDEBUG) && !defined(__SANITIZE_ADDRESS__)  // the library is optimised, which these tests are not
    EXPECT_LE(least, 7168U) << words(first_error(least - 1024));
#else
    EXPECT_LE(least, 2U * 7168) << words(first_error(least - 1024));
#endif
    EXPECT_EQ(first_error(65536).code, Errc::none) << words(first_error(65536));
    EXPECT_GT(least, 2048U) << "the search has found nothing";
}

// These arenas are too small for the sequences of all slaves at the same time. Some sequences wait for others, and no
// sequence waits for ever.
TEST_F(SmallContext, ASmallerArenaIsSlowerButSucceeds) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "odd_device", "analog_in_4", "analog_in_4", "odd_device",
               "drive", "odd_device", "analog_in_4", "analog_in_4", "odd_device", "drive", "drive", "odd_device",
               "analog_in_4"});
    switch_on();
    const std::uint32_t least = 1024 * sizeof(void*);
    std::size_t smaller = 0;
    for (const std::uint16_t tasks : {std::uint16_t{0}, std::uint16_t{2}}) {
        for (std::uint32_t arena = least; arena < 16 * 4096; arena += 1024 * 3 / 4) {
            auto small = limits(arena);
            small.slaves = 16;
            small.tasks = tasks;
            const auto error = first_error(small);
            EXPECT_EQ(error.code, Errc::none) << arena << " octets, tasks " << tasks << ": " << words(error);
            ++smaller;
        }
    }
    EXPECT_GT(smaller, 100U);
    auto none = limits(1024);
    none.slaves = 16;
    const auto error = first_error(none);
    EXPECT_EQ(error.code, Errc::capacity);
    EXPECT_NE(words(error).find("Limits::arena_bytes"), std::string::npos) << words(error);
}

// At each size the error says that the arena is too small, and not a buffer of the call.
TEST_F(SmallContext, AnArenaThatIsTooSmallIsNamed) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "odd_device", "analog_in_4"});
    switch_on();
    unsigned failed = 0;
    for (std::uint32_t arena = 512; arena < 16384; arena += 64) {
        const auto error = first_error(arena);
        if (error.code == Errc::none) continue;
        ++failed;
        EXPECT_EQ(error.code, Errc::capacity) << arena << ": " << words(error);
        EXPECT_EQ(words(error).find("the buffer of the call"), std::string::npos) << arena << ": " << words(error);
    }
    EXPECT_GT(failed, 10U);
}

TEST_F(SmallContext, WithoutTheFeatureOverlappingCyclesAreRefused) {
    plug_line({"coupler", "digital_out_8"});
    switch_on();
    HostContext small(limits(0));
    std::array<std::byte, 16> image{};
    ASSERT_TRUE(init(small, wire, osal, {}));
    ASSERT_TRUE(config_init(small));
    small.group(0).config.cycles_in_flight = 2;
    EXPECT_EQ(words(config_map(small, image).error()),
              "mapping process data: init() was not given kOverlapFeature, so cycles_in_flight must be 1");
    small.group(0).config.cycles_in_flight = 1;
    EXPECT_TRUE(config_map(small, image));
}

// Without the feature the dictionary is not read: the PDOs come from the SII, and a warning reports it.
TEST_F(SmallContext, WithoutTheFeatureTheSiiSaysThePdosAndThisIsTold) {
    plug_line({"coupler", "digital_out_8", "analog_io_4_2"});
    switch_on();
    std::array<std::byte, 64> image{};
    HostContext usual(limits(0));
    ASSERT_TRUE(init(usual, wire, osal));
    ASSERT_TRUE(config_init(usual));
    const auto by_dictionary = config_map(usual, image);
    ASSERT_TRUE(by_dictionary);
    EXPECT_EQ(usual.slave(3).config.source, ConfigurationSource::coe);
    EXPECT_FALSE(usual.warnings().take());

    HostContext small(limits(0));
    ASSERT_TRUE(init(small, wire, osal, {}));
    ASSERT_TRUE(config_init(small));
    const auto by_sii = config_map(small, image);
    ASSERT_TRUE(by_sii) << words(by_sii.error());
    EXPECT_EQ(*by_sii, *by_dictionary);
    EXPECT_EQ(small.slave(3).config.source, ConfigurationSource::sii);
    EXPECT_EQ(small.slave(3).al.state, AlState::safeop);
    const auto told = small.warnings().take();
    ASSERT_TRUE(told);
    EXPECT_EQ(words(*told),
              "slave 3: finding the PDOs: init() was not given kCoeFeature, so the object dictionary is not "
              "read (used: 20 octets, as the SII says)");
    EXPECT_FALSE(small.warnings().take()) << "the terminal without a dictionary needs no feature";
    ASSERT_TRUE(config_map(small, image));
    EXPECT_FALSE(small.warnings().take()) << "it is told once";
    EXPECT_FALSE(small.errors().take());
    std::array<std::byte, 4> vendor{};
    EXPECT_TRUE(SDOread(small, 3, 0x1018, 1, false, vendor)) << "an SDO brings the mailbox with it";
}

TEST_F(SmallContext, WithoutTheFeatureAndWithoutSizesInTheSiiTheMappingFails) {
    auto device = sim::make_device("analog_io_4_2").value();
    ASSERT_TRUE(sim::add_quirk(device, "sii_no_pdos"));
    ASSERT_TRUE(sim::add_quirk(device, "sii_sync_managers_off"));
    plug("digital_out_8");
    plug(std::move(device));
    switch_on();
    std::array<std::byte, 128> image{};
    HostContext small(limits(0));
    ASSERT_TRUE(init(small, wire, osal, {}));
    ASSERT_TRUE(config_init(small));
    const auto mapped = config_map(small, image);
    EXPECT_EQ(mapped.error().code, Errc::unsupported);
    EXPECT_EQ(words(small.slave(2).error),
              "slave 2: finding the PDOs: init() was not given kCoeFeature, so the object dictionary is not read, and "
              "the SII has no sizes");
    EXPECT_EQ(small.slave(2).al.state, AlState::preop);
    EXPECT_EQ(small.slave(1).al.state, AlState::safeop);

    static constexpr SmPdos kNothing[] = {{2, {}}, {3, {}}};
    static constexpr SlaveSetup kSetup{.pdos = kNothing};
    small.slave(2).config.setup = &kSetup;
    ASSERT_TRUE(clear_error(small, 2));
    (void)config_map(small, image);
    EXPECT_NE(small.slave(2).error.code, Errc::unsupported) << "the application says the PDOs itself";
}

TEST_F(SmallContext, WithoutTheFeatureTheParametersOfDrivesAreNotReadAndThisIsTold) {
    plug("soe_drive");
    switch_on();
    std::array<std::byte, 128> image{};
    HostContext small(limits(0));
    ASSERT_TRUE(init(small, wire, osal, {.coe = &kCoeFeature}));
    ASSERT_TRUE(config_init(small));
    (void)config_map(small, image);
    const auto told = small.warnings().take();
    ASSERT_TRUE(told);
    EXPECT_EQ(words(*told),
              "slave 1: finding the PDOs: init() was not given kSoeFeature, so the parameters of the "
              "drives are not read (used: 32 octets, as the SII says)");
}

TEST_F(SmallContext, WithTheFeatureTheSmallProgramReadsTheDictionary) {
    auto device = sim::make_device("analog_io_4_2").value();
    ASSERT_TRUE(sim::add_quirk(device, "sii_no_pdos"));
    plug(std::move(device));
    switch_on();
    std::array<std::byte, 64> image{};
    HostContext small(limits(0));
    ASSERT_TRUE(init(small, wire, osal, {.coe = &kCoeFeature}));
    ASSERT_TRUE(config_init(small));
    const auto mapped = config_map(small, image);
    ASSERT_TRUE(mapped) << words(mapped.error());
    EXPECT_EQ(*mapped, 20U);
    EXPECT_EQ(small.slave(1).config.source, ConfigurationSource::coe);
}

TEST_F(SmallContext, ErrorsAndEventsAreKeptAsTheLimitsSay) {
    HostContext small(limits(0));
    ASSERT_TRUE(init(small, wire, osal, {}));
    EXPECT_EQ(small.errors().capacity(), 8U);
    EXPECT_EQ(small.warnings().capacity(), 8U);
    EXPECT_EQ(small.events().capacity(), 4U);
    HostContext usual;
    ASSERT_TRUE(init(usual, wire, osal));
    EXPECT_EQ(usual.errors().capacity(), 64U);
    EXPECT_EQ(usual.events().capacity(), 64U);
}

}  // namespace
}  // namespace margay
