// A device as its author writes it with the README and the headers of the slave stack: two axes, slots for modules,
// parameters in flash, firmware by FoE in BOOT, SYNC0 at a pin of the processor. It uses interrupts.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "subdevice/foe_server.hpp"
#include "subdevice/memory_store.hpp"
#include "subdevice/modules.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/stored_values.hpp"
#include "subdevice/sync_objects.hpp"
#include "subdevice_check/check.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <optional>

namespace margay::subdevice {
namespace {

using namespace std::chrono_literals;
using margay::subdevice::testing::MemoryStore;

// ------------------------------------------------------------------ the modules

constexpr auto kCraneOut = od::kReadWrite | od::kRxMappable;
constexpr auto kCraneIn = od::kRead | od::kTxMappable;

struct RelayValues {
    std::array<std::uint8_t, 4> relays;
};
constexpr Entry kRelays[] = {entry_count(4), flag<&RelayValues::relays>(1, "Relay", kCraneOut)};
constexpr Entry kRelayPdo[] = {entry_count(4), mapped(1, 0x7000, 1, 1), mapped(2, 0x7000, 2, 1),
                               mapped(3, 0x7000, 3, 1), mapped(4, 0x7000, 4, 1)};
constexpr Object kRelayObjects[] = {record(0x1600, "Relays", kRelayPdo, nullptr, DataType::pdo_mapping),
                                    array(0x7000, "Relays", kRelays)};

struct ScaleValues {
    Le<std::int32_t> weight;
    Le<std::int32_t> tare;
};
constexpr Entry kWeight[] = {entry_count(1), value<&ScaleValues::weight>(1, "Weight", kCraneIn)};
constexpr Entry kTare[] = {entry_count(1),
                           value<&ScaleValues::tare>(1, "Tare", od::kReadWrite | od::kBackup).within(kLimits<0, 500>)};
constexpr Entry kWeightPdo[] = {entry_count(1), mapped(1, 0x6000, 1, 32)};
constexpr Object kScaleObjects[] = {record(0x1A00, "Weight", kWeightPdo, nullptr, DataType::pdo_mapping),
                                    record(0x6000, "Weight", kWeight), record(0x8000, "Tare", kTare)};

constexpr ModuleKind kCraneKinds[] = {
    {.ident = 0x11, .name = "4 relays", .objects = kRelayObjects, .value_bytes = sizeof(RelayValues)},
    {.ident = 0x22, .name = "Scale", .objects = kScaleObjects, .value_bytes = sizeof(ScaleValues)}};
constexpr std::uint16_t kCraneRx[] = {0x16F0, 0x16F1};
constexpr std::uint16_t kCraneTx[] = {0x1AF0, 0x1AF1};
constexpr ModularDevice kCraneSlots{.kinds = kCraneKinds, .slots = 2, .own_rx_pdos = kCraneRx, .own_tx_pdos = kCraneTx};

// ------------------------------------------------------------------ the axes

struct CraneAxis {
    Le<std::int32_t> target;
    Le<std::int32_t> actual;
    Le<std::uint16_t> gain;
};
struct CraneValues {
    std::array<CraneAxis, 2> axes;
    std::array<std::byte, SyncValues<0>::bytes> sync;
};
using CraneModules = ModuleTables<kCraneSlots, sizeof(CraneValues)>;

constexpr DeviceDescription kCrane{
    .vendor_id = 0x4D47,
    .product_code = 0x0C2A,
    .revision = 1,
    .name = "Crane",
    .protocols = {.coe = true, .foe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 256}, {.start = 0x1100, .size_bytes = 256}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 512}, {.start = 0x1200, .size_bytes = 512}},
    .outputs = {.sync_manager = 2, .start = 0x1800, .max_bytes = CraneModules::most_bytes(true) + 8, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1A00, .max_bytes = CraneModules::most_bytes(false) + 8},
    .dc = {.supported = true, .min_cycle = 250us}};

template <unsigned N>
constexpr auto kAxis = std::to_array<Entry>(
    {entry_count(3),
     value<&CraneValues::axes, N, &CraneAxis::target>(1, "Target", kCraneOut).within(kLimits<-9999, 9999>),
     value<&CraneValues::axes, N, &CraneAxis::actual>(2, "Actual", kCraneIn),
     value<&CraneValues::axes, N, &CraneAxis::gain>(3, "Gain", od::kReadWrite | od::kBackup, 1).within(kLimits<1, 8>)});
