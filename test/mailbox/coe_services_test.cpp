// Complete access and its fallback, PDOs by the dictionary, SDO information, and PDOs by mailbox.
#include "facts.hpp"
#include "mailbox/mailbox_bus.hpp"

#include <map>

namespace margay {
namespace {

using subdevice::testing::table::kObjects;

TEST(CompleteAccess, ReadsAndWritesWholeObjects) {
    MailboxBus bus;
    bus.add_stack(128);
    bus.start();
    std::array<std::byte, 64> memory{};
    const auto read = SDOread(*bus.ctx, 1, 0x1018, 0, true, memory);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(*read, 18U);  // two octets of count and padding, four numbers
    EXPECT_EQ(load_le<std::uint16_t>(memory), 4);
    EXPECT_EQ(load_le<std::uint32_t>(memory, 2), 0x4D47U);
    const auto from_one = SDOread(*bus.ctx, 1, 0x1018, 1, true, memory);
    EXPECT_EQ(*from_one, 16U);
    EXPECT_EQ(load_le<std::uint32_t>(memory), 0x4D47U);
}

// Two slaves with the same objects, one with complete access and one without it. Both return the same octets.
TEST(CompleteAccess, FallsBackToSingleSubindicesAndRemembersIt) {
    MailboxBus bus;
    bus.add_stack(128, true);
    bus.add_stack(128, false);
    bus.start();
    facts(bus.ctx->slave(2)).coe_details |= coe_detail::kCompleteAccess;  // advertised although the slave refuses it
    for (const std::uint16_t index : std::initializer_list<std::uint16_t>{0x1018, 0x1C00, 0x1C12, 0x1600, 0x1A00}) {
        for (const std::uint8_t subindex : std::initializer_list<std::uint8_t>{0, 1}) {
            std::array<std::byte, 64> whole{};
            std::array<std::byte, 64> singly{};
            const auto first = SDOread(*bus.ctx, 1, index, subindex, true, whole);
            const auto second = SDOread(*bus.ctx, 2, index, subindex, true, singly);
            ASSERT_TRUE(first.ok()) << bus.words(first.error());
            ASSERT_TRUE(second.ok()) << bus.words(second.error());
            EXPECT_LE(*second, *first);  // a complete access also returns unused subindices of a list
            EXPECT_TRUE(std::equal(singly.begin(), singly.begin() + static_cast<long>(*second), whole.begin()))
                << std::hex << index;
        }
    }
    // Complete access is not tried again: the number of messages equals the number of subindices.
    const auto before = mailbox_statistics(*bus.ctx, 2)->sent;
    std::array<std::byte, 64> memory{};
    EXPECT_TRUE(SDOread(*bus.ctx, 2, 0x1018, 0, true, memory).ok());
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 2)->sent - before, 5U);
    std::array<std::byte, 4> little{};
    const auto too_long = SDOread(*bus.ctx, 2, 0x1018, 0, true, little);
    EXPECT_EQ(too_long.error().code, Errc::capacity);
    // A missing object gives the same abort code with both forms of access.
    EXPECT_EQ(SDOread(*bus.ctx, 2, 0x3000, 0, true, memory).error().detail, 0x06020000U);
}

