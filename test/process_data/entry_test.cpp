// Process data by name. The device receives exactly the bits that a handle writes, and a handle reads exactly the bits
// that the device shows. config_map() reports every difference between the slave and the declaration of the
// application.
#include "process_data/entry_device.hpp"
#include "process_data/plant.hpp"

#include <bit>
#include <random>

namespace margay {
namespace {

using wire::sii::PdoEntryDescription;
using Words = std::vector<std::string>;

enum class Mode : std::int8_t { reverse = -3, off = 0, forward = 2 };

// Outputs in two SyncManagers and inputs in two SyncManagers, with entries of different sizes, and gaps.
const PdoEntryDescription kRxA[] = {
    {.index = 0x7000, .subindex = 1, .name = "Enable", .data_type = 0x01, .bit_length = 1},
    {.bit_length = 2},
    {.index = 0x7000, .subindex = 2, .name = "Ramp", .bit_length = 5},
    {.index = 0x7000, .subindex = 3, .name = "Target", .bit_length = 32}};
const PdoEntryDescription kRxB[] = {{.index = 0x7010, .subindex = 1, .name = "Odd", .bit_length = 13},
                                    {.index = 0x7010, .subindex = 2, .name = "Text", .bit_length = 48},
                                    {.index = 0x7010, .subindex = 3, .name = "Mode", .bit_length = 3}};
const PdoEntryDescription kRxSecond[] = {
    {.index = 0x7020, .subindex = 1, .name = "Gain", .data_type = 0x08, .bit_length = 32}};
const PdoEntryDescription kTxA[] = {
    {.index = 0x6000, .subindex = 1, .name = "Limit", .bit_length = 1},
    {.index = 0x6000, .subindex = 2, .name = "Temperature", .bit_length = 12},
    {.bit_length = 3},
    {.index = 0x6000, .subindex = 3, .name = "Position", .bit_length = 32},
    {.index = 0x6000, .subindex = 4, .name = "Angle", .data_type = 0x11, .bit_length = 64},
    {.index = 0x6000, .subindex = 5, .name = "Long", .bit_length = 61},
    {.index = 0x6000, .subindex = 6, .name = "State", .bit_length = 3},
    {.index = 0x6000, .subindex = 7, .name = "Serial", .bit_length = 40}};
const PdoEntryDescription kTxSecond[] = {{.index = 0x6010, .subindex = 0, .name = "Count", .bit_length = 16},
                                         {.index = 0x6000, .subindex = 1, .name = "Limit again", .bit_length = 8}};

EntryDevice odd_widths() {
    return {.rx = {{.index = 0x1600, .sync_manager = 0, .entries = kRxA},
                   {.index = 0x1601, .sync_manager = 0, .entries = kRxB},
                   {.index = 0x1602, .sync_manager = 1, .entries = kRxSecond}},
            .tx = {{.index = 0x1A00, .sync_manager = 2, .entries = kTxA},
                   {.index = 0x1A01, .sync_manager = 3, .entries = kTxSecond}},
            .output_sms = 2,
            .input_sms = 2};
}

class EntryTest : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(4096);

