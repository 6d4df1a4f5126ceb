// "encoder": an incremental encoder that turns at a speed set by other programs. Its counter is latched by the index
// pulse of the encoder and, with nanosecond resolution, by latch input 0 of the ESC, which the master must leave to the
// device (0x0980 bit 4).
#include "sim/library/device_tables.hpp"

#include "subdevice/esc_registers.hpp"

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr std::int64_t kCountsPerTurn = 4096;

struct Values {
    using latch_index = Field<std::uint8_t, 0>;  // outputs
    using latch_input = Field<std::uint8_t, 1>;
    using set_counter = Field<std::uint8_t, 2>;
    using set_value = Field<std::uint32_t, 3>;
    using index_valid = Field<std::uint8_t, 7>;  // inputs
    using input_valid = Field<std::uint8_t, 8>;
    using set_done = Field<std::uint8_t, 9>;
    using level = Field<std::uint8_t, 10>;
    using counter = Field<std::uint32_t, 11>;
    using latched = Field<std::uint32_t, 15>;
    using speed = Field<std::int32_t, 19>;
    using reverse = Field<std::uint8_t, 23>;
    static constexpr std::size_t bytes = 24;
};

constexpr auto kDevice = io_device({.product_code = 0x5101,
                                    .name = "Encoder with latch",
                                    .order_code = "MG5101",
                                    .group = "Measuring",
                                    .output_bytes = 6,
                                    .input_bytes = 14});
using Common = CommonObjects<kDevice, 0x00090196>;  // profile 406, encoder

constexpr auto kIn = od::kRead | od::kTxMappable;
constexpr auto kOut = od::kReadWrite | od::kRxMappable;

constexpr Entry kInputs[] = {entry_count(0x13),
                             flag<Values::index_valid>(1, "Latch index valid", kIn),
                             flag<Values::input_valid>(2, "Latch input valid", kIn),
                             flag<Values::set_done>(3, "Set counter done", kIn),
                             flag<Values::level>(4, "Index level", kIn),
                             value<Values::counter>(0x11, "Counter value", kIn),
                             value<Values::latched>(0x12, "Latch value", kIn),
                             value<Values::speed>(0x13, "Speed", kIn)};
constexpr Entry kOutputs[] = {entry_count(0x11), flag<Values::latch_index>(1, "Enable latch index", kOut),
                              flag<Values::latch_input>(2, "Enable latch input, rising edge", kOut),
                              flag<Values::set_counter>(3, "Set counter", kOut),
                              value<Values::set_value>(0x11, "Set counter value", kOut)};
constexpr Entry kSettings[] = {entry_count(1),
                               flag<Values::reverse>(1, "Reverse direction", od::kReadWrite | od::kBackup)};
constexpr Entry kRxPdo[] = {entry_count(5),          mapped(1, 0x7000, 1, 1), mapped(2, 0x7000, 2, 1),
                            mapped(3, 0x7000, 3, 1), mapped(4, 0, 0, 13),     mapped(5, 0x7000, 0x11, 32)};
constexpr Entry kTxPdo[] = {entry_count(8),
                            mapped(1, 0x6000, 1, 1),
                            mapped(2, 0x6000, 2, 1),
                            mapped(3, 0x6000, 3, 1),
                            mapped(4, 0x6000, 4, 1),
                            mapped(5, 0, 0, 12),
                            mapped(6, 0x6000, 0x11, 32),
                            mapped(7, 0x6000, 0x12, 32),
                            mapped(8, 0x6000, 0x13, 32)};

constexpr auto kObjects = with_common<Common>({
    record(0x1600, "Encoder outputs", kRxPdo, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Encoder inputs", kTxPdo, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kOneRxPdo),
    array(0x1C13, "TxPDO assignment", kOneTxPdo),
    record(0x6000, "Encoder inputs", kInputs),
    record(0x7000, "Encoder outputs", kOutputs),
    record(0x8000, "Encoder settings", kSettings),
});
static_assert(well_formed(kObjects, Values::bytes));

constexpr std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b != 0 && (a < 0) != (b < 0)); }

