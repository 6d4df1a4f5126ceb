// A StandardDevice with its own values and PDOs and with modules. Each PDO is at the place in the assignment, in the
// dictionary and in the SII.
#include "subdevice/modules.hpp"

#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"

#include <gtest/gtest.h>

namespace margay::subdevice {
namespace {

constexpr auto kStationOut = od::kReadWrite | od::kRxMappable;
constexpr auto kStationIn = od::kRead | od::kTxMappable;

struct StationValues {
    Le<std::uint16_t> status;
    Le<std::uint16_t> relay;
};
struct ValveValues {
    std::array<std::uint8_t, 2> coils;
};
struct ProbeValues {
    Le<std::uint16_t> level;
    std::array<char, 300> label;
};

constexpr Entry kCoils[] = {entry_count(2), flag<&ValveValues::coils>(1, "Coil", kStationOut)};
constexpr Entry kCoilPdo[] = {entry_count(2), mapped(1, 0x7000, 1, 1), mapped(2, 0x7000, 2, 1)};
constexpr Object kValve[] = {record(0x1600, "Coils", kCoilPdo, nullptr, DataType::pdo_mapping),
                             array(0x7000, "Coils", kCoils)};
constexpr Entry kLevel[] = {entry_count(1), value<&ProbeValues::level>(1, "Level", kStationIn)};
constexpr Entry kLabel[] = {entry_count(1),
                            octets<&ProbeValues::label>(1, "Label", DataType::visible_string, od::kReadWrite)};
constexpr Entry kLevelPdo[] = {entry_count(1), mapped(1, 0x6000, 1, 16)};
constexpr Object kProbe[] = {record(0x1A00, "Level", kLevelPdo, nullptr, DataType::pdo_mapping),
                             record(0x6000, "Level", kLevel), record(0x8000, "Label", kLabel)};
constexpr ModuleKind kStationKinds[] = {
    {.ident = 0x10, .name = "Valves", .objects = kValve, .value_bytes = sizeof(ValveValues)},
    {.ident = 0x20, .name = "Probe", .objects = kProbe, .value_bytes = sizeof(ProbeValues)}};
constexpr std::uint16_t kStationTx[] = {0x1AF0};
constexpr std::uint16_t kStationRx[] = {0x16F0};
constexpr ModularDevice kStation{
    .kinds = kStationKinds, .slots = 2, .own_rx_pdos = kStationRx, .own_tx_pdos = kStationTx};
using StationTables = ModuleTables<kStation, sizeof(StationValues)>;

constexpr DeviceDescription kStationDevice{
    .vendor_id = 1,
    .product_code = 2,
    .name = "Station",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1200, .max_bytes = StationTables::most_bytes(true) + 2},
    .inputs = {.sync_manager = 3, .start = 0x1400, .max_bytes = StationTables::most_bytes(false) + 2}};
constexpr Entry kStationStatus[] = {value<&StationValues::status>(0, "Status", kStationIn)};
constexpr Entry kStationRelay[] = {value<&StationValues::relay>(0, "Relay", kStationOut)};
constexpr Entry kStationTxPdo[] = {entry_count(1), mapped(1, 0x2000, 0, 16)};
constexpr Entry kStationRxPdo[] = {entry_count(1), mapped(1, 0x2001, 0, 16)};
constexpr Object kStationOwn[] = {record(0x16F0, "Station", kStationRxPdo, nullptr, DataType::pdo_mapping),
                                  record(0x1AF0, "Station", kStationTxPdo, nullptr, DataType::pdo_mapping),
                                  variable(0x2000, "Status", kStationStatus), variable(0x2001, "Relay", kStationRelay)};
constexpr auto kStationObjects = joined(kStationOwn, StationTables::kObjects);
using Station = StandardDevice<kStationDevice, kStationObjects, std::array<std::byte, StationTables::end>, 0, 0x1389,
                               StationTables::kMostMapped + 1, StationTables::kLargestValue>;
static_assert(well_formed(Station::Objects::kObjects, StationTables::end, kStation));

struct ModularStation : ::testing::Test {
    std::array<std::byte, StationTables::end> values{};
    ModuleMemory<StationTables> memory;
    Modules modules{memory};
    ObjectDictionary dictionary{Station::Objects::kObjects, values};

