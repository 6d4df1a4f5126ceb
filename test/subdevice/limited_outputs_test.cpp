// Outputs in the process data keep the limits of their entries, as downloads do.
#include "subdevice/standard_device.hpp"

#include "subdevice/plain_esc.hpp"

#include <gtest/gtest.h>

namespace margay::subdevice {
namespace {

using namespace testing;

constexpr DeviceDescription kLimitedDevice{
    .name = "Limited",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 16}};
struct LimitedValues {
    std::uint8_t program;  // four bits
    std::uint8_t valve;    // four bits
    Le<std::int16_t> speed;
    Le<std::uint32_t> limit;
    Le<std::int64_t> place;
};
constexpr auto kLimitedOut = od::kReadWrite | od::kRxMappable;
constexpr Entry kLimitedEntries[] = {
    entry_count(5),
    flag<&LimitedValues::program>(1, "Program", kLimitedOut, 4, 1).within(kLimits<1, 3>),
    flag<&LimitedValues::valve>(2, "Valve", kLimitedOut, 4),
    value<&LimitedValues::speed>(3, "Speed", kLimitedOut, -7).within(kLimits<-3000, 3000>),
    value<&LimitedValues::limit>(4, "Limit", kLimitedOut, 0xFFFF'0000).within(kLimits<10, 0xFFFF'FFF0>),
    value<&LimitedValues::place>(5, "Place", kLimitedOut, -5).within(kLimits<-0x1'0000'0000, 0x1'0000'0000>)};
constexpr Object kLimitedObjects[] = {record(0x7000, "Outputs", kLimitedEntries)};
using LimitedStack = StandardDevice<kLimitedDevice, kLimitedObjects, LimitedValues>;

// A table is wrong if its initial values are outside of their limits, or if the limits permit no value.
template <class T>
bool right_table(T initial, const ValueLimits& limits) {
    const Entry entries[] = {value<Field<T, 0>>(0, "Value", kLimitedOut, initial).within(limits)};
    const Object objects[] = {variable(0x2000, "Value", entries)};
    return well_formed(objects, sizeof(T));
}
TEST(LimitedTable, BeginsWithinItsLimits) {
    EXPECT_TRUE(right_table<std::uint8_t>(1, kLimits<1, 3>));
    EXPECT_TRUE(right_table<std::uint8_t>(255, kLimits<0, 255>));
    EXPECT_TRUE(right_table<std::uint32_t>(0xFFFF'FFFF, kLimits<0, 0xFFFF'FFFF>));
    EXPECT_TRUE(right_table<std::int64_t>(-5, kLimits<-5, 0x1'0000'0000>));
    EXPECT_TRUE(right_table<std::uint64_t>(5, kLimits<0, -1>)) << "all numbers of 64 bits";
    EXPECT_FALSE(right_table<std::uint8_t>(0, kLimits<1, 3>));
    EXPECT_FALSE(right_table<std::int16_t>(-1, kLimits<0, 100>));
    EXPECT_FALSE(right_table<std::int16_t>(101, kLimits<-100, 100>));
    EXPECT_FALSE(right_table<std::int16_t>(0, kLimits<2, 1>));
}

class LimitedOutputs : public ::testing::Test {
  protected:
    struct Nothing final : LimitedStack::App {
        using App::App;
    };
    PlainEsc esc;
    LimitedStack::Memory memory;
    Nothing application{memory};
    LimitedStack stack{esc, application, memory};
    LimitedValues& values = memory.values;

    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)stack.device.step(esc.time);
        return esc.al_status();
    }
    void put(unsigned program, unsigned valve, std::int16_t speed, std::uint32_t limit, std::int64_t place) {
        std::array<std::byte, 15> raw{};
        raw[0] = static_cast<std::byte>(program | valve << 4);
        store_le(MutableBytes(raw), 1, speed);
        store_le(MutableBytes(raw), 3, limit);
        store_le(MutableBytes(raw), 7, place);
        ASSERT_TRUE(esc.ecat_write(0x1400, raw));
        (void)stack.device.step(esc.time);
    }
    void expect(unsigned program, unsigned valve, std::int16_t speed, std::uint32_t limit, std::int64_t place) const {
        EXPECT_EQ(values.program, program);
        EXPECT_EQ(values.valve, valve);
        EXPECT_EQ(values.speed, speed);
        EXPECT_EQ(values.limit, limit);
        EXPECT_EQ(values.place, place);
    }
    void to_op() {
        stack.device.start(esc.time);
        esc.configure(0, {0x1000, 128, 0x26, 1});
        esc.configure(1, {0x1100, 128, 0x22, 1});
        esc.configure(2, {0x1400, 15, 0x64, 1});
        ASSERT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        put(0, 9, 3001, 9, 0);
        ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
    }
};

TEST_F(LimitedOutputs, BeginWithTheirInitialValues) {
    expect(1, 0, -7, 0xFFFF'0000, -5);
    to_op();
    expect(1, 9, -7, 0xFFFF'0000, 0);
    EXPECT_EQ(stack.process_data.counters().refused_values, 3U);
}

TEST_F(LimitedOutputs, KeepTheirLastValueWhereTheNewOneIsOutside) {
    to_op();
    const auto before = stack.process_data.counters().refused_values;
    put(3, 15, -3000, 0xFFFF'FFF0, 0x1'0000'0000);
    expect(3, 15, -3000, 0xFFFF'FFF0, 0x1'0000'0000);
    EXPECT_EQ(stack.process_data.counters().refused_values, before);
    put(4, 1, -3001, 0xFFFF'FFF1, -0x1'0000'0001);
    expect(3, 1, -3000, 0xFFFF'FFF0, 0x1'0000'0000);
    EXPECT_EQ(stack.process_data.counters().refused_values, before + 4);
    put(2, 2, 3000, 10, -0x1'0000'0000);
    expect(2, 2, 3000, 10, -0x1'0000'0000);
}

}  // namespace
}  // namespace margay::subdevice
