// Mail in recordings made octet by octet: conversations, lost messages and late messages.
#include "analyse/made_recording.hpp"

#include "wire/coe.hpp"
#include "wire/mailbox.hpp"

namespace margay::analyse {
namespace {

std::vector<std::byte> mail(std::uint8_t counter, std::vector<std::byte> coe) {
    std::vector<std::byte> all(wire::kMailboxHeaderBytes);
    wire::store_mailbox_header(
        all, {.length = static_cast<std::uint16_t>(coe.size()), .type = wire::MailboxType::coe, .counter = counter});
    all.insert(all.end(), coe.begin(), coe.end());
    all.resize(64);
    return all;
}

class MailTest : public AnalyserTest {
  protected:
    static wire::DatagramAddress at(std::uint16_t ado) { return {0x1001, ado}; }
    static Part request(std::uint8_t counter, std::uint8_t command, std::uint16_t index, std::uint8_t subindex) {
        return {
            Command::FPWR, at(0x1000),
            mail(counter, octets_of({0, 0x20, command, index & 0xFFU, unsigned{index} >> 8U, subindex, 1, 2, 0, 0})),
            1};
    }
    static Part response(std::uint8_t counter, std::uint8_t command, std::uint16_t index, std::uint8_t subindex,
                         std::uint8_t value = 0) {
        return {Command::FPRD, at(0x1040),
                mail(counter,
                     octets_of({0, 0x30, command, index & 0xFFU, unsigned{index} >> 8U, subindex, value, 0, 0, 0})),
                1};
    }
    // The frame of the request does not come back.
    void lost(Duration when, const Part& part) { packet(when, frame_of({part}, false, 9)); }
    void SetUp() override {
        exchange(0ms, {{Command::FPWR, at(0x0800),
                        octets_of({0, 0x10, 64, 0, 0x26, 0, 1, 0, 0x40, 0x10, 64, 0, 0x22, 0, 1, 0}), 1}});
    }
    static constexpr std::uint8_t kUpload = 0x40;    // the request
    static constexpr std::uint8_t kUploaded = 0x43;  // the response of 4 octets
    static constexpr std::uint8_t kDownload = 0x2B;  // of 2 octets
    static constexpr std::uint8_t kAbort = 0x80;
};

TEST_F(MailTest, PutsMailTogetherToConversations) {
    // Segmented upload of 9 octets: 4 in the response, 5 in a segment of 7.
    exchange(1ms, {{Command::FPWR, at(0x1000), mail(1, octets_of({0, 0x20, 0x40, 0x08, 0x10, 0, 0, 0, 0, 0})), 1}});
    exchange(2ms, {{Command::FPRD, at(0x1040), std::vector<std::byte>(64), 0}});  // no mail yet
    exchange(3ms, {{Command::FPRD, at(0x1040),
                    mail(1, octets_of({0, 0x30, 0x41, 0x08, 0x10, 0, 9, 0, 0, 0, 'D', 'r', 'i', 'v'})), 1}});
    exchange(4ms, {{Command::FPWR, at(0x1000), mail(2, octets_of({0, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0})), 1}});
    exchange(5ms, {{Command::FPRD, at(0x1040), mail(2, octets_of({0, 0x30, 0x05, 'e', ' ', 'o', 'n', 'e', 0, 0})), 1}});
    // The slave aborts a download, and sends an emergency in between.
    exchange(6ms, {{Command::FPWR, at(0x1000), mail(3, octets_of({0, 0x20, 0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0})), 1}});
    exchange(7ms, {{Command::FPRD, at(0x1040), mail(3, octets_of({0, 0x10, 0x10, 0x82, 0x11, 1, 2, 3, 4, 5})), 1}});
    exchange(8ms, {{Command::FPRD, at(0x1040),
                    mail(4, octets_of({0, 0x20, 0x80, 0x40, 0x60, 0, 0x02, 0x00, 0x01, 0x06})), 1}});
    exchange(9ms, {{Command::FPRD, at(0x1040),
                    mail(4, octets_of({0, 0x20, 0x80, 0x40, 0x60, 0, 0x02, 0x00, 0x01, 0x06})), 1}});  // repeated
    exchange(10ms, {{Command::FPWR, at(0x1000), mail(4, octets_of({0, 0x20, 0x40, 0, 0x10, 0, 0, 0, 0, 0})), 1}});
    const auto a = analyser.finish();
    ASSERT_EQ(a.conversations.items.size(), 3u);
    const auto& upload = a.conversations.items[0];
    EXPECT_EQ(upload.outcome, Outcome::done);
    EXPECT_EQ(upload.index, 0x1008);
    EXPECT_EQ(upload.bytes, 9u);
    EXPECT_EQ(printable(upload.data), "Drive one");
    EXPECT_EQ(a.slaves.at(0).name, "Drive one");
    const auto& abort = a.conversations.items[1];
    EXPECT_EQ(abort.action, Action::sdo_download);
    EXPECT_EQ(abort.data, octets_of({0x0F, 0}));
    EXPECT_EQ(abort.outcome, Outcome::refused) << "this slave sends its abort as a request";
    EXPECT_EQ(abort.code, 0x06010002u);
    EXPECT_FALSE(abort.reason.empty());
    EXPECT_EQ(a.conversations.items[2].outcome, Outcome::unfinished);
    ASSERT_EQ(a.emergencies.items.size(), 1u);
    EXPECT_EQ(a.emergencies.items[0].code, 0x8210);
    EXPECT_EQ(a.emergencies.items[0].error_register, 0x11);
    EXPECT_EQ(a.slaves.at(0).mail.at(wire::MailboxType::coe).received, 4u);
    EXPECT_EQ(a.slaves.at(0).unanswered, 0u) << "a look for mail needs no answer";
}

// Field notes: some slaves answer after the master has given up the request.
TEST_F(MailTest, ALateAnswerBelongsToItsOwnRequest) {
    exchange(1ms, {request(1, kUpload, 0x1018, 1)});
    exchange(50ms, {request(2, kUpload, 0x6041, 0)});
    exchange(51ms, {response(1, kUploaded, 0x1018, 1, 0x4D)});
    exchange(52ms, {response(2, kUploaded, 0x6041, 0, 0x37)});
    exchange(53ms, {request(3, kUpload, 0x1018, 2)});
    exchange(90ms, {request(4, kUpload, 0x6041, 0)});
    exchange(91ms, {response(3, kAbort, 0x1018, 2, 0x11)});
    exchange(92ms, {response(4, kUploaded, 0x6041, 0, 0x38)});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 4U);
    EXPECT_EQ(all[0].data, octets_of({0x4D, 0, 0, 0}));
    EXPECT_TRUE(all[0].late);
    EXPECT_EQ(all[0].end.at, 51ms + 30us);
    EXPECT_EQ(all[1].data, octets_of({0x37, 0, 0, 0}));
    EXPECT_FALSE(all[1].late);
    EXPECT_EQ(all[2].outcome, Outcome::refused);
    EXPECT_TRUE(all[2].late);
    EXPECT_EQ(all[3].data, octets_of({0x38, 0, 0, 0}));
}

TEST_F(MailTest, AnAnswerOfAnotherObjectIsNotTheValue) {
    exchange(1ms, {request(1, kUpload, 0x6041, 0)});
    exchange(2ms, {response(1, kUploaded, 0x6064, 0, 1)});
    exchange(3ms, {response(2, kUploaded, 0x6041, 1, 2)});
    exchange(4ms, {response(3, kAbort, 0x6040, 0, 3)});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].outcome, Outcome::unfinished);
    EXPECT_EQ(all[0].bytes, 0U);
}

