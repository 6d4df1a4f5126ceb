// SDO information, emergencies, diagnosis history and the rules of PDO configuration.
#include "bench_device.hpp"

#include <algorithm>
#include <set>

namespace margay::subdevice {
namespace {

using namespace testing;
namespace coe = wire::coe;
using coe::InfoLayout;

std::vector<std::byte> info_request(int opcode, int index_or_list, int subindex = -1, int value_info = 0) {
    std::vector<std::byte> out(subindex < 0 ? 8 : 10);
    coe::store_header(out, {0, coe::Service::sdo_information});
    InfoLayout::opcode::store(out, static_cast<std::uint8_t>(opcode));
    InfoLayout::index::store(out, static_cast<std::uint16_t>(index_or_list));
    if (subindex >= 0) {
        InfoLayout::entry_subindex::store(out, static_cast<std::uint8_t>(subindex));
        InfoLayout::entry_value_info::store(out, static_cast<std::uint8_t>(value_info));
    }
    return out;
}

// All fragments of a response, joined; their headers are checked.
struct Information {
    int opcode = 0;
    std::vector<std::byte> data;
    unsigned fragments = 0;
    [[nodiscard]] std::string text(std::size_t from) const {
        std::string out;
        for (std::size_t i = from; i < data.size(); ++i) out.push_back(static_cast<char>(data[i]));
        return out;
    }
};

Information ask(Bench& bench, const std::vector<std::byte>& request) {
    Information out;
    EXPECT_TRUE(bench.send(wire::MailboxType::coe, request));
    (void)bench.step();
    unsigned left = 0;
    do {
        const auto reply = bench.receive();
        if (reply.size() < coe::kInfoHeaderBytes) break;
        const auto opcode = InfoLayout::opcode::load(reply);
        const auto fragments_left = InfoLayout::fragments_left::load(reply);
        if (out.fragments != 0) {
            EXPECT_EQ(fragments_left, left - 1);
        }
        EXPECT_EQ((opcode & 0x80) != 0, fragments_left != 0);
        out.opcode = opcode & 0x7F;
        out.data.insert(out.data.end(), reply.begin() + 6, reply.end());
        left = fragments_left;
        ++out.fragments;
    } while (left != 0);
    return out;
}

std::vector<int> indices(const Information& info) {
    std::vector<int> out;
    for (std::size_t i = 2; i + 1 < info.data.size(); i += 2) out.push_back(load_le<std::uint16_t>(info.data, i));
    return out;
}

Abort information_abort(Bench& bench, const std::vector<std::byte>& request) {
    const auto info = ask(bench, request);
    return info.opcode == 7 && info.data.size() == 4 ? static_cast<Abort>(load_le<std::uint32_t>(info.data))
                                                     : Abort::none;
}

// The objects of the bench device, without the objects of its stored values.
std::vector<int> indices_without_stored_values() {
    const std::set<int> absent{0x1010, 0x1011, 0x10F0};
    std::vector<int> out;
    for (const auto& object : table::kObjects)
        if (!absent.contains(object.index)) out.push_back(object.index);
    return out;
}

struct NoStore final : ValueStore {
    std::size_t load(MutableBytes) override { return 0; }
    HookAnswer save(Bytes, Time) override { return Abort::hardware_error; }
};

TEST(SdoInformation, AllFiveListsAndTheirLengths) {
    Bench bench;
    const auto all = indices_without_stored_values();
    EXPECT_EQ(indices(ask(bench, info_request(1, 1))), all);
    EXPECT_EQ(indices(ask(bench, info_request(1, 2))), (std::vector<int>{0x7000}));
    EXPECT_EQ(indices(ask(bench, info_request(1, 3))), (std::vector<int>{0x10F3, 0x10F8, 0x6000}));
    EXPECT_EQ(indices(ask(bench, info_request(1, 4))), (std::vector<int>{0x2000, 0x2002}));
    EXPECT_EQ(indices(ask(bench, info_request(1, 5))), (std::vector<int>{0x2000}));
    const auto lengths = ask(bench, info_request(1, 0));
    EXPECT_EQ(lengths.opcode, 2);
    EXPECT_EQ(lengths.data, raw({0, 0, static_cast<int>(all.size()), 0, 1, 0, 3, 0, 2, 0, 1, 0}));
}

// An object is in the lists exactly when an SDO can read it.
TEST(SdoInformation, AnObjectThatTheDeviceDoesNotHaveIsNotThere) {
    Bench bench;
    for (const int index : {0x1010, 0x1011, 0x10F0}) {
        EXPECT_EQ(information_abort(bench, info_request(3, index)), Abort::no_object) << std::hex << index;
        EXPECT_EQ(information_abort(bench, info_request(5, index, 1)), Abort::no_object) << std::hex << index;
        EXPECT_EQ(upload(bench, index, 1).abort, Abort::no_object) << std::hex << index;
    }
    NoStore store;
    std::array<std::byte, stored_bytes(table::kObjects)> buffer{};
    StoredValues stored(bench.dictionary, store, buffer);
    bench.application.stored = &stored;
    EXPECT_EQ(indices(ask(bench, info_request(1, 1))).size(), std::size(table::kObjects));
    for (const int index : {0x1010, 0x1011, 0x10F0}) {
        EXPECT_EQ(ask(bench, info_request(3, index)).opcode, 4) << std::hex << index;
        EXPECT_EQ(ask(bench, info_request(5, index, 1)).opcode, 6) << std::hex << index;
        EXPECT_EQ(upload(bench, index, 1).abort, Abort::none) << std::hex << index;
    }
}

// Room for one message of 14 octets: four indices behind the header.
class SmallOutbox final : public Outbox {
  public:
    MutableBytes open() override { return message.empty() ? MutableBytes(room_) : MutableBytes{}; }
    void commit(wire::MailboxType, std::size_t bytes, std::uint16_t) override {
        message.assign(room_.begin(), room_.begin() + static_cast<std::ptrdiff_t>(bytes));
    }
    std::vector<std::byte> message;

