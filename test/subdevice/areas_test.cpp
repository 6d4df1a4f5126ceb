// A device with two SyncManagers in each direction: when its outputs count as arrived, which SyncManager starts the
// update, the order of values in the process image, and the content of its SII.
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"

#include "mail_hand.hpp"
#include "wire/sii_check.hpp"

#include <gtest/gtest.h>

#include <map>

namespace margay::subdevice {
namespace {

using namespace testing;
using namespace std::chrono_literals;

constexpr ProcessDataArea kMoreOut[] = {{.sync_manager = 4, .start = 0x1480, .max_bytes = 4, .watchdog = true}};
constexpr ProcessDataArea kMoreIn[] = {{.sync_manager = 5, .start = 0x14C0, .max_bytes = 4}};
constexpr DeviceDescription kTwoAreas{
    .vendor_id = 0x4D47,
    .product_code = 0x78,
    .name = "Two areas",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 4, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1440, .max_bytes = 4},
    .more_outputs = kMoreOut,
    .more_inputs = kMoreIn,
    .dc = {.supported = true}};

struct AreaValues {
    using bits = Field<std::uint8_t, 0>;  // three bits and a number in SM2
    using speed = Field<std::int16_t, bits::end>;
    using torque = Field<std::int16_t, speed::end>;  // SM4
    using position = Field<std::int32_t, torque::end>;
    using heat = Field<std::int16_t, position::end>;
    static constexpr std::size_t sync = heat::end;
    static constexpr std::size_t sync4 = sync + SyncValues<sync>::bytes;
    static constexpr std::size_t sync5 = sync4 + MoreSyncValues<sync4>::bytes;
    static constexpr std::size_t bytes = sync5 + MoreSyncValues<sync5>::bytes;
};
constexpr Entry kBits[] = {flag<AreaValues::bits>(0, "Bits", od::kReadWrite | od::kRxMappable, 3)};
constexpr Entry kSpeed[] = {value<AreaValues::speed>(0, "Speed", od::kReadWrite | od::kRxMappable)};
constexpr Entry kTorque[] = {value<AreaValues::torque>(0, "Torque", od::kReadWrite | od::kRxMappable, 7)};
constexpr Entry kPosition[] = {value<AreaValues::position>(0, "Position", od::kRead | od::kTxMappable)};
constexpr Entry kHeat[] = {value<AreaValues::heat>(0, "Heat", od::kRead | od::kTxMappable)};
// The mapping of SM2 ends within an octet: 16 + 3 bits.
constexpr Entry kRx2[] = {entry_count(2), mapped(1, 0x7001, 0, 16), mapped(2, 0x7000, 0, 3)};
constexpr Entry kRx4[] = {entry_count(1), mapped(1, 0x7002, 0, 16)};
constexpr Entry kTx3[] = {entry_count(1), mapped(1, 0x6000, 0, 32)};
constexpr Entry kTx5[] = {entry_count(1), mapped(1, 0x6001, 0, 16)};
constexpr Entry kIn2[] = {entry_count(1), assigned(1, 0x1600)};
constexpr Entry kIn3[] = {entry_count(1), assigned(1, 0x1A00)};
constexpr Entry kIn4[] = {entry_count(1), assigned(1, 0x1601)};
constexpr Entry kIn5[] = {entry_count(1), assigned(1, 0x1A01)};
constexpr auto kSync2 = sync_output_entries<AreaValues::sync>(kTwoAreas);
constexpr auto kSync3 = sync_input_entries<AreaValues::sync>(kTwoAreas);
constexpr auto kSync4 = more_sync_output_entries<AreaValues::sync, AreaValues::sync4>(kTwoAreas);
constexpr auto kSync5 = more_sync_input_entries<AreaValues::sync, AreaValues::sync5>(kTwoAreas);
constexpr Object kAreaObjects[] = {record(0x1600, "Rx of SM2", kRx2, nullptr, DataType::pdo_mapping),
                                   record(0x1601, "Rx of SM4", kRx4, nullptr, DataType::pdo_mapping),
                                   record(0x1A00, "Tx of SM3", kTx3, nullptr, DataType::pdo_mapping),
                                   record(0x1A01, "Tx of SM5", kTx5, nullptr, DataType::pdo_mapping),
                                   array(0x1C12, "RxPDO assignment", kIn2),
                                   array(0x1C13, "TxPDO assignment", kIn3),
                                   array(0x1C14, "RxPDO assignment", kIn4),
                                   array(0x1C15, "TxPDO assignment", kIn5),
                                   record(0x1C32, "Sync of SM2", kSync2, &kSyncParameterHooks),
                                   record(0x1C33, "Sync of SM3", kSync3, &kSyncParameterHooks),
                                   record(0x1C34, "Sync of SM4", kSync4, &kSyncParameterHooks),
                                   record(0x1C35, "Sync of SM5", kSync5, &kSyncParameterHooks),
                                   variable(0x6000, "Position", kPosition),
                                   variable(0x6001, "Heat", kHeat),
                                   variable(0x7000, "Bits", kBits),
                                   variable(0x7001, "Speed", kSpeed),
                                   variable(0x7002, "Torque", kTorque)};
using AreaStack = StandardDevice<kTwoAreas, kAreaObjects, std::array<std::byte, AreaValues::bytes>>;

class AreaApplication final : public Application {
  public:
    explicit AreaApplication(MutableBytes values) : values_(values) {}
    const DeviceDescription& description() const override { return device; }
    void cycle(Time, bool outputs_valid) override {
        ++cycles;
        valid = outputs_valid;
        spent += 700ns;
        speed = AreaValues::speed::load(values_);
        torque = AreaValues::torque::load(values_);
    }
    Time clock(Time now) override { return now + spent; }
    DeviceDescription device = kTwoAreas;
    Duration spent{};
    unsigned cycles = 0;
    int speed = 0;
    int torque = 0;
    bool valid = false;

