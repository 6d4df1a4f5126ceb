// Every form of SDO transfer at the sizes between two forms (ETG.1000.6 "SDO services", tables of the expedited,
// normal and segment coding), and wrong replies of slaves.
#include "mailbox/coe_transfer.hpp"
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

// ------------------------------------------------------------------ our client and our server, at every boundary

class TransferSizes : public testing::TestWithParam<std::uint16_t> {};

TEST_P(TransferSizes, UploadAndDownloadAtEveryBoundary) {
    const std::uint16_t mailbox = GetParam();
    MailboxBus bus;
    auto& slave = bus.add_stack(mailbox);
    bus.start();
    std::vector<std::size_t> sizes{0, 1, 2, 3, 4, 5, 6, 7, 8, 1000};
    for (std::size_t n = mailbox - 17U; n <= mailbox + 2U; ++n) sizes.push_back(n);
    const std::size_t first = mailbox - 16U;   // octets in an initiate message
    const std::size_t segment = mailbox - 9U;  // octets in a segment
    for (std::size_t n = 0; n <= 9; ++n)
        sizes.push_back(first + segment + n);  // segments of fewer than 7 octets are padded
    for (const std::size_t size : sizes) {
        SCOPED_TRACE(testing::Message() << "mailbox " << mailbox << ", value " << size);
        auto value = pattern(size);
        const auto written = SDOwrite(*bus.ctx, 1, 0x2008, 0, false, value);
        ASSERT_TRUE(written.ok()) << bus.words(written.error());
        EXPECT_EQ(slave.application.vast_bytes, size);
        EXPECT_TRUE(std::equal(value.begin(), value.end(), slave.application.vast.begin()));
        std::vector<std::byte> back(size + 4, std::byte{0xEE});
        const auto read = SDOread(*bus.ctx, 1, 0x2008, 0, false, back);
        ASSERT_TRUE(read.ok()) << bus.words(read.error());
        EXPECT_EQ(*read, size);
        EXPECT_TRUE(std::equal(value.begin(), value.end(), back.begin()));
        EXPECT_EQ(back[size], std::byte{0xEE});  // nothing is written behind the value
        // A buffer of exactly the length, and a buffer that is one octet too short.
        EXPECT_TRUE(SDOread(*bus.ctx, 1, 0x2008, 0, false, MutableBytes(back).first(size)).ok());
        if (size == 0) continue;
        const auto short_read = SDOread(*bus.ctx, 1, 0x2008, 0, false, MutableBytes(back).first(size - 1));
        EXPECT_EQ(short_read.error().code, Errc::capacity);
        EXPECT_EQ(short_read.error().expected, size);
        EXPECT_EQ(short_read.error().actual, size - 1);
    }
}
INSTANTIATE_TEST_SUITE_P(Mailboxes, TransferSizes, testing::Values(24, 25, 40, 128, 256, 1024));

// ------------------------------------------------------------------ octets, by the tables

Mail composed(MailClient& client, std::size_t room) {
    Mail data(room);
    data.resize(client.compose(data));
    return data;
}
MailClient::Taken give(MailClient& client, std::initializer_list<unsigned> octets) {
    const Mail data = mail_bytes(octets);
    return client.accept({{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::coe}, data});
}

TEST(TransferOctets, ExpeditedDownload) {
    const Mail value = mail_bytes({0x11, 0x22, 0x33});
    SdoDownloadTransfer transfer({0x6040, 0x01}, value);
    // ccs 1, one octet unused, expedited, size indicated.
    EXPECT_EQ(composed(transfer, 64), mail_bytes({0x00, 0x20, 0x27, 0x40, 0x60, 0x01, 0x11, 0x22, 0x33, 0x00}));
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x60, 0x40, 0x60, 0x01, 0, 0, 0, 0}), MailClient::Taken::all);
    EXPECT_TRUE(transfer.over());
    EXPECT_EQ(transfer.error().code, Errc::none);
}

