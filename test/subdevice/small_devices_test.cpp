// Small devices over StandardDevice: one octet of outputs with SYNC0, inputs only with 0x1C33, numbers below eight bits
// with limits.
#include "mail_hand.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"
#include "wire/coe.hpp"

#include <gtest/gtest.h>

namespace margay::subdevice {
namespace {

using namespace testing;
using namespace std::chrono_literals;

constexpr MailboxPair kLittleMailboxes{{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}};

// A StandardDevice on PlainEsc, with the SDO requests of a master.
template <const DeviceDescription& Description, const auto& Objects, class Values>
struct LittleBench {
    using Stack = StandardDevice<Description, Objects, Values>;
    struct Little final : Application {
        const DeviceDescription& description() const override { return Description; }
        void cycle(Time, bool) override { ++cycles; }
        Time clock(Time now) override { return now + spent; }
        unsigned cycles = 0;
        Duration spent{};
    };
    PlainEsc esc;
    typename Stack::Memory memory;
    Little application;
    Stack stack;
    MailHand hand{esc};

    explicit LittleBench(RunMode mode = RunMode::polling) : stack(esc, application, memory, {}, mode) {
        stack.device.start(esc.time);
        hand.configure(128);
        EXPECT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
    }
    Time step() {
        if ((esc.events() & esc.get<std::uint32_t>(wire::reg::kAlEventMask.address)) != 0)
            (void)stack.device.interrupt(esc.time);
        return stack.device.step(esc.time);
    }
    // Executes the device for a time: step() at each deadline.
    void run(Duration time) {
        const auto end = esc.time + time;
        for (auto next = step(); next <= end; next = step()) esc.time = std::max(esc.time, next);
        esc.time = end;
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)step();
        return esc.al_status();
    }
    void start_sync0(Duration cycle) {
        esc.ecat_set<std::uint32_t>(0x09A0, static_cast<std::uint32_t>(cycle.count()));
        esc.ecat_set<std::uint8_t>(0x0981, 3);
    }
    void sync0() {
        esc.raise(wire::al_event::kDcSync0);
        (void)step();
    }
    // The body of the reply to a request of `data` behind the CoE header.
    std::vector<std::byte> exchange(std::initializer_list<int> data) {
        auto message = raw({0x00, 0x20});
        for (const int octet : data) message.push_back(static_cast<std::byte>(octet));
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, message)));
        for (int n = 0; n < 4; ++n) (void)step();
        auto reply = hand.fetch();
        (void)step();
        if (reply.size() < 16) return std::vector<std::byte>(8);
        return {reply.begin() + 8, reply.end()};
    }
    std::uint32_t number(int index, int subindex) {
        const auto reply = exchange({0x40, index & 0xFF, index >> 8, subindex, 0, 0, 0, 0});
        EXPECT_NE(reply[0], std::byte{0x80}) << std::hex << index << ":" << subindex;
        return load_le<std::uint32_t>(reply, 4);
    }
    static Abort abort_in(const std::vector<std::byte>& reply) {
        return reply[0] == std::byte{0x80} ? static_cast<Abort>(load_le<std::uint32_t>(reply, 4)) : Abort::none;
    }
};

// ------------------------------------------------------------------ one octet of outputs

struct LittleLampValues {
    std::uint8_t lamps;
    Le<std::uint16_t> keys;
    std::array<std::byte, SyncValues<0>::bytes> sync;
};
constexpr DeviceDescription kLittleLamps{
    .name = "Eight lamps",
    .protocols = {.coe = true},
    .mailbox = kLittleMailboxes,
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 1, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 2},
    .dc = {.supported = true}};