// 0x1000 is a variable: its subindex 0 is not a count.
TEST(CompleteAccess, OfAnObjectOfOneValueIsRefused) {
    MailboxBus bus;
    bus.add_stack(128, false);
    bus.start();
    std::array<std::byte, 64> memory{};
    for (int n = 0; n < 2; ++n) {  // the second time the library knows the refusal
        for (const std::uint16_t index : std::initializer_list<std::uint16_t>{0x1000, 0x1008}) {
            const auto read = SDOread(*bus.ctx, 1, index, 0, true, memory);
            ASSERT_FALSE(read.ok()) << std::hex << index << ": " << *read << " octets";
            EXPECT_EQ(read.error().code, n == 0 ? Errc::sdo_abort : Errc::unsupported) << bus.words(read.error());
            EXPECT_EQ(read.error().detail, n == 0 ? 0x06010000U : 0U) << bus.words(read.error());
        }
        EXPECT_TRUE(SDOread(*bus.ctx, 1, 0x1018, 0, true, memory).ok());
    }
    // The value is 0 and longer than a count.
    MailboxBus other;
    auto& slave = other.add_scripted(64);
    other.start();
    slave.on_mail = [&](const Mail& mail) {
        const auto command = std::to_integer<unsigned>(mail[8]);
        Mail data(mail.begin() + 6, mail.begin() + 16);
        data[1] = (command & 0x10) != 0 ? std::byte{0x20} : std::byte{0x30};
        data[2] = (command & 0x10) != 0 ? std::byte{0x80} : std::byte{0x43};
        store_le<std::uint32_t>(data, 6, (command & 0x10) != 0 ? 0x06010000U : 0U);
        slave.reply(data);
    };
    const auto zero = SDOread(*other.ctx, 1, 0x607A, 0, true, memory);
    ASSERT_FALSE(zero.ok()) << *zero << " octets";
    EXPECT_EQ(zero.error().detail, 0x06010000U) << other.words(zero.error());
    EXPECT_FALSE(SDOread(*other.ctx, 1, 0xF980, 0, true, memory).ok());
    // Lists of errors, PDOs and modules may be empty, and their count may be longer than an octet.
    for (const std::uint16_t list : std::initializer_list<std::uint16_t>{0x1003, 0x1C12, 0xF030}) {
        EXPECT_EQ(*SDOread(*other.ctx, 1, list, 0, true, memory), 2U) << list;
        EXPECT_EQ(memory[0], std::byte{0});
    }
    std::uint32_t type = 0;
    EXPECT_EQ(*SDOread(*bus.ctx, 1, 0x1000, 0, false, std::as_writable_bytes(std::span(&type, 1))), 4U);
    EXPECT_NE(type, 0U);
}

// 0x6060 of this slave is a variable of one octet with the value 8. The value is not a count, also when the access
// begins with subindex 1.
TEST(CompleteAccess, OfAnObjectOfOneOctetIsRefused) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64);
    bus.start();
    slave.on_mail = [&](const Mail& mail) {
        const auto command = std::to_integer<unsigned>(mail[8]);
        const bool refused = (command & 0x10) != 0 || mail[11] != std::byte{0};
        Mail data(mail.begin() + 6, mail.begin() + 16);
        data[1] = refused ? std::byte{0x20} : std::byte{0x30};
        data[2] = refused ? std::byte{0x80} : std::byte{0x4F};
        store_le<std::uint32_t>(data, 6, (command & 0x10) != 0 ? 0x06010000U : refused ? 0x06090011U : 8U);
        slave.reply(data);
    };
    std::array<std::byte, 64> memory{};
    for (const std::uint8_t subindex : std::initializer_list<std::uint8_t>{0, 1}) {
        const auto read = SDOread(*bus.ctx, 1, 0x6060, subindex, true, memory);
        ASSERT_FALSE(read.ok()) << *read << " octets from subindex " << unsigned{subindex};
        EXPECT_EQ(read.error().detail, 0x06010000U) << bus.words(read.error());
        EXPECT_EQ(read.error().subindex, subindex) << bus.words(read.error());
    }
    EXPECT_EQ(*SDOread(*bus.ctx, 1, 0x6060, 0, false, memory), 1U);
}

TEST(CompleteAccess, AnAssignmentIsZeroedFirstAndItsCountWrittenLast) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64);
    bus.start();
    std::vector<Mail> writes;
    slave.on_mail = [&](const Mail& mail) {
        const auto command = std::to_integer<unsigned>(mail[8]);
        Mail data(mail.begin() + 6, mail.begin() + 16);
        if ((command & 0x10) != 0) {
            data[2] = std::byte{0x80};
            store_le<std::uint32_t>(data, 6, 0x06010004);  // complete access is not supported
            slave.reply(data);
            return;
        }
        writes.emplace_back(mail.begin() + 8, mail.end());
        data[1] = std::byte{0x30};
        data[2] = std::byte{0x60};
        slave.reply(data);
    };
    const Mail value = mail_bytes({0x02, 0x00, 0x01, 0x16, 0x05, 0x16});
    const auto done = SDOwrite(*bus.ctx, 1, 0x1C12, 0, true, value);
    ASSERT_TRUE(done.ok()) << bus.words(done.error());
    const std::vector<Mail> expected{
        mail_bytes({0x2F, 0x12, 0x1C, 0x00, 0, 0, 0, 0}), mail_bytes({0x2B, 0x12, 0x1C, 0x01, 0x01, 0x16, 0, 0}),
        mail_bytes({0x2B, 0x12, 0x1C, 0x02, 0x05, 0x16, 0, 0}), mail_bytes({0x2F, 0x12, 0x1C, 0x00, 2, 0, 0, 0})};
    EXPECT_EQ(writes, expected);
    writes.clear();
    EXPECT_TRUE(SDOwrite(*bus.ctx, 1, 0x1C12, 0, true, value).ok());
    EXPECT_EQ(writes, expected);  // the refusal was remembered
}