TEST(TransferOctets, SegmentedDownload) {
    const Mail value = pattern(20);
    SdoDownloadTransfer transfer({0x2000, 0x00}, value);
    // A mailbox of 20 octets: 14 of data, 4 of the value in the initiate message.
    Mail expected = mail_bytes({0x00, 0x20, 0x21, 0x00, 0x20, 0x00, 20, 0, 0, 0});
    expected.insert(expected.end(), value.begin(), value.begin() + 4);
    EXPECT_EQ(composed(transfer, 14), expected);
    EXPECT_EQ(composed(transfer, 14), expected);  // the same message again if it may not have arrived
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x60, 0x00, 0x20, 0x00, 0, 0, 0, 0}), MailClient::Taken::all);
    EXPECT_TRUE(transfer.must_abort());
    expected = mail_bytes({0x00, 0x20, 0x00});  // toggle 0, more segments follow, 11 octets
    expected.insert(expected.end(), value.begin() + 4, value.begin() + 15);
    EXPECT_EQ(composed(transfer, 14), expected);
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x20, 0, 0, 0, 0, 0, 0, 0}), MailClient::Taken::all);
    expected = mail_bytes({0x00, 0x20, 0x15});  // toggle 1, two of seven unused, last
    expected.insert(expected.end(), value.begin() + 15, value.end());
    expected.resize(10);
    EXPECT_EQ(composed(transfer, 14), expected);
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x30, 0, 0, 0, 0, 0, 0, 0}), MailClient::Taken::all);
    EXPECT_TRUE(transfer.over());
    EXPECT_FALSE(transfer.must_abort());
    EXPECT_EQ(transfer.bytes(), 20U);
}

TEST(TransferOctets, UploadWithCompleteAccessAndSegments) {
    std::array<std::byte, 32> into{};
    SdoUploadTransfer transfer({0x1018, 0x00, true}, into);
    EXPECT_EQ(composed(transfer, 64), mail_bytes({0x00, 0x20, 0x50, 0x18, 0x10, 0x00, 0, 0, 0, 0}));
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x51, 0x18, 0x10, 0x00, 13, 0, 0, 0, 1, 2, 3}), MailClient::Taken::all);
    EXPECT_EQ(composed(transfer, 64), mail_bytes({0x00, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x00, 4, 5, 6, 7, 8, 9, 10}), MailClient::Taken::all);
    EXPECT_EQ(composed(transfer, 64), mail_bytes({0x00, 0x20, 0x70, 0, 0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x19, 11, 12, 13, 0, 0, 0, 0}),
              MailClient::Taken::all);  // toggle, four unused, last
    EXPECT_TRUE(transfer.over());
    EXPECT_EQ(transfer.bytes(), 13U);
    EXPECT_EQ(into[12], std::byte{13});
    EXPECT_EQ(into[13], std::byte{0});
}

TEST(TransferOctets, ExpeditedUploadWithoutSizeGivesWhatIsAskedFor) {
    for (std::size_t room = 0; room <= 6; ++room) {
        std::array<std::byte, 6> into{};
        SdoUploadTransfer transfer({0x2000, 0}, MutableBytes(into).first(room));
        EXPECT_EQ(give(transfer, {0x00, 0x30, 0x42, 0x00, 0x20, 0x00, 1, 2, 3, 4}), MailClient::Taken::all);
        EXPECT_EQ(transfer.error().code, Errc::none);
        EXPECT_EQ(transfer.bytes(), std::min<std::size_t>(room, 4));
    }
}

TEST(TransferOctets, ANormalResponseThatFillsTheMailboxIsCutAtItsSize) {
    std::array<std::byte, 8> into{};
    SdoUploadTransfer transfer({0x2000, 0}, into);
    EXPECT_EQ(give(transfer, {0x00, 0x30, 0x41, 0x00, 0x20, 0x00, 5, 0, 0, 0, 1, 2, 3, 4, 5, 0xFF, 0xFF}),
              MailClient::Taken::all);
    EXPECT_TRUE(transfer.over());
    EXPECT_EQ(transfer.bytes(), 5U);
    EXPECT_EQ(into[5], std::byte{0});
}

// ------------------------------------------------------------------ wrong replies

struct Hostile {
    const char* what;
    std::vector<Mail> replies;  // one for each message; the last reply is sent repeatedly
    Errc code;
    std::uint32_t told;  // the abort code that the slave receives; 0: none
};

Mail segment(unsigned command, std::size_t bytes) {
    Mail data = mail_bytes({0x00, 0x30, command});
    data.resize(3 + bytes);
    return data;
}
Mail initiated(unsigned size) {
    return mail_bytes({0x00, 0x30, 0x41, 0x00, 0x20, 0x00, size & 0xFF, (size >> 8) & 0xFF, (size >> 16) & 0xFF,
                       size >> 24, 1, 2, 3, 4});
}

