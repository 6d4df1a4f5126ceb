// The SoE server: elements, fragments in both directions, write protection by state, lists, procedure commands,
// notifications. The octets are written by hand from ETG.1000.6; tshark decodes all of them, too (tshark_test.cpp).
#include "subdevice/soe_server.hpp"

#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
using Octets = std::vector<std::byte>;

struct DriveValues {
    using position = Field<std::int32_t, 0>;
    using limit = Field<std::uint16_t, 4>;
    using offset_value = Field<std::int16_t, 6>;
    static constexpr std::size_t telegram = 8;
    static constexpr std::size_t label = telegram + soe_list_bytes(8);
    static constexpr std::size_t homing = label + soe_list_bytes(100);
    static constexpr std::size_t bytes = homing + kSoeCommandBytes;
};
constexpr Idn kDefaults[] = {Idn::standard(51), Idn::standard(40)};
constexpr SoeParameter kAscending[] = {
    soe_constant<std::uint16_t>(Idn::standard(15), "Telegram type", 7),
    soe_idn_list(Idn::standard(16), "AT list", DriveValues::telegram, 8, kDefaults).protect(false, true, true),
    soe_all(Idn::standard(17), "All IDNs", SoeStorage::all_idns),
    soe_all(Idn::standard(25), "All commands", SoeStorage::all_commands),
    soe_text(Idn::standard(30), "Manufacturer version", "Margay 1.0"),
    soe_value<DriveValues::position>(Idn::standard(51), "Position feedback value", "inc", 4).read_only(),
    soe_value<DriveValues::limit>(Idn::standard(91), "Velocity limit", "rpm").within(10, 60000).starts_with(3000),
    soe_procedure(Idn::standard(148), "Homing", DriveValues::homing),
    soe_value<DriveValues::offset_value>(Idn::standard(150), "Offset").within(-5, 5).protect(false, false, true),
    soe_list(Idn::product(1), "Label", DriveValues::label, 100, 1, SoeType::text),
};
constexpr SoeParameter kDescending[] = {kAscending[5], kAscending[0]};
static_assert(well_formed(kAscending, DriveValues::bytes));
static_assert(!well_formed(kDescending, DriveValues::bytes));
static_assert(!well_formed(kAscending, DriveValues::bytes - 1));

class Author final : public SoeApplication {
  public:
    SoeError before_read(const SoeAccess& access) override {
        ++reads;
        return access.parameter.idn == Idn::standard(51) ? read_error : SoeError::none;
    }
    SoeError before_write(const SoeAccess& access, Bytes value) override {
        last_state = access.state;
        return value.size() == 2 && load_le<std::uint16_t>(value) == 1234 ? SoeError::value_settings : SoeError::none;
    }
    void after_write(const SoeAccess&) override { ++writes; }
    SoeError start_command(const SoeAccess& access) override {
        ++started;
        if (at_once) server->finish_command(access.drive, access.parameter.idn, true);
        return refuse;
    }
    void stop_command(const SoeAccess&) override { ++stopped; }

    SoeServer* server = nullptr;
    SoeError read_error = SoeError::none;
    SoeError refuse = SoeError::none;
    AlState last_state = AlState::none;
    bool at_once = false;
    unsigned reads = 0;
    unsigned writes = 0;
    unsigned started = 0;
    unsigned stopped = 0;
};