template <std::uint16_t Index, std::uint8_t Subindex>
constexpr Entry kAxisPdo[] = {entry_count(1), mapped(1, Index, Subindex, 32)};
constexpr std::size_t kCraneSync = offset_of(&CraneValues::sync);
constexpr auto kCraneSyncError = sync_error_entries<kCraneSync>(kCrane);
constexpr auto kCraneOutputSync = sync_output_entries<kCraneSync>(kCrane);
constexpr auto kCraneInputSync = sync_input_entries<kCraneSync>(kCrane);
constexpr Object kCraneOwn[] = {array(0x1010, "Store parameters", kStoreEntries, &kStoreHooks),
                                array(0x1011, "Restore default parameters", kRestoreEntries, &kRestoreHooks),
                                record(0x10F0, "Backup parameter handling", kBackupEntries, &kBackupHooks),
                                record(0x10F1, "Sync error setting", kCraneSyncError),
                                record(0x16F0, "Target of axis 1", kAxisPdo<0x2000, 1>, nullptr, DataType::pdo_mapping),
                                record(0x16F1, "Target of axis 2", kAxisPdo<0x2001, 1>, nullptr, DataType::pdo_mapping),
                                record(0x1AF0, "Actual of axis 1", kAxisPdo<0x2000, 2>, nullptr, DataType::pdo_mapping),
                                record(0x1AF1, "Actual of axis 2", kAxisPdo<0x2001, 2>, nullptr, DataType::pdo_mapping),
                                record(0x1C32, "Output sync", kCraneOutputSync, &kSyncParameterHooks),
                                record(0x1C33, "Input sync", kCraneInputSync, &kSyncParameterHooks),
                                record(0x2000, "Axis 1", kAxis<0>),
                                record(0x2001, "Axis 2", kAxis<1>)};
constexpr auto kCraneObjects = joined(kCraneOwn, CraneModules::kObjects);
using CraneStack = StandardDevice<kCrane, kCraneObjects, ModularValues<CraneValues, CraneModules>, 1, 0x1389,
                                  CraneModules::kMostMapped + 2, CraneModules::kLargestValue>;
static_assert(well_formed(CraneStack::Objects::kObjects, CraneModules::end, kCraneSlots));

class Crane final : public CraneStack::App {
    ModuleMemory<CraneModules> module_memory_;

  public:
    using App::App;
    ModuleLayout* modules() override { return &plugs; }
    StoredValues* stored_values() override { return stored; }
    void cycle(Time, bool outputs_valid) override {
        for (auto& axis : values.own.axes)
            if (outputs_valid) axis.actual = axis.target * axis.gain;
        for (unsigned slot = 1; slot <= kCraneSlots.slots; ++slot) {
            const auto* const kind = plugs.in_use(slot);
            if (kind == nullptr || kind->ident != 0x22) continue;
            auto scale = values_in<ScaleValues>(plugs.values(slot));
            scale.weight = 100 - scale.tare;
            store_values(plugs.values(slot), scale);
        }
        ++cycles;
    }
    void safe_outputs(Time) override { ++safe; }
    Modules plugs{module_memory_};
    StoredValues* stored = nullptr;
    unsigned cycles = 0;
    unsigned safe = 0;
};

class CraneFirmwareFile final : public FoeStore {
  public:
    FoeAnswer open_to_read(const FoeFile&, Time) override { return FoeAnswer::error(FoeError::access_denied); }
    FoeAnswer read(std::size_t, MutableBytes, std::size_t&, Time) override {
        return FoeAnswer::error(FoeError::illegal);
    }
    FoeAnswer open_to_write(const FoeFile& file, Time) override {
        if (file.state != AlState::boot) return FoeAnswer::error(FoeError::bootstrap_only);
        octets = 0;
        return FoeAnswer::go();
    }
    FoeAnswer write(std::size_t, Bytes data, Time) override {
        octets += data.size();
        return FoeAnswer::go();
    }
    FoeAnswer finish_write(std::size_t, Time) override { return FoeAnswer::go(); }
    void give_up() override {}
    std::size_t octets = 0;
};