TEST(CompleteAccess, OtherObjectsAreCutByTheSizesThatTheirValuesHave) {
    MailboxBus bus;
    auto& slave = bus.add_stack(128, false);
    bus.start();
    std::array<std::byte, 8> values{};
    // 0x7000: UNSIGNED8, INTEGER16, two bits in an octet each. Subindex 0 is read-only and has the value 4.
    const Mail value = mail_bytes({4, 0, 0x77, 0x34, 0x12, 1, 0});
    const auto done = SDOwrite(*bus.ctx, 1, 0x7000, 0, true, value);
    ASSERT_TRUE(done.ok()) << bus.words(done.error());
    EXPECT_EQ(subdevice::testing::Values::out_a::load(slave.image), 0x77);
    EXPECT_EQ(subdevice::testing::Values::out_b::load(slave.image), 0x1234);
    EXPECT_EQ(subdevice::testing::Values::bit_a::load(slave.image), 1);
    EXPECT_EQ(SDOwrite(*bus.ctx, 1, 0x7000, 0, true, Bytes(value).first(4)).error().code, Errc::wrong_size);
    (void)values;
}

// ------------------------------------------------------------------ PDOs

TEST(PdoDiscovery, FollowsTheDictionaryNotTheSii) {
    for (const bool complete : {true, false}) {
        MailboxBus bus;
        bus.add_stack(128, complete);
        bus.start();
        // The mapping differs from the SII: only the 8 bits of 0x7000:1.
        ASSERT_TRUE(SDOwrite(*bus.ctx, 1, 0x1600, 0, std::uint8_t{0}).ok());
        ASSERT_TRUE(SDOwrite(*bus.ctx, 1, 0x1600, 0, std::uint8_t{1}).ok());
        std::vector<std::byte> image(64);
        const auto mapped = config_map(*bus.ctx, image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        const Slave& slave = bus.ctx->slave(1);
        EXPECT_EQ(slave.error.code, Errc::none) << bus.words(slave.error);
        EXPECT_EQ(slave.config.source, ConfigurationSource::coe);
        ASSERT_EQ(slave.config.sm_count, 2);
        EXPECT_EQ(slave.config.sms[0].number, 2);
        EXPECT_EQ(slave.config.sms[0].bits, 8U);
        EXPECT_EQ(slave.config.sms[1].bits, 48U);
        EXPECT_EQ(slave.al.state, AlState::safeop);
    }
}

// All slaves are read at the same time, with the default memory of a context.
TEST(PdoDiscovery, ManySlavesAtOnceFitTheArena) {
    for (const std::uint16_t mailbox : std::initializer_list<std::uint16_t>{128, 1024}) {
        MailboxBus bus;
        for (int n = 0; n < 40; ++n) bus.add_stack(mailbox);
        bus.start();
        std::vector<std::byte> image(4096);
        const auto mapped = config_map(*bus.ctx, image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        for (const Slave& slave : bus.ctx->slaves()) {
            EXPECT_EQ(slave.error.code, Errc::none) << bus.words(slave.error);
            EXPECT_EQ(slave.config.source, ConfigurationSource::coe);
        }
        EXPECT_LE(bus.ctx->arena_peak_bytes(), bus.ctx->arena_bytes() * 9 / 10);
    }
}

TEST(PdoDiscovery, ASlaveThatAbortsItsAssignmentIsKnownByItsSii) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64, mailbox_protocol::kCoE);
    bus.start();
    slave.on_mail = [&](const Mail& mail) {
        Mail data(mail.begin() + 6, mail.begin() + 16);
        data[2] = std::byte{0x80};
        store_le<std::uint32_t>(data, 6, 0x06020000);
        slave.reply(data);
    };
    std::vector<std::byte> image(64);
    const auto mapped = config_map(*bus.ctx, image);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::none) << bus.words(bus.ctx->slave(1).error);
    EXPECT_EQ(bus.ctx->slave(1).config.source, ConfigurationSource::sii);
    EXPECT_FALSE(bus.ctx->errors().take().has_value());
    EXPECT_GE(slave.received.size(), 3U);
}