TEST_F(MailTest, AnAbortThatNamesNoObjectIsOfTheYoungestRequest) {
    exchange(1ms, {request(1, kUpload, 0x6041, 0)});
    exchange(50ms, {request(2, kUpload, 0x6064, 0)});
    exchange(51ms, {response(1, kAbort, 0, 0, 0x11)});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].outcome, Outcome::unanswered);
    EXPECT_EQ(all[1].outcome, Outcome::refused);
}

// The slave has received the request, and the frame was lost after the slave.
TEST_F(MailTest, ARequestWhoseFrameWasLostIsKnownByItsAnswer) {
    exchange(1ms, {request(1, kUpload, 0x1018, 1)});  // never answered
    lost(50ms, request(2, kUpload, 0x6041, 0));
    exchange(51ms, {response(1, kUploaded, 0x6041, 0, 0x37)});
    lost(60ms, request(3, kDownload, 0x6060, 0));
    exchange(61ms, {response(2, kAbort, 0x6060, 0, 0x11)});
    const auto a = analyser.finish();
    const auto& all = a.conversations.items;
    ASSERT_EQ(all.size(), 3U);
    EXPECT_EQ(all[0].outcome, Outcome::unanswered);
    EXPECT_EQ(all[0].index, 0x1018);
    EXPECT_EQ(all[1].index, 0x6041);
    EXPECT_EQ(all[1].data, octets_of({0x37, 0, 0, 0}));
    EXPECT_FALSE(all[1].late);
    EXPECT_EQ(all[2].action, Action::sdo_download);
    EXPECT_EQ(all[2].outcome, Outcome::refused);
    EXPECT_EQ(all[2].data, octets_of({1, 2}));
    EXPECT_EQ(a.slaves.at(0).mail.at(wire::MailboxType::coe).sent, 3U);
    EXPECT_EQ(a.frames.lost + a.frames.open, 2U);
}