    void plug(std::uint32_t first, std::uint32_t second) {
        modules.detect(1, first);
        modules.detect(2, second);
        modules.lay_out(dictionary);
    }
};

TEST_F(ModularStation, ThePdoOfAModuleIsNotHiddenByAListOfTheOwnValues) {
    plug(0x10, 0x20);
    EXPECT_EQ(modules.check(), AlStatusCode::none);
    EXPECT_EQ(dictionary.number(0x1600, 1), 0x70000101U);
    plug(0x20, 0x10);
    EXPECT_EQ(modules.check(), AlStatusCode::none);
    EXPECT_EQ(dictionary.number(0x1A00, 1), 0x60000110U);
}

TEST_F(ModularStation, AModuleWhoseObjectTheDeviceHasItselfIsRefused) {
    static constexpr Object kTwice[] = {record(0x1600, "Coils", kStationRxPdo, nullptr, DataType::pdo_mapping)};
    static constexpr auto kObjects = joined(kTwice, joined(kStationOwn, StationTables::kObjects));
    ObjectDictionary with_twice(kObjects, values);
    modules.detect(1, 0x20);
    modules.lay_out(with_twice);
    EXPECT_EQ(modules.check(), AlStatusCode::none);
    modules.detect(1, 0x10);
    modules.lay_out(with_twice);
    EXPECT_EQ(modules.check(), AlStatusCode::unspecified);
}

// A master that maps by the SII finds the process data at the places of the assignment.
TEST_F(ModularStation, TheSiiHasThePdosInTheOrderOfTheirAssignment) {
    plug(0x20, 0x20);
    SiiWorkspace<16, 64> workspace;
    std::array<std::byte, 4096> image{};
    ASSERT_TRUE(write_sii(kStationDevice, {}, dictionary, workspace, image).ok());
    std::vector<std::uint16_t> inputs;
    for (const auto& pdo : workspace.pdos)
        if (pdo.sync_manager == 3) inputs.push_back(pdo.index);
    std::vector<std::uint16_t> assigned;
    for (unsigned n = 1; n <= dictionary.number(0x1C13, 0); ++n)
        assigned.push_back(static_cast<std::uint16_t>(dictionary.number(0x1C13, n)));
    EXPECT_EQ(assigned, (std::vector<std::uint16_t>{0x1AF0, 0x1A00, 0x1A01}));
    EXPECT_EQ(inputs, assigned);
}

TEST_F(ModularStation, TheLargestValueOfAModuleCanBeWritten) {
    EXPECT_GE(sizeof(Station::Memory{}.staging), 300U);
    EXPECT_EQ(StationTables::kLargestValue, 303U);
}

// Members of base classes have the offset in their base class, so two values would lie in the same octets.
TEST(StructOfValues, ValuesLieApart) {
    static constexpr Entry kA[] = {value<&StationValues::status>(0, "Status", kStationIn)};
    static constexpr Entry kB[] = {value<&StationValues::relay>(0, "Relay", kStationOut)};
    static constexpr Entry kAgain[] = {value<&StationValues::status>(0, "Status", kStationOut)};
    static constexpr Object kApart[] = {variable(0x2000, "Status", kA), variable(0x2001, "Relay", kB)};
    static constexpr Object kSame[] = {variable(0x2000, "Status", kA), variable(0x2001, "Status", kAgain)};
    EXPECT_TRUE(standard::lie_apart<2>(kApart));
    EXPECT_FALSE(standard::lie_apart<2>(kSame));
    // An object of the stack with a wrong offset.
    static constexpr Object kOver[] = {variable(0x10F8, "Status", kAgain), variable(0x2000, "Status", kA)};
    static constexpr Object kShown[] = {variable(0x1008, "Status", kA), variable(0x1009, "Status", kAgain)};
    EXPECT_FALSE(standard::lie_apart<2>(kOver));
    EXPECT_TRUE(standard::lie_apart<2>(kShown)) << "two objects of the communication show one value";
}

TEST(SyncObjects, ADeviceThatRequiresTheClockAnnouncesNothingElse) {
    constexpr DeviceDescription kRequired{.dc = {.supported = true, .required = true},
                                          .free_run_cycle = std::chrono::milliseconds(2)};
    EXPECT_EQ(sync_entry::supported(kRequired), 4U);
    constexpr DeviceDescription kByChoice{.dc = {.supported = true}, .free_run_cycle = std::chrono::milliseconds(2)};
    EXPECT_EQ(sync_entry::supported(kByChoice), 7U);
}

}  // namespace
}  // namespace margay::subdevice
