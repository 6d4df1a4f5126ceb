// A device whose objects, memory and wiring follow from its description: the device of ten lines in the README.
#include "subdevice/standard_device.hpp"

#include "mail_hand.hpp"
#include "subdevice/sii_image.hpp"
#include "wire/sii_check.hpp"

#include <gtest/gtest.h>

namespace margay::subdevice {
namespace {

using namespace testing;

constexpr DeviceDescription kLampsDevice{
    .vendor_id = 0x4D47,
    .product_code = 0x77,
    .name = "Lamps",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128, .max_bytes = 200}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 4},
    .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 8}};
struct LampValues {
    std::uint8_t lamps;
    Le<std::uint16_t> dimming;
    std::array<Le<std::uint16_t>, 3> currents;
};

class LampsApplication final : public Application {
  public:
    explicit LampsApplication(LampValues& values) : values_(values) {}
    const DeviceDescription& description() const override { return kLampsDevice; }
    void cycle(Time, bool) override { shown = values_.lamps; }
    HookAnswer check_dimming(const ObjectAccess&, Bytes data) {
        return load_le<std::uint16_t>(data) % 10 == 0 ? Abort::none : Abort::value_range;
    }
    void dimmed(const ObjectAccess&) { ++changes; }
    unsigned shown = 0;
    unsigned changes = 0;

  private:
    LampValues& values_;
};

constexpr ObjectHooks kDimmingHooks{.before_write = before_write_by<&LampsApplication::check_dimming>,
                                    .after_write = after_write_by<&LampsApplication::dimmed>};
