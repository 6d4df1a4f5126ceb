// Unusual or wrong tables of authors: complete access to numbers below eight bits, a mapping whose count the master
// cannot write, limits of values that are not numbers.
#include "bench_device.hpp"

namespace margay::subdevice::testing {
namespace {

struct Settings {
    using count = Field<std::uint8_t, 0>;
    using level = Field<std::uint8_t, 1>;  // four of them
    using map_count = Field<std::uint8_t, 5>;
    using map = Field<std::uint32_t, 6>;  // eight of them
    using word = Field<std::uint16_t, 38>;
    static constexpr std::size_t bytes = 40;
};
constexpr Entry level(std::uint8_t subindex) {
    auto entry = flag<Settings::level>(subindex, "Level", od::kReadWrite, 2).within(kLimits<0, 2>);
    entry.offset += subindex - 1u;
    return entry;
}
constexpr Entry kLevels[] = {value<Settings::count>(0, "SubIndex 000", od::kReadWrite, 4).within(kLimits<0, 4>),
                             level(1), level(2), level(3), level(4)};
constexpr Entry kMap[] = {
    value<Settings::map_count>(0, "SubIndex 000", od::kRead, 1),
    octets(1, "Mapping", DataType::unsigned32, od::kReadWritePreop, Settings::map::offset, 4).times(8)};
constexpr Object kTable[] = {record(0x1600, "RxPDO", kMap, &kPdoMappingHooks, DataType::pdo_mapping),
                             record(0x2000, "Levels", kLevels)};
static_assert(well_formed(kTable, Settings::bytes));

class AuthorTables : public ::testing::Test {
  protected:
    void SetUp() override {
        device.start(esc.time);
        hand.configure(128);
        esc.al_control(2);
        (void)device.step(esc.time);
        ASSERT_EQ(esc.al_status(), (AlStatus{AlState::preop, false, 0}));
    }
    // A normal download by complete access.
    Abort write_complete(int index, int from, std::initializer_list<int> data) {
        auto request = sdo_request(0x31, index, from, static_cast<std::uint32_t>(data.size()));
        for (const int octet : data) request.push_back(static_cast<std::byte>(octet));
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, request)));
        for (int n = 0; n < 3; ++n) (void)device.step(esc.time);
        auto reply = hand.fetch();
        EXPECT_FALSE(reply.empty());
        reply.erase(reply.begin(), reply.begin() + wire::kMailboxHeaderBytes);
        reply.resize(wire::coe::kSdoBytes);
        return abort_of(reply);
    }
    [[nodiscard]] std::vector<int> levels() const {
        std::vector<int> all;
        for (std::size_t n = 0; n < 4; ++n) all.push_back(std::to_integer<int>(image[Settings::level::offset + n]));
        return all;
    }

    PlainEsc esc;
    BenchApplication application;
    std::array<std::byte, Settings::bytes> image{};
    ObjectDictionary dictionary{kTable, image, &application};
    std::array<std::byte, 512> staging{};
    CoeServer coe{dictionary, staging, true};
    MailboxProtocol protocols[1] = {{wire::MailboxType::coe, &coe}};
    MailboxMemory<256, 4> memory;
    Mailbox mailbox{esc, memory, protocols};
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data{esc, application, dictionary, process_memory};
    Device device{esc, application, process_data, &mailbox};
    MailHand hand{esc};
};