  private:
    std::array<std::byte, 14> room_{};
};

TEST(SdoInformation, AListWhoseObjectsDisappearMeanwhileEnds) {
    static bool there;
    static constexpr ObjectHooks kHooks{.exists = [](const ObjectAccess&) { return there; }};
    static constexpr Entry kEntry[] = {constant<std::uint8_t>(0, "Value", 1)};
    static constexpr Object kObjects[] = {variable(0x2000, "Value", kEntry), variable(0x2001, "Value", kEntry),
                                          variable(0x2002, "Value", kEntry), variable(0x2003, "Value", kEntry),
                                          variable(0x2004, "Value", kEntry, &kHooks)};
    there = true;
    ObjectDictionary dictionary(kObjects, {});
    SdoInformation information(dictionary);
    SmallOutbox out;
    ASSERT_FALSE(information.receive(info_request(1, 1), 0, out));
    std::vector<std::byte> data(out.message.begin() + coe::kInfoHeaderBytes, out.message.end());
    there = false;
    while (information.busy()) {
        out.message.clear();
        information.step(out);
        ASSERT_GT(out.message.size(), coe::kInfoHeaderBytes);
        data.insert(data.end(), out.message.begin() + coe::kInfoHeaderBytes, out.message.end());
    }
    EXPECT_EQ(data, raw({1, 0, 0, 0x20, 1, 0x20, 2, 0x20, 3, 0x20, 0, 0})) << "the length that was announced";
}

TEST(SdoInformation, FragmentsForEveryMailbox) {
    for (int bytes = 24; bytes <= 80; ++bytes) {
        Bench bench(static_cast<std::uint16_t>(bytes), 3);
        const auto list = ask(bench, info_request(1, 1));
        const auto found = indices(list);
        EXPECT_EQ(found, indices_without_stored_values()) << bytes;
        const auto room = static_cast<std::size_t>(bytes - 12) & ~std::size_t{1};
        EXPECT_EQ(list.fragments, (2 + 2 * found.size() + room - 1) / room) << bytes;
        EXPECT_EQ(ask(bench, info_request(3, 0x1003)).text(6), "Pre-defined error field") << bytes;
        EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u);
    }
}

TEST(SdoInformation, AMasterThatDoesNotFetchBlocksNobodyForGood) {
    Bench bench(24, 2);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, info_request(1, 1)));
    bench.settle();
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    bench.settle();
    while (true) {
        const auto reply = bench.receive();
        ASSERT_FALSE(reply.empty());
        if (coe::load_header(reply).service == coe::Service::sdo_response) break;
    }
}

