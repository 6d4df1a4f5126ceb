// A device that has every mailbox protocol, each with data that a test can compare: an object of 600 octets, a file, an
// IDN, a memory, echoed Ethernet frames and echoed vendor messages. Its inputs repeat its outputs. All of this works in
// PREOP, SAFEOP and OP.
#pragma once

#include "mailbox/mailbox_bus.hpp"
#include "sim/library/device_tables.hpp"

#include <algorithm>

namespace margay {

namespace all_protocols {

using namespace subdevice;

inline constexpr std::size_t kObjectBytes = 600;
inline constexpr std::size_t kFileBytes = 4000;
inline constexpr std::uint16_t kObject = 0x2000;
inline constexpr Idn kIdn = Idn::product(7);
inline constexpr AoeAddress kAoeTarget{{{1, 2, 3, 4, 5, 6}}, 10};

// The device has no watchdog, because a test with real threads may be late.
inline constexpr DeviceDescription kDescription = [] {
    auto device = sim::io_device({.product_code = 0xA11,
                                  .name = "Every protocol",
                                  .order_code = "A11",
                                  .group = "Test",
                                  .output_bytes = 2,
                                  .input_bytes = 2});
    device.protocols = {.aoe = true, .eoe = true, .coe = true, .foe = true, .soe = true, .voe = true};
    device.outputs.watchdog = false;
    return device;
}();
using Common = sim::CommonObjects<kDescription, 0>;

struct Values {
    using outputs = Field<std::uint16_t, 0>;
    using inputs = Field<std::uint16_t, 2>;
    static constexpr std::size_t block = inputs::end;
    static constexpr std::size_t bytes = block + kObjectBytes;
};
inline constexpr Entry kBlock[] = {
    octets(0, "Block", DataType::octet_string, od::kReadWrite, Values::block, kObjectBytes)};
inline constexpr Entry kIn[] = {value<Values::inputs>(0, "Repeated outputs", od::kRead | od::kTxMappable)};
inline constexpr Entry kOut[] = {value<Values::outputs>(0, "Outputs", od::kReadWrite | od::kRxMappable)};
inline constexpr Entry kRx[] = {entry_count(1), mapped(1, 0x7000, 0, 16)};
inline constexpr Entry kTx[] = {entry_count(1), mapped(1, 0x6000, 0, 16)};
inline constexpr auto kObjects = sim::with_common<Common>({
    record(0x1600, "Outputs", kRx, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Inputs", kTx, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", sim::kOneRxPdo),
    array(0x1C13, "TxPDO assignment", sim::kOneTxPdo),
    variable(kObject, "Block", kBlock),
    variable(0x6000, "Repeated outputs", kIn),
    variable(0x7000, "Outputs", kOut),
});

inline constexpr SoeParameter kParameters[] = {soe_value<Field<std::uint32_t, 0>>(kIdn, "Number")};

class Device final : public sim::Model,
                     private FoeStore,
                     private VoeApplication,
                     private EoeApplication,
                     private SoeApplication,
                     private AoeDevice {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDescription; }
    [[nodiscard]] FoeStore* files() override { return this; }
    [[nodiscard]] SoeServer* soe() override { return &soe_; }
    [[nodiscard]] VoeServer* voe() override { return &voe_; }
    [[nodiscard]] AoeServer* aoe() override { return &aoe_; }
    [[nodiscard]] EoeServer* eoe() override { return &eoe_; }
    void start(const sim::Surroundings& around, Time) override { image_ = around.dictionary->image(); }
    void cycle(Time, bool) override { Values::inputs::store(image_, Values::outputs::load(image_)); }

  private:
    // FoE: one file, which has any name.
    FoeAnswer open_to_read(const FoeFile&, Time) override { return FoeAnswer::go(); }
    FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time) override {
        bytes = std::min(into.size(), file_.size() - std::min(offset, file_.size()));
        std::copy_n(file_.begin() + static_cast<std::ptrdiff_t>(offset), bytes, into.begin());
        return FoeAnswer::go();
    }
    FoeAnswer open_to_write(const FoeFile&, Time) override {
        coming_.clear();
        return FoeAnswer::go();
    }
    FoeAnswer write(std::size_t, Bytes data, Time) override {
        if (coming_.size() + data.size() > kFileBytes) return FoeAnswer::error(FoeError::disk_full);
        coming_.insert(coming_.end(), data.begin(), data.end());
        return FoeAnswer::go();
    }
    FoeAnswer finish_write(std::size_t, Time) override {
        file_ = coming_;
        return FoeAnswer::go();
    }
    void give_up() override {}

    [[nodiscard]] bool received(VoeServer& server, const subdevice::VoeHeader& header, Bytes data, Time) override {
        (void)server.send(header, data);
        return true;
    }
    [[nodiscard]] EoeResult set_ip(const EoeIp& ip) override {
        ip_ = ip;
        return EoeResult::success;
    }
    [[nodiscard]] EoeResult get_ip(EoeIp& ip) override {
        ip = ip_;
        return EoeResult::success;
    }
    void received(EoeServer& server, Bytes frame, Time) override { (void)server.send(frame, 1); }
    Time step(VoeServer&, Time) override { return kNever; }
    Time step(EoeServer&, Time) override { return kNever; }

    [[nodiscard]] AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time) override {
        bytes = std::min(into.size(), memory_.size() - std::min<std::size_t>(index.offset, memory_.size()));
        std::copy_n(memory_.begin() + index.offset, bytes, into.begin());
        return AoeError::none;
    }
    [[nodiscard]] AoeError write(AoeIndex index, Bytes data, Time) override {
        if (index.offset + data.size() > memory_.size()) return AoeError::invalid_size;
        std::ranges::copy(data, memory_.begin() + index.offset);
        return AoeError::none;
    }

    MutableBytes image_;
    EoeIp ip_;
    std::vector<std::byte> file_;
    std::vector<std::byte> coming_;
    std::array<std::byte, 64> memory_{};
    std::array<std::byte, 4> drive_image_{};
    std::array<SoeDrive, 1> drives_{{{kParameters, drive_image_, this}}};
    std::array<std::byte, 128> staging_{};
    SoeServer soe_{drives_, staging_};
    std::array<std::byte, 1024> messages_{};
    VoeServer voe_{*this, messages_};
    std::array<AoeRoute, 1> routes_{{{this, kAoeTarget.port}}};
    std::array<AoeWatch, 2> watches_{};
    AoeServer aoe_{routes_, watches_};
    std::array<std::byte, 1536> assembly_{};
    std::array<std::byte, 4 * 1536> frames_{};
    EoeServer eoe_{*this, assembly_, frames_};
};

inline constexpr sim::Blueprint kBlueprint =
    sim::blueprint<Device>("every_protocol", kDescription, kObjects, Values::bytes);

[[nodiscard]] inline sim::Device make() { return sim::build(kBlueprint); }

}  // namespace all_protocols

}  // namespace margay