class Encoder final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDevice; }
    void start(const Surroundings& around, Time now) override {
        esc_ = around.esc;
        image_ = around.dictionary->image();
        shift_ = 0;
        index_armed_ = input_armed_ = false;
        since_ = now;  // an incremental encoder starts at the position of power-up
        origin_ = position_ = 0;
        turn_to(now);
    }
    Time advance(Time now) override {
        apply_latch(now);
        return kNever;
    }
    void cycle(Time now, bool) override {
        const auto before = position_;
        turn_to(now);
        look_for_index(before);
        serve_commands();
        Values::counter::store(image_, counter(position_));
        Values::speed::store(image_, reversed() ? -speed_ : speed_);
        Values::level::store(image_, position_ % kCountsPerTurn == 0);
    }
    // Speed in counts per second, signed, 32 bits.
    [[nodiscard]] MutableBytes measured() override { return measured_; }

  private:
    [[nodiscard]] bool reversed() const { return Values::reverse::load(image_) != 0; }
    [[nodiscard]] std::uint32_t counter(std::int64_t position) const {
        return static_cast<std::uint32_t>((reversed() ? -position : position) + shift_);
    }
    [[nodiscard]] std::int64_t position_at(Time when) const {
        const auto whole = std::chrono::floor<std::chrono::seconds>(when - since_);
        const auto rest = (when - since_ - whole).count();
        return origin_ + whole.count() * speed_ + floor_div(rest * speed_, 1'000'000'000);
    }
    // Moves at the previous speed until `now`, and at the set speed from now on.
    void turn_to(Time now) {
        position_ = position_at(now);
        const auto wanted = load_le<std::int32_t>(measured_);
        if (wanted == speed_) return;
        origin_ = position_;
        since_ = now;
        speed_ = wanted;
    }
    // Finds the first index pulse between position `before` and the present position.
    void look_for_index(std::int64_t before) {
        if (!index_armed_ || position_ == before || Values::index_valid::load(image_) != 0) return;
        const bool up = position_ > before;
        const auto pulse =
            (up ? floor_div(before, kCountsPerTurn) + 1 : floor_div(before - 1, kCountsPerTurn)) * kCountsPerTurn;
        if (up ? pulse > position_ : pulse < position_) return;
        Values::latched::store(image_, counter(pulse));
        Values::index_valid::store(image_, 1);
    }
    void serve_commands() {
        index_armed_ = Values::latch_index::load(image_) != 0;
        const bool armed = Values::latch_input::load(image_) != 0;
        if (armed && !input_armed_) arm_latch();
        input_armed_ = armed;
        if (!index_armed_) Values::index_valid::store(image_, 0);
        if (!input_armed_) Values::input_valid::store(image_, 0);
        const bool set = Values::set_counter::load(image_) != 0;
        if (set && Values::set_done::load(image_) == 0)
            shift_ += static_cast<std::int32_t>(Values::set_value::load(image_) - counter(position_));
        Values::set_done::store(image_, set);
    }
    // Latches the first rising edge from now on. An earlier edge is discarded.
    void arm_latch() {
        namespace reg = wire::reg;
        constexpr std::uint8_t kSingleRisingEdge = 1;
        write_register(*esc_, reg::kLatch0Control.address, kSingleRisingEdge);
        (void)read_register<std::uint64_t>(*esc_, reg::kLatch0PositiveEdge.address);
    }
    // The ESC provides the time of the edge; the position of the encoder at that time is calculated from it.
    void apply_latch(Time now) {
        namespace reg = wire::reg;
        if ((read_register<std::uint8_t>(*esc_, reg::kLatch0Status.address) & 1) == 0) return;
        const auto edge = read_register<std::uint64_t>(*esc_, reg::kLatch0PositiveEdge.address);
        const auto clock = read_register<std::uint64_t>(*esc_, reg::kSystemTime.address);
        if (!input_armed_ || Values::input_valid::load(image_) != 0) return;
        // Also correct for 32-bit clocks.
        const auto age = static_cast<std::int32_t>(static_cast<std::uint32_t>(clock - edge));
        Values::latched::store(image_, counter(position_at(now - Duration{age})));
        Values::input_valid::store(image_, 1);
    }

    EscAccess* esc_ = nullptr;
    MutableBytes image_;
    std::array<std::byte, 4> measured_{};
    std::int32_t speed_ = 0;
    std::int64_t origin_ = 0;  // position at since_
    Time since_{};
    std::int64_t position_ = 0;
    std::int64_t shift_ = 0;  // offset of the counter, set by the master
    bool index_armed_ = false;
    bool input_armed_ = false;
};

}  // namespace

constexpr Blueprint kEncoder = blueprint<Encoder>("encoder", kDevice, kObjects, Values::bytes);

}  // namespace margay::sim
