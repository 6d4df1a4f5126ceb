// The FoE client without a bus: every octet of its messages, every reply, and replies that no slave may send.
#include "mailbox/foe_transfer.hpp"
#include "mailbox/foe_bus.hpp"

namespace margay {
namespace {

using foe::Opcode;
using Taken = MailClient::Taken;

constexpr std::size_t kRoom = 10;  // data octets of a full packet

Mail composed(FoeTransfer& transfer, std::size_t room = foe::kHeaderBytes + kRoom) {
    EXPECT_TRUE(transfer.prepare());
    Mail data(room);
    data.resize(transfer.compose(data));
    return data;
}
Taken answer(FoeTransfer& transfer, const Mail& data) {
    return transfer.accept({{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::foe}, data});
}
Taken acknowledge(FoeTransfer& transfer, std::uint32_t number) {
    return answer(transfer, foe_message(Opcode::acknowledge, number));
}

struct Writing {
    explicit Writing(Bytes content) : source(content), transfer(prepared(content), source, packet) {}
    FoeWrite& prepared(Bytes content) {
        request.name = "ab";
        request.password = 0x12345678;
        request.data = content;
        return request;
    }
    FoeWrite request;
    MemorySource source;
    std::array<std::byte, kRoom> packet{};
    FoeWriteTransfer transfer;
};

struct Reading {
    explicit Reading(std::size_t bytes) : memory(bytes), sink(memory), transfer(prepared(), sink, packet) {}
    FoeRead& prepared() {
        request.name = "ab";
        request.password = 7;
        return request;
    }
    FoeRead request;
    std::vector<std::byte> memory;
    MemorySink sink;
    std::array<std::byte, kRoom> packet{};
    FoeReadTransfer transfer;
};

// When a file was refused, the source shows the application whether the slave may have changed anything.
TEST(FoeTransferWrite, TheSourceIsAskedWhenTheSlaveHasAcceptedTheRequest) {
    const auto content = pattern(13);
    for (const bool accepted : {false, true}) {
        SlowSource source(content, 20);
        FoeWrite request;
        request.name = "ab";
        request.source = &source;
        std::array<std::byte, kRoom> packet{};
        FoeWriteTransfer transfer(request, source, packet);
        (void)composed(transfer);
        EXPECT_EQ(source.calls, 0U);
        if (accepted) {
            EXPECT_EQ(acknowledge(transfer, 0), Taken::all);
            EXPECT_FALSE(transfer.prepare());  // this source has no data at first
            EXPECT_TRUE(transfer.prepare());
        }
        EXPECT_EQ(answer(transfer, foe_error(0x8010)), Taken::all);
        EXPECT_EQ(transfer.error().code, Errc::foe_error);
        EXPECT_EQ(source.calls != 0, accepted);
        EXPECT_EQ(request.bytes(), 0U);
    }
}

TEST(FoeTransferWrite, EveryOctetOfItsMessages) {
    const auto content = pattern(13);
    Writing w(content);
    EXPECT_EQ(composed(w.transfer), mail_bytes({2, 0, 0x78, 0x56, 0x34, 0x12, 'a', 'b'}));
    EXPECT_EQ(acknowledge(w.transfer, 0), Taken::all);
    EXPECT_EQ(composed(w.transfer), foe_message(Opcode::data, 1, Bytes(content).first(10)));
    EXPECT_EQ(w.request.bytes(), 0U);
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::all);
    EXPECT_EQ(w.request.bytes(), 10U);
    EXPECT_EQ(composed(w.transfer), foe_message(Opcode::data, 2, Bytes(content).subspan(10)));
    EXPECT_TRUE(w.transfer.must_abort());
    EXPECT_EQ(acknowledge(w.transfer, 2), Taken::all);
    EXPECT_TRUE(w.transfer.over());
    EXPECT_FALSE(w.transfer.must_abort());
    EXPECT_EQ(w.transfer.error().code, Errc::none);
    EXPECT_EQ(w.request.bytes(), 13U);
}

// An earlier request may still be acknowledged. This request is sent again after a message that ends the earlier
// request. No reply answers that message.
TEST(FoeTransferWrite, InDoubtTheRequestIsSentAgain) {
    const auto content = pattern(3);
    Writing w(content);
    const Mail request = composed(w.transfer);
    EXPECT_EQ(acknowledge(w.transfer, 0), Taken::all);
    w.transfer.doubt(1);
    const Mail end = composed(w.transfer);
    EXPECT_EQ(end, foe_error(0x8000, "canceled"));
    EXPECT_FALSE(w.transfer.awaits_reply());
    for (const std::uint32_t late : {0U, 1U, 2U}) EXPECT_EQ(acknowledge(w.transfer, late), Taken::no) << late;
    ASSERT_FALSE(w.transfer.over());
    w.transfer.finish();
    EXPECT_EQ(composed(w.transfer), request);
    EXPECT_TRUE(w.transfer.awaits_reply());
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::no);
    EXPECT_EQ(acknowledge(w.transfer, 0), Taken::all);
    EXPECT_EQ(composed(w.transfer), foe_message(Opcode::data, 1, Bytes(content)));
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::all);
    EXPECT_TRUE(w.transfer.over());
    EXPECT_EQ(w.transfer.error().code, Errc::none);
}

