// "dc_bridge": one half of a bridge between two segments (sim/clock_bridge.hpp connects two of them). Its inputs have
// the time stamps of both clocks, taken at the same moment, as object 0x10F4 "External synchronization status"
// (ETG.1020 "External synchronization"), and the outputs of the other half.
#include "sim/clock_bridge.hpp"
#include "sim/library/device_tables.hpp"

namespace margay::sim {

namespace {

using namespace subdevice;

constexpr DeviceDescription kDcBridgeDevice = io_device({.product_code = 0x6701,
                                                         .name = "Bridge between two segments",
                                                         .order_code = "MG6701",
                                                         .group = "Communication",
                                                         .output_bytes = 4,
                                                         .input_bytes = 26});
using DcBridgeCommon = CommonObjects<kDcBridgeDevice, 0>;

struct DcBridgeValues {
    using outputs = Field<std::uint32_t, 0>;
    using inputs = Field<std::uint32_t, 4>;
    using control_toggle = Field<std::uint8_t, 8>;
    using stamp_toggle = Field<std::uint8_t, 9>;
    using not_connected = Field<std::uint8_t, 10>;
    using internal = Field<std::uint64_t, 11>;
    using external = Field<std::uint64_t, 19>;
    using control = Field<std::int32_t, 27>;
    static constexpr std::size_t bytes = control::end;
};

constexpr auto kDcBridgeRead = od::kRead | od::kTxMappable;
constexpr Entry kDcBridgeStatus[] = {
    entry_count(0x13),
    flag<DcBridgeValues::control_toggle>(0x0E, "Control value update toggle", kDcBridgeRead),
    flag<DcBridgeValues::stamp_toggle>(0x0F, "Time stamp update toggle", kDcBridgeRead),
    flag<DcBridgeValues::not_connected>(0x10, "External device not connected", kDcBridgeRead),
    value<DcBridgeValues::internal>(0x11, "Internal time stamp", kDcBridgeRead),
    value<DcBridgeValues::external>(0x12, "External time stamp", kDcBridgeRead),
    value<DcBridgeValues::control>(0x13, "Control value for DC master clock", kDcBridgeRead)};
constexpr Entry kDcBridgeIn[] = {value<DcBridgeValues::inputs>(0, "Outputs of the other half", kDcBridgeRead)};
constexpr Entry kDcBridgeOut[] = {value<DcBridgeValues::outputs>(0, "Outputs", od::kReadWrite | od::kRxMappable)};
constexpr Entry kDcBridgeRx[] = {entry_count(1), mapped(1, 0x7000, 0, 32)};
constexpr Entry kDcBridgeTx[] = {entry_count(8),
                                 mapped(1, 0x6000, 0, 32),
                                 mapped(2, 0, 0, 13),
                                 mapped(3, 0x10F4, 0x0E, 1),
                                 mapped(4, 0x10F4, 0x0F, 1),
                                 mapped(5, 0x10F4, 0x10, 1),
                                 mapped(6, 0x10F4, 0x11, 64),
                                 mapped(7, 0x10F4, 0x12, 64),
                                 mapped(8, 0x10F4, 0x13, 32)};

constexpr auto kDcBridgeObjects = with_common<DcBridgeCommon>({
    record(0x10F4, "External synchronization status", kDcBridgeStatus),
    record(0x1600, "Outputs", kDcBridgeRx, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Inputs", kDcBridgeTx, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kOneRxPdo),
    array(0x1C13, "TxPDO assignment", kOneTxPdo),
    variable(0x6000, "Outputs of the other half", kDcBridgeIn),
    variable(0x7000, "Outputs", kDcBridgeOut),
});
static_assert(well_formed(kDcBridgeObjects, DcBridgeValues::bytes));

class DcBridge final : public Model, public BridgeHalf {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDcBridgeDevice; }
    [[nodiscard]] BridgeHalf* bridge() override { return this; }
    void start(const Surroundings& around, Time) override {
        image_ = around.dictionary->image();
        DcBridgeValues::not_connected::store(image_, 1);
    }
    void cycle(Time now, bool) override {
        const bool there = links_.other_clock != nullptr && links_.other_clock->powered();
        DcBridgeValues::not_connected::store(image_, there ? 0 : 1);
        if (!there) return;
        const auto internal = links_.own->system_time_ns(now);
        const auto external = links_.other_clock->system_time_ns(now);
        DcBridgeValues::internal::store(image_, internal);
        DcBridgeValues::external::store(image_, external);
        DcBridgeValues::control::store(image_,
                                       static_cast<std::int32_t>(static_cast<std::uint32_t>(external - internal)));
        DcBridgeValues::stamp_toggle::store(image_, DcBridgeValues::stamp_toggle::load(image_) ^ 1U);
        DcBridgeValues::control_toggle::store(image_, DcBridgeValues::control_toggle::load(image_) ^ 1U);
        DcBridgeValues::inputs::store(image_, links_.other->sent());
    }

    void connect(const Links& links) override { links_ = links; }
    [[nodiscard]] std::uint32_t sent() const override {
        return image_.empty() ? 0 : DcBridgeValues::outputs::load(image_);
    }

  private:
    MutableBytes image_;
    Links links_;
};

}  // namespace

constexpr Blueprint kDcBridge =
    blueprint<DcBridge>("dc_bridge", kDcBridgeDevice, kDcBridgeObjects, DcBridgeValues::bytes);

}  // namespace margay::sim