  private:
    MutableBytes values_;
};

class Areas : public ::testing::TestWithParam<RunMode> {
  protected:
    PlainEsc esc;
    AreaStack::Memory memory;
    AreaApplication application{memory.values};
    AreaStack stack{esc, application, memory, {}, GetParam()};
    MailHand hand{esc};

    void SetUp() override {
        stack.device.start(esc.time);
        hand.configure(128);
        configure(0x64);
        ASSERT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
    }
    void configure(std::uint8_t outputs) {
        esc.configure(2, {0x1400, 3, outputs, 1});
        esc.configure(3, {0x1440, 4, 0x20, 1});
        esc.configure(4, {0x1480, 2, outputs, 1});
        esc.configure(5, {0x14C0, 2, 0x20, 1});
    }
    Time run() {
        // The interrupt line follows the mask.
        if (GetParam() != RunMode::polling && (esc.events() & esc.get<std::uint32_t>(0x0204)) != 0)
            (void)stack.device.interrupt(esc.time);
        return stack.device.step(esc.time);
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)run();
        return esc.al_status();
    }
    void first(int speed, int bits) {
        ASSERT_TRUE(esc.ecat_write(0x1400, raw({speed & 0xFF, speed >> 8, bits})));
        (void)run();
    }
    void second(int torque) {
        ASSERT_TRUE(esc.ecat_write(0x1480, raw({torque & 0xFF, torque >> 8})));
        (void)run();
    }
    std::uint64_t sync_value(unsigned index, unsigned subindex) {
        return stack.dictionary.number(static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(subindex));
    }
    void sync0() {
        esc.time += 1ms;
        esc.raise(wire::al_event::kDcSync0);
        (void)run();
    }
    void to_op() {
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        first(1, 1);
        second(2);
        ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
    }
};
INSTANTIATE_TEST_SUITE_P(Modes, Areas, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

TEST_P(Areas, OpNeedsDataInEachOfThem) {
    ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    second(2);
    ASSERT_EQ(request(8), (AlStatus{AlState::safeop, false, 0})) << "it waits";
    esc.time += 200ms;
    (void)run();
    EXPECT_EQ(esc.al_status(),
              (AlStatus{AlState::safeop, true, static_cast<std::uint16_t>(AlStatusCode::no_valid_outputs)}));
    ASSERT_EQ(request(0x18), (AlStatus{AlState::safeop, false, 0}));
    first(1, 1);
    (void)run();
    EXPECT_EQ(esc.al_status(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(AreaValues::torque::load(memory.values), 2);
}

TEST_P(Areas, TheLastOneDrives) {
    to_op();
    const auto before = application.cycles;
    first(-300, 5);
    EXPECT_EQ(application.cycles, before) << "the frame is not complete";
    EXPECT_EQ(AreaValues::speed::load(memory.values), -300);
    second(1000);
    EXPECT_EQ(application.cycles, before + 1);
    EXPECT_EQ(application.speed, -300);
    EXPECT_EQ(application.torque, 1000) << "it starts at an octet of its own";
    EXPECT_EQ(AreaValues::bits::load(memory.values), 5);
    EXPECT_TRUE(application.valid);
    second(1001);  // a group that is exchanged more often
    EXPECT_EQ(application.cycles, before + 2);
    EXPECT_EQ(application.speed, -300);
}

// Objects 0x1C34 and 0x1C35 beside 0x1C32 and 0x1C33.
TEST_P(Areas, EachCountsItsOwnMissedFrames) {
    esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    first(1, 1);
    second(2);
    sync0();
    ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
    for (int n = 0; n < 10; ++n) {
        first(n, 1);
        second(n);
        sync0();
    }
    EXPECT_EQ(sync_value(0x1C32, 0x0B), 0U);
    EXPECT_EQ(sync_value(0x1C34, 0x0B), 0U);
    for (int n = 0; n < 20; ++n) {  // SM4 drives: the device stays in OP
        second(n);
        sync0();
    }
    EXPECT_EQ(sync_value(0x1C32, 0x0B), 20U);
    EXPECT_EQ(sync_value(0x1C34, 0x0B), 0U);
    EXPECT_EQ(stack.process_data.counters().missed_frames, 20U);
    EXPECT_EQ(esc.al_status(), (AlStatus{AlState::op, false, 0}));
    first(1, 1);
    second(2);
    sync0();
    for (int n = 0; n < 5; ++n) {
        first(n, 1);
        sync0();
    }
    EXPECT_EQ(sync_value(0x1C32, 0x0B), 20U);
    EXPECT_EQ(sync_value(0x1C34, 0x0B), 4U) << "with the limit of four, the fifth ends OP";
    EXPECT_EQ(esc.al_status(), (AlStatus{AlState::safeop, true, 0x001A}));
    EXPECT_EQ(sync_value(0x1C32, 0x20), 1U);
    EXPECT_EQ(sync_value(0x1C34, 0x20), 1U) << "one error of the device";
}

TEST_P(Areas, HaveTheirOwnCycleTimesAndTheMeasuredTimesOfTheDevice) {
    for (const unsigned index : {0x1C32U, 0x1C33U, 0x1C34U, 0x1C35U}) {
        EXPECT_EQ(sync_value(index, 1), index == 0x1C32 || index == 0x1C34 ? 1U : 0x22U);
        EXPECT_EQ(sync_value(index, 4), 6U) << "SM event and DC SYNC0";
    }
    MoreSyncValues<AreaValues::sync4>::cycle::store(memory.values, 2'000'000);
    EXPECT_EQ(sync_value(0x1C34, 2), 2'000'000U);
    EXPECT_EQ(sync_value(0x1C32, 2), 0U);
    EXPECT_EQ(sync_value(0x1C35, 2), 0U);
    SyncValues<AreaValues::sync>::get_cycle_time::store(memory.values, 1);
    application.spent = 0ns;
    to_op();
    EXPECT_GE(sync_value(0x1C32, 6), 700U);
    EXPECT_EQ(sync_value(0x1C34, 6), sync_value(0x1C32, 6));
    EXPECT_EQ(sync_value(0x1C35, 6), sync_value(0x1C33, 6));
    EXPECT_EQ(sync_value(0x1C35, 8), 1U) << "one command for all";
}

TEST_P(Areas, InputsGoToTheirOwnSyncManagers) {
    AreaValues::position::store(memory.values, 0x12345678);
    AreaValues::heat::store(memory.values, -2);
    ASSERT_EQ(request(4).state, AlState::safeop);
    std::vector<std::byte> position(4);
    std::vector<std::byte> heat(2);
    ASSERT_TRUE(esc.ecat_read(0x1440, position));
    ASSERT_TRUE(esc.ecat_read(0x14C0, heat));
    EXPECT_EQ(position, raw({0x78, 0x56, 0x34, 0x12}));
    EXPECT_EQ(heat, raw({0xFE, 0xFF}));
}

TEST_P(Areas, EachLengthIsChecked) {
    const std::map<unsigned, AlStatusCode> wrong{{2, AlStatusCode::invalid_output_configuration},
                                                 {3, AlStatusCode::invalid_input_configuration},
                                                 {4, AlStatusCode::invalid_output_configuration},
                                                 {5, AlStatusCode::invalid_input_configuration}};
    for (const auto& [n, code] : wrong) {
        auto setting = esc.sync_manager(n);
        ++setting.length_bytes;
        esc.configure(n, setting);
        EXPECT_EQ(request(4), (AlStatus{AlState::preop, true, static_cast<std::uint16_t>(code)})) << n;
        configure(0x64);
        ASSERT_EQ(request(0x12), (AlStatus{AlState::preop, false, 0}));
    }
    EXPECT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    for (const unsigned n : {2U, 3U, 4U, 5U}) EXPECT_FALSE(esc.locked(n)) << n;
    (void)request(2);
    for (const unsigned n : {2U, 3U, 4U, 5U}) EXPECT_TRUE(esc.locked(n)) << n;
}

TEST_P(Areas, SafeValuesOfAllWhenOneFails) {
    to_op();
    EXPECT_EQ(AreaValues::torque::load(memory.values), 2);
    auto setting = esc.sync_manager(4);
    setting.activate = 0;
    esc.configure(4, setting);
    (void)run();
    EXPECT_EQ(esc.al_status(), (AlStatus{AlState::preop, true, 0x001D}));
    EXPECT_EQ(AreaValues::torque::load(memory.values), 7) << "the initial value";
    EXPECT_EQ(AreaValues::speed::load(memory.values), 0);
}

// Both watchdog triggers belong to one watchdog (0x0420).
TEST_P(Areas, AreRefusedWhenTheyAreTooOld) {
    ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    first(1, 1);
    second(2);
    esc.ecat_set<std::uint16_t>(0x0440, 0);
    esc.time += 200ms;
    (void)request(8);
    esc.time += 200ms;
    (void)run();
    EXPECT_EQ(esc.al_status(),
              (AlStatus{AlState::safeop, true, static_cast<std::uint16_t>(AlStatusCode::sync_manager_watchdog)}));
}

TEST_P(Areas, ThatRaiseNoEventsArePolled) {
    configure(0x44);
    to_op();
    const auto before = application.cycles;
    esc.time += 1ms;
    first(9, 0);
    second(8);
    EXPECT_EQ(application.speed, 9);
    EXPECT_EQ(application.torque, 8);
    EXPECT_EQ(application.cycles, before + 1);
    EXPECT_LE(run(), esc.time + 1ms);
}

TEST_P(Areas, AreInTheSii) {
    SiiWorkspace<8, 32> workspace;
    std::vector<std::byte> image(2048);
    const auto written = write_sii(kTwoAreas, {}, stack.dictionary, workspace, image);
    ASSERT_TRUE(written.ok()) << to_text(written.fault);
    namespace sii = wire::sii;
    std::vector<std::pair<SmType, unsigned>> managers;
    std::map<unsigned, unsigned> pdos;
    std::size_t fmmus = 0;
    sii::CategoryChain chain(static_cast<std::uint32_t>(image.size() / 2));
    while (chain.more()) {
        const auto place = chain.step(Bytes(image).subspan(chain.header_word() * 2, 4));
        if (!place) break;
        const auto content = Bytes(image).subspan(place->word * 2, place->words * std::size_t{2});
        if (place->type == sii::category::kFmmu) {
            for (const auto use : content) fmmus += use == std::byte{1} || use == std::byte{2} ? 1 : 0;
        } else if (place->type == sii::category::kSyncManager) {
            sii::SyncManagers all(content);
            while (const auto manager = all.next()) managers.emplace_back(manager->type, manager->length_bytes);
        } else if (place->type == sii::category::kRxPdo || place->type == sii::category::kTxPdo) {
            sii::Pdos all(content);
            while (const auto pdo = all.next()) pdos[pdo->index] = pdo->sync_manager;
        }
    }
    EXPECT_EQ(fmmus, 4U);
    const std::vector<std::pair<SmType, unsigned>> expected{{SmType::mailbox_out, 128}, {SmType::mailbox_in, 128},
                                                            {SmType::outputs, 3},       {SmType::inputs, 4},
                                                            {SmType::outputs, 2},       {SmType::inputs, 2}};
    EXPECT_EQ(managers, expected);
    EXPECT_EQ(pdos, (std::map<unsigned, unsigned>{{0x1600, 2}, {0x1601, 4}, {0x1A00, 3}, {0x1A01, 5}}));
    EXPECT_EQ(stack.dictionary.number(0x1C00, 0), 6U);
    EXPECT_EQ(stack.dictionary.number(0x1C00, 5), 3U);
    EXPECT_EQ(stack.dictionary.number(0x1C00, 6), 4U);
}

TEST_P(Areas, MoreThanTheStackHasRoomForAreRefused) {
    std::array<ProcessDataArea, kMostMoreAreas + 1> many{};
    many[0] = kMoreOut[0];
    application.device.more_outputs = many;
    EXPECT_EQ(request(4), (AlStatus{AlState::preop, true, static_cast<std::uint16_t>(AlStatusCode::no_memory)}));
}

}  // namespace
}  // namespace margay::subdevice