Octets octets(std::initializer_list<unsigned> values) {
    Octets out;
    for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

constexpr std::uint16_t kMailbox = 32;  // 22 octets of data in a message

class SoeServerTest : public ::testing::Test {
  protected:
    SoeServerTest() : protocols_{{{wire::MailboxType::coe, &bench.coe}, {wire::MailboxType::soe, &server}}} {
        author.server = &server;
        for (const auto& drive : drives) drive.restore_defaults();
        bench.mailbox.emplace(bench.esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(kMailbox);
        (void)bench.request(2);
    }
    Octets exchange(const Octets& data) {
        EXPECT_TRUE(bench.send(wire::MailboxType::soe, data));
        (void)bench.step();
        return bench.receive(wire::MailboxType::soe);
    }
    Octets exchange(std::initializer_list<unsigned> data) { return exchange(octets(data)); }
    // The elements of a parameter, collected from the fragments.
    Octets read(Idn idn, unsigned elements = soe_element::kValue, unsigned drive = 0) {
        Octets all;
        Octets part = exchange({1U | drive << 5, elements, idn.value & 0xFFU, unsigned{idn.value} >> 8});
        for (;;) {
            if (part.size() < 4) return {};
            const auto header = wire::soe::load_header(part);
            EXPECT_EQ(header.opcode, wire::soe::Opcode::read_response);
            EXPECT_EQ(header.drive, drive);
            EXPECT_EQ(header.elements, elements);
            if (header.error) return octets({std::to_integer<unsigned>(part[4]), std::to_integer<unsigned>(part[5])});
            all.insert(all.end(), part.begin() + 4, part.end());
            if (!header.incomplete) {
                EXPECT_EQ(header.idn(), idn);
                return all;
            }
            EXPECT_EQ(part.size(), 26U);
            part = bench.receive(wire::MailboxType::soe);
        }
    }
    SoeError error(Idn idn, unsigned elements = soe_element::kValue, unsigned drive = 0) {
        const auto answer = exchange({1U | drive << 5, elements, idn.value & 0xFFU, unsigned{idn.value} >> 8});
        const auto header = wire::soe::load_header(answer);
        EXPECT_EQ(header.idn(), idn);
        EXPECT_EQ(header.drive, drive);
        return header.error ? load_le<SoeError>(answer, 4) : SoeError::none;
    }
    SoeError write(Idn idn, const Octets& value, unsigned elements = soe_element::kValue) {
        Octets message = octets({3U, elements, idn.value & 0xFFU, unsigned{idn.value} >> 8});
        message.insert(message.end(), value.begin(), value.end());
        const auto answer = exchange(message);
        const auto header = wire::soe::load_header(answer);
        EXPECT_EQ(header.opcode, wire::soe::Opcode::write_response);
        EXPECT_EQ(header.idn(), idn);
        EXPECT_EQ(answer.size(), header.error ? 6U : 4U);
        return header.error ? load_le<SoeError>(answer, 4) : SoeError::none;
    }
    SoeError write(Idn idn, std::initializer_list<unsigned> value, unsigned elements = soe_element::kValue) {
        return write(idn, octets(value), elements);
    }
    void silent(const Octets& data) {
        EXPECT_TRUE(bench.send(wire::MailboxType::soe, data));
        bench.settle();
        EXPECT_TRUE(bench.fetch().empty());
    }

    Bench bench{kMailbox};
    Author author;
    std::array<std::byte, DriveValues::bytes> image{};
    std::array<std::byte, DriveValues::bytes> second{};
    std::array<SoeDrive, 2> drives{{{kAscending, image, &author}, {kAscending, second, nullptr}}};
    std::array<std::byte, 160> staging{};
    SoeServer server{drives, staging};

  private:
    std::array<MailboxProtocol, 2> protocols_;
    std::array<std::byte, kMailbox> receive_{};
    std::array<std::byte, 4 * kMailbox> send_{};
};

TEST_F(SoeServerTest, ReadsEveryElement) {
    DriveValues::position::store(image, -2);
    EXPECT_EQ(exchange({0x01, 0x40, 0x33, 0x00}), octets({0x02, 0x40, 0x33, 0x00, 0xFE, 0xFF, 0xFF, 0xFF}));
    EXPECT_EQ(author.reads, 1U);
    const Idn limit = Idn::standard(91);
    EXPECT_EQ(read(limit, soe_element::kName),
              octets({14, 0, 14, 0, 'V', 'e', 'l', 'o', 'c', 'i', 't', 'y', ' ', 'l', 'i', 'm', 'i', 't'}));
    EXPECT_EQ(read(limit, soe_element::kUnit), octets({3, 0, 3, 0, 'r', 'p', 'm'}));
    EXPECT_EQ(read(limit, soe_element::kMinimum), octets({10, 0}));
    EXPECT_EQ(read(limit, soe_element::kMaximum), octets({0x60, 0xEA}));
    EXPECT_EQ(read(limit, soe_element::kDefault), octets({0xB8, 0x0B}));
    EXPECT_EQ(read(limit), octets({0xB8, 0x0B}));
    EXPECT_EQ(read(limit, soe_element::kDataState), octets({0, 0}));
    EXPECT_EQ(read(Idn::standard(51), soe_element::kAttribute),
              octets({0x01, 0x00, 0x22, 0x74}));  // 4 octets, signed, 4 decimals, never writable
    EXPECT_EQ(read(Idn::standard(16), soe_element::kAttribute),
              octets({0x01, 0x00, 0x55, 0x60}));  // list of IDNs, not writable in SAFEOP and OP
    EXPECT_EQ(read(Idn::standard(148), soe_element::kAttribute), octets({0x01, 0x00, 0x09, 0x00}));
    // Several elements are sent in the order of their bits.
    EXPECT_EQ(read(limit, 0x70), octets({10, 0, 0x60, 0xEA, 0xB8, 0x0B}));
    EXPECT_EQ(read(Idn::standard(15)), octets({7, 0}));
    EXPECT_EQ(author.reads, 5U);  // values and data states only
}

TEST_F(SoeServerTest, ListsHaveAHeadAndComeInFragments) {
    EXPECT_EQ(read(Idn::standard(16)), octets({4, 0, 8, 0, 51, 0, 40, 0}));
    EXPECT_EQ(read(Idn::standard(25)), octets({2, 0, 2, 0, 148, 0}));
    EXPECT_EQ(read(Idn::standard(17)), octets({20, 0, 20, 0, 15, 0, 16,  0, 17,  0, 25,   0,
                                               30, 0, 51, 0, 91, 0, 148, 0, 150, 0, 0x01, 0x80}));  // two fragments
    EXPECT_EQ(read(Idn::standard(30)), octets({10, 0, 10, 0, 'M', 'a', 'r', 'g', 'a', 'y', ' ', '1', '.', '0'}));
    EXPECT_EQ(read(Idn::product(1)), octets({0, 0, 100, 0}));
    // Fragments count down, and another request waits until the last fragment.
    Octets value = octets({100, 0, 0, 0});
    for (unsigned n = 0; n < 100; ++n) value.push_back(static_cast<std::byte>(n));
    for (unsigned at = 0, left = 4; at < value.size(); at += 22, --left) {
        Octets message = left != 0 ? octets({0x0B, 0x40, left, 0}) : octets({0x03, 0x40, 0x01, 0x80});
        const auto end = std::min<std::size_t>(at + 22, value.size());
        message.insert(message.end(), value.begin() + at, value.begin() + static_cast<std::ptrdiff_t>(end));
        if (left != 0)
            silent(message);
        else
            EXPECT_EQ(exchange(message), octets({0x04, 0x40, 0x01, 0x80}));
    }
    EXPECT_EQ(author.writes, 1U);
    value[2] = std::byte{100};
    EXPECT_EQ(read(Idn::product(1)), value);
    EXPECT_TRUE(bench.send(wire::MailboxType::soe, octets({0x01, 0x40, 0x01, 0x80})));
    bench.settle();
    EXPECT_TRUE(bench.send(wire::MailboxType::soe, octets({0x01, 0x40, 0x0F, 0x00})));
    bench.settle();
    for (unsigned left = 4; left > 0; --left) {
        const auto part = bench.receive(wire::MailboxType::soe);
        EXPECT_EQ(wire::soe::load_header(part).number, left);
    }
    EXPECT_EQ(bench.receive(wire::MailboxType::soe).size(), 4U + 104 - 4 * 22);
    EXPECT_EQ(bench.receive(wire::MailboxType::soe), octets({0x02, 0x40, 0x0F, 0x00, 7, 0}));
}

TEST_F(SoeServerTest, WhatIsNotThereIsTold) {
    EXPECT_EQ(error(Idn::standard(1)), SoeError::no_idn);
    EXPECT_EQ(error(Idn::standard(15), soe_element::kValue, 2), SoeError::invalid_drive);
    EXPECT_EQ(error(Idn::standard(15), 0), SoeError::no_element);
    EXPECT_EQ(error(Idn::standard(15), soe_element::kUnit), SoeError::no_unit);
    EXPECT_EQ(error(Idn::standard(15), soe_element::kMinimum), SoeError::no_minimum);
    EXPECT_EQ(error(Idn::standard(15), soe_element::kMaximum), SoeError::no_maximum);
    EXPECT_EQ(error(Idn::standard(16), soe_element::kDefault), SoeError::no_default);
    author.read_error = SoeError::general;
    EXPECT_EQ(error(Idn::standard(51)), SoeError::general);
    EXPECT_EQ(error(Idn::standard(51), soe_element::kValue, 1), SoeError::none);  // the command of the other drive
}

TEST_F(SoeServerTest, WritesAreCheckedBeforeTheyChangeAnything) {
    const Idn limit = Idn::standard(91);
    const Idn offset = Idn::standard(150);
    EXPECT_EQ(write(limit, {0x10, 0x27}), SoeError::none);
    EXPECT_EQ(DriveValues::limit::load(image), 10000);
    EXPECT_EQ(author.last_state, AlState::preop);
    EXPECT_EQ(write(limit, {9, 0}), SoeError::value_too_small);
    EXPECT_EQ(write(limit, {0xFF, 0xFF}), SoeError::value_too_large);  // 65535, not −1
    EXPECT_EQ(write(limit, {1}), SoeError::value_too_short);
    EXPECT_EQ(write(limit, {1, 2, 3}), SoeError::value_too_long);
    EXPECT_EQ(write(limit, {0xD2, 0x04}), SoeError::value_settings);  // refused by the application
    EXPECT_EQ(write(offset, {0xFB, 0xFF}), SoeError::none);
    EXPECT_EQ(write(offset, {0xFA, 0xFF}), SoeError::value_too_small);
    EXPECT_EQ(write(offset, {6, 0}), SoeError::value_too_large);
    EXPECT_EQ(DriveValues::offset_value::load(image), -5);
    EXPECT_EQ(DriveValues::limit::load(image), 10000);
    EXPECT_EQ(write(Idn::standard(51), {1, 0, 0, 0}), SoeError::value_read_only);
    EXPECT_EQ(write(Idn::standard(30), {1, 0, 1, 0, 1}), SoeError::value_read_only);
    EXPECT_EQ(write(Idn::standard(99), {1, 0}), SoeError::no_idn);
    for (const auto& [element, code] : {std::pair{soe_element::kName, SoeError::name_read_only},
                                        {soe_element::kAttribute, SoeError::attribute_read_only},
                                        {soe_element::kUnit, SoeError::unit_read_only},
                                        {soe_element::kMinimum, SoeError::minimum_read_only},
                                        {soe_element::kMaximum, SoeError::maximum_read_only},
                                        {soe_element::kDefault, SoeError::default_read_only}})
        EXPECT_EQ(write(limit, {1, 0}, element), code);
    const Idn list = Idn::standard(16);
    EXPECT_EQ(write(list, {2, 0, 0, 0, 40, 0}), SoeError::none);
    EXPECT_EQ(read(list), octets({2, 0, 8, 0, 40, 0}));
    EXPECT_EQ(write(list, {2, 0}), SoeError::value_too_short);
    EXPECT_EQ(write(list, {4, 0, 0, 0, 40, 0}), SoeError::value_too_short);
    EXPECT_EQ(write(list, {2, 0, 0, 0, 40, 0, 1}), SoeError::value_too_long);
    EXPECT_EQ(write(list, {1, 0, 0, 0, 40}), SoeError::value_invalid);
    EXPECT_EQ(write(list, {10, 0, 0, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5, 0}), SoeError::value_too_long);
    EXPECT_EQ(read(list), octets({2, 0, 8, 0, 40, 0}));
}

TEST_F(SoeServerTest, WriteProtectionGoesByState) {
    EXPECT_EQ(write(Idn::standard(16), {0, 0, 0, 0}), SoeError::none);
    EXPECT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(write(Idn::standard(16), {0, 0, 0, 0}), SoeError::value_protected);
    EXPECT_EQ(write(Idn::standard(150), {1, 0}), SoeError::none);
    EXPECT_EQ(author.last_state, AlState::safeop);
    bench.esc.ecat_write(0x1200, std::array<std::byte, 4>{});
    bench.settle();
    bench.request(8);
    bench.esc.ecat_write(0x1200, std::array<std::byte, 4>{});
    bench.settle();
    ASSERT_EQ(bench.esc.al_status().state, AlState::op);
    EXPECT_EQ(write(Idn::standard(150), {1, 0}), SoeError::value_protected);
    EXPECT_EQ(write(Idn::standard(91), {100, 0}), SoeError::none);
    EXPECT_EQ(bench.request(2).state, AlState::preop);
    EXPECT_EQ(write(Idn::standard(16), {0, 0, 0, 0}), SoeError::none);
}

TEST_F(SoeServerTest, FragmentsThatAreGivenUpOrTooMany) {
    Octets fragment = octets({0x0B, 0x40, 3, 0, 1, 2, 3, 4});
    silent(fragment);
    EXPECT_EQ(write(Idn::standard(91), {100, 0}), SoeError::none);  // a separate write
    silent(fragment);
    EXPECT_EQ(read(Idn::standard(91)), octets({100, 0}));
    fragment[2] = std::byte{1};
    fragment.resize(26);
    silent(fragment);  // the read has ended the first write, so this fragment starts a new write
    EXPECT_EQ(write(Idn::standard(91), {1}), SoeError::value_too_long);
    // A value that is too long is received completely, then refused.
    fragment[4] = std::byte{200};
    for (unsigned left = 9; left > 0; --left) {
        fragment[2] = static_cast<std::byte>(left);
        silent(fragment);
    }
    EXPECT_EQ(write(Idn::product(1), {1}), SoeError::value_too_long);
    EXPECT_EQ(write(Idn::product(1), {1, 0, 0, 0, 1}), SoeError::none);
}

// A master that gives up a write without a message may begin the next write with the number that the first write would
// have next.
TEST_F(SoeServerTest, ANewWriteBehindASilenceIsNoPartOfTheOneBefore) {
    Octets fragment(26, std::byte{7});
    std::ranges::copy(octets({0x0B, 0x40, 1, 0}), fragment.begin());
    silent(fragment);
    bench.esc.time += std::chrono::milliseconds(250);
    EXPECT_EQ(write(Idn::standard(91), {100, 0}), SoeError::none);
    EXPECT_EQ(read(Idn::standard(91)), octets({100, 0}));

    // A write of three fragments is given up after the first fragment. The next write has two fragments.
    fragment[2] = std::byte{2};
    silent(fragment);
    bench.esc.time += std::chrono::milliseconds(250);
    Octets list = octets({0x0B, 0x40, 1, 0, 20, 0, 20, 0});
    list.resize(26, std::byte{0x41});
    silent(list);
    EXPECT_EQ(write(Idn::product(1), {0x42, 0x43}), SoeError::none);
    EXPECT_EQ(read(Idn::product(1)).size(), 24U);

    // A slow write is one write, although its last fragment alone is a value, too.
    list = octets({0x0B, 0x40, 1, 0, 23, 0, 100, 0});
    list.resize(26, std::byte{0x44});
    silent(list);
    bench.esc.time += std::chrono::seconds(5);
    EXPECT_EQ(write(Idn::product(1), {1, 0, 100, 0, 0x45}), SoeError::none);
    EXPECT_EQ(read(Idn::product(1)).size(), 27U);

    // A value that is too long is refused, although its end alone is a valid value, because there was no pause between
    // the fragments.
    fragment[2] = std::byte{1};
    silent(fragment);
    EXPECT_EQ(write(Idn::standard(91), {200, 0}), SoeError::value_too_long);
    EXPECT_EQ(read(Idn::standard(91)), octets({100, 0}));
}

TEST_F(SoeServerTest, CommandsRunUntilTheyAreFinished) {
    const Idn homing = Idn::standard(148);
    const auto state = [&] { return load_le<std::uint16_t>(read(homing, soe_element::kDataState)); };
    EXPECT_EQ(state(), 0);
    EXPECT_EQ(write(homing, {2, 0}), SoeError::value_invalid);
    EXPECT_EQ(write(homing, {3, 0}), SoeError::none);
    EXPECT_EQ(author.started, 1U);
    EXPECT_EQ(state(), 0x0007);
    EXPECT_EQ(read(homing), octets({3, 0}));
    EXPECT_EQ(write(homing, {3, 0}), SoeError::command_active);
    server.finish_command(0, homing, true);
    server.finish_command(0, homing, true);  // the command has already ended
    bench.settle();
    EXPECT_EQ(bench.receive(wire::MailboxType::soe), octets({0x05, 0x01, 148, 0, 0x03, 0x00}));
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_EQ(state(), 0x0003);
    EXPECT_EQ(write(homing, {0, 0}), SoeError::none);
    EXPECT_EQ(state(), 0);
    EXPECT_EQ(author.stopped, 0U);

    EXPECT_EQ(write(homing, {3, 0}), SoeError::none);
    EXPECT_EQ(write(homing, {1, 0}), SoeError::none);  // interrupted
    EXPECT_EQ(author.stopped, 1U);
    EXPECT_EQ(state(), 0x0005);
    EXPECT_EQ(write(homing, {3, 0}), SoeError::none);
    server.finish_command(0, homing, false);
    bench.settle();
    EXPECT_EQ(bench.receive(wire::MailboxType::soe), octets({0x05, 0x01, 148, 0, 0x0F, 0x00}));
    EXPECT_EQ(write(homing, {0, 0}), SoeError::none);
    author.refuse = SoeError::command_not_now;
    EXPECT_EQ(write(homing, {3, 0}), SoeError::command_not_now);
    EXPECT_EQ(state(), 0);
    author.refuse = SoeError::none;
    author.at_once = true;
    EXPECT_EQ(write(homing, {3, 0}), SoeError::none);
    EXPECT_EQ(bench.receive(wire::MailboxType::soe), octets({0x05, 0x01, 148, 0, 0x03, 0x00}));
}

TEST_F(SoeServerTest, EmergenciesLeaveAsSlaveInfo) {
    for (unsigned n = 0; n < 4; ++n) EXPECT_TRUE(server.report(1, octets({n, 2, 3})));
    EXPECT_FALSE(server.report(1, octets({9})));
    for (unsigned n = 0; n < 4; ++n) {
        bench.settle();
        EXPECT_EQ(bench.receive(wire::MailboxType::soe), octets({0x26, 0x00, 0, 0, n, 2, 3}));
    }
    // Notifications that the master did not read are deleted with the mailbox.
    EXPECT_TRUE(server.report(1, {}));
    (void)bench.request(1);
    bench.configure(kMailbox);
    (void)bench.request(2);
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty());
}

TEST_F(SoeServerTest, WhatIsNoRequestIsRefused) {
    const auto refused = [&](std::initializer_list<unsigned> data) {
        EXPECT_TRUE(bench.send(wire::MailboxType::soe, octets(data)));
        (void)bench.step();
        const auto reply = bench.receive(wire::MailboxType::error);
        return wire::MailboxErrorLayout::detail::load(reply);
    };
    for (const unsigned opcode : {2U, 4U, 5U, 6U})
        EXPECT_EQ(refused({opcode, 0x40, 15, 0}), wire::MailboxErrorCode::service_not_supported);
    EXPECT_EQ(refused({0, 0x40, 15, 0}), wire::MailboxErrorCode::invalid_header);
    EXPECT_EQ(refused({7, 0x40, 15, 0}), wire::MailboxErrorCode::invalid_header);
    EXPECT_EQ(refused({1, 0x40, 15}), wire::MailboxErrorCode::size_too_short);
}

TEST_F(SoeServerTest, DrivesKnowTheirValues) {
    EXPECT_EQ(drives[0].number(Idn::standard(91)), 3000U);
    EXPECT_EQ(drives[0].number(Idn::standard(15)), 7U);
    EXPECT_EQ(drives[0].number(Idn::standard(1)), 0U);
    EXPECT_EQ(drives[0].list(Idn::standard(16)).size(), 4U);
    EXPECT_TRUE(drives[0].list(Idn::standard(91)).empty());
    DriveValues::limit::store(image, 5);
    drives[0].restore_defaults();
    EXPECT_EQ(drives[0].number(Idn::standard(91)), 3000U);
}

}  // namespace
}  // namespace margay::subdevice
