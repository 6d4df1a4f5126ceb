// "split_io": a device with two SyncManagers in each direction. Its digital channels have SM2 and SM3, its analogue
// channels SM4 and SM5, whose PDOs the master may choose.
#include "sim/library/device_tables.hpp"
#include "subdevice/sync_objects.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;

struct SplitValues {
    using digital_out = Field<std::uint16_t, 0>;
    using analogue_out = Field<std::int16_t, digital_out::end>;  // two
    using digital_in = Field<std::uint16_t, analogue_out::end + 2>;
    using analogue_in = Field<std::int16_t, digital_in::end>;  // two
    using updates = Field<std::uint16_t, analogue_in::end + 2>;
    using digital_pins = Field<std::uint16_t, updates::end>;
    using analogue_pins = Field<std::int16_t, digital_pins::end>;  // two
    static constexpr std::size_t rx = analogue_pins::end + 2;
    static constexpr std::size_t tx = rx + kListBytes<std::uint16_t, 1>;
    static constexpr std::size_t sync = tx + kListBytes<std::uint16_t, 1>;
    static constexpr std::size_t sync4 = sync + SyncValues<sync>::bytes;
    static constexpr std::size_t sync5 = sync4 + MoreSyncValues<sync4>::bytes;
    static constexpr std::size_t bytes = sync5 + MoreSyncValues<sync5>::bytes;
};

constexpr ProcessDataArea kSplitMoreOutputs[] = {
    {.sync_manager = 4, .start = 0x1400, .max_bytes = 4, .watchdog = true}};
constexpr ProcessDataArea kSplitMoreInputs[] = {{.sync_manager = 5, .start = 0x1500, .max_bytes = 6}};

constexpr DeviceDescription split_device() {
    auto device = io_device({.product_code = 0x5024,
                             .name = "Digital and analogue I/O, two SyncManagers a direction",
                             .order_code = "MG5024",
                             .group = "Digital",
                             .output_bytes = 2,
                             .input_bytes = 2});
    device.more_outputs = kSplitMoreOutputs;
    device.more_inputs = kSplitMoreInputs;
    device.free_run_cycle = {};  // only the master causes updates
    return device;
}
constexpr auto kSplitDevice = split_device();
using SplitCommon = CommonObjects<kSplitDevice, 0x000F0191>;

constexpr auto kSplitOut = od::kReadWrite | od::kRxMappable;
constexpr auto kSplitIn = od::kRead | od::kTxMappable;
constexpr Entry kSplitDigitalOut[] = {value<SplitValues::digital_out>(0, "Digital outputs", kSplitOut)};
constexpr Entry kSplitAnalogueOut[] = {entry_count(2),
                                       value<SplitValues::analogue_out>(1, "Analogue output", kSplitOut).times(2)};
constexpr Entry kSplitDigitalIn[] = {value<SplitValues::digital_in>(0, "Digital inputs", kSplitIn)};
constexpr Entry kSplitAnalogueIn[] = {entry_count(2),
                                      value<SplitValues::analogue_in>(1, "Analogue input", kSplitIn).times(2)};
constexpr Entry kSplitUpdates[] = {value<SplitValues::updates>(0, "Updates", kSplitIn)};
constexpr Entry kSplitPins[] = {entry_count(3), value<SplitValues::digital_pins>(1, "Digital pins", od::kRead),
                                value<SplitValues::analogue_pins>(2, "Analogue terminal", od::kRead).times(2)};

constexpr Entry kSplitRxDigital[] = {entry_count(1), mapped(1, 0x7000, 0, 16)};
constexpr Entry kSplitRxAnalogue[] = {entry_count(2), mapped(1, 0x7010, 1, 16), mapped(2, 0x7010, 2, 16)};
constexpr Entry kSplitRxOne[] = {entry_count(1), mapped(1, 0x7010, 1, 16)};
constexpr Entry kSplitTxDigital[] = {entry_count(1), mapped(1, 0x6000, 0, 16)};
constexpr Entry kSplitTxAnalogue[] = {entry_count(2), mapped(1, 0x6010, 1, 16), mapped(2, 0x6010, 2, 16)};
constexpr Entry kSplitTxCounted[] = {entry_count(3), mapped(1, 0x6010, 1, 16), mapped(2, 0x6010, 2, 16),
                                     mapped(3, 0x6020, 0, 16)};