TEST(FoeTransferWrite, AFileOfWholePacketsAndAnEmptyOneEndWithAnEmptyPacket) {
    for (const std::size_t bytes : {std::size_t{0}, kRoom, 3 * kRoom}) {
        const auto content = pattern(bytes);
        Writing w(content);
        (void)composed(w.transfer);
        (void)acknowledge(w.transfer, 0);
        std::uint32_t number = 0;
        for (; number < bytes / kRoom;) {
            EXPECT_EQ(composed(w.transfer).size(), foe::kHeaderBytes + kRoom);
            EXPECT_EQ(acknowledge(w.transfer, ++number), Taken::all);
            ASSERT_FALSE(w.transfer.over());
        }
        EXPECT_EQ(composed(w.transfer), foe_message(Opcode::data, number + 1));
        (void)acknowledge(w.transfer, number + 1);
        EXPECT_TRUE(w.transfer.over());
        EXPECT_EQ(w.request.bytes(), bytes);
    }
}

TEST(FoeTransferWrite, ABusySlaveGetsTheSameMessageAgain) {
    const auto content = pattern(25);
    Writing w(content);
    struct Seen {
        unsigned calls = 0;
        FoeProgress last;
        std::string text;
    } seen;
    w.request.user = &seen;
    w.request.progressed = [](const FoeProgress& progress, void* user) {
        auto& s = *static_cast<Seen*>(user);
        ++s.calls;
        s.last = progress;
        s.text = progress.busy_text;
    };
    const Mail request = composed(w.transfer);
    EXPECT_EQ(answer(w.transfer, foe_busy(1, 4, "erasing\x1B[2J")), Taken::all);
    EXPECT_TRUE(w.transfer.is_busy());
    EXPECT_EQ(seen.calls, 1U);
    EXPECT_TRUE(seen.last.busy);
    EXPECT_EQ(seen.last.busy_done, 1);
    EXPECT_EQ(seen.last.busy_entire, 4);
    EXPECT_EQ(seen.last.total, 25U);
    EXPECT_EQ(seen.text, "erasing?[2J");  // no control characters reach a terminal
    EXPECT_EQ(composed(w.transfer), request);
    (void)acknowledge(w.transfer, 0);
    EXPECT_FALSE(w.transfer.is_busy());
    const Mail first = composed(w.transfer);
    (void)answer(w.transfer, foe_busy(0, 0));
    EXPECT_EQ(composed(w.transfer), first);
    (void)acknowledge(w.transfer, 1);
    EXPECT_FALSE(seen.last.busy);
    EXPECT_EQ(seen.last.bytes, kRoom);
    EXPECT_EQ(w.request.slave_text(), "");
}

