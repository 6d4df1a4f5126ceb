// SlaveConfiguration::group is the group of the slave after the next mapping. Until then the slave stays in its group.
#include "process_data/bus.hpp"

#include <margay/run.hpp>

#include <cstring>

namespace margay {
namespace {

using namespace std::chrono_literals;

class NextGroup : public testing::Test, protected Bus {
  protected:
    std::array<std::byte, 1024> image{};
    std::array<std::byte, 1024> second{};
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    void bus_inputs(std::size_t n, int value) {
        for (auto& octet : device(n).inputs()) octet = static_cast<std::byte>(value);
    }
};

// Slave 3 is the destination of a copy in group 0, and is then mapped in group 1.
TEST_F(NextGroup, ACopyToASlaveThatHasLeftTheGroup) {
    for (const bool far : {false, true}) {
        segment = sim::Segment();
        add(32, 0);
        add(0, 32);
        add(far ? 1600 : 32, 0);
        add(32, 0);
        start();
        static constexpr SlaveToSlave kTo4[] = {{.from_slave = 2, .to_slave = 4, .bits = 32}};
        ctx->group(0).config.copies = kTo4;
        if (far) ctx->slave(3).config.group = 1;
        image.fill(std::byte{0});
        ASSERT_TRUE(config_map(*ctx, image, 0));
        (void)to_op();
        const std::size_t used = far ? 12 : 16;
        ctx->slave(4).config.group = 1;
        const auto mapped = config_map(*ctx, second, 1);
        EXPECT_EQ(
            words(mapped.error()),
            "slave 4: mapping process data: argument out of range: GroupConfiguration::copies: at least 1 bit, and "
            "only bits of the slave's data in this group");
        EXPECT_EQ(ctx->errors().take(), mapped.error());
        EXPECT_TRUE(ctx->group(1).mapped);
        std::fill(image.begin(), image.end(), std::byte{0});
        std::fill_n(image.begin(), 4, std::byte{0x11});  // the outputs that the application has set for slave 1
        std::fill_n(image.begin() + static_cast<long>(used) - 4, 4, std::byte{0x77});  // inputs of slave 2
        EXPECT_TRUE(cycle(0)) << "the group continues without slave 4";
        EXPECT_EQ(image[0], std::byte{0x11}) << "the outputs of slave 1 were changed";
        std::size_t beyond = 0;
        for (std::size_t n = used; n < image.size(); ++n) beyond += image[n] != std::byte{0} ? 1 : 0;
        EXPECT_EQ(beyond, 0U) << "octets written behind the image of group 0";
    }
}

// The source of a copy is mapped in another group. The destination must not keep the outputs that were copied last.
TEST_F(NextGroup, ACopyFromASlaveThatHasLeftTheGroup) {
    for (int n = 0; n < 3; ++n) add(16, 16);
    start();
    static constexpr SlaveToSlave kFrom2[] = {{.from_slave = 2, .to_slave = 3, .bits = 16}};
    ctx->group(0).config.copies = kFrom2;
    ASSERT_TRUE(config_map(*ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*ctx, supervision));
    bus_inputs(2, 0x22);
    for (int n = 0; n < 300; ++n) (void)cycle();
    ASSERT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    ASSERT_EQ(device(3).outputs()[0], std::byte{0x22});
    ctx->slave(2).config.group = 1;
    const std::string why =
        "slave 2: mapping process data: argument out of range: GroupConfiguration::copies: at least 1 bit, and only "
        "bits "
        "of the slave's data in this group";
    EXPECT_EQ(words(config_map(*ctx, second, 1).error()), why);
    const auto run = [&] {
        for (int n = 0; n < 300; ++n) (void)cycle(0), (void)cycle(1);
    };
    run();
    EXPECT_EQ(words(what_is_wrong(*ctx)), why);
    EXPECT_TRUE(config_map(*ctx, second, 1)) << "the slave does not leave a group this time";
    run();
    EXPECT_EQ(words(what_is_wrong(*ctx)), why) << "the copy is still not executed";
    ctx->group(0).config.copies = {};  // the application copies the data itself
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
    ctx->slave(3).image.outputs.bytes[0] = std::byte{0x33};
    run();
    EXPECT_EQ(device(3).outputs()[0], std::byte{0x33});
    supervision.cancel();
}

// The application sets `config.group` for the next config_map(). The mapped group continues.
TEST_F(NextGroup, TheGroupOfASlaveIsSetForTheNextMapping) {
    add(8, 16);
    add(8, 16);
    start();
    ASSERT_TRUE(config_map(*ctx, image, 0));
    ASSERT_EQ(to_op().state, AlState::op);
    ctx->slave(2).config.group = 1;
    const auto in = ctx->slave(2).image.inputs;
    for (int n = 0; n < 3; ++n) {
        std::ranges::fill(in.bytes, std::byte{0xEE});
        const auto wkc = cycle(0);
        EXPECT_FALSE(wkc.ok() && in.bytes[0] == std::byte{0xEE}) << "success, but the inputs were not copied";
    }
    // Meanwhile a slave loses its power.
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*ctx, supervision));
    for (int n = 0; n < 20; ++n) (void)cycle(0);
    segment.set_power(1, false, osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle(0);
    EXPECT_EQ(cycle(0).error().detail, Error::kOthersFresh);
    segment.set_power(1, true, osal.now());
    for (int n = 0; n < 3000; ++n) (void)cycle(0);
    EXPECT_TRUE(cycle(0)) << "back in the group that it was mapped with";
    supervision.cancel();
}

// Slave 3 moves to group 1 while group 0 continues with the other slaves. Then slave 3 is lost and comes back.
TEST_F(NextGroup, ASlaveThatMovesToAnotherGroup) {
    add(8, 16);
    add(8, 16);
    add(8, 16);
    add(8, 16);
    start();
    ctx->slave(4).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image, 0));
    ASSERT_TRUE(config_map(*ctx, second, 1));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*ctx, supervision));
    int being_mapped = 0;
    const auto both = [&](int count) {
        while (count-- > 0) {
            (void)cycle(0);
            const Error error = cycle(1).error();
            if (error.code != Errc::working_counter || error.slave != 0) continue;
            being_mapped += error.detail == Error::kBeingMapped ? 1 : 0;
            EXPECT_NE(error.detail, static_cast<std::uint32_t>(Error::kOthersFresh)) << words(error);
        }
    };
    both(200);
    ctx->slave(3).config.group = 1;
    MapRequest map;
    map.group = 1;
    map.image = second;
    ASSERT_TRUE(submit(*ctx, map));
    for (int n = 0; n < 1000 && map.busy(); ++n) both(1);
    ASSERT_FALSE(map.busy());
    both(300);
    EXPECT_GT(being_mapped, 0);
    EXPECT_EQ(*cycle(0), 6U) << "the group continues without slave 3";
    EXPECT_EQ(*cycle(1), 6U);
    segment.set_power(2, false, osal.now());
    both(50);
    EXPECT_FALSE(cycle(1));
    segment.set_power(2, true, osal.now());
    both(3000);
    EXPECT_TRUE(cycle(0));
    EXPECT_TRUE(cycle(1));
    // Slave 3 moves back to group 0.
    ctx->slave(3).config.group = 0;
    map.group = 0;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map));
    for (int n = 0; n < 1000 && map.busy(); ++n) both(1);
    both(3000);
    const auto last = cycle(0);
    EXPECT_TRUE(last.ok()) << words(last.error());
    const auto other = cycle(1);
    EXPECT_TRUE(other.ok()) << words(other.error());
    supervision.cancel();
}

