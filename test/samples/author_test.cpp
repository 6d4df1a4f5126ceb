// A device as its author writes it with the README and the headers of the slave stack: two outputs, three inputs, a
// parameter in flash, a diagnosis message, SYNC0. It works with the master, and subdevice_check finds no fault.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "subdevice/diagnosis.hpp"
#include "subdevice/memory_store.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/stored_values.hpp"
#include "subdevice_check/check.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <optional>

namespace margay::subdevice {
namespace {

using namespace std::chrono_literals;
using margay::subdevice::testing::MemoryStore;

// ------------------------------------------------------------------ the device

constexpr DeviceDescription kPump{
    .vendor_id = 0x4D47,
    .product_code = 0x0FF1,
    .revision = 2,
    .name = "Pump",
    .order_code = "P-1",
    .group = "Pumps",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 3, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1500, .max_bytes = 8},
    .dc = {.supported = true, .min_cycle = 250us}};

struct PumpValues {
    std::uint8_t on;
    Le<std::int16_t> speed;
    Le<std::uint16_t> pressure;
    Le<std::int32_t> flow;
    Le<std::uint16_t> cycles;
    Le<std::uint16_t> gain;
};
constexpr auto kPumpOut = od::kReadWrite | od::kRxMappable;
constexpr auto kPumpIn = od::kRead | od::kTxMappable;
constexpr Entry kPumpOn[] = {value<&PumpValues::on>(0, "On", kPumpOut)};
constexpr Entry kPumpSpeed[] = {value<&PumpValues::speed>(0, "Speed", kPumpOut).within(kLimits<-3000, 3000>)};
constexpr Entry kPumpPressure[] = {value<&PumpValues::pressure>(0, "Pressure", kPumpIn)};
constexpr Entry kPumpFlow[] = {value<&PumpValues::flow>(0, "Flow", kPumpIn)};
constexpr Entry kPumpCycles[] = {value<&PumpValues::cycles>(0, "Cycles", kPumpIn)};
constexpr Entry kPumpGain[] = {
    value<&PumpValues::gain>(0, "Gain", od::kReadWrite | od::kBackup, 10).within(kLimits<1, 100>)};
constexpr auto kPumpDiagnosis = kDiagnosisEntries<4>;
constexpr Object kPumpObjects[] = {array(0x1010, "Store parameters", kStoreEntries, &kStoreHooks),
                                   array(0x1011, "Restore default parameters", kRestoreEntries, &kRestoreHooks),
                                   record(0x10F0, "Backup parameter handling", kBackupEntries, &kBackupHooks),
                                   record(0x10F3, "Diagnosis history", kPumpDiagnosis, &kDiagnosisHooks),
                                   variable(0x6000, "Pressure", kPumpPressure),
                                   variable(0x6010, "Flow", kPumpFlow),
                                   variable(0x6020, "Cycles", kPumpCycles),
                                   variable(0x7000, "On", kPumpOn),
                                   variable(0x7010, "Speed", kPumpSpeed),
                                   variable(0x8000, "Gain", kPumpGain)};
using PumpStack = StandardDevice<kPump, kPumpObjects, PumpValues>;

class Pump final : public Application {
  public:
    explicit Pump(PumpValues& values) : values_(values) {}
    const DeviceDescription& description() const override { return kPump; }
    DiagnosisHistory* diagnosis() override { return &history_; }
    StoredValues* stored_values() override { return stored; }
    void cycle(Time, bool outputs_valid) override {
        const int speed = outputs_valid && values_.on != 0 ? int{values_.speed} : 0;
        values_.flow = speed * values_.gain;
        values_.pressure = static_cast<std::uint16_t>(speed < 0 ? -speed : speed);
        values_.cycles = static_cast<std::uint16_t>(values_.cycles + 1);
    }
    // Called from the main loop.
    void watch(Time now) {
        const bool high = values_.pressure > 2500;
        if (high && !told_)
            (void)history_.add(
                {.code = 0xE8001234, .type = DiagnosisType::warning, .text_id = 7, .time_stamp_ns = timestamp_ns(now)});
        told_ = high;
    }
    StoredValues* stored = nullptr;

  private:
    PumpValues& values_;
    std::array<std::byte, 4 * 24> messages_{};
    DiagnosisHistory history_{messages_, 4};
    bool told_ = false;
};

// The main program of the device.
class PumpFirmware final : public sim::Firmware {
  public:
    explicit PumpFirmware(MemoryStore& flash) : flash_(flash) {}
    void start(EscAccess& esc, Time now) override {
        all_.emplace(esc, flash_);
        all_->stack.device.start(now);
    }
    Time step(Time now) override {
        all_->pump.watch(now);
        return std::min(all_->stack.device.step(now), now + 50us);  // this device polls
    }

