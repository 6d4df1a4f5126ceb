// "analog_io_4_2": four analogue inputs with user scaling and limits, two analogue outputs with user scaling.
#include "sim/library/device_tables.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr unsigned kInputChannels = 4;
constexpr unsigned kOutputChannels = 2;
// End of the converter's range; larger values are overrange, smaller values underrange.
constexpr int kRangeEnd = 32000;

// Values of an input, of an output, and of the scaling settings, as offsets from the start of their block.
struct In {
    using underrange = Field<std::uint8_t, 0>;
    using overrange = Field<std::uint8_t, 1>;
    using limit = Field<std::uint8_t, 2>;  // 0: off or within the limits, 1: below, 2: above
    using error = Field<std::uint8_t, 3>;
    using toggle = Field<std::uint8_t, 4>;
    using value = Field<std::int16_t, 5>;
    using raw = Field<std::int16_t, 7>;
    static constexpr std::size_t bytes = 9;
};
struct Out {
    using value = Field<std::int16_t, 0>;
    using terminal = Field<std::int16_t, 2>;
    static constexpr std::size_t bytes = 4;
};
struct Scale {
    using on = Field<std::uint8_t, 0>;
    using offset = Field<std::int16_t, 1>;
    using gain = Field<std::int32_t, 3>;  // 65536 means a gain of 1
    using limits_on = Field<std::uint8_t, 7>;
    using low = Field<std::int16_t, 8>;
    using high = Field<std::int16_t, 10>;
    static constexpr std::size_t bytes = 12;
};
constexpr std::size_t in_at(unsigned n) { return n * In::bytes; }
constexpr std::size_t out_at(unsigned n) { return in_at(kInputChannels) + n * Out::bytes; }
// Settings of the inputs first, then of the outputs.
constexpr std::size_t scale_at(unsigned n) { return out_at(kOutputChannels) + n * Scale::bytes; }
constexpr std::size_t kImageBytes = scale_at(kInputChannels + kOutputChannels);

constexpr auto kDevice = io_device({.product_code = 0x5042,
                                    .name = "Analogue I/O, 4 inputs, 2 outputs",
                                    .order_code = "MG5042",
                                    .group = "Analogue",
                                    .output_bytes = 4,
                                    .input_bytes = 16});
using Common = CommonObjects<kDevice, 0x00040191>;

constexpr auto kOneBit = od::kRead | od::kTxMappable;

template <unsigned N>
struct Input {
    template <class F>
    using At = Field<typename F::Type, in_at(N) + F::offset>;
    template <class F>
    using Set = Field<typename F::Type, scale_at(N) + F::offset>;
    static constexpr std::array<Entry, 7> kValues{entry_count(0x11),
                                                  flag<At<In::underrange>>(1, "Underrange", kOneBit),
                                                  flag<At<In::overrange>>(2, "Overrange", kOneBit),
                                                  flag<At<In::limit>>(3, "Limit", kOneBit, 2),
                                                  flag<At<In::error>>(7, "Error", kOneBit),
                                                  flag<At<In::toggle>>(0x10, "Toggle", kOneBit),
                                                  value<At<In::value>>(0x11, "Value", kOneBit)};
    static constexpr std::array<Entry, 7> kSettings{
        entry_count(0x14),
        flag<Set<Scale::on>>(1, "Enable user scale", od::kReadWrite | od::kBackup),
        flag<Set<Scale::limits_on>>(7, "Enable limits", od::kReadWrite | od::kBackup),
        value<Set<Scale::offset>>(0x11, "User scale offset", od::kReadWrite | od::kBackup),
        value<Set<Scale::gain>>(0x12, "User scale gain", od::kReadWrite | od::kBackup, 65536),
        value<Set<Scale::low>>(0x13, "Lower limit", od::kReadWrite | od::kBackup),
        value<Set<Scale::high>>(0x14, "Upper limit", od::kReadWrite | od::kBackup)};
    static constexpr std::array<Entry, 2> kRaw{entry_count(1), value<At<In::raw>>(1, "Converter value", od::kRead)};
    static constexpr std::uint16_t kIndex = 0x6000 + 0x10 * N;
    static constexpr std::array<Entry, 9> kPdo{
        entry_count(8),          mapped(1, kIndex, 1, 1),    mapped(2, kIndex, 2, 1),
        mapped(3, kIndex, 3, 2), mapped(4, 0, 0, 2),         mapped(5, kIndex, 7, 1),
        mapped(6, 0, 0, 8),      mapped(7, kIndex, 0x10, 1), mapped(8, kIndex, 0x11, 16)};
};

template <unsigned N>
struct Output {
    template <class F>
    using At = Field<typename F::Type, out_at(N) + F::offset>;
    template <class F>
    using Set = Field<typename F::Type, scale_at(kInputChannels + N) + F::offset>;
    static constexpr std::uint16_t kIndex = 0x7040 + 0x10 * N;
    static constexpr std::array<Entry, 2> kValues{entry_count(1),
                                                  value<At<Out::value>>(1, "Value", od::kReadWrite | od::kRxMappable)};
    static constexpr std::array<Entry, 4> kSettings{
        entry_count(0x12), flag<Set<Scale::on>>(1, "Enable user scale", od::kReadWrite | od::kBackup),
        value<Set<Scale::offset>>(0x11, "User scale offset", od::kReadWrite | od::kBackup),
        value<Set<Scale::gain>>(0x12, "User scale gain", od::kReadWrite | od::kBackup, 65536)};
    static constexpr std::array<Entry, 2> kTerminal{entry_count(1),
                                                    value<At<Out::terminal>>(1, "Terminal value", od::kRead)};
    static constexpr std::array<Entry, 2> kPdo{entry_count(1), mapped(1, kIndex, 1, 16)};
};