// Zeros in place of missing octets would mean a slave without process data, or a gap in its list.
TEST(PdoDiscovery, AnAnswerWithoutItsOctetsIsAnErrorOfTheSlave) {
    for (const unsigned at : {0U, 1U}) {  // the subindex whose answer has no octets
        SCOPED_TRACE(at);
        MailboxBus bus;
        auto& slave = bus.add_scripted(64, mailbox_protocol::kCoE, 0);
        bus.start();
        slave.on_mail = [&](const Mail& mail) {
            const auto subindex = std::to_integer<unsigned>(mail[11]);
            const bool assignment = mail[9] == std::byte{0x12} && mail[10] == std::byte{0x1C};
            if (!assignment)
                slave.reply({0, 0x20, 0x80, std::to_integer<unsigned>(mail[9]), std::to_integer<unsigned>(mail[10]),
                             subindex, 0, 0, 0x02, 0x06});
            else if (subindex == at)
                slave.reply({0, 0x30, 0x41, 0x12, 0x1C, subindex, 0, 0, 0, 0});
            else
                slave.reply({0, 0x30, 0x4F, 0x12, 0x1C, subindex, 1, 0, 0, 0});
        };
        std::vector<std::byte> image(64);
        (void)config_map(*bus.ctx, image);
        EXPECT_TRUE(bus.ctx->slave(1).pdos_failed);
        EXPECT_EQ(bus.words(bus.ctx->slave(1).error),
                  "slave 1: SDO upload of 0x1c12:" + std::to_string(at) +
                      ": the size of the value differs from the requested size (expected " + (at == 0 ? "1" : "2") +
                      " octets, got 0)");
    }
}

TEST(MailPdo, SentAndAskedFor) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64);
    bus.start();
    slave.on_mail = [&](const Mail& mail) {
        if (mail[7] == std::byte{0x60}) {     // TxPDO remote request
            slave.reply({0x07, 0x40, 9, 9});  // another PDO
            slave.reply({0x05, 0x40, 1, 2, 3});
        }
    };
    MailPdoSend send;
    const Mail out = mail_bytes({0xA, 0xB, 0xC});
    send.slave = 1;
    send.number = 0x12;
    send.data = out;
    ASSERT_TRUE(submit(*bus.ctx, send).ok());
    bus.run(send);
    EXPECT_EQ(send.state(), RequestState::success) << bus.words(send.error());
    bus.idle(1ms);
    ASSERT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(Mail(slave.received[0].begin() + 6, slave.received[0].end()), mail_bytes({0x12, 0x50, 0xA, 0xB, 0xC}));

    struct Pdos final : MailPdoListener {
        std::vector<std::pair<unsigned, Mail>> all;
        void received(std::uint16_t, std::uint16_t number, std::span<const std::byte> data) override {
            all.emplace_back(number, Mail(data.begin(), data.end()));
        }
    } pdos;
    pdos.only_slave = 1;
    ASSERT_TRUE(listen(*bus.ctx, pdos).ok());
    MailPdoFetch fetch;
    std::array<std::byte, 8> into{};
    fetch.slave = 1;
    fetch.number = 5;
    fetch.data = into;
    ASSERT_TRUE(submit(*bus.ctx, fetch).ok());
    bus.run(fetch);
    EXPECT_EQ(fetch.state(), RequestState::success) << bus.words(fetch.error());
    EXPECT_EQ(fetch.bytes, 3U);
    EXPECT_EQ(into[2], std::byte{3});
    ASSERT_EQ(pdos.all.size(), 1U);
    EXPECT_EQ(pdos.all[0].first, 7U);
    EXPECT_EQ(pdos.all[0].second, mail_bytes({9, 9}));
    fetch.data = MutableBytes(into).first(2);
    ASSERT_TRUE(submit(*bus.ctx, fetch).ok());
    bus.run(fetch);
    EXPECT_EQ(fetch.error().code, Errc::capacity);
    send.data = Bytes(into);
    const std::vector<std::byte> large(64);
    send.data = large;
    ASSERT_TRUE(submit(*bus.ctx, send).ok());
    bus.run(send);
    EXPECT_EQ(send.error().code, Errc::capacity);
}