// The application sets `config.group` for the next config_map(), and the slave is lost before that call. The inputs of
// the slave in group 0 are old.
TEST_F(NextGroup, FreshInputsOfASlaveWhoseGroupIsSetForTheNextMapping) {
    add(8, 16);
    add(64, 128);
    add(8, 16);
    start();
    ctx->slave(2).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image, 0));
    ASSERT_TRUE(config_map(*ctx, second, 1));
    for (int n = 0; n < 50; ++n) (void)cycle(0), (void)cycle(1);
    (void)writestate(*ctx, 0, AlState::op);
    for (int n = 0; n < 50; ++n) (void)cycle(0), (void)cycle(1);
    (void)statecheck(*ctx, 0, AlState::op, 0ms);
    for (auto& octet : device(3).inputs()) octet = std::byte{0x5A};
    for (int n = 0; n < 5; ++n) (void)cycle(0), (void)cycle(1);
    ctx->slave(3).config.group = 1;
    segment.set_power(2, false, osal.now());
    segment.advance(osal.now());
    for (int n = 0; n < 3; ++n) {
        (void)cycle(0);
        (void)cycle(1);
        EXPECT_FALSE(inputs_fresh(*ctx, 3)) << "slave 3 has no power";
    }
}

// The same while another slave is lost: "the inputs of all other slaves are fresh".
TEST_F(NextGroup, OthersAreFreshButNotTheSlaveWhoseGroupIsSetForTheNextMapping) {
    add(8, 16);
    add(8, 16);
    add(8, 16);
    start();
    ctx->group(0).config.cycles_in_flight = 2;
    ASSERT_TRUE(config_map(*ctx, image, 0));
    (void)to_op();
    segment.set_power(2, false, osal.now());
    for (int n = 0; n < 5; ++n) (void)cycle(0);
    (void)readstate(*ctx);
    for (int n = 0; n < 5; ++n) (void)cycle(0);
    ctx->slave(2).config.group = 1;
    for (auto& octet : device(2).inputs()) octet = std::byte{0x5A};
    for (int n = 0; n < 5; ++n) {
        std::ranges::fill(ctx->slave(2).image.inputs.bytes, std::byte{0xEE});
        const auto wkc = cycle(0);
        const bool others = wkc.error().detail == Error::kOthersFresh;
        EXPECT_FALSE(others && ctx->slave(2).image.inputs.bytes[0] == std::byte{0xEE}) << words(wkc.error());
    }
}

