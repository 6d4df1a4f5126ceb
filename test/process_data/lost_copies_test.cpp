// Copies of inputs to outputs (GroupConfiguration::copies) while the slave with the inputs is lost or does not take
// part.
#include "process_data/identities.hpp"

#include <margay/run.hpp>

namespace margay {
namespace {

// The inputs of slave 3, a sensor, are copied to the outputs of slave 2.
struct LostCopies : Identities {
    void TestBody() override {}  // a test uses two objects of this class
    static constexpr SlaveToSlave kCopies[] = {{.from_slave = 3, .to_slave = 2, .bits = 8}};

    void SetUp() override {}
    void start(bool optional) {
        wanted[2].optional = optional;
        build();
        ctx->group(0).config.copies = kCopies;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(until([&] { return all_right(*ctx); }));
        program(line[2]).inputs()[0] = std::byte{0x77};
        program(line[2]).poke();
        run(100);
        ASSERT_EQ(output(), 0x77);
    }
    // Executes cycles. The application writes 0 to the outputs.
    void run(int count) {
        for (int n = 0; n < count; ++n) {
            ctx->slave(2).image.outputs.bytes[0] = std::byte{0};
            (void)cycle();
        }
    }
    [[nodiscard]] int output() { return std::to_integer<int>(program(line[1]).outputs()[0]); }
};

TEST_F(LostCopies, OfASlaveWithoutPowerDriveNothing) {
    for (const bool optional : {false, true}) {
        LostCopies plant;
        plant.start(optional);
        plant.power(plant.line[2], false);
        plant.run(300);
        EXPECT_EQ(plant.output(), 0) << "the sensor is optional: " << optional;
        plant.power(plant.line[2], true);
        ASSERT_TRUE(plant.until([&] { return inputs_fresh(*plant.ctx, 3); }));
        plant.program(plant.line[2]).inputs()[0] = std::byte{0x33};
        plant.program(plant.line[2]).poke();
        plant.run(10);
        EXPECT_EQ(plant.output(), 0x33) << "the sensor is back";
    }
}

TEST_F(LostCopies, OfASlaveInPreopDriveNothing) {
    start(false);
    ASSERT_TRUE(set_target(*ctx, 3, AlState::preop).ok());
    run(300);
    EXPECT_EQ(output(), 0);
}

TEST_F(LostCopies, OfAnExchangedSlaveDriveNothing) {
    start(false);
    take_out(line[2]);
    ASSERT_TRUE(segment.connect({line[1], 1}, {tool, 0}));
    segment.reconsider();
    run(300);
    EXPECT_EQ(output(), 0);
}

}  // namespace
}  // namespace margay