// ETG.1000.6 "SDO Download (complete access)": subindex 0 contains the number of entries in the data.
TEST_F(AuthorTables, CompleteAccessWritesTheEntriesOfItsCountOnly) {
    ASSERT_EQ(write_complete(0x2000, 0, {4, 0, 0b00'01'10'01}), Abort::none);
    EXPECT_EQ(levels(), (std::vector<int>{1, 2, 1, 0}));
    EXPECT_EQ(write_complete(0x2000, 0, {1, 0, 0b11'11'11'10}), Abort::none);
    EXPECT_EQ(levels(), (std::vector<int>{2, 2, 1, 0})) << "the bits behind the first entry are padding";
    EXPECT_EQ(Settings::count::load(image), 1);
}

TEST_F(AuthorTables, CompleteAccessChecksTheLimitsOfAllThatItWrites) {
    ASSERT_EQ(write_complete(0x2000, 1, {0b10'01'00'01}), Abort::none);
    EXPECT_EQ(levels(), (std::vector<int>{1, 0, 1, 2}));
    EXPECT_EQ(write_complete(0x2000, 1, {0b00'00'11'00}), Abort::value_too_high);
    EXPECT_EQ(write_complete(0x2000, 0, {4, 0, 0b11'00'00'00}), Abort::value_too_high);
    EXPECT_EQ(levels(), (std::vector<int>{1, 0, 1, 2})) << "a refused write changes nothing";
}

// The data of the request end after one entry, so the count in the data is not written.
TEST_F(AuthorTables, ACountThatIsNotWritableDoesNotSayHowManyEntriesAreChecked) {
    EXPECT_EQ(write_complete(0x1600, 0, {8, 0, 8, 0, 0, 0}), Abort::none);
    EXPECT_EQ(Settings::map_count::load(image), 1);
    EXPECT_EQ(Settings::map::load(image), 0x00000008U);
    EXPECT_EQ(write_complete(0x1600, 0, {8, 0, 16, 0, 5, 0}), Abort::length_mismatch) << "a dummy of another size";
}

TEST(AuthorLimits, TheLimitsOfAnUnsignedNumberAreNotNegative) {
    static constexpr Entry kWrong[] = {value<Settings::word>(0, "Word", od::kReadWrite, 7).within(kLimits<-5, 100>)};
    static constexpr Object kObject[] = {variable(0x2000, "Word", kWrong)};
    EXPECT_FALSE(well_formed(kObject, Settings::bytes)) << "no value could be written";
    static constexpr Entry kRight[] = {
        value<Settings::word>(0, "Word", od::kReadWrite, 7).as(DataType::integer16).within(kLimits<-5, 100>)};
    static constexpr Object kSigned[] = {variable(0x2000, "Word", kRight)};
    EXPECT_TRUE(well_formed(kSigned, Settings::bytes));
    // A value of a hook has no initial value in the table.
    static constexpr ObjectHooks kHooks{.memory = [](const ObjectAccess&) { return MutableBytes(); }};
    static constexpr Entry kProvided[] = {
        provided(0, "Level", DataType::unsigned8, 8, od::kReadWrite).within(kLimits<1, 9>)};
    static constexpr Object kOfHook[] = {variable(0x2000, "Level", kProvided, &kHooks)};
    static_assert(well_formed(kOfHook, Settings::bytes));
}

// The compiler does not refuse a table that is not a constant expression.
TEST(AuthorLimits, OctetsHaveNoLimits) {
    const Entry wrong[] = {octets(0, "Name", DataType::octet_string, od::kReadWrite, 0, 20).within(kLimits<0, 100>)};
    const Object object[] = {variable(0x2000, "Name", wrong)};
    EXPECT_FALSE(well_formed(object, Settings::bytes));

    struct OneReply final : Outbox {
        MutableBytes open() override { return octets; }
        void commit(wire::MailboxType, std::size_t bytes, std::uint16_t) override { used = bytes; }
        std::array<std::byte, 128> octets{};
        std::size_t used = 0;
    } out;
    std::array<std::byte, 20> image{};
    ObjectDictionary dictionary(object, image);
    SdoInformation information(dictionary);
    std::array<std::byte, 10> request{};
    request[2] = std::byte{5};  // get entry description of 0x2000:0 with all value information
    store_le<std::uint16_t>(request, 6, 0x2000);
    request[9] = std::byte{0x7F};
    EXPECT_EQ(information.receive(request, 0, out), std::nullopt);
    EXPECT_EQ(out.used, 16U + 4) << "no limits, and the name";
}

}  // namespace
}  // namespace margay::subdevice::testing
