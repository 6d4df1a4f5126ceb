// Entries of process data of slaves with a dictionary. The master finds them while it reads the PDOs, either the PDOs
// of the application or the lists of the slave.
#include "segment/field_notes.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class EntriesByDictionary : public FieldNotes {};

constexpr PdoEntry kGapped[] = {{0x7000, 9, 16}, {0, 0, 8}, {0x7000, 1, 16}};
constexpr PdoEntry kTwo[] = {{0x6000, 31, 16}, {0x6000, 32, 16}};
constexpr Pdo kOddOutputs[] = {{0x1601, kGapped}};
constexpr Pdo kOddInputs[] = {{0x1A01}, {0x1A00, kTwo}};
constexpr SmPdos kOddPdos[] = {{2, kOddOutputs}, {3, kOddInputs}};
constexpr SlaveSetup kOddSetup{.pdos = kOddPdos};

TEST_F(EntriesByDictionary, AreFoundAsTheyAreMapped) {
    const std::initializer_list<Names> manners{{}, {"refuses_complete_access"}, {"no_assignment"}};
    for (const auto& names : manners) plug_odd(names);
    start();
    for (std::uint16_t n = 1; n <= manners.size(); ++n) {
        std::array<char, 32> name{};
        EXPECT_EQ(*read_entry_name(ctx, n, 0x6000, 31, name), "SubIndex 031")
            << "by its dictionary, its SII does not have it";
    }
    for (std::uint16_t n = 1; n <= manners.size(); ++n) {
        SCOPED_TRACE(n);
        Output<std::uint16_t> first{n, 0x7000, 1};
        Output<std::uint16_t> third{EntryAddress::at(n, 2, 1, 3)};
        Input<std::uint16_t> back{n, 0x6000, 1};
        Input<std::uint16_t> fourth{EntryAddress::at(n, 3, 1, 4)};
        EntryHandle* const entries[] = {&first, &third, &back, &fourth};
        ctx.group(0).config.entries = entries;
        ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(n);
        EXPECT_EQ(third.place().index, 0x7000);
        EXPECT_EQ(third.place().subindex, 3);
        EXPECT_EQ(third.place().offset_bits, ctx.slave(n).image.outputs.offset_bits + 32);
        EXPECT_EQ(fourth.place().subindex, 4);
        first.write(0x1234);
        cycles(5);
        EXPECT_EQ(back.read(), 0x1234);
        ctx.group(0).config.entries = {};
    }
}

// The PDO mapping of a dictionary has no data types; the SII of the drive has, for the same objects.
TEST_F(EntriesByDictionary, HaveTheDataTypesOfTheSii) {
    plug("drive");
    start();
    Output<float> wrong{1, 0x607A, 0};
    Output<std::int32_t> right{1, 0x607A, 0};
    EntryHandle* const entries[] = {&wrong, &right};
    ctx.group(0).config.entries = entries;
    for (int mapping = 0; mapping < 2; ++mapping) {
        const auto mapped = config_map(ctx, image);
        EXPECT_EQ(mapped.error().code, Errc::entry_type) << words(mapped.error());
        EXPECT_FALSE(wrong.mapped());
        EXPECT_TRUE(right.mapped());
        EXPECT_EQ(right.place().data_type, 0x04) << "INTEGER32";
    }
}

TEST_F(EntriesByDictionary, FollowTheListsOfTheApplication) {
    plug_odd({});
    plug_odd({});
    start();
    ctx.slave(2).config.setup = &kOddSetup;
    Output<std::uint16_t> ninth{2, 0x7000, 9};
    Output<std::uint16_t> first{2, 0x7000, 1};
    Input<std::uint16_t> back{2, 0x6000, 9};
    Input<std::uint16_t> last{2, 0x6000, 32};
    Input<std::uint16_t> second{EntryAddress::at(2, 3, 2, 1)};
    Output<std::uint16_t> gone{2, 0x7000, 5};
    gone.optional = true;
    EntryHandle* const entries[] = {&ninth, &first, &back, &last, &second, &gone};
    ctx.group(0).config.entries = entries;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    const std::uint32_t out = ctx.slave(2).image.outputs.offset_bits;
    const std::uint32_t in = ctx.slave(2).image.inputs.offset_bits;
    EXPECT_EQ(ninth.place().offset_bits, out);
    EXPECT_EQ(first.place().offset_bits, out + 24);
    EXPECT_EQ(back.place().offset_bits, in + 4 * 16);
    EXPECT_EQ(last.place().offset_bits, in + 9 * 16);
    EXPECT_EQ(second.place().subindex, 31);
    EXPECT_FALSE(gone.mapped());
    ninth.write(0xBEEF);
    cycles(5);
    EXPECT_EQ(back.read(), 0xBEEF);
    // The same by a request during cycles.
    EntryRequest request;
    request.address = EntryAddress::object(2, 0x6000, 32);
    ASSERT_TRUE(submit(ctx, request));
    for (int n = 0; n < 1000 && request.busy(); ++n) (void)cycle();
    ASSERT_EQ(request.state(), RequestState::success) << words(request.error());
    EXPECT_EQ(request.place.offset_bits, last.place().offset_bits);
    EXPECT_EQ(request.place.direction, Direction::inputs);
}

// The slave does not answer the read of its PDOs: no entry is copied from another source.
TEST_F(EntriesByDictionary, AreNotGuessedWhereTheSlaveDoesNotAnswer) {
    plug_odd({"never_replies"});
    plug_odd({});
    start();
    Output<std::uint16_t> silent{1, 0x7000, 1};
    Output<std::uint16_t> other{2, 0x7000, 1};
    EntryHandle* const entries[] = {&silent, &other};
    ctx.group(0).config.entries = entries;
    const auto mapped = config_map(ctx, image);
    EXPECT_EQ(mapped.error().code, Errc::timeout) << words(mapped.error());
    EXPECT_EQ(mapped.error().slave, 1);
    EXPECT_FALSE(silent.mapped());
    EXPECT_TRUE(other.mapped());
}

}  // namespace
}  // namespace margay