constexpr auto kSplitRxAssignment =
    changeable_list<std::uint16_t, 1>(SplitValues::rx, 1, "Assigned PDO", std::array<std::uint16_t, 1>{0x1601});
constexpr auto kSplitTxAssignment =
    changeable_list<std::uint16_t, 1>(SplitValues::tx, 1, "Assigned PDO", std::array<std::uint16_t, 1>{0x1A01});

constexpr auto kSplitSyncError = sync_error_entries<SplitValues::sync>(kSplitDevice);
constexpr auto kSplitSync2 = sync_output_entries<SplitValues::sync>(kSplitDevice);
constexpr auto kSplitSync3 = sync_input_entries<SplitValues::sync>(kSplitDevice);
constexpr auto kSplitSync4 = more_sync_output_entries<SplitValues::sync, SplitValues::sync4>(kSplitDevice);
constexpr auto kSplitSync5 = more_sync_input_entries<SplitValues::sync, SplitValues::sync5>(kSplitDevice);

constexpr auto kSplitObjects = with_common<SplitCommon>({
    record(0x10F1, "Sync error setting", kSplitSyncError),
    record(0x1600, "Digital outputs", kSplitRxDigital, nullptr, DataType::pdo_mapping),
    record(0x1601, "Analogue outputs", kSplitRxAnalogue, nullptr, DataType::pdo_mapping),
    record(0x1602, "One analogue output", kSplitRxOne, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Digital inputs", kSplitTxDigital, nullptr, DataType::pdo_mapping),
    record(0x1A01, "Analogue inputs", kSplitTxAnalogue, nullptr, DataType::pdo_mapping),
    record(0x1A02, "Analogue inputs and updates", kSplitTxCounted, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment of SM2", kOneRxPdo),
    array(0x1C13, "TxPDO assignment of SM3", kOneTxPdo),
    array(0x1C14, "RxPDO assignment of SM4", kSplitRxAssignment, &kPdoAssignmentHooks),
    array(0x1C15, "TxPDO assignment of SM5", kSplitTxAssignment, &kPdoAssignmentHooks),
    record(0x1C32, "Synchronization of SM2", kSplitSync2, &kSyncParameterHooks),
    record(0x1C33, "Synchronization of SM3", kSplitSync3, &kSyncParameterHooks),
    record(0x1C34, "Synchronization of SM4", kSplitSync4, &kSyncParameterHooks),
    record(0x1C35, "Synchronization of SM5", kSplitSync5, &kSyncParameterHooks),
    variable(0x6000, "Digital inputs", kSplitDigitalIn),
    array(0x6010, "Analogue inputs", kSplitAnalogueIn),
    variable(0x6020, "Updates", kSplitUpdates),
    variable(0x7000, "Digital outputs", kSplitDigitalOut),
    array(0x7010, "Analogue outputs", kSplitAnalogueOut),
    record(0x9000, "Levels of the outputs", kSplitPins),
});
static_assert(well_formed(kSplitObjects, SplitValues::bytes));

class SplitIo final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kSplitDevice; }
    void start(const Surroundings& around, Time) override { image_ = around.dictionary->image(); }
    void cycle(Time, bool) override {
        copy(SplitValues::digital_in::offset, 6, terminals_, 0);
        SplitValues::updates::store(image_, static_cast<std::uint16_t>(SplitValues::updates::load(image_) + 1u));
        drive();
    }
    void safe_outputs(Time) override { drive(); }
    // The levels of the inputs: the digital channels, then the two analogue channels.
    [[nodiscard]] MutableBytes measured() override { return terminals_; }

  private:
    void drive() { copy(SplitValues::digital_pins::offset, 6, image_, SplitValues::digital_out::offset); }
    void copy(std::size_t to, std::size_t bytes, Bytes from, std::size_t at) {
        std::ranges::copy(from.subspan(at, bytes), image_.subspan(to).begin());
    }

    MutableBytes image_;
    std::array<std::byte, 6> terminals_{};
};

}  // namespace

constexpr Blueprint kSplitIo = blueprint<SplitIo>("split_io", kSplitDevice, kSplitObjects, SplitValues::bytes);

}  // namespace margay::sim