  private:
    struct All {
        All(EscAccess& esc, MemoryStore& flash) : stack(esc, pump, memory), stored(stack.dictionary, flash, block) {
            pump.stored = &stored;
            (void)stored.load();
        }
        PumpStack::Memory memory;
        Pump pump{memory.values};
        PumpStack stack;
        std::array<std::byte, stored_bytes(kPumpObjects)> block{};
        StoredValues stored;
    };
    MemoryStore& flash_;
    std::optional<All> all_;
};

sim::Device make_pump(MemoryStore& flash) {
    PumpValues values{};
    const ObjectDictionary dictionary(PumpStack::Objects::kObjects, image_of(values));
    SiiWorkspace<2, 8> workspace;
    sim::Device device{.chip = *sim::chip_by_name("et1100"), .sii = std::vector<std::byte>(2048), .firmware = {}};
    const auto written = write_sii(kPump, {}, dictionary, workspace, device.sii);
    EXPECT_TRUE(written.ok()) << to_text(written.fault);
    device.firmware = std::make_unique<PumpFirmware>(flash);
    return device;
}

// ------------------------------------------------------------------ the tests

class AuthorsDevice : public ::testing::Test {
  protected:
    MemoryStore flash;
    sim::Segment segment;
    VirtualOsal osal;
    SimulatedNic nic{segment, osal};
    HostContext ctx{Limits{.slaves = 4}};
    std::array<std::byte, 64> image{};

    void SetUp() override {
        segment.add(make_pump(flash).assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
        ASSERT_TRUE(init(ctx, nic, osal).ok());
    }
    void cycle() {
        osal.advance(1ms);
        ASSERT_TRUE(send_processdata(ctx).ok());
        (void)receive_processdata(ctx, 500us);
        (void)poll(ctx, osal.now());
    }
    void to_op() {
        ASSERT_TRUE(config_map(ctx, image).ok());
        ASSERT_TRUE(writestate(ctx, 0, AlState::op).ok());
        for (int n = 0; n < 500 && statecheck(ctx, 1, AlState::op, Duration{0})->state != AlState::op; ++n) cycle();
        ASSERT_EQ(readstate(ctx)->state, AlState::op) << ctx.slave(1).al.code;
    }
};

TEST_F(AuthorsDevice, WorksWithTheMasterAndSync0) {
    ASSERT_TRUE(config_init(ctx).ok());
    ASSERT_TRUE(configdc(ctx).ok());
    ASSERT_TRUE(dcsync0(ctx, 1, true, 1ms, 0ns).ok());
    to_op();
    const auto& slave = ctx.slave(1);
    ASSERT_EQ(slave.image.outputs.bytes.size(), 3U);
    ASSERT_EQ(slave.image.inputs.bytes.size(), 8U);
    slave.image.outputs.bytes[0] = std::byte{1};
    store_le<std::int16_t>(slave.image.outputs.bytes, 1, -2600);
    for (int n = 0; n < 5; ++n) cycle();
    EXPECT_EQ(load_le<std::uint16_t>(slave.image.inputs.bytes, 0), 2600);
    EXPECT_EQ(load_le<std::int32_t>(slave.image.inputs.bytes, 2), -26'000);
    const auto before = load_le<std::uint16_t>(slave.image.inputs.bytes, 6);
    const Time begun = osal.now();
    for (int n = 0; n < 100; ++n) cycle();
    const auto cycles = static_cast<std::uint16_t>(load_le<std::uint16_t>(slave.image.inputs.bytes, 6) - before);
    // SYNC0 calls the application. An exchange takes time, too, so there are more calls than exchanges.
    EXPECT_NEAR(cycles, static_cast<double>((osal.now() - begun) / 1ms), 2);
    ASSERT_TRUE(writestate(ctx, 0, AlState::preop).ok());
    ASSERT_EQ(statecheck(ctx, 1, AlState::preop, 1s)->state, AlState::preop);
    EXPECT_EQ(*SDOread<std::uint8_t>(ctx, 1, 0x10F3, 2, 1s), 6) << "one message";
    std::array<std::byte, 32> message{};
    const auto bytes = SDOread(ctx, 1, 0x10F3, 6, false, message, 1s);
    ASSERT_TRUE(bytes.ok());
    EXPECT_EQ(load_le<std::uint32_t>(message, 0), 0xE8001234U);
}

TEST_F(AuthorsDevice, KeepsItsParameterInFlash) {
    ASSERT_TRUE(config_init(ctx).ok());
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 1, 0x8000, 0, 1s), 10);
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x8000, 0, std::uint16_t{25}, 1s).ok());
    EXPECT_EQ(SDOwrite(ctx, 1, 0x8000, 0, std::uint16_t{101}, 1s).error().detail, 0x06090031U);
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1010, 1, kSave, 1s).ok());
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x8000, 0, std::uint16_t{30}, 1s).ok());
    segment.set_power(0, false, osal.now());
    osal.advance(10ms);
    segment.set_power(0, true, osal.now());
    osal.advance(1s);
    ASSERT_TRUE(config_init(ctx).ok());
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 1, 0x8000, 0, 1s), 25) << "what was stored";
}

TEST_F(AuthorsDevice, KeepsTheRulesOfTheStandard) {
    using namespace samples::conformance;
    const auto checked = check_device(ctx, osal, nic.wait_handle(), 1, {});
    EXPECT_EQ(checked.error, "");
    EXPECT_TRUE(checked.report.conforms()) << report_text(checked.report, true);
    const auto sync = std::ranges::find(checked.report.checks, "clock.sync0", &CheckResult::name);
    ASSERT_NE(sync, checked.report.checks.end());
    EXPECT_EQ(sync->outcome, Outcome::passed) << sync->reason;
}

}  // namespace
}  // namespace margay::subdevice