TEST(HostileReplies, EndAnUploadInBoundedTimeWithNothingBeyondTheBuffer) {
    const std::vector<Hostile> all{
        {"another index", {mail_bytes({0x00, 0x30, 0x4B, 0x01, 0x20, 0x00, 1, 0, 0, 0})}, Errc::timeout, 0x05040000},
        {"another subindex", {mail_bytes({0x00, 0x30, 0x4B, 0x00, 0x20, 0x01, 1, 0, 0, 0})}, Errc::timeout, 0x05040000},
        {"a download response",
         {mail_bytes({0x00, 0x30, 0x60, 0x00, 0x20, 0x00, 0, 0, 0, 0})},
         Errc::timeout,
         0x05040000},
        {"a request", {mail_bytes({0x00, 0x20, 0x40, 0x00, 0x20, 0x00, 0, 0, 0, 0})}, Errc::timeout, 0x05040000},
        {"an abort of another index",
         {mail_bytes({0x00, 0x20, 0x80, 0x01, 0x20, 0x00, 0, 0, 2, 6})},
         Errc::timeout,
         0x05040000},
        {"the abort of ours", {mail_bytes({0x00, 0x20, 0x80, 0x00, 0x20, 0x00, 0, 0, 2, 6})}, Errc::sdo_abort, 0},
        {"an abort as a response", {mail_bytes({0x00, 0x30, 0x80, 0x00, 0x20, 0x00, 0, 0, 2, 6})}, Errc::sdo_abort, 0},
        {"half an abort", {mail_bytes({0x00, 0x20, 0x80, 0x00, 0x20, 0x00})}, Errc::protocol, 0},
        {"half a response", {mail_bytes({0x00, 0x30, 0x4B, 0x00, 0x20})}, Errc::protocol, 0},
        {"a header only", {mail_bytes({0x00, 0x30})}, Errc::protocol, 0},
        {"one octet", {mail_bytes({0x00})}, Errc::timeout, 0x05040000},
        {"a size of 4 GiB", {initiated(0xFFFFFFFF)}, Errc::capacity, 0x05040005},
        {"a size one too large", {initiated(65)}, Errc::capacity, 0x05040005},
        {"a wrong toggle at once", {initiated(60), segment(0x10, 20)}, Errc::protocol, 0x05030000},
        {"a toggle that stays", {initiated(60), segment(0x00, 20), segment(0x00, 20)}, Errc::protocol, 0x05030000},
        {"segments without end",
         {initiated(60), segment(0x00, 7), segment(0x10, 7), segment(0x00, 48)},
         Errc::protocol,
         0x06070012},
        {"empty segments without end", {initiated(60), segment(0x0E, 7)}, Errc::protocol, 0x08000000},
        {"a segment of nothing", {initiated(60), segment(0x00, 0)}, Errc::protocol, 0x08000000},
        {"too early an end", {initiated(60), segment(0x01, 20)}, Errc::protocol, 0},
        {"a segment in the place of the response", {segment(0x01, 7)}, Errc::timeout, 0x05040000},
        {"the response again in the place of a segment", {initiated(60)}, Errc::timeout, 0x05040000},
        {"an abort amid segments, without an index",
         {initiated(60), mail_bytes({0x00, 0x20, 0x80, 0, 0, 0, 0x01, 0, 4, 5})},
         Errc::sdo_abort,
         0},
    };
    for (const Hostile& hostile : all) {
        SCOPED_TRACE(hostile.what);
        MailboxBus bus;
        auto& slave = bus.add_scripted(64);
        bus.start();
        std::uint32_t told = 0;
        std::size_t n = 0;
        slave.on_mail = [&](const Mail& mail) {
            if (mail[8] == std::byte{0x80}) {
                told = load_le<std::uint32_t>(mail, 12);
                return;
            }
            slave.reply(hostile.replies[std::min(n++, hostile.replies.size() - 1)]);
        };
        std::vector<std::byte> into(80, std::byte{0xEE});
        const Time begin = bus.osal.now();
        const auto read = SDOread(*bus.ctx, 1, 0x2000, 0, false, MutableBytes(into).first(64), 200ms);
        EXPECT_EQ(read.error().code, hostile.code) << bus.words(read.error());
        EXPECT_LE(bus.osal.now() - begin, 210ms);
        EXPECT_LE(slave.received.size(), 5U);
        EXPECT_EQ(into[64], std::byte{0xEE});
        bus.idle(10ms);
        EXPECT_EQ(told, hostile.told) << std::hex << told;
    }
}

