// "voe_device": a device with messages of its vendor (VoE), without process data. Messages of vendor 0x00004D47:
//
//     type 1: the device sends the same message back
//     type 2: period in milliseconds, number of messages, octets of a message (16 bits each): from now on the device
//             sends messages of type 3 on its own: a counter of 32 bits, then octets that count upwards
//
// Messages of vendor 0x00001234, any type: the device sends the octets back in reverse order, with the next type. Other
// messages get a mailbox error.
#include "sim/library/device_tables.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;

constexpr DeviceDescription kVoeDescription{
    .vendor_id = kVendorId,
    .product_code = 0x5F0E,
    .revision = 1,
    .name = "Device with VoE",
    .order_code = "MG5F0E",
    .group = "Tools",
    .protocols = {.coe = true, .voe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 34, .max_bytes = 512},
                {.start = 0x1200, .size_bytes = 128, .min_bytes = 34, .max_bytes = 512}},
};
using VoeCommon = CommonObjects<kVoeDescription, 0>;

constexpr Object kVoeObjects[] = {VoeCommon::device_type, VoeCommon::error_history,     VoeCommon::device_name,
                                  VoeCommon::hardware,    VoeCommon::software,          VoeCommon::identity,
                                  VoeCommon::diagnosis,   VoeCommon::sync_manager_types};

constexpr std::uint32_t kOtherVendor = 0x1234;
constexpr std::uint16_t kEcho = 1;
constexpr std::uint16_t kStart = 2;
constexpr std::uint16_t kTick = 3;

class VoeDevice final : public Model, private VoeApplication {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kVoeDescription; }
    [[nodiscard]] VoeServer* voe() override { return &server_; }
    void start(const Surroundings&, Time) override { left_ = 0; }

  private:
    Time step(VoeServer& server, Time now) override {
        while (left_ != 0 && now >= due_) {
            std::array<std::byte, 512> data{};
            store_le(data, 0, counter_++);
            for (std::size_t n = 4; n < data.size(); ++n) data[n] = static_cast<std::byte>(n);
            (void)server.send({kVendorId, kTick}, Bytes(data).first(bytes_));
            due_ += period_;
            --left_;
        }
        return left_ == 0 ? kNever : due_;
    }
    bool received(VoeServer& server, const VoeHeader& header, Bytes data, Time now) override {
        if (header.vendor_id == kOtherVendor) {
            std::vector<std::byte> reversed(data.rbegin(), data.rend());
            (void)server.send({kOtherVendor, static_cast<std::uint16_t>(header.vendor_type + 1)}, reversed);
            return true;
        }
        if (header.vendor_id != kVendorId) return false;
        if (header.vendor_type == kEcho) {
            (void)server.send(header, data);
            return true;
        }
        if (header.vendor_type != kStart || data.size() != 6) return false;
        period_ = std::chrono::milliseconds(std::max<int>(load_le<std::uint16_t>(data, 0), 1));
        left_ = load_le<std::uint16_t>(data, 2);
        bytes_ = std::clamp<std::size_t>(load_le<std::uint16_t>(data, 4), 4, 512);
        due_ = now + period_;
        counter_ = 0;
        return true;
    }

    std::array<std::byte, 2048> memory_{};
    VoeServer server_{*this, memory_};
    Duration period_{};
    Time due_{};
    std::uint16_t left_ = 0;
    std::size_t bytes_ = 4;
    std::uint32_t counter_ = 0;
};

}  // namespace

constexpr Blueprint kVoeDevice =
    blueprint<VoeDevice>("voe_device", kVoeDescription, kVoeObjects, 0, {.pdi_control = kSpi});

}  // namespace margay::sim