TEST(SdoInformation, ObjectDescriptionsOctetByOctet) {
    Bench bench;
    EXPECT_EQ(bench.exchange(info_request(3, 0x1018)),
              raw({0, 0x80, 4, 0, 0, 0, 0x18, 0x10, 0x23, 0, 4, 9, 'I', 'd', 'e', 'n', 't', 'i', 't', 'y'}));
    EXPECT_EQ(bench.exchange(info_request(3, 0x2001)),
              raw({0, 0x80, 4, 0, 0, 0, 0x01, 0x20, 0x1B, 0, 0, 7, 'B', 'i', 'g'}));
    const auto types = ask(bench, info_request(3, 0x1C00)).data;
    EXPECT_EQ(types[2], std::byte{5}) << "an array has the type of its elements";
    EXPECT_EQ(types[5], std::byte{8});
}

TEST(SdoInformation, EntryDescriptionsCarryWhatIsAskedForAndThere) {
    Bench bench;
    const auto setting = ask(bench, info_request(5, 0x2000, 0, 0x78));
    EXPECT_EQ(setting.opcode, 6);
    EXPECT_EQ(setting.data, raw({0x00, 0x20, 0,    0x70, 3,   0,   16,  0,   0x3F, 0x03, 100, 0,
                                 0x0C, 0xFE, 0xF4, 0x01, 'S', 'e', 't', 't', 'i',  'n',  'g'}));
    EXPECT_EQ(ask(bench, info_request(5, 0x2000, 0, 0)).data,
              raw({0x00, 0x20, 0, 0, 3, 0, 16, 0, 0x3F, 0x03, 'S', 'e', 't', 't', 'i', 'n', 'g'}));
    EXPECT_EQ(ask(bench, info_request(5, 0x2000, 0, 0x40)).data,
              raw({0x00, 0x20, 0, 0x40, 3, 0, 16, 0, 0x3F, 0x03, 0xF4, 0x01, 'S', 'e', 't', 't', 'i', 'n', 'g'}));
    const auto flag = ask(bench, info_request(5, 0x7000, 3, 0));
    EXPECT_EQ(flag.data, raw({0x00, 0x70, 3, 0, 1, 0, 1, 0, 0x7F, 0, 'B', 'i', 't', ' ', 'a'}));
    EXPECT_EQ(ask(bench, info_request(5, 0x1600, 7, 0)).text(10), "SubIndex 007") << "one of several alike";
    const auto vast = ask(bench, info_request(5, 0x2008, 0, 0x10));
    EXPECT_EQ(load_le<std::uint16_t>(vast.data, 6), 0) << "longer than 65535 bits";
}

TEST(SdoInformation, ErrorsCarryAnAbortCode) {
    Bench bench;
    const auto code = [&](const std::vector<std::byte>& request) { return information_abort(bench, request); };
    EXPECT_EQ(code(info_request(1, 6)), Abort::unsupported_access);
    EXPECT_EQ(code(info_request(3, 0x5000)), Abort::no_object);
    EXPECT_EQ(code(info_request(5, 0x5000, 0)), Abort::no_object);
    EXPECT_EQ(code(info_request(5, 0x1018, 5)), Abort::no_subindex);
    for (const int opcode : {0, 2, 4, 6, 7, 9, 127}) EXPECT_EQ(code(info_request(opcode, 1)), Abort::unknown_command);
}

// --- Emergencies ---

EmergencyMessage emergency(int code, int first) {
    return {static_cast<std::uint16_t>(code),
            0x20,
            {std::byte(first), std::byte{2}, std::byte{3}, std::byte{4}, std::byte{5}}};
}

TEST(Emergency, GoesOutOctetByOctetAndIntoTheHistory) {
    Bench bench;
    auto& emergencies = *bench.application.emergencies();
    EXPECT_TRUE(emergencies.raise(emergency(0x8130, 1)));
    (void)bench.step();
    EXPECT_EQ(bench.receive(), raw({0, 0x10, 0x30, 0x81, 0x20, 1, 2, 3, 4, 5}));
    EXPECT_EQ(upload(bench, 0x1003, 0).number(), 1u);
    EXPECT_EQ(upload(bench, 0x1003, 1).number(), 0x02018130u);
    EXPECT_EQ(upload(bench, 0x1003, 2).abort, Abort::no_subindex);
}