// A slave that was busy acknowledges when it is ready, and once more for the repeated packet.
TEST(FoeTransferWrite, ASlaveThatAcknowledgesTwice) {
    const auto content = pattern(25);
    Writing w(content);
    (void)composed(w.transfer);
    (void)acknowledge(w.transfer, 0);
    (void)composed(w.transfer);
    EXPECT_EQ(acknowledge(w.transfer, 0), Taken::no);
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::all);
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::no);
    EXPECT_EQ(composed(w.transfer), foe_message(Opcode::data, 2, Bytes(content).subspan(kRoom, kRoom)));
    EXPECT_EQ(acknowledge(w.transfer, 1), Taken::no);
    EXPECT_EQ(acknowledge(w.transfer, 2), Taken::all);
    (void)composed(w.transfer);
    EXPECT_EQ(acknowledge(w.transfer, 3), Taken::all);
    EXPECT_TRUE(w.transfer.over());
    EXPECT_EQ(w.request.bytes(), 25U);
}

// Packet numbers have 32 bits; some slaves count with 16 bits.
TEST(FoeTransferWrite, NumbersOf16BitsWrap) {
    for (const bool narrow : {false, true}) {
        constexpr std::size_t kPackets = 70'000;
        const auto content = pattern(kPackets * kRoom + 1);
        Writing w(content);
        (void)composed(w.transfer);
        (void)acknowledge(w.transfer, 0);
        for (std::uint32_t n = 1; n <= kPackets + 1; ++n) {
            const Mail data = composed(w.transfer);
            ASSERT_EQ(foe::Layout::packet_number::load(data), n);
            if (n == 0x10001) {
                ASSERT_EQ(acknowledge(w.transfer, narrow ? 0 : 0x10000), Taken::no);
            }
            ASSERT_EQ(acknowledge(w.transfer, narrow ? n & 0xFFFF : n), Taken::all) << n;
        }
        EXPECT_TRUE(w.transfer.over());
        EXPECT_EQ(w.transfer.error().code, Errc::none);
        EXPECT_EQ(w.request.bytes(), content.size());
    }
}

TEST(FoeTransferWrite, AWrongNumberEndsItAndTheSlaveIsTold) {
    const auto content = pattern(25);
    Writing w(content);
    (void)composed(w.transfer);
    EXPECT_EQ(acknowledge(w.transfer, 77), Taken::no);  // acknowledgement of an earlier transfer
    (void)acknowledge(w.transfer, 0);
    (void)composed(w.transfer);
    EXPECT_EQ(acknowledge(w.transfer, 2), Taken::all);
    EXPECT_EQ(w.transfer.error().code, Errc::protocol);
    EXPECT_EQ(w.transfer.error().expected, 1U);
    EXPECT_EQ(w.transfer.error().actual, 2U);
    EXPECT_TRUE(w.transfer.must_abort());
    const auto told = w.transfer.abort_message();
    EXPECT_EQ(Mail(told.begin(), told.end()), foe_error(0x8005, "canceled"));
}

TEST(FoeTransferWrite, ErrorsOfTheSlaveEndItWithTheirText) {
    const auto content = pattern(25);
    Writing w(content);
    (void)composed(w.transfer);
    EXPECT_EQ(answer(w.transfer, foe_error(0x800A, std::string(200, 'x'))), Taken::all);
    EXPECT_EQ(w.transfer.error().code, Errc::foe_error);
    EXPECT_EQ(w.transfer.error().detail, 0x800AU);
    EXPECT_EQ(w.request.slave_text(), std::string(FoeRequest::kTextBytes, 'x'));
    EXPECT_FALSE(w.transfer.must_abort());
    EXPECT_EQ(MailboxBus::words({.code = Errc::foe_error, .step = Step::foe_write, .slave = 3, .detail = 0x800A}),
              "slave 3: FoE write: the slave ended the file transfer (error code 0x800a: no access rights)");
}

TEST(FoeTransferWrite, OtherMailIsNotTaken) {
    const auto content = pattern(25);
    Writing w(content);
    (void)composed(w.transfer);
    EXPECT_EQ(answer(w.transfer, mail_bytes({4, 0, 0, 0, 0})), Taken::no);  // too short
    EXPECT_EQ(answer(w.transfer, {}), Taken::no);
    for (const unsigned opcode : {0U, 1U, 2U, 3U, 7U, 255U})
        EXPECT_EQ(answer(w.transfer, mail_bytes({opcode, 0, 0, 0, 0, 0})), Taken::no) << opcode;
    EXPECT_FALSE(w.transfer.over());
}