// The number of a PDO is not a register. A mailbox of 7 octets has no room for the CoE header; a fault of an earlier
// version wrote behind it.
TEST(MailPdo, ErrorsNameThePdo) {
    MailboxBus bus;
    (void)bus.add_scripted(7);
    bus.start();
    std::array<std::byte, 8> into{};
    MailPdoFetch fetch;
    fetch.slave = 1;
    fetch.number = 5;
    fetch.data = into;
    ASSERT_TRUE(submit(*bus.ctx, fetch).ok());
    bus.run(fetch);
    EXPECT_EQ(fetch.error().code, Errc::capacity);
    EXPECT_EQ(
        bus.words(fetch.error()),
        "slave 1: sending to the mailbox of PDO 5: not enough memory: the mailbox of the slave (needed 2, there is "
        "room for 1)");
    MailPdoSend send;
    send.slave = 1;
    send.number = 0x12;
    ASSERT_TRUE(submit(*bus.ctx, send).ok());
    bus.run(send);
    EXPECT_EQ(send.error().code, Errc::capacity);
    MailboxBus silent;
    (void)silent.add_scripted(64);
    silent.start();
    fetch.timeout = 20ms;
    ASSERT_TRUE(submit(*silent.ctx, fetch).ok());
    silent.run(fetch);
    EXPECT_EQ(silent.words(fetch.error()).substr(0, 49), "slave 1: receiving from the mailbox of PDO 5: tim");
}

// A slave requests its outputs by mailbox. The application answers with a request.
TEST(MailPdo, AskedForByTheSlave) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64);
    bus.start();
    slave.on_mail = [&](const Mail& mail) {
        if (mail[7] != std::byte{0x60}) return;
        slave.reply({0x33, 0x70});  // RxPDO remote request of PDO 0x33
        slave.reply({0x05, 0x40, 1});
    };
    struct Wanted final : MailPdoListener {
        std::vector<unsigned> numbers;
        void received(std::uint16_t, std::uint16_t, std::span<const std::byte>) override {}
        void wanted(std::uint16_t, std::uint16_t number) override { numbers.push_back(number); }
    } listener;
    ASSERT_TRUE(listen(*bus.ctx, listener).ok());
    const auto& wanted = listener.numbers;
    MailPdoFetch fetch;
    std::array<std::byte, 8> into{};
    fetch.slave = 1;
    fetch.number = 5;
    fetch.data = into;
    ASSERT_TRUE(submit(*bus.ctx, fetch).ok());
    bus.run(fetch);
    EXPECT_EQ(fetch.state(), RequestState::success) << bus.words(fetch.error());
    ASSERT_EQ(wanted, std::vector<unsigned>{0x33});

    MailPdoSend answer;
    const Mail outputs = mail_bytes({7, 8});
    answer.slave = 1;
    answer.number = static_cast<std::uint16_t>(wanted[0]);
    answer.data = outputs;
    ASSERT_TRUE(submit(*bus.ctx, answer).ok());
    bus.run(answer);
    bus.idle(1ms);
    ASSERT_EQ(slave.received.size(), 2U);
    EXPECT_EQ(Mail(slave.received[1].begin() + 6, slave.received[1].end()), mail_bytes({0x33, 0x50, 7, 8}));
}

// ------------------------------------------------------------------ SDO information

void collect(std::span<const std::uint16_t> some, void* user) {
    auto& list = *static_cast<std::vector<std::uint16_t>*>(user);
    list.insert(list.end(), some.begin(), some.end());
}

TEST(SdoInformation, TheFiveListsAndTheirLengths) {
    for (const std::uint16_t mailbox : std::initializer_list<std::uint16_t>{24, 40, 128}) {
        MailboxBus bus;
        bus.add_stack(mailbox);
        bus.start();
        std::vector<std::uint16_t> lengths;
        ASSERT_TRUE(read_object_list(*bus.ctx, 1, ObjectList::lengths, collect, &lengths).ok());
        ASSERT_EQ(lengths.size(), 5U);
        const std::pair<ObjectList, std::uint16_t> lists[] = {{ObjectList::all, 0},
                                                              {ObjectList::rx_mappable, subdevice::od::kRxMappable},
                                                              {ObjectList::tx_mappable, subdevice::od::kTxMappable},
                                                              {ObjectList::backup, subdevice::od::kBackup},
                                                              {ObjectList::settings, subdevice::od::kSettings}};
        for (const auto& [list, access] : lists) {
            std::vector<std::uint16_t> expected;
            for (const auto& object : kObjects) {
                bool in = access == 0;
                for (const auto& entry : object.entries) in = in || (entry.access & access) != 0;
                if (in) expected.push_back(object.index);
            }
            std::vector<std::uint16_t> found;
            const auto count = read_object_list(*bus.ctx, 1, list, collect, &found);
            ASSERT_TRUE(count.ok()) << bus.words(count.error());
            EXPECT_EQ(found, expected);
            EXPECT_EQ(*count, expected.size());
            EXPECT_EQ(lengths[static_cast<std::size_t>(list) - 1], expected.size());
        }
    }
}