TEST_F(MailTest, ARequestThatIsSentAgainIsOne) {
    lost(1ms, request(1, kUpload, 0x6041, 0));
    exchange(10ms, {request(1, kUpload, 0x6041, 0)});
    exchange(11ms, {response(1, kUploaded, 0x6041, 0, 0x37)});
    lost(20ms, request(0, kUpload, 0x6064, 0));  // a master without counters
    exchange(30ms, {request(0, kUpload, 0x6064, 0)});
    exchange(31ms, {response(2, kUploaded, 0x6064, 0, 0x38)});
    // the slave has the request, so its mailbox is full when the request comes again
    lost(40ms, request(2, kUpload, 0x6061, 0));
    exchange(50ms, {[&] {
                 auto full = request(2, kUpload, 0x6061, 0);
                 full.wkc = 0;
                 return full;
             }()});
    exchange(51ms, {response(3, kUploaded, 0x6061, 0, 0x39)});
    const auto a = analyser.finish();
    const auto& all = a.conversations.items;
    ASSERT_EQ(all.size(), 3U);
    for (const auto& one : all) {
        EXPECT_EQ(one.outcome, Outcome::done);
        EXPECT_FALSE(one.late);
    }
    EXPECT_EQ(all[2].data, octets_of({0x39, 0, 0, 0}));
    EXPECT_EQ(a.slaves.at(0).mail.at(wire::MailboxType::coe).sent, 3U);
}

// Each start of the program brings the slave to INIT and begins with counter 1.
TEST_F(MailTest, CountersBeginAgainWhenTheMailboxIsSetUp) {
    for (int run = 0; run < 3; ++run) {
        SetUp();
        exchange(10ms * run + 1ms, {request(1, kUpload, 0x6041, 0)});
        exchange(10ms * run + 2ms, {response(1, kUploaded, 0x6041, 0, 0x37)});
    }
    EXPECT_EQ(analyser.finish().conversations.items.size(), 3U);
}

TEST_F(MailTest, ACounterThatComesAgainWithOtherOctetsIsAnotherMessage) {
    exchange(1ms, {request(1, kUpload, 0x6041, 0)});
    exchange(2ms, {response(1, kUploaded, 0x6041, 0, 0x37)});
    exchange(3ms, {request(1, kUpload, 0x6064, 0)});
    exchange(4ms, {response(1, kUploaded, 0x6064, 0, 0x38)});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[1].data, octets_of({0x38, 0, 0, 0}));
}