constexpr Entry kRxAssignment[] = {entry_count(2), assigned(1, 0x1600), assigned(2, 0x1601)};
constexpr Entry kTxAssignment[] = {entry_count(4), assigned(1, 0x1A00), assigned(2, 0x1A01), assigned(3, 0x1A02),
                                   assigned(4, 0x1A03)};

constexpr auto kObjects = with_common<Common>({
    record(0x1600, "AO channel 1", Output<0>::kPdo, nullptr, DataType::pdo_mapping),
    record(0x1601, "AO channel 2", Output<1>::kPdo, nullptr, DataType::pdo_mapping),
    record(0x1A00, "AI channel 1", Input<0>::kPdo, nullptr, DataType::pdo_mapping),
    record(0x1A01, "AI channel 2", Input<1>::kPdo, nullptr, DataType::pdo_mapping),
    record(0x1A02, "AI channel 3", Input<2>::kPdo, nullptr, DataType::pdo_mapping),
    record(0x1A03, "AI channel 4", Input<3>::kPdo, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kRxAssignment),
    array(0x1C13, "TxPDO assignment", kTxAssignment),
    record(0x6000, "AI inputs channel 1", Input<0>::kValues),
    record(0x6010, "AI inputs channel 2", Input<1>::kValues),
    record(0x6020, "AI inputs channel 3", Input<2>::kValues),
    record(0x6030, "AI inputs channel 4", Input<3>::kValues),
    record(0x7040, "AO outputs channel 1", Output<0>::kValues),
    record(0x7050, "AO outputs channel 2", Output<1>::kValues),
    record(0x8000, "AI settings channel 1", Input<0>::kSettings),
    record(0x8010, "AI settings channel 2", Input<1>::kSettings),
    record(0x8020, "AI settings channel 3", Input<2>::kSettings),
    record(0x8030, "AI settings channel 4", Input<3>::kSettings),
    record(0x8040, "AO settings channel 1", Output<0>::kSettings),
    record(0x8050, "AO settings channel 2", Output<1>::kSettings),
    record(0x9000, "AI internal data channel 1", Input<0>::kRaw),
    record(0x9010, "AI internal data channel 2", Input<1>::kRaw),
    record(0x9020, "AI internal data channel 3", Input<2>::kRaw),
    record(0x9030, "AI internal data channel 4", Input<3>::kRaw),
    record(0x9040, "AO internal data channel 1", Output<0>::kTerminal),
    record(0x9050, "AO internal data channel 2", Output<1>::kTerminal),
});
static_assert(well_formed(kObjects, kImageBytes));

std::int16_t scaled(Bytes scale, std::int16_t value) {
    std::int64_t result = value;
    if (Scale::on::load(scale) != 0) result = (result * Scale::gain::load(scale)) / 65536 + Scale::offset::load(scale);
    return static_cast<std::int16_t>(std::clamp<std::int64_t>(result, INT16_MIN, INT16_MAX));
}

class AnalogIo final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDevice; }
    void start(const Surroundings& around, Time) override { image_ = around.dictionary->image(); }
    void cycle(Time, bool) override {
        for (unsigned n = 0; n < kInputChannels; ++n) convert(n);
        drive_outputs();
    }
    void safe_outputs(Time) override { drive_outputs(); }
    // Raw values at the converters, 16 bits per channel.
    [[nodiscard]] MutableBytes measured() override { return terminals_; }

  private:
    void convert(unsigned n) {
        const auto in = image_.subspan(in_at(n), In::bytes);
        const Bytes scale = image_.subspan(scale_at(n), Scale::bytes);
        const auto raw = load_le<std::int16_t>(terminals_, 2 * std::size_t{n});
        const auto held = static_cast<std::int16_t>(std::clamp<int>(raw, -kRangeEnd, kRangeEnd));
        const auto result = scaled(scale, held);
        In::raw::store(in, raw);
        In::value::store(in, result);
        In::underrange::store(in, raw < -kRangeEnd);
        In::overrange::store(in, raw > kRangeEnd);
        In::error::store(in, raw != held);
        unsigned limit = 0;
        if (Scale::limits_on::load(scale) != 0)
            limit = result < Scale::low::load(scale) ? 1 : result > Scale::high::load(scale) ? 2 : 0;
        In::limit::store(in, static_cast<std::uint8_t>(limit));
        In::toggle::store(in, static_cast<std::uint8_t>(In::toggle::load(in) ^ 1u));
    }
    void drive_outputs() {
        for (unsigned n = 0; n < kOutputChannels; ++n) {
            const auto out = image_.subspan(out_at(n), Out::bytes);
            const Bytes scale = image_.subspan(scale_at(kInputChannels + n), Scale::bytes);
            Out::terminal::store(out, scaled(scale, Out::value::load(out)));
        }
    }

    MutableBytes image_;
    std::array<std::byte, 2 * kInputChannels> terminals_{};
};

}  // namespace

constexpr Blueprint kAnalogIo = blueprint<AnalogIo>("analog_io_4_2", kDevice, kObjects, kImageBytes);

}  // namespace margay::sim