constexpr Entry kLamps[] = {value<&LampValues::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kDimming[] = {value<&LampValues::dimming>(0, "Dimming", od::kReadWrite, 100)};
constexpr Entry kCurrents[] = {entry_count(3), value<&LampValues::currents>(1, "Current", od::kRead | od::kTxMappable)};
constexpr Entry kOwnName[] = {text(0, "Device name", "Lamps of ours")};
constexpr Object kLampObjects[] = {variable(0x1008, "Device name", kOwnName),
                                   variable(0x2000, "Dimming", kDimming, &kDimmingHooks),
                                   array(0x6000, "Currents", kCurrents), variable(0x7000, "Lamps", kLamps)};
using LampStack = StandardDevice<kLampsDevice, kLampObjects, LampValues>;

// StandardDevice asserts that the result is `apart`.
constexpr auto places_with(auto change) {
    DeviceDescription device = kLampsDevice;
    change(device);
    return standard::places_of(device);
}
using standard::Places;
constexpr ProcessDataArea kBehindInputs[] = {{.sync_manager = 4, .start = 0x1498, .max_bytes = 2}};
constexpr ProcessDataArea kInInputs[] = {{.sync_manager = 4, .start = 0x1497, .max_bytes = 2}};
static_assert(places_with([](auto&) {}) == Places::apart);
static_assert(places_with([](auto& d) { d.inputs.start = 0x140C; }) == Places::apart);
static_assert(places_with([](auto& d) { d.inputs.start = 0x140B; }) == Places::data_overlap, "three buffers");
static_assert(places_with([](auto& d) { d.inputs.start = 0x1404, d.outputs.three_buffers = false; }) == Places::apart);
static_assert(places_with([](auto& d) { d.inputs.start = 0x1401, d.outputs.max_bytes = 1; }) == Places::apart,
              "one octet has no buffers");
static_assert(places_with([](auto& d) { d.more_outputs = kBehindInputs; }) == Places::apart);
static_assert(places_with([](auto& d) { d.more_outputs = kInInputs; }) == Places::data_overlap);
static_assert(places_with([](auto& d) { d.outputs.start = 0x1100; }) == Places::data_overlap, "on a mailbox");
static_assert(places_with([](auto& d) { d.outputs.start = 0x0FFF; }) == Places::data_outside);
static_assert(places_with([](auto& d) { d.inputs.start = 0xFFF0; }) == Places::data_outside);
static_assert(places_with([](auto& d) { d.mailbox.send.start = 0x107F; }) == Places::mailboxes_overlap);
static_assert(places_with([](auto& d) { d.mailbox.receive.start = 0x0400; }) == Places::mailboxes_outside);
static_assert(places_with([](auto& d) { d.boot_mailbox = {{0x1400, 128}, {0x1480, 128}}; }) == Places::apart);
static_assert(places_with([](auto& d) {
                  d.boot_mailbox = {{0x1400, 129}, {0x1480, 128}};
              }) == Places::mailboxes_overlap);

// Other mistakes that StandardDevice detects with a named assertion.
constexpr bool fits_an_sdo(std::uint16_t bytes) {
    DeviceDescription device = kLampsDevice;
    device.mailbox.receive.size_bytes = bytes;
    return standard::mailboxes_fit_an_sdo(device);
}
static_assert(fits_an_sdo(16) && !fits_an_sdo(15));
using std::chrono_literals::operator""ms;
static_assert(cycle_limits_agree({.min_cycle = 1ms}) && cycle_limits_agree({.min_cycle = 1ms, .max_cycle = 1ms}));
static_assert(!cycle_limits_agree({.min_cycle = 2ms, .max_cycle = 1ms}));
constexpr bool mailbox_fits(MailboxArea area) {
    DeviceDescription device = kLampsDevice;
    device.mailbox.receive = area;
    return mailbox_sizes_agree(device);
}
static_assert(mailbox_fits({.size_bytes = 128}) &&
              mailbox_fits({.size_bytes = 128, .min_bytes = 64, .max_bytes = 128}));
static_assert(!mailbox_fits({.size_bytes = 128, .min_bytes = 32, .max_bytes = 64}));
static_assert(!mailbox_fits({.size_bytes = 128, .min_bytes = 200, .max_bytes = 100}));
constexpr bool outputs_agree(ProcessDataArea area) {
    DeviceDescription device = kLampsDevice;
    device.outputs = area;
    return sync_managers_agree(device);
}
static_assert(outputs_agree({.sync_manager = 15, .max_bytes = 4}) &&
              !outputs_agree({.sync_manager = 16, .max_bytes = 4}));
static_assert(!outputs_agree({.max_bytes = 4}) && !outputs_agree({.sync_manager = 1, .max_bytes = 4}));
template <unsigned Count>
constexpr Entry kCounted[] = {entry_count(Count), value<&LampValues::dimming>(1, "Dimming", od::kReadWrite)};
template <unsigned Count>
constexpr Object kCountedObjects[] = {record(0x2000, "Dimming", kCounted<Count>)};
static_assert(counts_what_is_there(kCountedObjects<1>) && well_formed(kCountedObjects<1>, sizeof(LampValues)));
static_assert(!counts_what_is_there(kCountedObjects<2>) && !well_formed(kCountedObjects<2>, sizeof(LampValues)));

struct LampBench {
    PlainEsc esc;
    LampStack::Memory memory;
    LampsApplication application{memory.values};
    LampStack stack{esc, application, memory};
    MailHand hand{esc};

    LampBench() {
        stack.device.start(esc.time);
        hand.configure(128);
        esc.configure(2, {0x1400, 2, 0x64, 1});
        esc.configure(3, {0x1480, 6, 0x20, 1});
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)stack.device.step(esc.time);
        return esc.al_status();
    }
    // The eight octets of an expedited SDO answer.
    std::vector<std::byte> sdo(const std::vector<std::byte>& body) {
        std::vector<std::byte> data = raw({0x00, 0x20});
        data.insert(data.end(), body.begin(), body.end());
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        for (int n = 0; n < 4; ++n) (void)stack.device.step(esc.time);
        auto answer = hand.fetch();
        if (answer.size() < 16) return {};
        return {answer.begin() + 8, answer.begin() + 16};
    }
};

TEST(StandardDevice, HasTheObjectsOfEveryDeviceAndThoseOfItsAuthor) {
    std::vector<int> indices;
    for (const Object& object : LampStack::Objects::kObjects) indices.push_back(object.index);
    EXPECT_EQ(indices,
              (std::vector{0x1000, 0x1008, 0x1018, 0x1600, 0x1A00, 0x1C00, 0x1C12, 0x1C13, 0x2000, 0x6000, 0x7000}));
    EXPECT_TRUE(well_formed(LampStack::Objects::kObjects, sizeof(LampValues)));
    LampBench bench;
    EXPECT_EQ(bench.stack.dictionary.find(0x1008)->entries[0].content(), "Lamps of ours") << "the author's object";
    EXPECT_EQ(bench.stack.dictionary.number(0x1018, 2), 0x77U);
    EXPECT_EQ(bench.stack.dictionary.number(0x1600, 0), 2U) << "a gap follows one octet";
    EXPECT_EQ(bench.stack.dictionary.number(0x1600, 1), 0x70000008U);
    EXPECT_EQ(bench.stack.dictionary.number(0x1600, 2), 8U);
    EXPECT_EQ(bench.stack.dictionary.number(0x1A00, 3), 0x60000310U);
}