// A packet is sent again after "busy" and after a loss.
TEST_F(MailTest, APacketOfFoeThatComesAgainCountsOnce) {
    const auto foe = [](bool sent, std::uint8_t counter, std::uint8_t opcode, std::uint8_t packet_number,
                        std::size_t octets) {
        std::vector<std::byte> all(64);
        wire::store_mailbox_header(
            all,
            {.length = static_cast<std::uint16_t>(6 + octets), .type = wire::MailboxType::foe, .counter = counter});
        all[wire::kMailboxHeaderBytes] = static_cast<std::byte>(opcode);
        all[wire::kMailboxHeaderBytes + 2] = static_cast<std::byte>(packet_number);
        return Part{sent ? Command::FPWR : Command::FPRD, at(sent ? 0x1000 : 0x1040), all, 1};
    };
    constexpr std::size_t kFull = 64 - 6 - 6;
    exchange(1ms, {foe(true, 1, 2, 0, 1)});      // write
    exchange(2ms, {foe(false, 1, 4, 0, 0)});     // acknowledge
    exchange(3ms, {foe(true, 2, 3, 1, kFull)});  // data
    exchange(4ms, {foe(false, 2, 6, 0, 0)});     // busy
    exchange(5ms, {foe(true, 3, 3, 1, kFull)});
    exchange(6ms, {foe(false, 3, 4, 1, 0)});
    exchange(7ms, {foe(true, 4, 3, 2, 10)});
    exchange(8ms, {foe(false, 4, 4, 2, 0)});
    // Some loaders begin with packet 0.
    exchange(11ms, {foe(true, 5, 1, 0, 1)});  // read
    exchange(12ms, {foe(false, 5, 3, 0, kFull)});
    exchange(13ms, {foe(true, 6, 4, 0, 0)});
    exchange(14ms, {foe(false, 6, 3, 1, 10)});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 2U);
    for (const auto& one : all) {
        EXPECT_EQ(one.outcome, Outcome::done);
        EXPECT_EQ(one.bytes, kFull + 10);
    }
}

// A message may be written without the rest of the mailbox, if its last octet is written too.
TEST_F(MailTest, ThePacketsOfAFoeWriteAreComparedWithTheMailbox) {
    const auto foe = [&](Duration when, bool sent, std::uint8_t counter, std::uint8_t opcode,
                         std::uint8_t packet_number, std::size_t octets) {
        std::vector<std::byte> all(64);
        wire::store_mailbox_header(
            all,
            {.length = static_cast<std::uint16_t>(6 + octets), .type = wire::MailboxType::foe, .counter = counter});
        all[wire::kMailboxHeaderBytes] = static_cast<std::byte>(opcode);
        all[wire::kMailboxHeaderBytes + 2] = static_cast<std::byte>(packet_number);
        if (!sent) return exchange(when, {{Command::FPRD, at(0x1040), all, 1}});
        all.resize(wire::kMailboxHeaderBytes + 6 + octets);
        exchange(when, {{Command::FPWR, at(0x1000), all, 1}});
        if (all.size() < 64) exchange(when + 100us, {{Command::FPWR, at(0x103F), octets_of({0}), 1}});
    };
    constexpr std::size_t kFull = 64 - 6 - 6;
    foe(1ms, true, 1, 2, 0, 1);  // write
    foe(2ms, false, 1, 4, 0, 0);
    foe(3ms, true, 2, 3, 1, kFull);
    foe(4ms, false, 2, 4, 1, 0);
    foe(5ms, true, 3, 3, 2, 10);
    foe(6ms, false, 3, 4, 2, 0);
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].outcome, Outcome::done);
    EXPECT_EQ(all[0].bytes, kFull + 10);
}

// The value of an object is the value that was transferred last, with or without complete access.
class ObjectTest : public MailTest {
  protected:
    // Uploads or downloads `data` of an object by complete access.
    void whole(bool upload, std::uint16_t index, std::vector<std::byte> data) {
        const auto low = index & 0xFFU;
        const auto high = unsigned{index} >> 8U;
        auto head = octets_of({0, upload ? 0x30U : 0x20U, upload ? 0x51U : 0x31U, low, high, 0,
                               static_cast<unsigned>(data.size()), 0, 0, 0});
        head.insert(head.end(), data.begin(), data.end());
        ++counter_;
        if (upload) {
            exchange(next(), {request(counter_, 0x50, index, 0)});
            exchange(next(), {{Command::FPRD, at(0x1040), mail(counter_, head), 1}});
        } else {
            exchange(next(), {{Command::FPWR, at(0x1000), mail(counter_, head), 1}});
            exchange(next(), {response(counter_, 0x60, index, 0)});
        }
    }
    void download(std::uint16_t index, std::uint8_t subindex, unsigned size, std::uint32_t value) {
        const auto command = 0x23U | (4 - size) << 2U;
        ++counter_;
        exchange(next(),
                 {{Command::FPWR, at(0x1000),
                   mail(counter_, octets_of({0, 0x20, command, index & 0xFFU, unsigned{index} >> 8U, subindex,
                                             value & 0xFFU, value >> 8U & 0xFFU, value >> 16U & 0xFFU, value >> 24U})),
                   1}});
        exchange(next(), {response(counter_, 0x60, index, subindex)});
    }
    Slave slave() { return analyser.finish().slaves.at(0); }