TEST(HostileReplies, EndADownload) {
    const Mail confirmed = mail_bytes({0x00, 0x30, 0x60, 0x00, 0x20, 0x00, 0, 0, 0, 0});
    const std::vector<Hostile> all{
        {"another index", {mail_bytes({0x00, 0x30, 0x60, 0x01, 0x20, 0x00, 0, 0, 0, 0})}, Errc::timeout, 0x05040000},
        {"an upload response",
         {mail_bytes({0x00, 0x30, 0x4B, 0x00, 0x20, 0x00, 1, 0, 0, 0})},
         Errc::timeout,
         0x05040000},
        {"a confirmation too many", {confirmed}, Errc::timeout, 0x05040000},
        {"a wrong toggle", {confirmed, segment(0x30, 7)}, Errc::protocol, 0x05030000},
        {"a toggle that stays", {confirmed, segment(0x20, 7)}, Errc::protocol, 0x05030000},
        {"an abort", {confirmed, mail_bytes({0x00, 0x20, 0x80, 0x00, 0x20, 0x00, 0x22, 0, 0, 8})}, Errc::sdo_abort, 0},
    };
    for (const Hostile& hostile : all) {
        SCOPED_TRACE(hostile.what);
        MailboxBus bus;
        auto& slave = bus.add_scripted(64);
        bus.start();
        std::uint32_t told = 0;
        std::size_t n = 0;
        slave.on_mail = [&](const Mail& mail) {
            if (mail[8] == std::byte{0x80})
                told = load_le<std::uint32_t>(mail, 12);
            else
                slave.reply(hostile.replies[std::min(n++, hostile.replies.size() - 1)]);
        };
        const auto value = pattern(200);
        const auto written = SDOwrite(*bus.ctx, 1, 0x2000, 0, false, value, 200ms);
        EXPECT_EQ(written.error().code, hostile.code) << bus.words(written.error());
        bus.idle(10ms);
        EXPECT_EQ(told, hostile.told) << std::hex << told;
    }
}

TEST(HostileReplies, EndAnObjectList) {
    const auto fragment = [](unsigned opcode, std::size_t indices, bool first) {
        Mail data = mail_bytes({0x00, 0x80, opcode, 0x00, 0x01, 0x00});
        if (first) data.insert(data.end(), {std::byte{1}, std::byte{0}});
        data.resize(data.size() + 2 * indices, std::byte{0x20});
        return data;
    };
    struct Case {
        const char* what;
        Mail first;
        Mail then;
        Errc code;
    };
    const std::vector<Case> all{
        {"fragments without end", fragment(0x82, 10, true), fragment(0x82, 26, false), Errc::protocol},
        {"empty fragments without end", fragment(0x82, 10, true), fragment(0x82, 0, false), Errc::protocol},
        {"another list", mail_bytes({0x00, 0x80, 0x02, 0, 0, 0, 0x02, 0x00, 0x00, 0x10}), {}, Errc::timeout},
        {"an error", mail_bytes({0x00, 0x80, 0x07, 0, 0, 0, 0x00, 0x00, 0x02, 0x06}), {}, Errc::sdo_abort},
        {"half an error", mail_bytes({0x00, 0x80, 0x07, 0, 0, 0, 0x00}), {}, Errc::protocol},
        {"half a header", mail_bytes({0x00, 0x80, 0x02, 0}), {}, Errc::protocol},
    };
    for (const Case& hostile : all) {
        SCOPED_TRACE(hostile.what);
        MailboxBus bus;
        auto& slave = bus.add_scripted(64);
        bus.start();
        slave.on_mail = [&](const Mail&) {
            slave.reply(hostile.first);
            if (!hostile.then.empty())
                for (int n = 0; n < 3000; ++n) slave.reply(hostile.then);
        };
        std::size_t calls = 0;
        const auto listed = read_object_list(
            *bus.ctx, 1, ObjectList::all,
            [](std::span<const std::uint16_t> some, void* user) { *static_cast<std::size_t*>(user) += some.size(); },
            &calls, 60s);
        EXPECT_EQ(listed.error().code, hostile.code) << bus.words(listed.error());
        EXPECT_LE(calls, 65536U);
        EXPECT_EQ(slave.received.size(), 1U);
    }
}

}  // namespace
}  // namespace margay