// The octets of a struct are the image of its values.
struct MixedValues {
    Le<std::uint16_t> first;
    std::uint8_t octet;
    std::array<Le<std::int32_t>, 3> numbers;
    std::array<char, 300> label;
    Le<std::uint64_t> behind;
};
static_assert(sizeof(MixedValues) == 323, "no gaps");
static_assert(offset_of(&MixedValues::octet) == 2 && offset_of(&MixedValues::behind) == 315);
constexpr Entry kNumbers = value<&MixedValues::numbers>(1, "Number", od::kReadOnly, -5);
static_assert(kNumbers.offset == 3 && kNumbers.count == 3 && kNumbers.bits == 32);
static_assert(kNumbers.type == DataType::integer32);
constexpr Entry kLabelOctets =
    subdevice::octets<&MixedValues::label>(0, "Label", DataType::visible_string, od::kReadWrite, "none");
static_assert(kLabelOctets.offset == 15 && kLabelOctets.bits == 2400);
static_assert(flag<&MixedValues::octet>(0, "Flag", od::kReadOnly).type == DataType::boolean);

// Structs in a struct, and in an array.
struct AxisValues {
    Le<std::int32_t> target;
    std::array<Le<std::uint16_t>, 2> currents;
    std::array<char, 8> label;
};
struct MachineValues {
    std::uint8_t mode;
    std::array<AxisValues, 3> axes;
    AxisValues spare;
};
constexpr Entry kSecondCurrents = value<&MachineValues::axes, 2, &AxisValues::currents>(1, "Current", od::kReadOnly, 7);
static_assert(kSecondCurrents.offset == 1 + 2 * 16 + 4 && kSecondCurrents.count == 2 && kSecondCurrents.bits == 16);
static_assert(value<&MachineValues::spare, &AxisValues::target>(0, "Target", od::kReadOnly).offset == 49);
static_assert(value<&MachineValues::axes, 1, &AxisValues::currents, 1>(0, "Current", od::kReadOnly).offset == 23);
static_assert(subdevice::octets<&MachineValues::spare, &AxisValues::label>(0, "Label", DataType::visible_string,
                                                                           od::kReadOnly)
                  .offset == 57);

TEST(StandardDevice, AStructOfValuesIsTheImage) {
    MixedValues values{};
    values.first = 0x1234;
    values.numbers[1] = -2;
    const auto image = image_of(values);
    EXPECT_EQ(image[0], std::byte{0x34}) << "the order of the wire";
    EXPECT_EQ(image[7], std::byte{0xFE});
    EXPECT_EQ(image[10], std::byte{0xFF});
    image[1] = std::byte{0x56};
    EXPECT_EQ(values.first, 0x5634);
    EXPECT_EQ(values.first * 2 + 1, 0xAC69);
    EXPECT_EQ(values_in<MixedValues>(image).numbers[1], -2);
}

TEST(StandardDevice, GoesToOpAndExchanges) {
    LampBench bench;
    ASSERT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1400, raw({0x5A, 0})));
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    bench.memory.values.currents[0] = 0x1234;
    ASSERT_TRUE(bench.esc.ecat_write(0x1400, raw({0xA5, 0})));
    (void)bench.stack.device.step(bench.esc.time);
    EXPECT_EQ(bench.application.shown, 0xA5U);
    std::vector<std::byte> inputs(6);
    ASSERT_TRUE(bench.esc.ecat_read(0x1480, inputs));
    EXPECT_EQ(load_le<std::uint16_t>(inputs), 0x1234U);
}