struct CraneParts {  // of one device, for the tests
    MemoryStore flash;
    CraneFirmwareFile file;
    std::array<std::uint32_t, 2> plugged{0x11, 0x22};
    unsigned cycles = 0;
    std::uint32_t missed_syncs = 0;
};

// The main program: the handlers of the interrupts, and the task that the handlers wake.
class CraneFirmware final : public sim::Firmware {
  public:
    explicit CraneFirmware(CraneParts& parts) : parts_(parts) {}
    void start(EscAccess& esc, Time now) override {
        esc_ = &esc;
        all_.emplace(esc, parts_);
        all_->stack.device.start(now);
    }
    Time step(Time now) override {
        auto& device = all_->stack.device;
        for (unsigned slot = 1; slot <= 2; ++slot) all_->crane.plugs.detect(slot, parts_.plugged[slot - 1]);
        std::array<std::byte, 1> pin{};  // the level of the pin
        esc_->read(wire::reg::kSync0Status.address, pin);
        if ((pin[0] & std::byte{1}) != std::byte{0}) device.sync0(now);
        (void)device.interrupt(now);
        const auto next = device.step(now);
        parts_.cycles = all_->crane.cycles;
        parts_.missed_syncs = all_->stack.process_data.counters().missed_syncs;
        return std::min(next, now + 20us);  // the simulation has no pins, so this program polls the level
    }

  private:
    struct All {
        All(EscAccess& esc, CraneParts& parts)
            : foe(parts.file),
              stack(esc, crane, memory, {{{wire::MailboxType::foe, &foe, true}}}, RunMode::interrupts),
              stored(stack.dictionary, parts.flash, block) {
            crane.stored = &stored;
            for (unsigned slot = 1; slot <= 2; ++slot) crane.plugs.detect(slot, parts.plugged[slot - 1]);
            crane.plugs.lay_out(stack.dictionary);
            (void)stored.load();
        }
        CraneStack::Memory memory;
        Crane crane{memory};
        FoeServer foe;
        CraneStack stack;
        std::array<std::byte, stored_bytes(kCraneObjects) + CraneModules::kStoredBytes> block{};
        StoredValues stored;
    };
    CraneParts& parts_;
    EscAccess* esc_ = nullptr;
    std::optional<All> all_;
};

sim::Device make_crane(CraneParts& parts) {
    std::array<std::byte, CraneModules::end> values{};
    ModuleMemory<CraneModules> memory;
    Modules modules(memory);
    ObjectDictionary dictionary(CraneStack::Objects::kObjects, values);
    for (unsigned slot = 1; slot <= 2; ++slot) modules.detect(slot, parts.plugged[slot - 1]);
    modules.lay_out(dictionary);
    SiiWorkspace<8, 32> workspace;
    sim::Device device{.chip = *sim::chip_by_name("et1100"), .sii = std::vector<std::byte>(2048), .firmware = {}};
    const BoardDescription board{.sync0 = SyncPin{.output = true}};
    const auto written = write_sii(kCrane, board, dictionary, workspace, device.sii);
    EXPECT_TRUE(written.ok()) << to_text(written.fault);
    device.firmware = std::make_unique<CraneFirmware>(parts);
    return device;
}

// ------------------------------------------------------------------ a program of a user

class AuthorsCrane : public ::testing::Test {
  protected:
    CraneParts parts;
    sim::Segment segment;
    VirtualOsal osal;
    SimulatedNic nic{segment, osal};
    HostContext ctx{Limits{.slaves = 4}};
    std::array<std::byte, 64> image{};

