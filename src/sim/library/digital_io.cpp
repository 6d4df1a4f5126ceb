// "digital_io_16": 16 inputs and 16 outputs on a processor, with settings by CoE.
#include "sim/library/device_tables.hpp"

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr std::uint8_t kChannels = 16;

struct Values {
    static constexpr std::size_t inputs = 0;  // one octet per channel
    static constexpr std::size_t outputs = kChannels;
    using invert = Field<std::uint16_t, 2 * kChannels>;
    using rx = Field<std::uint8_t, invert::end>;
    static constexpr std::size_t bytes = rx::end;
};

constexpr auto kDevice = io_device({.product_code = 0x5016,
                                    .name = "Digital I/O, 16 inputs, 16 outputs",
                                    .order_code = "MG5016",
                                    .group = "Digital",
                                    .output_bytes = 2,
                                    .input_bytes = 2});
using Common = CommonObjects<kDevice, 0x00030191>;  // profile 401, digital inputs and outputs

constexpr Entry channels(const char* name, std::uint16_t access, std::size_t offset) {
    return Entry{.subindex = 1,
                 .count = kChannels,
                 .storage = Storage::image,
                 .type = DataType::boolean,
                 .access = access,
                 .bits = 1,
                 .offset = static_cast<std::uint32_t>(offset),
                 .name = name};
}
constexpr auto pdo(std::uint16_t index) {
    std::array<Entry, kChannels + 1> entries{};
    entries[0] = entry_count(kChannels);
    for (std::uint8_t n = 1; n <= kChannels; ++n) entries[n] = mapped(n, index, n, 1);
    return entries;
}

constexpr Entry kInputs[] = {entry_count(kChannels), channels("Input", od::kRead | od::kTxMappable, Values::inputs)};
constexpr Entry kOutputs[] = {entry_count(kChannels),
                              channels("Output", od::kReadWrite | od::kRxMappable, Values::outputs)};
constexpr auto kRxPdo = pdo(0x7000);
constexpr auto kTxPdo = pdo(0x6000);
constexpr Entry kSettings[] = {entry_count(1),
                               value<Values::invert>(1, "Invert inputs", od::kReadWrite | od::kBackup | od::kSettings)};

constexpr auto kObjects = with_common<Common>({
    record(0x1600, "Outputs", kRxPdo, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Inputs", kTxPdo, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kOneRxPdo),
    array(0x1C13, "TxPDO assignment", kOneTxPdo),
    array(0x6000, "Inputs", kInputs),
    array(0x7000, "Outputs", kOutputs),
    record(0x8000, "Settings", kSettings),
});
static_assert(well_formed(kObjects, Values::bytes));

class DigitalIo final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDevice; }
    void start(const Surroundings& around, Time) override { image_ = around.dictionary->image(); }
    void cycle(Time, bool) override {
        const unsigned level = load_le<std::uint16_t>(pins_) ^ unsigned { Values::invert::load(image_) };
        for (unsigned n = 0; n < kChannels; ++n) image_[Values::inputs + n] = static_cast<std::byte>(level >> n & 1u);
    }
    // The levels at the input pins, one bit per channel.
    [[nodiscard]] MutableBytes measured() override { return pins_; }

  private:
    MutableBytes image_;
    std::array<std::byte, 2> pins_{};
};

}  // namespace

constexpr Blueprint kDigitalIo = blueprint<DigitalIo>("digital_io_16", kDevice, kObjects, Values::bytes);

}  // namespace margay::sim
