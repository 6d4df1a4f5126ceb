// A master and a device with modules in slots: the mapping by dictionary and by the application's PDOs, the exchange,
// and modules that change while the device runs.
#include "segment/field_notes.hpp"

#include "sim/sii_model.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class ModularIo : public FieldNotes {
  protected:
    static constexpr std::size_t kSlots = 4;
    static constexpr int kLamps = 1;
    static constexpr int kKeys = 2;
    static constexpr int kMeters = 3;
    static constexpr int kCounter = 4;
    sim::Esc* chip = nullptr;
    void SetUp() override {
        chip = &plug(sim::make_device("modular_io").value());
        start();
    }
    MutableBytes out() { return ctx.slave(1).image.outputs.bytes; }
    Bytes in() { return ctx.slave(1).image.inputs.bytes; }
    MutableBytes terminals(std::size_t slot) {
        return chip->process_data()->inputs().subspan(kSlots + 4 * (slot - 1), 4);
    }
    void plug_in(std::array<int, kSlots> modules) {
        for (std::size_t slot = 0; slot < kSlots; ++slot)
            chip->process_data()->inputs()[slot] = static_cast<std::byte>(modules[slot]);
    }
    // Brings the slave to INIT and PREOP again, as a master does that has changed the modules.
    void again() {
        ASSERT_TRUE(writestate(ctx, 1, AlState::init));
        ASSERT_EQ(statecheck(ctx, 1, AlState::init, 1s)->state, AlState::init);
        const auto found = config_init(ctx);
        ASSERT_TRUE(found) << words(found.error());
    }
    Result<> expect_modules(std::initializer_list<std::uint32_t> idents) {
        std::uint8_t slot = 0;
        if (auto wrong = SDOwrite(ctx, 1, 0xF030, 0, slot, 1s); !wrong) return wrong.error();
        for (const auto ident : idents)
            if (auto wrong = SDOwrite(ctx, 1, 0xF030, ++slot, ident, 1s); !wrong) return wrong.error();
        if (auto wrong = SDOwrite(ctx, 1, 0xF030, 0, slot, 1s); !wrong) return wrong.error();
        return {};
    }
    template <class T>
    T read(std::uint16_t index, std::uint8_t subindex) {
        const auto value = SDOread<T>(ctx, 1, index, subindex, 1s);
        EXPECT_TRUE(value) << words(value.error());
        return value ? *value : T{};
    }
};

TEST_F(ModularIo, IsMappedAsTheModulesLie) {
    EXPECT_EQ(ctx.slave(1).name(), "Coupler with four slots");
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    // Four lamps in slot 1 use half an octet: the preset of the counter in slot 4 follows them.
    ASSERT_EQ(out().size(), 5U);
    ASSERT_EQ(in().size(), 1U + 4 + 4);
    out()[0] = std::byte{0x5A};  // lamps 0xA, preset 5
    terminals(2)[0] = std::byte{0xC3};
    store_le<std::int16_t>(terminals(3), 0, 1000);
    store_le<std::int16_t>(terminals(3), 2, -1000);
    store_le<std::uint32_t>(terminals(4), 0, 7);
    cycles(4);
    EXPECT_EQ(in()[0], std::byte{0xC3});
    EXPECT_EQ(load_le<std::int16_t>(in(), 1), 1100) << "with its offset";
    EXPECT_EQ(load_le<std::int16_t>(in(), 3), -900);
    EXPECT_EQ(load_le<std::uint32_t>(in(), 5), 12U);
    EXPECT_EQ(beside_the_cycle(1, 0x7000, 1) & 0xFF, 0U);
    EXPECT_EQ(beside_the_cycle(1, 0x7000, 2) & 0xFF, 1U);
    EXPECT_EQ(beside_the_cycle(1, 0x7030, 1), 5U);
}

