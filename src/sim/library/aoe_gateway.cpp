// "aoe_gateway": a gateway to another fieldbus with two subordinates, without process data. All three devices speak
// AoE:
//
//     the gateway itself: port 1, the NetID that the master sets
//     the subordinates:   port 1001, NetIDs 10.0.0.1.2.1 and 10.0.0.2.2.1
//
// Each device has 256 octets at index group 0x100 (the index offset is the first octet), a counter of 32 bits at index
// 0x200:0 that counts 10 ms, and at index 0x300:0 a command that returns the written octets in reverse order. Write
// control starts and stops the counter.
#include "sim/library/device_tables.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;

constexpr DeviceDescription kGatewayDescription{
    .vendor_id = kVendorId,
    .product_code = 0x6751,
    .revision = 1,
    .name = "Gateway with AoE",
    .order_code = "MG6751",
    .group = "Tools",
    .protocols = {.aoe = true, .coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 256, .min_bytes = 96, .max_bytes = 1024},
                {.start = 0x1400, .size_bytes = 256, .min_bytes = 96, .max_bytes = 1024}},
};
using GatewayCommon = CommonObjects<kGatewayDescription, 0>;

constexpr Object kGatewayObjects[] = {GatewayCommon::device_type, GatewayCommon::error_history,
                                      GatewayCommon::device_name, GatewayCommon::hardware,
                                      GatewayCommon::software,    GatewayCommon::identity,
                                      GatewayCommon::diagnosis,   GatewayCommon::sync_manager_types};

constexpr std::uint32_t kMemory = 0x100;
constexpr AoeIndex kCounter{0x200, 0};
constexpr AoeIndex kReverse{0x300, 0};

class Subordinate final : public AoeDevice {
  public:
    explicit Subordinate(std::string_view name) : name_(name) {}

    AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time now) override {
        if (index == kCounter) {
            if (into.size() != sizeof(std::uint32_t)) return AoeError::invalid_size;
            constexpr Duration kStep = std::chrono::milliseconds(10);
            store_le(into, 0, static_cast<std::uint32_t>((stopped_ ? at_ : now).time_since_epoch() / kStep));
            bytes = into.size();
            return AoeError::none;
        }
        if (index.group != kMemory) return AoeError::invalid_group;
        if (index.offset >= memory_.size()) return AoeError::invalid_offset;
        bytes = std::min(into.size(), memory_.size() - index.offset);
        std::copy_n(memory_.begin() + index.offset, bytes, into.begin());
        return AoeError::none;
    }
    AoeError write(AoeIndex index, Bytes data, Time) override {
        if (index == kCounter) return AoeError::access_denied;
        if (index.group != kMemory) return AoeError::invalid_group;
        if (index.offset >= memory_.size()) return AoeError::invalid_offset;
        if (data.size() > memory_.size() - index.offset) return AoeError::invalid_size;
        std::ranges::copy(data, memory_.begin() + index.offset);
        return AoeError::none;
    }
    AoeError read_write(AoeIndex index, Bytes written, MutableBytes into, std::size_t& bytes, Time) override {
        if (index != kReverse) return AoeError::invalid_group;
        bytes = std::min(written.size(), into.size());
        std::copy_n(written.rbegin(), bytes, into.begin());
        return AoeError::none;
    }
    AoeError write_control(AdsState state, std::uint16_t, Bytes, Time now) override {
        if (state != AdsState::run && state != AdsState::stop) return AoeError::invalid_state;
        stopped_ = state == AdsState::stop;
        at_ = now;
        return AoeError::none;
    }
    [[nodiscard]] AdsState state() const override { return stopped_ ? AdsState::stop : AdsState::run; }
    [[nodiscard]] std::uint16_t device_state() const override { return 0x0042; }
    [[nodiscard]] AoeIdentity identity() const override { return {1, 2, 345, name_}; }

  private:
    std::string_view name_;
    std::array<std::byte, 256> memory_{};
    bool stopped_ = false;
    Time at_{};
};

class AoeGateway final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kGatewayDescription; }
    [[nodiscard]] AoeServer* aoe() override { return &server_; }

  private:
    Subordinate own_{"Gateway"};
    Subordinate first_{"Subordinate 1"};
    Subordinate second_{"Subordinate 2"};
    std::array<AoeRoute, 3> routes_{
        {{&own_, 1}, {&first_, 1001, true, {{10, 0, 0, 1, 2, 1}}}, {&second_, 1001, true, {{10, 0, 0, 2, 2, 1}}}}};
    std::array<AoeWatch, 4> watches_{};
    AoeServer server_{routes_, watches_};
};

}  // namespace

constexpr Blueprint kAoeGateway =
    blueprint<AoeGateway>("aoe_gateway", kGatewayDescription, kGatewayObjects, 0, {.pdi_control = kSpi});

}  // namespace margay::sim