TEST(SdoInformation, DescribesObjectsAndEntries) {
    MailboxBus bus;
    bus.add_stack(40);  // names arrive in fragments
    bus.start();
    for (const auto& object : kObjects) {
        const auto described = read_object_description(*bus.ctx, 1, object.index);
        ASSERT_TRUE(described.ok()) << bus.words(described.error());
        EXPECT_EQ(described->name(), object.name);
        EXPECT_EQ(described->data_type, static_cast<std::uint16_t>(object.type));
        EXPECT_EQ(described->object_code, static_cast<std::uint8_t>(object.code));
        EXPECT_EQ(described->max_subindex, object.max_subindex());
        for (const auto& entry : object.entries) {
            const auto found = read_entry_description(*bus.ctx, 1, object.index, entry.subindex, true);
            ASSERT_TRUE(found.ok()) << bus.words(found.error());
            EXPECT_EQ(found->access, entry.access);
            EXPECT_EQ(found->data_type, static_cast<std::uint16_t>(entry.type));
            if (entry.count == 1) {
                EXPECT_EQ(found->name(), entry.name);
            }
        }
    }
    const auto setting = read_entry_description(*bus.ctx, 1, 0x2000, 0, true);
    ASSERT_TRUE(setting.ok());
    EXPECT_EQ(setting->bit_length, 16);
    EXPECT_EQ(load_le<std::int16_t>(setting->default_value.octets), 100);
    EXPECT_EQ(load_le<std::int16_t>(setting->minimum.octets), -500);
    EXPECT_EQ(load_le<std::int16_t>(setting->maximum.octets), 500);
    EXPECT_TRUE(setting->writable());
    const auto plain = read_entry_description(*bus.ctx, 1, 0x2000, 0, false);
    EXPECT_EQ(plain->minimum.bytes, 0);
    const auto none = read_object_description(*bus.ctx, 1, 0x3000);
    EXPECT_EQ(none.error().code, Errc::sdo_abort);
    EXPECT_EQ(bus.words(none.error()),
              "slave 1: SDO information of 0x3000:0: the slave aborted the transfer (abort code 0x06020000: object "
              "does not exist)");
}

// 30 000 objects, more than any table of the master can store. The callback receives them as they arrive.
TEST(SdoInformation, ADictionaryMayBeOfAnySize) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(512);
    bus.start({.slaves = 1});
    constexpr unsigned kObjectsThere = 30'000;
    slave.on_mail = [&](const Mail&) {
        unsigned next = 0;
        for (bool first = true; next < kObjectsThere; first = false) {
            Mail data = mail_bytes({0x00, 0x80, 0x02, 0x00, 0x00, 0x00});
            if (first) data.insert(data.end(), {std::byte{1}, std::byte{0}});
            while (data.size() + 2 <= 506 && next < kObjectsThere) {
                data.push_back(static_cast<std::byte>(next & 0xFF));
                data.push_back(static_cast<std::byte>(next >> 8));
                ++next;
            }
            if (next < kObjectsThere) data[2] = std::byte{0x82};
            slave.reply(data);
        }
    };
    struct Seen {
        unsigned count = 0;
        bool in_order = true;
    } seen;
    const auto count = read_object_list(
        *bus.ctx, 1, ObjectList::all,
        [](std::span<const std::uint16_t> some, void* user) {
            auto& s = *static_cast<Seen*>(user);
            for (const auto index : some) s.in_order = s.in_order && index == s.count++;
        },
        &seen);
    ASSERT_TRUE(count.ok()) << bus.words(count.error());
    EXPECT_EQ(*count, kObjectsThere);
    EXPECT_EQ(seen.count, kObjectsThere);
    EXPECT_TRUE(seen.in_order);
}

}  // namespace
}  // namespace margay