  private:
    Duration next() { return now_ += 1ms; }
    Duration now_{};
    std::uint8_t counter_ = 0;
};

TEST_F(ObjectTest, AListThatIsWrittenLaterIsTheListOfPdos) {
    whole(true, 0x1C12, octets_of({1, 0, 0x00, 0x16}));
    whole(true, 0x1600, octets_of({1, 0, 0x10, 0x00, 0x40, 0x60}));
    download(0x1C12, 0, 1, 0);
    download(0x1601, 0, 1, 0);
    download(0x1601, 1, 4, 0x607A'0020);
    download(0x1601, 0, 1, 1);
    download(0x1C12, 1, 2, 0x1601);
    download(0x1C12, 0, 1, 1);
    const auto pdos = slave().pdos;
    ASSERT_EQ(pdos.size(), 1U);
    EXPECT_EQ(pdos[0].index, 0x1601);
    ASSERT_EQ(pdos[0].entries.size(), 1U);
    EXPECT_EQ(pdos[0].entries[0].index, 0x607A);
    EXPECT_EQ(pdos[0].entries[0].bits, 32);
}

TEST_F(ObjectTest, AListThatIsWrittenAsAWholeReplacesItsSubindices) {
    download(0x1C13, 1, 2, 0x1A00);
    download(0x1C13, 2, 2, 0x1A01);
    download(0x1C13, 0, 1, 2);
    download(0x1A02, 1, 4, 0x6041'0010);
    download(0x1A02, 0, 1, 1);
    whole(false, 0x1C13, octets_of({1, 0, 0x02, 0x1A}));
    const auto pdos = slave().pdos;
    ASSERT_EQ(pdos.size(), 1U);
    EXPECT_EQ(pdos[0].index, 0x1A02);
    EXPECT_EQ(pdos[0].entries.size(), 1U);
}

TEST_F(ObjectTest, TheIdentityIsThatOfCompleteAccessToo) {
    whole(true, 0x1018, octets_of({4, 0, 0x11, 0, 0, 0, 0x22, 0, 0, 0, 0x33, 0, 0, 0, 0x44, 0, 0, 0}));
    const auto facts = slave();
    EXPECT_EQ(facts.vendor, 0x11U);
    EXPECT_EQ(facts.product, 0x22U);
    EXPECT_EQ(facts.revision, 0x33U);
    EXPECT_EQ(facts.serial, 0x44U);
}

TEST_F(MailTest, ANameInIso88591IsKept) {
    exchange(1ms, {request(1, kUpload, 0x1008, 0)});
    exchange(2ms, {{Command::FPRD, at(0x1040),
                    mail(1, octets_of({0, 0x30, 0x41, 0x08, 0x10, 0, 6, 0, 0, 0, 'M', 0xFC, 'l', 'l', 'e', 'r'})), 1}});
    EXPECT_EQ(analyser.finish().slaves.at(0).name, "M\u00FCller");
}

class DriveTest : public MailTest {
  protected:
    static Part soe(bool sent, std::uint8_t counter, const std::vector<std::byte>& octets) {
        std::vector<std::byte> all(64);
        wire::store_mailbox_header(
            all,
            {.length = static_cast<std::uint16_t>(octets.size()), .type = wire::MailboxType::soe, .counter = counter});
        std::ranges::copy(octets, all.begin() + wire::kMailboxHeaderBytes);
        return Part{sent ? Command::FPWR : Command::FPRD, at(sent ? 0x1000 : 0x1040), all, 1};
    }
};

TEST_F(DriveTest, ADriveRefusesTheFirstFragmentOfAWrite) {
    exchange(1ms, {soe(true, 1, octets_of({0x0B, 0x40, 1, 0, 1, 2, 3, 4}))});      // write request, 1 more fragment
    exchange(2ms, {soe(false, 1, octets_of({0x14, 0x40, 0x2F, 0, 0x04, 0x70}))});  // refused: IDN 47, 0x7004
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].outcome, Outcome::refused);
    EXPECT_EQ(all[0].code, 0x7004U);
    EXPECT_FALSE(all[0].index_known) << "it stands in the last fragment";
}