TEST(StandardDevice, HooksAreFunctionsOfTheApplication) {
    LampBench bench;
    (void)bench.request(2);
    EXPECT_EQ(bench.sdo(raw({0x2B, 0x00, 0x20, 0, 50, 0, 0, 0}))[0], std::byte{0x60});
    EXPECT_EQ(bench.application.changes, 1U);
    EXPECT_EQ(bench.sdo(raw({0x2B, 0x00, 0x20, 0, 51, 0, 0, 0}))[0], std::byte{0x80});
    EXPECT_EQ(bench.application.changes, 1U);
    EXPECT_EQ(bench.sdo(raw({0x40, 0x00, 0x20, 0, 0, 0, 0, 0})), raw({0x4B, 0x00, 0x20, 0, 50, 0, 0, 0}));
}

TEST(StandardDevice, ItsSiiFollowsFromTheSameTables) {
    LampBench bench;
    SiiWorkspace<4, 16> workspace;
    std::vector<std::byte> image(1024);
    const auto written = write_sii(kLampsDevice, {}, bench.stack.dictionary, workspace, image);
    ASSERT_TRUE(written.ok()) << to_text(written.fault);
    EXPECT_EQ(wire::sii::load_fixed_part(image).value.identity.product, 0x77U);
}

// ------------------------------------------------------------------ devices of other sizes

constexpr MailboxPair kSmallMailboxes{{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}};

// One octet in each direction, without a gap.
constexpr DeviceDescription kOneOctet{.name = "One octet",
                                      .protocols = {.coe = true},
                                      .mailbox = kSmallMailboxes,
                                      .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 1},
                                      .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 1}};
struct OctetValues {
    using lamps = Field<std::uint8_t, 0>;
    using keys = Field<std::uint8_t, 1>;
};
constexpr Entry kOctetLamps[] = {value<OctetValues::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kOctetKeys[] = {value<OctetValues::keys>(0, "Keys", od::kRead | od::kTxMappable)};
constexpr Object kOctetObjects[] = {variable(0x6000, "Keys", kOctetKeys), variable(0x7000, "Lamps", kOctetLamps)};

// Inputs in SyncManager 2, and no outputs.
constexpr DeviceDescription kInputsInSm2{.name = "Inputs in SM2",
                                         .protocols = {.coe = true},
                                         .mailbox = kSmallMailboxes,
                                         .inputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 2}};
constexpr Entry kTwoOctets[] = {value<Field<std::uint16_t, 0>>(0, "Keys", od::kRead | od::kTxMappable)};
constexpr Object kTwoOctetObjects[] = {variable(0x6000, "Keys", kTwoOctets)};

// Outputs in SyncManager 3, and no inputs.
constexpr DeviceDescription kOutputsInSm3{.name = "Outputs in SM3",
                                          .protocols = {.coe = true},
                                          .mailbox = kSmallMailboxes,
                                          .outputs = {.sync_manager = 3, .start = 0x1400, .max_bytes = 2}};
constexpr Entry kTwoOctetsOut[] = {value<Field<std::uint16_t, 0>>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Object kTwoOctetOutObjects[] = {variable(0x7000, "Lamps", kTwoOctetsOut)};

// Assignments with a mistake: the PDO of the inputs in the outputs, and a PDO that does not exist.
constexpr DeviceDescription kBothWays{.name = "Both directions",
                                      .protocols = {.coe = true},
                                      .mailbox = kSmallMailboxes,
                                      .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 2},
                                      .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 2}};