TEST(Emergency, HistoryHasTheNewestFirstAndIsClearedByZero) {
    Bench bench;
    auto& emergencies = *bench.application.emergencies();
    for (int i = 1; i <= 6; ++i) {
        EXPECT_TRUE(emergencies.raise(emergency(0x1000 + i, i)));
        (void)bench.step();
        (void)bench.fetch();
    }
    EXPECT_EQ(upload(bench, 0x1003, 0).number(), 4u) << "as many as there is room for";
    EXPECT_EQ(upload(bench, 0x1003, 1).number() & 0xFFFF, 0x1006u);
    EXPECT_EQ(upload(bench, 0x1003, 4).number() & 0xFFFF, 0x1003u);
    EXPECT_EQ(upload(bench, 0x1003, 0, true).data.size(), 18u);
    EXPECT_EQ(download(bench, 0x1003, 0, number(0, 1)).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x1003, 0).number(), 0u);
    EXPECT_EQ(upload(bench, 0x1003, 1).abort, Abort::no_subindex);
}

TEST(Emergency, QueueIsBoundedAndCountsWhatItLoses) {
    Bench bench(128, 2);
    auto& emergencies = *bench.application.emergencies();
    int taken = 0;
    for (int i = 0; i < 5; ++i) taken += emergencies.raise(emergency(0x2000 + i, i)) ? 1 : 0;
    EXPECT_EQ(taken, 3);
    EXPECT_EQ(emergencies.lost(), 2u);
    for (int i = 0; i < 3; ++i) {
        (void)bench.step();
        EXPECT_EQ(coe::EmergencyLayout::error_code::load(bench.receive()), 0x2000 + i) << "in order";
    }
}

TEST(Emergency, DoesNotBreakIntoATransfer) {
    Bench bench(64);
    ASSERT_EQ(abort_of(bench.exchange(sdo_request(0x40, 0x2003, 0))), Abort::none);
    ASSERT_TRUE(bench.application.emergencies()->raise(emergency(0x8130, 1)));
    (void)bench.step();
    EXPECT_EQ(coe::load_header(bench.receive()).service, coe::Service::emergency);
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::none) << "the upload goes on";
}

// --- Diagnosis history ---

TEST(Diagnosis, MessagesAsTheObjectShowsThem) {
    Bench bench;
    auto& diagnosis = *bench.application.diagnosis();
    EXPECT_EQ(upload(bench, 0x10F3, 1).number(), 3u);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 0u);
    const auto parameter = raw({2, 0x10, 0x34, 0x12});
    EXPECT_TRUE(diagnosis.add({0xE8008130, DiagnosisType::error, 0x0102, 0x1122334455667788, 1, parameter}));
    EXPECT_EQ(upload(bench, 0x10F3, 2).number(), 6u);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u);
    EXPECT_EQ(upload(bench, 0x10F3, 6).data, raw({0x30, 0x81, 0x00, 0xE8, 0x02, 0x01, 0x02, 0x01, 0x88, 0x77,
                                                  0x66, 0x55, 0x44, 0x33, 0x22, 0x11, 2,    0x10, 0x34, 0x12}));
    EXPECT_TRUE(upload(bench, 0x10F3, 7).data.empty());
    EXPECT_EQ(download(bench, 0x10F3, 3, number(6, 1)).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 0u);
    EXPECT_EQ(download(bench, 0x10F3, 3, number(3, 1)).abort, Abort::value_too_low);
    EXPECT_EQ(download(bench, 0x10F3, 3, number(9, 1)).abort, Abort::value_too_high);
    EXPECT_EQ(download(bench, 0x10F3, 3, number(7, 1)).abort, Abort::value_range) << "no message there yet";
}

TEST(Diagnosis, OverwritesOrWaitsForAcknowledgeAsTheMasterWantsIt) {
    Bench bench;
    auto& diagnosis = *bench.application.diagnosis();
    const auto add = [&](unsigned code) { return diagnosis.add({.code = code, .type = DiagnosisType::warning}); };
    for (unsigned i = 1; i <= 4; ++i) EXPECT_TRUE(add(i));
    EXPECT_EQ(upload(bench, 0x10F3, 2).number(), 6u);
    EXPECT_EQ(upload(bench, 0x10F3, 6).data[0], std::byte{4}) << "the oldest is overwritten";
    EXPECT_EQ(upload(bench, 0x10F3, 5).number(), 0x20u) << "and that is told";
    EXPECT_EQ(download(bench, 0x10F3, 3, number(0, 1)).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x10F3, 2).number(), 0u);
    EXPECT_EQ(download(bench, 0x10F3, 5, number(0x10, 2)).abort, Abort::none);
    for (unsigned i = 1; i <= 3; ++i) EXPECT_TRUE(add(i));
    EXPECT_FALSE(add(4));
    EXPECT_EQ(upload(bench, 0x10F3, 5).number(), 0x30u);
    EXPECT_EQ(download(bench, 0x10F3, 3, number(7, 1)).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u) << "the third is not acknowledged";
    EXPECT_TRUE(add(5));
    EXPECT_EQ(download(bench, 0x10F3, 5, number(0x04, 2)).abort, Abort::none);
    EXPECT_FALSE(add(6)) << "no warnings wanted";
    EXPECT_EQ(download(bench, 0x10F3, 5, number(0x100, 2)).abort, Abort::value_range);
}