TEST_F(DriveTest, TheElementsOfAParameterAreTold) {
    exchange(1ms, {soe(true, 1, octets_of({0x01, 0x04, 36, 0}))});  // read request of the attribute
    exchange(2ms, {soe(false, 1, octets_of({0x02, 0x04, 36, 0, 1, 0, 0x22, 0}))});
    exchange(3ms, {soe(true, 2, octets_of({0x0B, 0x40, 1, 0, 1, 2}))});  // write request of the value, 2 fragments
    exchange(4ms, {soe(true, 3, octets_of({0x03, 0x40, 47, 0, 3, 4}))});
    exchange(5ms, {soe(false, 2, octets_of({0x04, 0x40, 47, 0}))});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].elements, 0x04);
    EXPECT_EQ(all[0].index, 36);
    EXPECT_TRUE(all[0].index_known);
    EXPECT_EQ(all[1].elements, 0x40);
    EXPECT_EQ(all[1].index, 47);
    EXPECT_TRUE(all[1].index_known);
    EXPECT_EQ(all[1].bytes, 4U);
}

// The master toggles the repeat request in the activate octet of SyncManager 1, and the slave sends its message again.
// When the SyncManager is switched off and on, the mailbox starts again, and the same message counts as a new message.
TEST_F(DriveTest, AMessageThatIsRepeatedOnRequestCountsOnce) {
    const Part fragment = soe(false, 1, octets_of({0x0A, 0x40, 1, 0, 1, 2, 3, 4}));
    const auto activate = [&](unsigned octet) {
        return std::vector<Part>{{Command::FPWR, at(0x080E), octets_of({octet}), 1}};
    };
    exchange(1ms, {soe(true, 1, octets_of({0x01, 0x40, 30, 0}))});
    exchange(2ms, {fragment});
    exchange(3ms, activate(3));
    exchange(4ms, {fragment});
    exchange(5ms, {soe(false, 2, octets_of({0x02, 0x40, 30, 0, 5, 6}))});
    exchange(6ms, {soe(true, 2, octets_of({0x01, 0x40, 31, 0}))});
    exchange(7ms, {soe(false, 1, octets_of({0x02, 0x40, 31, 0, 7}))});
    exchange(8ms, activate(0));
    exchange(9ms, activate(1));
    exchange(10ms, {soe(true, 3, octets_of({0x01, 0x40, 31, 0}))});
    exchange(11ms, {soe(false, 1, octets_of({0x02, 0x40, 31, 0, 7}))});
    const auto all = analyser.finish().conversations.items;
    ASSERT_EQ(all.size(), 3U);
    EXPECT_EQ(all[0].bytes, 6U);
    for (const auto& one : all) EXPECT_EQ(one.outcome, Outcome::done) << one.index;
}

// A recording that contains only requests shows no answers of the slaves.
TEST_F(AnalyserTest, RequestsAloneAreNoConversations) {
    for (int n = 0; n < 600; ++n)
        packet(1ms * n,
               frame_of(
                   {{Command::FPWR, wire::DatagramAddress(0x1001, 0x1000),
                     mail(static_cast<std::uint8_t>(n % 7 + 1), octets_of({0, 0x20, 0x40, 0x41, 0x60, 0, 0, 0, 0, 0})),
                     1}},
                   false));
    EXPECT_TRUE(analyser.finish().conversations.items.empty());
}

}  // namespace
}  // namespace margay::analyse
