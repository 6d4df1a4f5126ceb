// "soe_drive": a servo drive of the servo drive profile with two axes, without CoE.
#include "sim/library/device_tables.hpp"
#include "sim/library/soe_axis.hpp"

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr std::uint8_t kAxes = 2;
constexpr std::uint16_t kMost = kAxes * SoeAxis::kMostBytes;

constexpr DeviceDescription kDevice{
    .vendor_id = kVendorId,
    .product_code = 0x5204,
    .revision = 1,
    .name = "Servo drive with SoE, 2 axes",
    .order_code = "MG5204",
    .group = "Drives",
    .protocols = {.soe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 32, .max_bytes = 512},
                {.start = 0x1200, .size_bytes = 128, .min_bytes = 32, .max_bytes = 512}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = kMost, .sii_bytes = kAxes * 6, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1600, .max_bytes = kMost, .sii_bytes = kAxes * 10},
    .dc = {.supported = true, .min_cycle = 250us},
    .drive_axes = kAxes,
};

class ServoDrive final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDevice; }
    [[nodiscard]] SoeServer* soe() override { return &server_; }

    void start(const Surroundings&, Time now) override {
        for (auto& axis : axes_) axis.start(now);
    }
    // Load torque of each axis, 16 bits, in thousandths of the rated torque.
    [[nodiscard]] MutableBytes measured() override { return measured_; }
    Time advance(Time now) override {
        for (std::size_t n = 0; n < kAxes; ++n) {
            axes_[n].set_load(load_le<std::int16_t>(measured_, 2 * n));
            axes_[n].advance(now);
        }
        return kNever;
    }
    void cycle(Time now, bool) override { advance(now); }
    void after(subdevice::Transition transition, Time) override {
        for (auto& axis : axes_) axis.state_changed(transition.to);
    }
    void safe_outputs(Time) override {
        for (auto& axis : axes_) axis.stop();
    }

    std::optional<ProcessDataSizes> process_data_sizes() override {
        ProcessDataSizes sizes;
        for (const auto& axis : axes_) {
            sizes.outputs_bytes = static_cast<std::uint16_t>(sizes.outputs_bytes + axis.bytes(true));
            sizes.inputs_bytes = static_cast<std::uint16_t>(sizes.inputs_bytes + axis.bytes(false));
        }
        return sizes;
    }
    bool unpack_outputs(Bytes raw) override {
        for (auto& axis : axes_) {
            axis.take(raw);
            raw = raw.subspan(axis.bytes(true));
        }
        return true;
    }
    bool pack_inputs(MutableBytes raw) override {
        for (auto& axis : axes_) {
            axis.give(raw);
            raw = raw.subspan(axis.bytes(false));
        }
        return true;
    }

  private:
    std::array<std::byte, 2 * kAxes> measured_{};
    std::array<SoeAxis, kAxes> axes_{SoeAxis(0, server_), SoeAxis(1, server_)};
    std::array<SoeDrive, kAxes> drives_{axes_[0].drive(), axes_[1].drive()};
    std::array<std::byte, 512> staging_{};
    SoeServer server_{drives_, staging_};
};

}  // namespace

constexpr Blueprint kSoeDrive = blueprint<ServoDrive>(
    "soe_drive", kDevice, {}, 0, {.pdi_control = kSpiWithDc, .sync_pulse_length_10ns = kSyncPulse});

}  // namespace margay::sim