constexpr Entry kLampsBehindKeys[] = {value<Field<std::uint16_t, 2>>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kPdoOfInputs[] = {entry_count(1), assigned(1, 0x1A00)};
constexpr Entry kPdoOfOutputs[] = {entry_count(1), assigned(1, 0x1600)};
constexpr Entry kNoSuchPdo[] = {entry_count(1), assigned(1, 0x1605)};
constexpr Object kInputsInOutputs[] = {array(0x1C12, "Assignment", kPdoOfInputs), variable(0x6000, "Keys", kTwoOctets),
                                       variable(0x7000, "Lamps", kLampsBehindKeys)};
constexpr Object kOutputsInInputs[] = {array(0x1C13, "Assignment", kPdoOfOutputs), variable(0x6000, "Keys", kTwoOctets),
                                       variable(0x7000, "Lamps", kLampsBehindKeys)};
constexpr Object kOutputsMissing[] = {array(0x1C12, "Assignment", kNoSuchPdo), variable(0x6000, "Keys", kTwoOctets),
                                      variable(0x7000, "Lamps", kLampsBehindKeys)};

// A value of more octets than the usual staging buffer.
constexpr Entry kLongText[] = {subdevice::octets(0, "Text", DataType::octet_string, od::kReadWrite, 0, 300)};
constexpr Entry kLongArray[] = {
    entry_count(200), subdevice::octets(1, "Number", DataType::unsigned16, od::kReadWrite, 300, 2).times(200)};
constexpr Object kLongObjects[] = {variable(0x2000, "Text", kLongText), array(0x2001, "Numbers", kLongArray)};

template <const DeviceDescription& Description>
struct PlainApplication final : Application {
    const DeviceDescription& description() const override { return Description; }
};

template <const DeviceDescription& Description, const auto& Objects, std::size_t Bytes>
struct SizedBench {
    using Stack = StandardDevice<Description, Objects, std::array<std::byte, Bytes>>;
    PlainEsc esc;
    std::array<std::byte, 128> eeprom_content{};
    EepromEmulation eeprom{esc, eeprom_content};
    typename Stack::Memory memory;
    PlainApplication<Description> application;
    Stack stack{esc, application, memory, {}, RunMode::polling, &eeprom};
    MailHand hand{esc};

    SizedBench() {
        stack.device.start(esc.time);
        hand.configure(128);
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)stack.device.step(esc.time);
        return esc.al_status();
    }
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        for (int n = 0; n < 4; ++n) (void)stack.device.step(esc.time);
        auto reply = hand.fetch();
        return reply.size() < 16 ? std::vector<std::byte>(16) : reply;
    }
    // The command of the last reply to a download in segments.
    std::byte download(int index, bool complete, std::size_t bytes) {
        const auto low = static_cast<int>(bytes & 0xFF);
        auto data = raw(
            {0, 0x20, complete ? 0x31 : 0x21, index & 0xFF, index >> 8, 0, low, static_cast<int>(bytes >> 8), 0, 0});
        auto reply = exchange(data);
        int toggle = 0;
        for (std::size_t left = bytes; left != 0 && reply[8] != std::byte{0x80}; toggle ^= 0x10) {
            const auto part = std::min<std::size_t>(left, 128 - 6 - 3);
            left -= part;
            auto segment = raw({0, 0x20, toggle | (left == 0 ? 1 : 0)});
            segment.insert(segment.end(), part, std::byte{2});
            reply = exchange(segment);
        }
        return reply[8];
    }
};

TEST(StandardDevice, OneOctetNeedsNoGap) {
    SizedBench<kOneOctet, kOctetObjects, 2> bench;
    EXPECT_EQ(bench.stack.dictionary.number(0x1600, 0), 1U);
    bench.esc.configure(2, {0x1400, 1, 0x64, 1});
    bench.esc.configure(3, {0x1480, 1, 0x20, 1});
    ASSERT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1400, raw({0x5A})));
    bench.esc.time += std::chrono::milliseconds(1);
    (void)bench.stack.device.step(bench.esc.time);
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(OctetValues::lamps::load(bench.memory.values), 0x5A);
}

TEST(StandardDevice, ADirectionMayUseTheSyncManagerOfTheOther) {
    SizedBench<kInputsInSm2, kTwoOctetObjects, 2> inputs;
    inputs.esc.configure(2, {0x1400, 2, 0x20, 1});
    (void)inputs.request(2);
    EXPECT_EQ(inputs.request(4), (AlStatus{AlState::safeop, false, 0}));
    SizedBench<kOutputsInSm3, kTwoOctetOutObjects, 2> outputs;
    outputs.esc.configure(3, {0x1400, 2, 0x24, 1});
    (void)outputs.request(2);
    EXPECT_EQ(outputs.request(4), (AlStatus{AlState::safeop, false, 0}));
}

template <const auto& Objects>
AlStatus safeop_of(std::uint16_t outputs_bytes) {
    SizedBench<kBothWays, Objects, 4> bench;
    if (outputs_bytes != 0) bench.esc.configure(2, {0x1400, outputs_bytes, 0x64, 1});
    bench.esc.configure(3, {0x1480, 2, 0x20, 1});
    (void)bench.request(2);
    return bench.request(4);
}