TEST(Diagnosis, InOverwriteModeReadingTheNewestMessageClearsTheFlag) {
    Bench bench;
    auto& diagnosis = *bench.application.diagnosis();
    EXPECT_TRUE(diagnosis.add({.code = 1}));
    EXPECT_TRUE(diagnosis.add({.code = 2}));
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u);
    (void)upload(bench, 0x10F3, 6);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u) << "the newest is in subindex 7";
    (void)upload(bench, 0x10F3, 7);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 0u);
    EXPECT_TRUE(diagnosis.add({.code = 3}));
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u);
    EXPECT_EQ(download(bench, 0x10F3, 5, number(0x10, 2)).abort, Abort::none);
    (void)upload(bench, 0x10F3, 8);
    EXPECT_EQ(upload(bench, 0x10F3, 4).number(), 1u) << "acknowledge mode: only an acknowledge clears it";
}

TEST(Diagnosis, TheEmergencyFlagSendsEmergencies) {
    Bench bench;
    auto& diagnosis = *bench.application.diagnosis();
    EXPECT_TRUE(diagnosis.add({.code = 0xE8001234}));
    (void)bench.step();
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_EQ(download(bench, 0x10F3, 5, number(0x01, 2)).abort, Abort::none);
    EXPECT_TRUE(diagnosis.add({.code = 0xE8008130, .type = DiagnosisType::error, .text_id = 0x0102}));
    (void)bench.step();
    EXPECT_EQ(bench.receive(), raw({0, 0x10, 0x30, 0x81, 0, 0x02, 0x01, 0x02, 0, 0}));
    std::array<std::byte, 64> memory{};
    const DiagnosisHistory without(memory, 2);
    EXPECT_EQ(without.check_write(5, raw({1, 0})), Abort::value_range) << "there are no emergencies to send";
    EXPECT_EQ(without.check_write(5, raw({0x1E, 0})), Abort::none);
}

TEST(Diagnosis, NewestMessageAndNewMessagesCanBeMapped) {
    Bench bench;
    ASSERT_EQ(download(bench, 0x1A00, 0, number(0, 1)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 1, number(0x10F30208, 4)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 2, number(0x10F30401, 4)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 3, number(0x0000000F, 4)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 0, number(3, 1)).abort, Abort::none);
    EXPECT_EQ(download(bench, 0x1A00, 0, number(0, 1)).abort, Abort::none);
    EXPECT_EQ(download(bench, 0x1A00, 1, number(0x10F30108, 4)).abort, Abort::cannot_be_mapped);
    EXPECT_EQ(download(bench, 0x1A00, 1, number(0x10F30208, 4)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1A00, 0, number(3, 1)).abort, Abort::none);
    bench.esc.configure(3, {0x1300, 3, 0x20, 1});
    EXPECT_TRUE(bench.application.diagnosis()->add({.code = 1}));
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    std::vector<std::byte> inputs(3);
    ASSERT_TRUE(bench.esc.ecat_read(0x1300, inputs));
    EXPECT_EQ(inputs, raw({6, 1, 0}));
}

// --- PDO configuration ---

TEST(PdoRules, ZeroFirstThenEntriesThenTheCount) {
    using enum Abort;
    Bench bench;
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x70000108, 4)).abort, subindex_needs_zero);
    EXPECT_EQ(download(bench, 0x1600, 0, number(0, 1)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x70000301, 4)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 2, number(0x00000007, 4)).abort, none) << "a gap";
    EXPECT_EQ(download(bench, 0x1600, 3, number(0x70000210, 4)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 0, number(3, 1)).abort, none);
    bench.esc.configure(2, {0x1200, 3, 0x64, 1});
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0xFF, 0x34, 0x12})));
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(Values::bit_a::load(bench.image), 1);
    EXPECT_EQ(Values::out_b::load(bench.image), 0x1234);
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "not mapped any more";
}

