// "eoe_gateway": a gateway with one Ethernet port and EoE. It passes the frames of the master on to the port, and
// frames of the port on to the master if they pass its address filter. It keeps the IP parameters of the master. Its
// inputs repeat its outputs.
#include "sim/library/device_tables.hpp"

#include <deque>

namespace margay::sim {

namespace {

using namespace subdevice;

constexpr DeviceDescription kEoeGatewayDevice = [] {
    DeviceDescription device = io_device({.product_code = 0x6601,
                                          .name = "Gateway with EoE",
                                          .order_code = "MG6601",
                                          .group = "Communication",
                                          .output_bytes = 2,
                                          .input_bytes = 2,
                                          .mailbox_bytes = 1024,
                                          .mailbox_room = 1486,
                                          .least_mailbox = 64});
    device.protocols.eoe = true;
    return device;
}();
using EoeGatewayCommon = CommonObjects<kEoeGatewayDevice, 0>;

struct EoeGatewayValues {
    using outputs = Field<std::uint16_t, 0>;
    using inputs = Field<std::uint16_t, 2>;
    static constexpr std::size_t bytes = inputs::end;
};

constexpr Entry kEoeGatewayIn[] = {value<EoeGatewayValues::inputs>(0, "Repeated outputs", od::kRead | od::kTxMappable)};
constexpr Entry kEoeGatewayOut[] = {value<EoeGatewayValues::outputs>(0, "Outputs", od::kReadWrite | od::kRxMappable)};
constexpr Entry kEoeGatewayRx[] = {entry_count(1), mapped(1, 0x7000, 0, 16)};
constexpr Entry kEoeGatewayTx[] = {entry_count(1), mapped(1, 0x6000, 0, 16)};

constexpr auto kEoeGatewayObjects = with_common<EoeGatewayCommon>({
    record(0x1600, "Outputs", kEoeGatewayRx, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Inputs", kEoeGatewayTx, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kOneRxPdo),
    array(0x1C13, "TxPDO assignment", kOneTxPdo),
    variable(0x6000, "Repeated outputs", kEoeGatewayIn),
    variable(0x7000, "Outputs", kEoeGatewayOut),
});
static_assert(well_formed(kEoeGatewayObjects, EoeGatewayValues::bytes));

constexpr std::uint8_t kOuterPort = 1;
constexpr std::size_t kMostWaiting = 64;  // frames of the port
constexpr std::size_t kMostOctets = 1536;

class EoeGateway final : public Model, public EthernetPort, private EoeApplication {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kEoeGatewayDevice; }
    [[nodiscard]] EoeServer* eoe() override { return &server_; }
    [[nodiscard]] EthernetPort* ethernet() override { return this; }
    void start(const Surroundings& around, Time) override {
        image_ = around.dictionary->image();
        waiting_.clear();
        ip_ = {};
        filter_ = {};
        server_.append_time_stamp = false;
    }
    void cycle(Time, bool) override {
        EoeGatewayValues::inputs::store(image_, EoeGatewayValues::outputs::load(image_));
    }

    void connect(EthernetPeer* peer) override { peer_ = peer; }
    [[nodiscard]] bool has_room() const override { return waiting_.size() < kMostWaiting; }
    bool put(Bytes frame) override {
        if (!has_room() || frame.size() < wire::eoe::kLeastFrameBytes || frame.size() > kMostOctets) return false;
        waiting_.emplace_back(frame.begin(), frame.end());
        return true;
    }

  private:
    void received(EoeServer&, Bytes frame, Time now) override {
        if (peer_ != nullptr) peer_->arrived(frame, now);
    }
    Time step(EoeServer& server, Time) override {
        while (!waiting_.empty()) {
            const auto& frame = waiting_.front();
            MacAddress destination;
            for (std::size_t n = 0; n < destination.size(); ++n)
                destination[n] = std::to_integer<std::uint8_t>(frame[n]);
            if (filter_.passes(destination)) {
                if (!server.has_room(frame.size())) break;
                (void)server.send(frame, kOuterPort);
            }
            waiting_.pop_front();
        }
        return kNever;
    }
    [[nodiscard]] EoeResult set_ip(const EoeIp& ip) override {
        if (ip.mac) ip_.mac = ip.mac;
        if (ip.address) ip_.address = ip.address;
        if (ip.subnet_mask) ip_.subnet_mask = ip.subnet_mask;
        if (ip.default_gateway) ip_.default_gateway = ip.default_gateway;
        if (ip.dns_server) ip_.dns_server = ip.dns_server;
        if (ip.has_host_name) (void)ip_.set_host_name(ip.host_name());
        return EoeResult::success;
    }
    [[nodiscard]] EoeResult get_ip(EoeIp& ip) override {
        ip = ip_;
        return EoeResult::success;
    }
    [[nodiscard]] EoeResult set_filter(const EoeFilter& filter) override {
        filter_ = filter;
        return EoeResult::success;
    }
    [[nodiscard]] EoeResult get_filter(EoeFilter& filter) override {
        filter = filter_;
        return EoeResult::success;
    }

    std::array<std::byte, kMostOctets> assembly_{};
    std::array<std::byte, 16 * kMostOctets> memory_{};
    EoeServer server_{*this, assembly_, memory_};
    MutableBytes image_;
    std::deque<std::vector<std::byte>> waiting_;
    EthernetPeer* peer_ = nullptr;
    EoeIp ip_;
    EoeFilter filter_;
};

}  // namespace

constexpr Blueprint kEoeGateway =
    blueprint<EoeGateway>("eoe_gateway", kEoeGatewayDevice, kEoeGatewayObjects, EoeGatewayValues::bytes);

}  // namespace margay::sim