// Without this check, the outputs of the master would be stored in a read-only object, or in no object.
TEST(StandardDevice, AnAssignmentNeedsPdosOfItsDirection) {
    EXPECT_EQ(safeop_of<kInputsInOutputs>(2), (AlStatus{AlState::preop, true, 0x0025}));
    EXPECT_EQ(safeop_of<kOutputsInInputs>(2), (AlStatus{AlState::preop, true, 0x0024}));
    EXPECT_EQ(safeop_of<kOutputsMissing>(0), (AlStatus{AlState::preop, true, 0x0025}));
}

TEST(StandardDevice, TheLargestValueOfTheTableCanBeWritten) {
    SizedBench<kOneOctet, kLongObjects, 700> bench;
    (void)bench.request(2);
    EXPECT_EQ(bench.download(0x2000, false, 300), std::byte{0x20}) << "three segments";
    EXPECT_EQ(bench.memory.values[299], std::byte{2});
    EXPECT_NE(bench.download(0x2001, true, 402), std::byte{0x80});
}

TEST(StandardDevice, APdoHasLimits) {
    static constexpr Entry kMany[] = {entry_count(200),
                                      value<Field<std::uint8_t, 0>>(1, "B", od::kRead | od::kTxMappable).times(200)};
    static constexpr Object kTwice[] = {array(0x6000, "A", kMany), array(0x6010, "B", kMany)};
    static constexpr Object kOnce[] = {array(0x6000, "A", kMany)};
    static_assert(!standard::count_mapped(kTwice, od::kTxMappable, 400).fits_mapping());
    static_assert(standard::count_mapped(kOnce, od::kTxMappable, 400).fits_mapping());
    static constexpr Entry kWide[] = {
        subdevice::octets(0, "W", DataType::octet_string, od::kRead | od::kTxMappable, 0, 32)};
    static constexpr Entry kLess[] = {
        subdevice::octets(0, "L", DataType::octet_string, od::kRead | od::kTxMappable, 0, 31)};
    static constexpr Object kWideOne[] = {variable(0x6000, "W", kWide)};
    static constexpr Object kLessOne[] = {variable(0x6000, "L", kLess)};
    static_assert(!standard::count_mapped(kWideOne, od::kTxMappable, 400).fits_mapping());
    static_assert(standard::count_mapped(kLessOne, od::kTxMappable, 400).fits_mapping());
}

// The tables of a drive. The compiler must not compare each value with each other value.
constexpr std::size_t kManyCount = 600;
struct ManyValues {
    std::array<Le<std::uint32_t>, kManyCount> parameters;
    Le<std::uint16_t> lamps;
};
constexpr auto kManyEntries = [] {
    std::array<Entry, kManyCount> entries{};
    for (std::size_t n = 0; n < kManyCount; ++n) {
        entries[n] = value<Field<std::uint32_t, 0>>(0, "Parameter", od::kReadWrite);
        entries[n].offset = static_cast<std::uint32_t>(4 * n);
    }
    return entries;
}();
constexpr auto kManyObjects = [] {
    std::array<Object, kManyCount> objects{};
    for (std::size_t n = 0; n < kManyCount; ++n)
        objects[n] =
            variable(static_cast<std::uint16_t>(0x2000 + n), "Parameter", std::span(kManyEntries).subspan(n, 1));
    return objects;
}();
constexpr DeviceDescription kManyDevice{
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}}};

TEST(StandardDevice, MayHaveHundredsOfObjects) {
    EXPECT_GE((sizeof(StandardDevice<kManyDevice, kManyObjects, ManyValues>::Memory)), sizeof(ManyValues));
    static_assert(standard::lie_apart<kManyCount>(kManyObjects));
}

// The master reads a word of the SII: the ESC asks the firmware.
TEST(StandardDevice, AnEscWithoutEepromIsServed) {
    SizedBench<kOneOctet, kOctetObjects, 2> bench;
    bench.eeprom_content[8] = std::byte{0x4D};
    bench.esc.ecat_set<std::uint16_t>(0x0502, 0x0180);  // command "read", emulation selected
    bench.esc.ecat_set<std::uint32_t>(0x0504, 4);
    bench.esc.raise(wire::al_event::kEeprom);
    (void)bench.stack.device.step(bench.esc.time);
    EXPECT_EQ(bench.esc.get<std::uint8_t>(0x0508), 0x4D);
}

}  // namespace
}  // namespace margay::subdevice