TEST(PdoRules, ADataTypeIsADummyOfItsSize) {
    using enum Abort;
    Bench bench;
    ASSERT_EQ(download(bench, 0x1600, 0, number(0, 1)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x00050010, 4)).abort, length_mismatch) << "UNSIGNED8 has 8 bits";
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x00050108, 4)).abort, length_mismatch) << "it has no subindex 1";
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x00080020, 4)).abort, no_object) << "REAL32 is no dummy";
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x00050008, 4)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 2, number(0x00060010, 4)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 3, number(0x70000210, 4)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 0, number(3, 1)).abort, none);
    bench.esc.configure(2, {0x1200, 5, 0x64, 1});
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0xFF, 0xFF, 0xFF, 0x34, 0x12})));
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(Values::out_b::load(bench.image), 0x1234);
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "not mapped any more";
}

TEST(PdoRules, WhatCannotBeMappedIsRefusedWithItsReason) {
    using enum Abort;
    Bench bench;
    ASSERT_EQ(download(bench, 0x1600, 0, number(0, 1)).abort, none);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x50000108, 4)).abort, no_object);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x70000908, 4)).abort, no_subindex);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x60000110, 4)).abort, cannot_be_mapped) << "an input";
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x10180120, 4)).abort, cannot_be_mapped);
    EXPECT_EQ(download(bench, 0x1600, 1, number(0x70000110, 4)).abort, length_mismatch);
    EXPECT_EQ(download(bench, 0x1600, 0, number(9, 1)).abort, value_too_high);
    EXPECT_EQ(download(bench, 0x1601, 0, number(0, 1)).abort, read_only) << "a fixed PDO";
    for (int n = 1; n <= 8; ++n) {
        ASSERT_EQ(download(bench, 0x1600, n, number(0x000000FF, 4)).abort, none);
    }
    EXPECT_EQ(download(bench, 0x1600, 0, number(8, 1)).abort, exceeds_pdo) << "255 octets do not fit 16";
    EXPECT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, none);
    EXPECT_EQ(download(bench, 0x1C12, 1, number(0x1A00, 2)).abort, value_range);
    EXPECT_EQ(download(bench, 0x1C12, 1, number(0x16FF, 2)).abort, value_range);
    EXPECT_EQ(download(bench, 0x1C12, 1, number(0x1601, 2)).abort, none);
    EXPECT_EQ(download(bench, 0x1C12, 0, number(2, 1)).abort, value_range) << "the second is not set";
    EXPECT_EQ(download(bench, 0x1C12, 0, number(1, 1)).abort, none);
}

TEST(PdoRules, CompleteAccessWritesAllAtOnceOrNothing) {
    using enum Abort;
    Bench bench;
    EXPECT_EQ(download(bench, 0x1C12, 0, raw({2, 0, 0x00, 0x16, 0x01, 0x16}), true).abort, none);
    EXPECT_EQ(upload(bench, 0x1C12, 0, true).data, raw({2, 0, 0x00, 0x16, 0x01, 0x16}));
    EXPECT_EQ(download(bench, 0x1C12, 0, raw({2, 0, 0x00, 0x16, 0xFF, 0x16}), true).abort, value_range);
    EXPECT_EQ(upload(bench, 0x1C12, 0, true).data, raw({2, 0, 0x00, 0x16, 0x01, 0x16}));
    EXPECT_EQ(download(bench, 0x1C12, 0, raw({0, 0}), true).abort, none);
    EXPECT_EQ(upload(bench, 0x1C12, 0).number(), 0u);
    EXPECT_EQ(download(bench, 0x1C12, 0, raw({5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}), true).abort, value_too_high);
    EXPECT_EQ(download(bench, 0x1600, 0, raw({1, 0, 0x08, 0x01, 0x00, 0x70}), true).abort, none);
    EXPECT_EQ(download(bench, 0x1C12, 0, raw({1, 0, 0x00, 0x16}), true).abort, none);
    bench.esc.configure(2, {0x1200, 1, 0x64, 1});
    EXPECT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0})) << "one octet now";
}

}  // namespace
}  // namespace margay::subdevice