    const Group& group() { return bus.ctx->group(0); }
    Result<std::size_t> map(std::span<EntryHandle* const> entries) {
        group().config.entries = entries;
        return config_map(*bus.ctx, image);
    }
    static std::string words(const Error& error) {
        std::array<char, 256> text{};
        return std::string(describe(error, text));
    }
    // Returns the output octets of device `n` after another cycle.
    Bytes outputs(std::size_t n) {
        bus.osal.advance(std::chrono::milliseconds(2));
        const auto wkc = bus.cycle();
        EXPECT_TRUE(wkc.ok()) << words(wkc.error());
        bus.osal.advance(std::chrono::milliseconds(2));
        bus.segment.advance(bus.osal.now());
        return bus.device(n).outputs();
    }
    // Makes device `n` show these bits.
    void show(std::size_t n, std::size_t first, unsigned bits, std::uint64_t value) {
        set_bits(bus.device(n).inputs(), first, bits, value);
        bus.device(n).poke();
        const auto wkc = bus.cycle();
        EXPECT_TRUE(wkc.ok()) << words(wkc.error());
    }
};

// Compares with bits that are copied one by one: every width at every bit offset. No other bit changes.
TEST(EntryBits, OfEveryWidthAtEveryBit) {
    std::mt19937_64 random(7);
    for (unsigned shift = 0; shift < 8; ++shift) {
        for (unsigned bits = 1; bits <= 64; ++bits) {
            std::array<std::byte, 12> octets{};
            for (auto& octet : octets) octet = static_cast<std::byte>(random());
            auto expected = octets;
            const std::uint64_t value = random();
            ASSERT_EQ(detail::load_bits(octets.data() + 1, shift, bits), bits_at(octets, 8 + shift, bits));
            detail::store_bits(octets.data() + 1, shift, bits, value);
            set_bits(expected, 8 + shift, bits, value);
            ASSERT_EQ(octets, expected) << shift << ", " << bits;
        }
    }
}

TEST_F(EntryTest, WhatIsWrittenIsWhatTheDeviceGets) {
    add_device(bus, odd_widths());
    bus.start();
    Output<bool> enable{1, 0x7000, 1};
    Output<std::uint8_t> ramp{1, 0x7000, 2};
    Output<std::int32_t> target{1, 0x7000, 3};
    Output<std::int16_t> odd{EntryAddress::at(1, 0, 2, 1)};
    OutputOctets text{EntryAddress::object(1, 0x7010, 2), 6};
    Output<Mode> mode{1, 0x7010, 3};
    Output<float> gain{1, 0x7020, 1};
    EntryHandle* const entries[] = {&enable, &ramp, &target, &odd, &text, &mode, &gain};
    const auto mapped = map(entries);
    ASSERT_TRUE(mapped.ok()) << words(mapped.error());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    for (const EntryHandle* entry : entries) EXPECT_TRUE(entry->mapped());
    // Offsets calculated by hand: the second PDO begins at bit 40, the second SyncManager at an octet boundary.
    EXPECT_EQ(target.place().offset_bits, 8U);
    EXPECT_EQ(odd.place().offset_bits, 40U);
    EXPECT_EQ(odd.place().index, 0x7010);
    EXPECT_EQ(text.place().offset_bits, 53U);
    EXPECT_EQ(mode.place().offset_bits, 101U);
    EXPECT_EQ(gain.place().offset_bits, 104U);

    enable.write(true);
    ramp.write(0xF6);  // only five bits of the value
    target.write(-123456789);
    odd.write(-2000);
    text.write_text("Margay and more");
    mode.write(Mode::reverse);
    gain.write(-1.5F);
    const Bytes got = outputs(1);
    ASSERT_EQ(got.size(), 17U);
    EXPECT_EQ(bits_at(got, 0, 1), 1U);
    EXPECT_EQ(bits_at(got, 1, 2), 0U) << "the gap";
    EXPECT_EQ(bits_at(got, 3, 5), 0x16U);
    EXPECT_EQ(static_cast<std::int32_t>(bits_at(got, 8, 32)), -123456789);
    EXPECT_EQ(bits_at(got, 40, 13), static_cast<std::uint64_t>(-2000) & 0x1FFF);
    for (unsigned n = 0; n < 6; ++n) EXPECT_EQ(static_cast<char>(bits_at(got, 53 + 8 * n, 8)), "Margay"[n]);
    EXPECT_EQ(bits_at(got, 101, 3), 5U);  // -3 in three bits
    EXPECT_EQ(std::bit_cast<float>(static_cast<std::uint32_t>(bits_at(got, 104, 32))), -1.5F);
    // Written values can be read back.
    EXPECT_TRUE(enable.read());
    EXPECT_EQ(ramp.read(), 0x16);
    EXPECT_EQ(odd.read(), -2000);
    EXPECT_EQ(mode.read(), Mode::reverse);
    std::array<char, 8> back{};
    EXPECT_EQ(text.read_text(back), "Margay");
    // A shorter text is padded with zeros; false clears only its bit.
    text.write_text("IO");
    enable.write(false);
    const Bytes next = outputs(1);
    EXPECT_EQ(bits_at(next, 53 + 16, 32), 0U);
    EXPECT_EQ(bits_at(next, 0, 8), 0x16U << 3);
    EXPECT_EQ(text.read_text(back), "IO");
}

TEST_F(EntryTest, WhatTheDeviceShowsIsWhatIsRead) {
    add_device(bus, odd_widths());
    bus.start();
    Input<bool> limit{1, 0x6000, 1};
    Input<std::int16_t> temperature{1, 0x6000, 2};
    Input<std::uint32_t> position{1, 0x6000, 3};
    Input<double> angle{1, 0x6000, 4};
    Input<std::int64_t> huge{1, 0x6000, 5};
    Input<Mode> state{1, 0x6000, 6};
    InputOctets serial{EntryAddress::object(1, 0x6000, 7), 5};
    Input<std::uint16_t> count{1, 0x6010};
    Input<bool> again{EntryAddress::at(1, 3, 1, 2)};
    EntryHandle* const entries[] = {&limit, &temperature, &position, &angle, &huge, &state, &serial, &count, &again};
    const auto mapped = map(entries);
    ASSERT_TRUE(mapped.ok()) << words(mapped.error());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    EXPECT_EQ(limit.place().bits, 1U) << "the first of the two that are mapped";
    show(1, 0, 1, 1);
    EXPECT_TRUE(limit.read());
    show(1, 1, 12, 0xFFF);
    EXPECT_EQ(temperature.read(), -1) << "sign-extended";
    show(1, 1, 12, 0x800);
    EXPECT_EQ(temperature.read(), -2048);
    show(1, 1, 12, 0x7FF);
    EXPECT_EQ(temperature.read(), 2047);
    show(1, 16, 32, 0xDEADBEEF);
    EXPECT_EQ(position.read(), 0xDEADBEEFU);
    show(1, 48, 64, std::bit_cast<std::uint64_t>(-0.125));
    EXPECT_EQ(angle.read(), -0.125);
    show(1, 112, 61, static_cast<std::uint64_t>(-1234567890123));
    EXPECT_EQ(huge.read(), -1234567890123);
    show(1, 173, 3, 5);
    EXPECT_EQ(state.read(), Mode::reverse);
    for (unsigned n = 0; n < 5; ++n) show(1, 176 + 8 * n, 8, 0x10U * n + 3);
    std::array<std::byte, 8> octets{};
    EXPECT_EQ(serial.read(octets), 5U);
    EXPECT_EQ(octets[4], std::byte{0x43});
    // This entry is in the second SyncManager. The device stores its inputs without gaps.
    show(1, 216, 16, 0xBEEF);
    EXPECT_EQ(count.read(), 0xBEEF);
    EXPECT_FALSE(again.read());
    show(1, 232, 8, 0x40);
    EXPECT_TRUE(again.read()) << "any bit of it";
    EXPECT_EQ(temperature.read(), 2047) << "the neighbours are as they were";
}

// Slaves packed by bits, and images with overlapping halves: a handle reads and writes only its bits.
TEST_F(EntryTest, InPackedAndOverlappedImages) {
    const PdoEntryDescription three[] = {{.index = 0x7000, .subindex = 1, .bit_length = 1},
                                         {.index = 0x7000, .subindex = 2, .bit_length = 2}};
    const PdoEntryDescription five[] = {{.index = 0x6000, .subindex = 1, .bit_length = 4},
                                        {.index = 0x6000, .subindex = 2, .bit_length = 1}};
    for (int n = 0; n < 4; ++n)
        add_device(bus, {.rx = {{.index = 0x1600, .sync_manager = 0, .entries = three}},
                         .tx = {{.index = 0x1A00, .sync_manager = 1, .entries = five}}});
    bus.start();
    Output<bool> one{3, 0x7000, 1};
    Output<std::uint8_t> two{3, 0x7000, 2};  // bits 7 and 8 of the packed image
    Output<std::uint8_t> neighbour{4, 0x7000, 2};
    Input<std::int8_t> number{2, 0x6000, 1};
    Input<bool> flag{2, 0x6000, 2};
    EntryHandle* const entries[] = {&one, &two, &neighbour, &number, &flag};
    for (const bool overlapped : {false, true}) {
        for (const Packing packing : {Packing::bytes, Packing::bits}) {
            group().config.packing = packing;
            group().config.overlapped = overlapped;
            const auto mapped = map(entries);
            ASSERT_TRUE(mapped.ok()) << words(mapped.error());
            ASSERT_EQ(bus.to_op().state, AlState::op);
            if (packing == Packing::bits && !overlapped) {
                EXPECT_EQ(two.place().offset_bits, 7U);
            }
            one.write(true);
            two.write(2);
            neighbour.write(1);
            EXPECT_EQ(bits_at(outputs(3), 0, 3), 5U) << overlapped << ", " << static_cast<int>(packing);
            EXPECT_EQ(bits_at(outputs(4), 0, 3), 2U);
            EXPECT_EQ(bits_at(outputs(2), 0, 3), 0U);
            show(2, 0, 5, 0x18);
            EXPECT_EQ(number.read(), -8);
            EXPECT_TRUE(flag.read());
            show(2, 0, 5, 0x07);
            EXPECT_EQ(number.read(), 7);
            EXPECT_FALSE(flag.read());
        }
    }
}

TEST_F(EntryTest, WhatIsNotMappedIsNamedAndTheOthersAreFound) {
    add_device(bus, odd_widths());
    bus.start();
    Output<bool> enable{1, 0x7000, 1};
    Output<std::uint8_t> missing{1, 0x7000, 9};
    Input<std::uint8_t> nowhere{EntryAddress::at(1, 2, 3, 1)};
    Output<std::uint8_t> nobody{7, 0x7000, 1};
    Output<std::uint32_t> wished{1, 0x7777};
    wished.optional = true;
    EntryHandle* const entries[] = {&enable, &missing, &nowhere, &nobody, &wished};
    const auto mapped = map(entries);
    ASSERT_FALSE(mapped.ok());
    EXPECT_EQ(mapped.error().code, Errc::entry_not_mapped);
    EXPECT_EQ(bus.errors(), (Words{"slave 1: mapping process data of 0x7000:9: no PDO that the slave exchanges has "
                                   "this entry",
                                   "slave 1: mapping process data of 0x1c12:3, entry 1: no PDO that the slave "
                                   "exchanges has this entry",
                                   "slave 7: mapping process data of 0x7000:1: there is no such slave (there are 1)"}));
    EXPECT_TRUE(enable.mapped());
    EXPECT_FALSE(missing.mapped());
    // All other entries were mapped. A handle that is not mapped changes nothing.
    ASSERT_EQ(bus.to_op().state, AlState::op);
    const auto before = image;
    missing.write(0xFF);
    wished.write(0xFFFFFFFF);
    EXPECT_EQ(nowhere.read(), 0);
    EXPECT_EQ(image, before);
    enable.write(true);
    EXPECT_EQ(bits_at(outputs(1), 0, 1), 1U);
}

TEST_F(EntryTest, WrongTypesAreNamed) {
    add_device(bus, odd_widths());
    bus.start();
    Output<std::uint16_t> narrow{1, 0x7000, 3};
    Output<std::uint64_t> wide{1, 0x7000, 3};
    Output<float> number{1, 0x7000, 3};  // no source says that the entry is an integer
    Output<std::uint32_t> integer{1, 0x7020, 1};
    Input<std::uint32_t> input{1, 0x7000, 3};
    Output<bool> many{1, 0x7010, 1};
    OutputOctets octets{EntryAddress::object(1, 0x7010, 2), 5};
    struct {
        EntryHandle& handle;
        std::string says;
    } const cases[] = {
        {narrow,
         "slave 1: mapping process data of 0x7000:3: the entry does not have the size of the type (the type "
         "has 16 bits, the entry 32)"},
        {wide,
         "slave 1: mapping process data of 0x7000:3: the entry does not have the size of the type (the type has "
         "64 bits, the entry 32)"},
        {number, ""},
        {integer,
         "slave 1: mapping process data of 0x7020:1: one of entry and type is a floating point number, the "
         "other is not"},
        {input, "slave 1: mapping process data of 0x7000:3: the direction of the entry differs"},
        {many,
         "slave 1: mapping process data of 0x7010:1: the entry does not have the size of the type (the type has "
         "8 bits, the entry 13)"},
        {octets,
         "slave 1: mapping process data of 0x7010:2: the entry does not have the size of the type (the type "
         "has 40 bits, the entry 48)"},
    };
    for (const auto& c : cases) {
        EntryHandle* const entries[] = {&c.handle};
        const auto mapped = map(entries);
        EXPECT_EQ(mapped.ok() ? "" : words(mapped.error()), c.says);
        EXPECT_EQ(c.handle.mapped(), c.says.empty());
        group().config.entries = {};
    }
}

// After a new mapping at another place the handles have the new place. A handle without its entry is not mapped.
// Offsets that the caller kept are refused.
TEST_F(EntryTest, ARemapFindsThemAnew) {
    add_device(bus, odd_widths());
    add_device(bus, odd_widths());
    bus.start();
    Output<std::uint32_t> target{2, 0x7000, 3};
    EntryHandle* const entries[] = {&target};
    ASSERT_TRUE(map(entries).ok());
    const auto by_hand = find_entry(*bus.ctx, 2, 0x7000, 3);
    ASSERT_TRUE(by_hand.ok()) << words(by_hand.error());
    EXPECT_EQ(by_hand->offset_bits, target.place().offset_bits);
    EXPECT_EQ(target.place().offset_bits, 17U * 8 + 8);
    group().config.overlapped = true;  // the second slave begins behind the longer half of the first slave
    ASSERT_TRUE(map(entries).ok());
    EXPECT_EQ(target.place().offset_bits, 30U * 8 + 8);
    ASSERT_EQ(bus.to_op().state, AlState::op);
    target.write(0x12345678);
    EXPECT_EQ(bits_at(outputs(2), 8, 32), 0x12345678U);
    EXPECT_EQ(read_entry<std::uint32_t>(*bus.ctx, *by_hand).error().code, Errc::entry_stale);
    // After a failed mapping no handle is mapped, and the image does not change.
    std::vector<std::byte> little(3);
    ASSERT_FALSE(config_map(*bus.ctx, little).ok());
    EXPECT_FALSE(target.mapped());
    target.write(0xFFFFFFFF);
    EXPECT_EQ(little, std::vector<std::byte>(3));
}

TEST_F(EntryTest, FoundByHandTheyAreCheckedAtEachAccess) {
    add_device(bus, odd_widths());
    bus.start();
    EXPECT_EQ(find_entry(*bus.ctx, 1, 0x7000, 3).error().code, Errc::unknown_group) << "nothing is mapped yet";
    ASSERT_TRUE(map({}).ok());
    const auto odd = find_entry(*bus.ctx, EntryAddress::at(1, 0, 2, 1));
    ASSERT_TRUE(odd.ok()) << words(odd.error());
    EXPECT_EQ(odd->index, 0x7010);
    EXPECT_EQ(odd->bits, 13U);
    const auto angle = find_entry(*bus.ctx, 1, 0x6000, 4);
    ASSERT_TRUE(angle.ok()) << words(angle.error());
    EXPECT_EQ(angle->direction, Direction::inputs);
    EXPECT_EQ(find_entry(*bus.ctx, 1, 0x7777, 0).error().code, Errc::entry_not_mapped);
    EXPECT_EQ(find_entry(*bus.ctx, 9, 0x7000, 1).error().code, Errc::unknown_slave);
    std::array<char, 32> name{};
    EXPECT_EQ(*read_entry_name(*bus.ctx, 1, 0x7010, 1, name), "Odd");
    EXPECT_EQ(*read_entry_name(*bus.ctx, 1, 0x6000, 7, name), "Serial");
    EXPECT_EQ(read_entry_name(*bus.ctx, 1, 0x7010, 77, name).error().code, Errc::unsupported);
    std::array<char, 3> little{};
    EXPECT_EQ(*read_entry_name(*bus.ctx, 1, 0x6000, 7, little), "Ser");

    ASSERT_EQ(bus.to_op().state, AlState::op);
    EXPECT_TRUE(write_entry<std::int16_t>(*bus.ctx, *odd, -77).ok());
    EXPECT_EQ(*read_entry<std::int16_t>(*bus.ctx, *odd), -77);
    EXPECT_EQ(bits_at(outputs(1), 40, 13), static_cast<std::uint64_t>(-77) & 0x1FFF);
    EXPECT_EQ(read_entry<std::int32_t>(*bus.ctx, *odd).error().code, Errc::entry_size);
    EXPECT_EQ(write_entry(*bus.ctx, *angle, 1.0).error().code, Errc::entry_direction);
    EXPECT_EQ(read_entry<std::uint64_t>(*bus.ctx, *angle).error().code, Errc::entry_type);
    show(1, 48, 64, std::bit_cast<std::uint64_t>(2.5));
    EXPECT_EQ(*read_entry<double>(*bus.ctx, *angle), 2.5);
    EXPECT_EQ(read_entry<bool>(*bus.ctx, EntryPlace{}).error().code, Errc::entry_stale);
}

// A slave without CoE, whose PDOs the application reorders. The SII gives the entries of PDOs without a list of
// entries.
TEST_F(EntryTest, ListsOfTheApplicationCountAboveTheSii) {
    add_device(bus, odd_widths());
    bus.start();
    static constexpr PdoEntry kOwn[] = {{0x7000, 9, 7}, {0x7000, 3, 16}, {0, 0, 1}};
    static constexpr Pdo kOutputs[] = {{0x1601}, {0x1605, kOwn}, {0x1600}};
    static constexpr Pdo kWhole[] = {{0x1606, kOwn}};
    static constexpr SmPdos kPdos[] = {{0, kOutputs}, {1, kWhole}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};
    bus.ctx->slave(1).config.setup = &kSetup;
    Output<std::int16_t> odd{1, 0x7010, 1};
    Output<std::uint8_t> ninth{1, 0x7000, 9};
    Output<std::uint16_t> third{1, 0x7000, 3};
    Output<bool> enable{1, 0x7000, 1};
    Output<std::uint8_t> second{EntryAddress::at(1, 1, 1, 1)};
    EntryHandle* const entries[] = {&odd, &ninth, &third, &enable, &second};
    (void)map(entries);
    EXPECT_EQ(odd.place().offset_bits, 0U);
    EXPECT_EQ(enable.place().offset_bits, 64U + 24);
    EXPECT_EQ(second.place().offset_bits, 64U + 24 + 40);
    EXPECT_TRUE(ninth.mapped());
    EXPECT_TRUE(third.mapped()) << "the list's 16 bits come first";
    EXPECT_EQ(third.place().bits, 16U);
}

// Another thread uses its own images. The handle reads and writes these images, too.
TEST_F(EntryTest, InAnImageForAnotherThread) {
    add_device(bus, odd_widths());
    bus.start();
    Output<std::int16_t> odd{1, 0x7010, 1};
    Input<std::int16_t> temperature{1, 0x6000, 2};
    EntryHandle* const entries[] = {&odd, &temperature};
    std::vector<std::byte> memory(SharedImage::memory_bytes(64, 64));
    SharedImage shared(memory);
    group().config.shared = &shared;
    EXPECT_EQ(temperature.read(shared.inputs()), 0) << "not mapped yet";
    ASSERT_TRUE(map(entries).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    odd.write(shared.outputs(), -1000);
    shared.publish_outputs();
    EXPECT_EQ(bits_at(outputs(1), 40, 13), static_cast<std::uint64_t>(-1000) & 0x1FFF);
    show(1, 1, 12, 0xFF0);
    ASSERT_TRUE(shared.refresh_inputs());
    EXPECT_EQ(temperature.read(shared.inputs()), -16);
    EXPECT_EQ(temperature.read(shared.inputs().first(1)), 0) << "not in there";
}

// A slave that may be missing. Its entries cause no error while the slave is absent, and are found when the slave
// arrives.
class EntryOfALateSlave : public testing::Test, protected Plant {};

TEST_F(EntryOfALateSlave, IsFoundWhenTheSlaveComes) {
    const auto first = make({.product = 0x100});
    ASSERT_TRUE(segment.connect_master({first, 0}));
    SlaveConfiguration io;
    io.source = ConfigurationSource::application;
    io.add({0, Direction::outputs, 0x64, 0x1100, 8});
    io.add({1, Direction::inputs, 0x20, 0x2000, 8});
    const ExpectedSlave expected[] = {
        {.number = 1, .vendor = 0x4D47, .product = 0x100, .config = &io},
        {.number = 2, .vendor = 0x4D47, .product = 0x101, .optional = true, .config = &io}};
    EXPECT_EQ(bring_up(expected), Words());
    Output<std::uint8_t> here{1, 0x7000, 1};
    Output<std::uint8_t> late{2, 0x7000, 1};
    EntryHandle* const entries[] = {&here, &late};
    ctx->group(0).config.entries = entries;
    run();
    EXPECT_TRUE(here.mapped());
    EXPECT_FALSE(late.mapped());
    const auto second = make({.product = 0x101});
    plug({first, 1}, second);
    power(second, true);
    ASSERT_TRUE(until([&] { return in_op(2); })) << joined(events());
    ASSERT_TRUE(late.mapped());
    EXPECT_EQ(late.place().offset_bits, 8U);
    late.write(0xA5);
    EXPECT_EQ(ctx->slave(2).image.outputs.bytes[0], std::byte{0xA5});
    ctx->group(0).config.entries = {};
}

}  // namespace
}  // namespace margay