TEST(FoeTransferWrite, ASourceThatIsNotReadyOrFails) {
    const auto content = pattern(30);
    SlowSource source(content, 4);
    FoeWrite request;
    request.source = &source;
    std::array<std::byte, kRoom> packet{};
    FoeWriteTransfer transfer(request, source, packet);
    (void)composed(transfer);
    (void)acknowledge(transfer, 0);
    Mail got;
    unsigned waits = 0;
    for (std::uint32_t n = 1; !transfer.over(); ++n) {
        while (!transfer.prepare()) ASSERT_LT(++waits, 30U);
        Mail data(foe::kHeaderBytes + kRoom);
        data.resize(transfer.compose(data));
        got.insert(got.end(), data.begin() + foe::kHeaderBytes, data.end());
        ASSERT_EQ(acknowledge(transfer, n), Taken::all);
    }
    EXPECT_EQ(got, content);
    EXPECT_GE(waits, 8U);

    SlowSource failing(content, 4);
    failing.fails_after = 2;
    FoeWriteTransfer cut(request, failing, packet);
    (void)composed(cut);
    (void)acknowledge(cut, 0);
    while (!cut.prepare()) {
    }
    EXPECT_TRUE(cut.over());
    EXPECT_EQ(cut.error().code, Errc::stream_failed);
    EXPECT_EQ(cut.error().detail, 28U);
    EXPECT_TRUE(cut.must_abort());
}

TEST(FoeTransferRead, EveryOctetOfItsMessages) {
    const auto content = pattern(13);
    Reading r(20);
    EXPECT_EQ(composed(r.transfer), mail_bytes({1, 0, 7, 0, 0, 0, 'a', 'b'}));
    EXPECT_EQ(answer(r.transfer, foe_message(Opcode::data, 1, Bytes(content).first(10))), Taken::all);
    EXPECT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, 1));
    EXPECT_EQ(r.request.bytes(), 10U);
    EXPECT_TRUE(r.transfer.awaits_reply());
    EXPECT_EQ(answer(r.transfer, foe_message(Opcode::data, 2, Bytes(content).subspan(10))), Taken::all);
    EXPECT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, 2));
    EXPECT_FALSE(r.transfer.awaits_reply());
    EXPECT_FALSE(r.transfer.must_abort());
    r.transfer.finish();
    EXPECT_TRUE(r.transfer.over());
    EXPECT_EQ(r.request.bytes(), 13U);
    EXPECT_TRUE(std::equal(content.begin(), content.end(), r.memory.begin()));
}

TEST(FoeTransferRead, BusyRepeatsTheAcknowledgementAndARepeatedPacketCountsOnce) {
    const auto content = pattern(25);
    Reading r(40);
    const Mail request = composed(r.transfer);
    (void)answer(r.transfer, foe_busy(0, 0));
    EXPECT_EQ(composed(r.transfer), request);
    const Mail first = foe_message(Opcode::data, 1, Bytes(content).first(10));
    EXPECT_EQ(answer(r.transfer, first), Taken::all);
    EXPECT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, 1));
    EXPECT_EQ(answer(r.transfer, first), Taken::no);
    (void)answer(r.transfer, foe_busy(3, 0));
    EXPECT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, 1));
    EXPECT_EQ(answer(r.transfer, foe_message(Opcode::data, 2, Bytes(content).subspan(10, 10))), Taken::all);
    EXPECT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, 2));
    EXPECT_EQ(answer(r.transfer, foe_message(Opcode::data, 3, Bytes(content).subspan(20))), Taken::all);
    (void)composed(r.transfer);
    EXPECT_EQ(r.request.bytes(), 25U);
    EXPECT_TRUE(std::equal(content.begin(), content.end(), r.memory.begin()));
}