constexpr DeviceDescription kLittleLoop = [] {
    auto device = kLittleLamps;
    device.dc.pll = true;
    return device;
}();
constexpr auto kLittleSync = offset_of(&LittleLampValues::sync);
constexpr auto kLittleSyncOut = sync_output_entries<kLittleSync>(kLittleLamps);
constexpr auto kLittleSyncIn = sync_input_entries<kLittleSync>(kLittleLamps);
constexpr Entry kLittleLampEntry[] = {value<&LittleLampValues::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kLittleKeyEntry[] = {value<&LittleLampValues::keys>(0, "Keys", od::kRead | od::kTxMappable)};
constexpr Object kLittleLampObjects[] = {record(0x1C32, "Output sync", kLittleSyncOut, &kSyncParameterHooks),
                                         record(0x1C33, "Input sync", kLittleSyncIn, &kSyncParameterHooks),
                                         variable(0x6000, "Keys", kLittleKeyEntry),
                                         variable(0x7000, "Lamps", kLittleLampEntry)};

class OneOctet : public ::testing::TestWithParam<std::tuple<RunMode, Duration>> {
  protected:
    // The frames arrive in the middle between two SYNC0, and step() is called at each deadline.
    template <class Bench>
    static void cycle(Bench& bench, Duration sync0, int value) {
        bench.run(sync0 / 2);
        ASSERT_TRUE(bench.esc.ecat_write(0x1400, raw({value})));
        bench.run(sync0 / 2);
        bench.sync0();
    }
    template <class Bench>
    static void stays_in_op(Bench& bench) {
        const auto sync0 = std::get<1>(GetParam());
        bench.esc.configure(2, {0x1400, 1, 0x64, 1});
        bench.esc.configure(3, {0x1480, 2, 0x20, 1});
        bench.start_sync0(sync0);
        ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
        for (int n = 0; n < 20; ++n) cycle(bench, sync0, n);
        (void)bench.request(8);
        for (int n = 0; n < 20; ++n) cycle(bench, sync0, n);
        ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
        for (Duration passed{}; passed < 50ms; passed += sync0) cycle(bench, sync0, 7);
        EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
        EXPECT_EQ(bench.memory.values.lamps, 7);
        EXPECT_EQ(bench.stack.process_data.counters().missed_frames, 0u);
        EXPECT_EQ(bench.number(0x1C32, 0x0B), 0u) << "SM event missed counter";
    }
};

// The device cannot find out whether one octet has arrived, so frames are not counted.
TEST_P(OneOctet, NoFrameIsMissed) {
    LittleBench<kLittleLamps, kLittleLampObjects, LittleLampValues> bench(std::get<0>(GetParam()));
    stays_in_op(bench);
}

TEST_P(OneOctet, AControlLoopIsNotJudgedByFrames) {
    LittleBench<kLittleLoop, kLittleLampObjects, LittleLampValues> bench(std::get<0>(GetParam()));
    stays_in_op(bench);
}

TEST_P(OneOctet, TheWatchdogStillMonitorsTheOutputs) {
    LittleBench<kLittleLoop, kLittleLampObjects, LittleLampValues> bench(std::get<0>(GetParam()));
    stays_in_op(bench);
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    bench.esc.raise(wire::al_event::kWatchdog);
    bench.run(std::get<1>(GetParam()) / 2);
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::safeop, true, 0x001B}));
}

INSTANTIATE_TEST_SUITE_P(Cycles, OneOctet,
                         ::testing::Combine(::testing::Values(RunMode::polling, RunMode::interrupts),
                                            ::testing::Values(125us, 200us, 500us, 1000us, 2000us)));

// ------------------------------------------------------------------ inputs only

struct LittleSensorValues {
    Le<std::uint32_t> level;
    std::array<std::byte, SyncValues<0>::bytes> sync;
};
constexpr DeviceDescription kLittleSensor{.name = "Sensor",
                                          .protocols = {.coe = true},
                                          .mailbox = kLittleMailboxes,
                                          .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 4},
                                          .dc = {.supported = true, .min_cycle = 100us}};
constexpr auto kSensorSync = offset_of(&LittleSensorValues::sync);
constexpr auto kSensorSyncIn = sync_input_entries<kSensorSync>(kLittleSensor);
constexpr Entry kSensorLevel[] = {value<&LittleSensorValues::level>(0, "Level", od::kRead | od::kTxMappable)};
constexpr Object kSensorObjects[] = {record(0x1C33, "Input sync", kSensorSyncIn, &kSyncParameterHooks),
                                     variable(0x6000, "Level", kSensorLevel)};

TEST(InputsOnly, TheirObjectHasTheValuesOfTheDevice) {
    LittleBench<kLittleSensor, kSensorObjects, LittleSensorValues> bench;
    bench.esc.configure(3, {0x1480, 4, 0x20, 1});
    bench.start_sync0(500us);
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.number(0x1C33, 0x0A), 500'000u) << "the SYNC0 cycle in use";
    const auto measure = bench.exchange({0x2B, 0x33, 0x1C, 8, 1, 0, 0, 0});
    EXPECT_EQ(bench.abort_in(measure), Abort::none);
    bench.esc.time += 500us;
    bench.sync0();
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    bench.application.spent = 600us;
    bench.esc.time += 500us;
    bench.sync0();
    EXPECT_EQ(bench.number(0x1C33, 0x0C), 1u) << "the cycle was exceeded";
    bench.application.spent = 0us;
    (void)bench.request(2);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 0);
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.number(0x1C33, 0x0A), 0u) << "SYNC0 is off";
}

// ------------------------------------------------------------------ limits of numbers below eight bits