    void SetUp() override {
        segment.add(make_crane(parts).assemble());
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
    void to(AlState state) {
        StateRequest request;
        request.slave = 1;
        request.wanted = state;
        ASSERT_TRUE(submit(ctx, request).ok());
        ASSERT_TRUE(wait(ctx, request).ok());
    }
    void power_off_and_on() {
        segment.set_power(0, false, osal.now());
        osal.advance(10ms);
        segment.set_power(0, true, osal.now());
        osal.advance(1s);
    }
};

TEST_F(AuthorsCrane, MovesBothAxesWithSync0AtItsPin) {
    ASSERT_TRUE(config_init(ctx).ok());
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x2001, 3, std::uint16_t{3}, 1s).ok());
    ASSERT_TRUE(configdc(ctx).ok());
    ASSERT_TRUE(dcsync0(ctx, 1, true, 1ms, 0ns).ok());
    ASSERT_TRUE(config_map(ctx, image).ok());
    ASSERT_TRUE(writestate(ctx, 0, AlState::op).ok());
    for (int n = 0; n < 500 && statecheck(ctx, 1, AlState::op, Duration{0})->state != AlState::op; ++n) cycle();
    ASSERT_EQ(readstate(ctx)->state, AlState::op) << ctx.slave(1).al.code;
    const auto& data = ctx.slave(1).image;
    ASSERT_EQ(data.outputs.bytes.size(), 9U);
    ASSERT_EQ(data.inputs.bytes.size(), 12U);
    store_le<std::int32_t>(data.outputs.bytes, 0, 5000);
    store_le<std::int32_t>(data.outputs.bytes, 4, -9999);
    for (int n = 0; n < 5; ++n) cycle();
    EXPECT_EQ(load_le<std::int32_t>(data.inputs.bytes, 0), 5000);
    EXPECT_EQ(load_le<std::int32_t>(data.inputs.bytes, 4), -29'997);
    EXPECT_EQ(load_le<std::int32_t>(data.inputs.bytes, 8), 100);
    store_le<std::int32_t>(data.outputs.bytes, 4, 10'000);
    for (int n = 0; n < 5; ++n) cycle();
    EXPECT_EQ(load_le<std::int32_t>(data.inputs.bytes, 4), -29'997) << "outside of the limits of the target";
    const auto before = parts.cycles;
    const Time begun = osal.now();
    for (int n = 0; n < 100; ++n) cycle();
    EXPECT_NEAR(parts.cycles - before, static_cast<double>((osal.now() - begun) / 1ms), 2);
    EXPECT_EQ(parts.missed_syncs, 0U);
}

TEST_F(AuthorsCrane, KeepsParametersOfAxesAndModules) {
    ASSERT_TRUE(config_init(ctx).ok());
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x2000, 3, std::uint16_t{7}, 1s).ok());
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x8010, 1, std::int32_t{40}, 1s).ok());
    EXPECT_EQ(SDOwrite(ctx, 1, 0x8010, 1, std::int32_t{501}, 1s).error().detail, 0x06090031U);
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1010, 1, kSave, 1s).ok());
    power_off_and_on();
    ASSERT_TRUE(config_init(ctx).ok());
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 1, 0x2000, 3, 1s), 7);
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 1, 0x2001, 3, 1s), 1);
    EXPECT_EQ(*SDOread<std::int32_t>(ctx, 1, 0x8010, 1, 1s), 40);
}

TEST_F(AuthorsCrane, TakesItsFirmwareInBoot) {
    ASSERT_TRUE(config_init(ctx).ok());
    const std::vector<std::byte> firmware(3000, std::byte{7});
    EXPECT_EQ(FOEwrite(ctx, 1, "firmware", 0, firmware).error().detail, 0x8008U) << "in BOOT only";
    to(AlState::boot);
    ASSERT_TRUE(FOEwrite(ctx, 1, "firmware", 0, firmware).ok());
    EXPECT_EQ(parts.file.octets, firmware.size());
    to(AlState::init);
    to(AlState::preop);
}

TEST_F(AuthorsCrane, KeepsTheRulesOfTheStandard) {
    using namespace samples::conformance;
    const auto checked = check_device(ctx, osal, nic.wait_handle(), 1, {});
    EXPECT_EQ(checked.error, "");
    EXPECT_TRUE(checked.report.conforms()) << report_text(checked.report, true);
    for (const auto* const name : {"clock.sync0", "modules.match", "modules.mismatch", "sync.types"}) {
        const auto check = std::ranges::find(checked.report.checks, name, &CheckResult::name);
        ASSERT_NE(check, checked.report.checks.end());
        EXPECT_EQ(check->outcome, Outcome::passed) << name << ": " << check->reason;
    }
}

}  // namespace
}  // namespace margay::subdevice