TEST(FoeTransferRead, NumbersOf16BitsWrap) {
    constexpr std::uint32_t kPackets = 70'000;
    Reading r(kPackets * kRoom);
    (void)composed(r.transfer);
    const Mail full(kRoom, std::byte{9});
    for (std::uint32_t n = 1; n <= kPackets; ++n) {
        ASSERT_EQ(answer(r.transfer, foe_message(Opcode::data, n & 0xFFFF, full)), Taken::all) << n;
        // The acknowledgement contains the number that the slave has used.
        ASSERT_EQ(composed(r.transfer), foe_message(Opcode::acknowledge, n & 0xFFFF));
    }
    EXPECT_EQ(answer(r.transfer, foe_message(Opcode::data, (kPackets + 1) & 0xFFFF)), Taken::all);
    (void)composed(r.transfer);
    EXPECT_FALSE(r.transfer.awaits_reply());
    EXPECT_EQ(r.request.bytes(), kPackets * kRoom);
}

TEST(FoeTransferRead, AFileLargerThanTheMemoryEndsItAndNothingIsWrittenBehind) {
    Reading r(15);
    r.memory.resize(32, std::byte{0xA5});  // the sink has only the first 15 octets
    MemorySink sink(MutableBytes(r.memory).first(15));
    FoeReadTransfer transfer(r.request, sink, r.packet);
    (void)composed(transfer);
    const Mail full(kRoom, std::byte{9});
    (void)answer(transfer, foe_message(Opcode::data, 1, full));
    (void)composed(transfer);
    (void)answer(transfer, foe_message(Opcode::data, 2, full));
    EXPECT_TRUE(transfer.prepare());
    EXPECT_TRUE(transfer.over());
    EXPECT_EQ(transfer.error().code, Errc::capacity);
    EXPECT_TRUE(transfer.must_abort());
    for (std::size_t n = 15; n < r.memory.size(); ++n) EXPECT_EQ(r.memory[n], std::byte{0xA5});
    const auto told = transfer.abort_message();
    EXPECT_EQ(Mail(told.begin(), told.end()), foe_error(0x8003, "canceled"));
}

TEST(FoeTransferRead, ASinkThatIsNotReadyOrFails) {
    const auto content = pattern(25);
    SlowSink sink;
    FoeRead request;
    request.sink = &sink;
    std::array<std::byte, kRoom> packet{};
    FoeReadTransfer transfer(request, sink, packet);
    (void)composed(transfer);
    for (std::uint32_t n = 1; n <= 3; ++n) {
        const auto part = Bytes(content).subspan((n - 1) * kRoom, std::min(kRoom, content.size() - (n - 1) * kRoom));
        ASSERT_EQ(answer(transfer, foe_message(Opcode::data, n, part)), Taken::all);
        unsigned waits = 0;
        while (!transfer.prepare()) ASSERT_LT(++waits, 10U);
        EXPECT_GT(waits, 0U);
        Mail data(foe::kHeaderBytes);
        ASSERT_EQ(transfer.compose(data), foe::kHeaderBytes);
    }
    EXPECT_EQ(sink.content, content);
    EXPECT_FALSE(transfer.awaits_reply());

    SlowSink failing;
    failing.fails_above = 3;
    FoeReadTransfer cut(request, failing, packet);
    (void)composed(cut);
    (void)answer(cut, foe_message(Opcode::data, 1, Bytes(content).first(kRoom)));
    while (!cut.prepare()) {
    }
    EXPECT_EQ(cut.error().code, Errc::stream_failed);
    EXPECT_EQ(cut.error().detail, 28U);

    // The application may use any number.
    struct Refusing final : ByteSink {
        Taken push(Bytes) override { return {.failure = 0xFFFF'FFFF}; }
    } refusing;
    request.sink = &refusing;
    FoeReadTransfer refused(request, refusing, packet);
    (void)composed(refused);
    (void)answer(refused, foe_message(Opcode::data, 1, Bytes(content).first(kRoom)));
    EXPECT_TRUE(refused.prepare());
    EXPECT_EQ(refused.error().code, Errc::stream_failed);
    EXPECT_EQ(refused.error().detail, 0xFFFF'FFFFU);
}

}  // namespace
}  // namespace margay