struct LittleSettings {
    std::uint8_t mode;
    std::uint8_t open;
    Le<std::int16_t> offset;
    std::uint8_t on;
};
constexpr DeviceDescription kLittleSetter{.name = "Settings", .protocols = {.coe = true}, .mailbox = kLittleMailboxes};
constexpr Entry kLittleSettings[] = {entry_count(5),
                                     flag<&LittleSettings::mode>(1, "Mode", od::kReadWrite, 4, 1).within(kLimits<1, 9>),
                                     flag<&LittleSettings::open>(2, "Open", od::kReadWrite, 4),
                                     value<&LittleSettings::offset>(3, "Offset", od::kReadWrite).within(kLimits<-5, 5>),
                                     flag<&LittleSettings::on>(4, "On", od::kReadWrite),
                                     padding(5, 7)};
constexpr Object kLittleSetterObjects[] = {record(0x8000, "Settings", kLittleSettings)};

TEST(SmallNumbers, CompleteAccessKeepsTheirLimits) {
    LittleBench<kLittleSetter, kLittleSetterObjects, LittleSettings> bench;
    // Subindex 0 in 16 bits, two numbers of four bits, one of 16 bits.
    const auto write = [&](int small, int offset) {
        return bench.abort_in(bench.exchange({0x31, 0x00, 0x80, 0, 6, 0, 0, 0, 5, 0, small, offset & 0xFF, 0, 1}));
    };
    EXPECT_EQ(write(0xF3, 2), Abort::none);
    EXPECT_EQ(bench.memory.values.mode, 3);
    EXPECT_EQ(bench.memory.values.open, 15) << "without limits";
    EXPECT_EQ(bench.memory.values.offset, 2);
    EXPECT_EQ(write(0x0A, 1), Abort::value_too_high);
    EXPECT_EQ(write(0x30, 1), Abort::value_too_low);
    EXPECT_EQ(write(0x01, 6), Abort::value_too_high);
    EXPECT_EQ(bench.memory.values.mode, 3);
    EXPECT_EQ(bench.memory.values.open, 15);
    EXPECT_EQ(bench.memory.values.offset, 2) << "nothing is written when one value is wrong";
    EXPECT_EQ(write(0x09, -5 & 0xFF), Abort::value_too_high) << "251: the high octet is 0";
}

TEST(SmallNumbers, ADownloadKeepsTheirLimitsAndTheirBits) {
    LittleBench<kLittleSetter, kLittleSetterObjects, LittleSettings> bench;
    auto& values = bench.memory.values;
    const auto write = [&](int subindex, int octet) {
        return bench.abort_in(bench.exchange({0x2F, 0x00, 0x80, subindex, octet, 0, 0, 0}));
    };
    EXPECT_EQ(write(1, 9), Abort::none);
    EXPECT_EQ(write(1, 10), Abort::value_too_high);
    EXPECT_EQ(write(1, 0), Abort::value_too_low);
    EXPECT_EQ(write(1, 0x13), Abort::value_too_high) << "the lower four bits are within the limits";
    EXPECT_EQ(values.mode, 9);
    EXPECT_EQ(write(2, 15), Abort::none);
    EXPECT_EQ(write(2, 16), Abort::value_too_high) << "four bits";
    EXPECT_EQ(write(2, 0xF1), Abort::value_too_high);
    EXPECT_EQ(values.open, 15);
    for (const int octet : {1, 0xFF}) {
        values.on = 0;
        EXPECT_EQ(write(4, octet), Abort::none) << octet;
        EXPECT_EQ(values.on, 1) << octet;
    }
    EXPECT_EQ(write(4, 2), Abort::value_too_high);
    EXPECT_EQ(values.on, 1) << "a value that is refused does not switch off";
}

TEST(SmallNumbers, PaddingIsZeroAfterAnotherValue) {
    LittleBench<kLittleSetter, kLittleSetterObjects, LittleSettings> bench;
    EXPECT_EQ(bench.exchange({0x40, 0x00, 0x80, 0, 0, 0, 0, 0}).at(4), std::byte{5});
    EXPECT_EQ(bench.exchange({0x40, 0x00, 0x80, 5, 0, 0, 0, 0}).at(4), std::byte{0});
}

// The octet of a small number may have more bits than the number: an upload has only the bits of the number.
TEST(SmallNumbers, AnUploadHasTheirBitsOnly) {
    LittleBench<kLittleSetter, kLittleSetterObjects, LittleSettings> bench;
    bench.memory.values.open = 0xF3;
    bench.memory.values.on = 0xFF;
    EXPECT_EQ(bench.exchange({0x40, 0x00, 0x80, 2, 0, 0, 0, 0}).at(4), std::byte{3});
    EXPECT_EQ(bench.exchange({0x40, 0x00, 0x80, 4, 0, 0, 0, 0}).at(4), std::byte{1});
}

}  // namespace
}  // namespace margay::subdevice