TEST_F(ModularIo, TheDictionaryHasTheObjectsOfTheSlots) {
    EXPECT_EQ(read<std::uint16_t>(0xF000, 1), 0x10);
    EXPECT_EQ(read<std::uint16_t>(0xF000, 2), 4);
    EXPECT_EQ(read<std::uint32_t>(0xF050, 3), 0x302U);
    EXPECT_EQ(read<std::int16_t>(0x8020, 2), 100);
    EXPECT_TRUE(SDOwrite(ctx, 1, 0x8020, 2, std::int16_t{-5}, 1s));
    EXPECT_EQ(read<std::int16_t>(0x8020, 2), -5);
    EXPECT_EQ(SDOwrite(ctx, 1, 0x8020, 2, std::int16_t{1001}, 1s).error().detail, 0x06090031U);
    EXPECT_EQ(SDOread<std::uint8_t>(ctx, 1, 0x6000, 1, 1s).error().detail, 0x06020000U);
}

// The application lists the PDOs that the modules have: they are compared, since the PDOs of modules cannot be changed.
TEST_F(ModularIo, TheApplicationMayNameThePdos) {
    static constexpr PdoEntry kLampEntries[] = {{0x7000, 1, 1}, {0x7000, 2, 1}, {0x7000, 3, 1}, {0x7000, 4, 1}};
    static constexpr PdoEntry kPreset[] = {{0x7030, 1, 32}};
    static constexpr PdoEntry kKeyEntries[] = {{0x6010, 1, 8}};
    static constexpr PdoEntry kLevels[] = {{0x6020, 1, 16}, {0x6020, 2, 16}};
    static constexpr PdoEntry kCount[] = {{0x6030, 1, 32}};
    static constexpr Pdo kOutputs[] = {{0x1600, kLampEntries}, {0x1603, kPreset}};
    static constexpr Pdo kInputs[] = {{0x1A01, kKeyEntries}, {0x1A02, kLevels}, {0x1A03, kCount}};
    static constexpr SmPdos kPdos[] = {{2, kOutputs}, {3, kInputs}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};
    ctx.slave(1).config.setup = &kSetup;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(in().size(), 9U);
}

TEST_F(ModularIo, OtherPdosOfTheApplicationAreRefused) {
    static constexpr PdoEntry kPreset[] = {{0x7000, 1, 32}};
    static constexpr Pdo kOutputs[] = {{0x1600, kPreset}};
    static constexpr SmPdos kPdos[] = {{2, kOutputs}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};
    ctx.slave(1).config.setup = &kSetup;
    const auto mapped = config_map(ctx, image);
    ASSERT_FALSE(mapped);
    EXPECT_EQ(mapped.error().slave, 1);
}

TEST_F(ModularIo, AListOfOtherModulesIsRefused) {
    ASSERT_TRUE(expect_modules({0x104, 0x208, 0x302}));
    const auto mapped = config_map(ctx, image);
    ASSERT_FALSE(mapped);
    EXPECT_EQ(mapped.error().slave, 1);
    EXPECT_EQ(ctx.slave(1).al.code, 0x0070) << told(1);
    EXPECT_NE(told(1).find("odule"), std::string::npos) << told(1);
}

TEST_F(ModularIo, TheListOfItsModulesIsRight) {
    ASSERT_TRUE(expect_modules({0x104, 0x208, 0x302, 0x401}));
    EXPECT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
}

TEST_F(ModularIo, OtherModulesAreMappedAfterInit) {
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    plug_in({kCounter, kLamps, 0, kMeters});
    cycles(3);
    EXPECT_EQ(beside_the_cycle(1, 0xF050, 1), 0x401U) << "the change is seen at once";
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::op, false, 0}));
    again();
    EXPECT_EQ(read<std::uint8_t>(0xF050, 0), 4);
    EXPECT_EQ(read<std::uint32_t>(0xF050, 3), 0U);
    EXPECT_EQ(read<std::int16_t>(0x8030, 1), 100);
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    ASSERT_EQ(out().size(), 5U);
    ASSERT_EQ(in().size(), 8U);
    store_le<std::uint32_t>(out(), 0, 0x01020304);
    out()[4] = std::byte{0x0F};
    store_le<std::uint32_t>(terminals(1), 0, 1);
    store_le<std::int16_t>(terminals(4), 2, 50);
    cycles(4);
    EXPECT_EQ(load_le<std::uint32_t>(in(), 0), 0x01020305U);
    EXPECT_EQ(load_le<std::int16_t>(in(), 6), 150);
    EXPECT_EQ(beside_the_cycle(1, 0x7010, 4) & 0xFF, 1U);
}

}  // namespace
}  // namespace margay
