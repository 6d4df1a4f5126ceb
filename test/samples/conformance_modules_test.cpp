// The checks of subdevice_check: a modular device whose author uses the indices after the last slot passes. The device
// reports its shortest cycle.
#include "samples/conformance.hpp"
#include "sim/process_data.hpp"
#include "subdevice/modules.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"

#include <memory>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using namespace subdevice;

struct ShelfValues {
    Le<std::uint16_t> supply;
    std::array<std::byte, SyncValues<0>::bytes> sync;
};
struct ShelfLamp {
    Le<std::uint16_t> lamps;
};
constexpr Entry kShelfLamps[] = {entry_count(1),
                                 value<&ShelfLamp::lamps>(1, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kShelfLampPdo[] = {entry_count(1), mapped(1, 0x7000, 1, 16)};
constexpr Object kShelfLampModule[] = {record(0x1600, "Lamps", kShelfLampPdo, nullptr, DataType::pdo_mapping),
                                       record(0x7000, "Lamps", kShelfLamps)};
constexpr ModuleKind kShelfKinds[] = {
    {.ident = 0x21, .name = "16 lamps", .objects = kShelfLampModule, .value_bytes = sizeof(ShelfLamp)}};
constexpr std::uint16_t kShelfOwnPdos[] = {0x1AF0};
constexpr ModularDevice kShelf{.kinds = kShelfKinds, .slots = 2, .own_tx_pdos = kShelfOwnPdos};
using ShelfTables = ModuleTables<kShelf, sizeof(ShelfValues)>;
constexpr DeviceDescription kShelfDevice{
    .vendor_id = 0x4D47,
    .product_code = 0x9A,
    .name = "Shelf",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = ShelfTables::most_bytes(true), .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1600, .max_bytes = 2},
    .dc = {.supported = true, .min_cycle = 100us}};
constexpr auto kShelfSync = sync_output_entries<offset_of(&ShelfValues::sync)>(kShelfDevice);
constexpr Entry kShelfSupply[] = {entry_count(1),
                                  value<&ShelfValues::supply>(1, "Supply", od::kRead | od::kTxMappable)};
constexpr Entry kShelfSupplyPdo[] = {entry_count(1), mapped(1, 0x6F00, 1, 16)};
constexpr Object kShelfOwn[] = {record(0x1AF0, "Supply", kShelfSupplyPdo, nullptr, DataType::pdo_mapping),
                                record(0x1C32, "Output sync", kShelfSync, &kSyncParameterHooks),
                                record(0x6F00, "Supply", kShelfSupply)};
constexpr auto kShelfObjects = joined(kShelfOwn, ShelfTables::kObjects);
using ShelfStack = StandardDevice<kShelfDevice, kShelfObjects, std::array<std::byte, ShelfTables::end>, 0, 0x1389,
                                  ShelfTables::kMostMapped + 1>;
static_assert(well_formed(kShelfObjects, ShelfTables::end, kShelf));

class ShelfApplication final : public Application {
  public:
    ShelfApplication() { slots_.detect(1, 0x21); }
    [[nodiscard]] const DeviceDescription& description() const override { return kShelfDevice; }
    [[nodiscard]] ModuleLayout* modules() override { return &slots_; }

  private:
    ModuleMemory<ShelfTables> memory_;
    Modules slots_{memory_};
};

class ShelfFirmware final : public sim::Firmware {
  public:
    void start(EscAccess& esc, Time now) override {
        all_ = std::make_unique<All>(esc);
        all_->stack.device.start(now);
    }
    Time step(Time now) override { return std::min(all_->stack.device.step(now), now + 50us); }

  private:
    struct All {
        explicit All(EscAccess& esc) : stack(esc, application, memory) {}
        ShelfStack::Memory memory;
        ShelfApplication application;
        ShelfStack stack;
    };
    std::unique_ptr<All> all_;
};

// The SII is in the state of the factory. Since then the user has removed a module.
TEST(SubdeviceCheckModules, TheSiiNeedNotDescribeTheModulesThatAreThere) {
    auto device = sim::make_device("modular_io").value();
    device.firmware->process_data()->inputs()[1] = std::byte{0};
    const auto report = check_it(std::move(device), {.only = "pdos.,eeprom."}).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_EQ(find(report, "pdos.sii")->outcome, Outcome::not_applicable);
}

TEST(SubdeviceCheckModules, ObjectsBehindTheLastSlotBelongToTheDevice) {
    std::array<std::byte, ShelfTables::end> values{};
    ShelfApplication application;
    ObjectDictionary dictionary(ShelfStack::Objects::kObjects, values);
    application.modules()->lay_out(dictionary);
    SiiWorkspace<4, 16> workspace;
    sim::Device device{
        .chip = sim::chip_by_name("et1100").value(), .sii = std::vector<std::byte>(2048), .firmware = {}};
    ASSERT_TRUE(write_sii(kShelfDevice, {}, dictionary, workspace, device.sii).ok());
    device.firmware = std::make_unique<ShelfFirmware>();
    const auto report = check_it(std::move(device)).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_FALSE(has(report, "clock.cycle_short", Severity::remark));
    for (const auto* const name :
         {"modules.lists", "modules.match", "modules.mismatch", "clock.sync0", "clock.cycle_short"})
        EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << "\n" << report_text(report, true);
}

}  // namespace
}  // namespace margay::samples::conformance