// The application sets `config.group` of a slave of group 0 for the next config_map(). The slave is lost, and this must
// not change the expected working counters of group 1. If it did, old inputs of a lost slave of group 1 would count as
// fresh.
TEST_F(NextGroup, TheCountersOfTheGroupThatASlaveIsToJoin) {
    for (int n = 0; n < 4; ++n) add(8, 16);
    start();
    ctx->slave(2).config.group = 1;
    ctx->slave(3).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image, 0));
    ASSERT_TRUE(config_map(*ctx, second, 1));
    for (int n = 0; n < 50; ++n) (void)cycle(0), (void)cycle(1);
    (void)writestate(*ctx, 0, AlState::op);
    for (int n = 0; n < 50; ++n) (void)cycle(0), (void)cycle(1);
    (void)statecheck(*ctx, 0, AlState::op, 0ms);
    for (auto& octet : device(3).inputs()) octet = std::byte{0x5A};
    for (int n = 0; n < 5; ++n) (void)cycle(0), (void)cycle(1);
    ctx->slave(4).config.group = 1;
    segment.set_power(3, false, osal.now());
    for (int n = 0; n < 5; ++n) (void)cycle(0), (void)cycle(1);
    (void)readstate(*ctx);  // now the master knows that slave 4 is lost
    for (int n = 0; n < 5; ++n) (void)cycle(0), (void)cycle(1);
    EXPECT_EQ(ctx->group(1).datagrams[0].accepted, 6);
    segment.set_power(2, false, osal.now());
    segment.advance(osal.now());
    for (int n = 0; n < 3; ++n) {
        (void)cycle(0);
        std::ranges::fill(ctx->slave(3).image.inputs.bytes, std::byte{0xEE});
        const auto one = cycle(1);
        EXPECT_FALSE(inputs_fresh(*ctx, 3)) << "slave 3 has no power";
        EXPECT_NE(one.error().detail, static_cast<std::uint32_t>(Error::kOthersFresh));
    }
}

// The same slave comes back before the mapping. It must not get the outputs of another slave.
TEST_F(NextGroup, ASlaveThatComesBackWithItsGroupSetForTheNextMapping) {
    for (int n = 0; n < 4; ++n) add(8, 16);
    start();
    ctx->slave(2).config.group = 1;
    ctx->slave(3).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image, 0));
    ASSERT_TRUE(config_map(*ctx, second, 1));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*ctx, supervision));
    const auto both = [&](int count) {
        while (count-- > 0) {
            for (const Slave& s : ctx->slaves()) s.image.outputs.bytes[0] = static_cast<std::byte>(0xA0 + s.number);
            (void)cycle(0);
            (void)cycle(1);
        }
    };
    both(300);
    for (std::size_t n = 1; n <= 4; ++n) ctx->slave(4).config.group = 1;
    segment.set_power(3, false, osal.now());
    both(50);
    segment.set_power(3, true, osal.now());
    both(3000);
    for (std::size_t n = 1; n <= 4; ++n)
        EXPECT_NE(device(4).outputs()[0], std::byte{0xA3}) << "slave 4 has the outputs of slave 3";
    segment.set_power(3, false, osal.now());
    segment.set_power(2, false, osal.now());
    segment.set_power(2, true, osal.now());
    supervision.cancel();
}

}  // namespace
}  // namespace margay
