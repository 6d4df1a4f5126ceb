// Mailbox requests during cycles: process data keeps its working counter and its number of frames.
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

class CycleTest : public testing::Test {
  protected:
    MailboxBus bus;
    std::vector<StackSlave*> slaves;
    std::vector<std::byte> image = std::vector<std::byte>(512);

    void start(std::size_t count, bool status_bits, std::uint16_t mailbox_bytes = 128) {
        for (std::size_t n = 0; n < count; ++n) slaves.push_back(&bus.add_stack(mailbox_bytes));
        bus.start();
        for (const Slave& slave : bus.ctx->slaves()) slave.config.mailbox_status = status_bits;
        const auto mapped = config_map(*bus.ctx, image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        for (const Slave& slave : bus.ctx->slaves()) ASSERT_EQ(slave.error.code, Errc::none) << bus.words(slave.error);
        for (int n = 0; n < 5; ++n) cycle();
        ASSERT_TRUE(writestate(*bus.ctx, 0, AlState::op).ok());
        for (int n = 0; n < 50; ++n) cycle();
        StateCheckRequest check;
        check.wanted = AlState::op;
        ASSERT_TRUE(submit(*bus.ctx, check).ok());
        while (check.busy()) cycle();
        ASSERT_EQ(check.reached.state, AlState::op);
    }

    // Executes one cycle of a millisecond, with checks.
    void cycle() {
        bus.osal.advance(1ms);
        const auto frames = bus.ctx->statistics().frames_sent;
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << bus.words(wkc.error());
        ASSERT_EQ(*wkc, bus.ctx->group(0).expected_wkc);
        (void)poll(*bus.ctx, bus.osal.now());
        most_frames = std::max(most_frames, bus.ctx->statistics().frames_sent - frames);
        ++cycles;
    }
    std::uint64_t most_frames = 0;
    unsigned cycles = 0;
};

TEST_F(CycleTest, EightSegmentedTransfersAndADictionaryKeepWkcAndFrames) {
    start(9, false);
    most_frames = 0;
    cycles = 0;
    std::array<SdoUpload, 4> uploads;
    std::array<SdoDownload, 4> downloads;
    std::vector<std::vector<std::byte>> values(4, std::vector<std::byte>(70'000));
    const auto value = pattern(9'000);
    for (std::size_t n = 0; n < 4; ++n) {
        slaves[n]->application.vast = pattern(70'000);
        slaves[n]->application.vast_bytes = 10'000 + n;
        uploads[n].slave = static_cast<std::uint16_t>(n + 1);
        uploads[n].index = 0x2008;
        uploads[n].data = values[n];
        downloads[n].slave = static_cast<std::uint16_t>(n + 5);
        downloads[n].index = 0x2008;
        downloads[n].data = value;
        ASSERT_TRUE(submit(*bus.ctx, uploads[n]).ok());
        ASSERT_TRUE(submit(*bus.ctx, downloads[n]).ok());
    }
    // The ninth slave reads its dictionary repeatedly: lists, objects, entries.
    std::vector<std::uint16_t> indices;
    ObjectListRequest list;
    list.slave = 9;
    list.user = &indices;
    list.found = [](std::span<const std::uint16_t> some, void* user) {
        auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
        all.insert(all.end(), some.begin(), some.end());
    };
    ObjectDescriptionRequest object;
    object.slave = 9;
    EntryDescriptionRequest entry;
    entry.slave = 9;
    std::size_t described = 0;
    unsigned lists = 0;
    const auto stream = [&] {
        if (list.busy() || object.busy() || entry.busy()) return;
        if (indices.empty()) {
            ASSERT_TRUE(submit(*bus.ctx, list).ok());
            ++lists;
            return;
        }
        object.index = indices.back();
        entry.index = indices.back();
        indices.pop_back();
        ASSERT_TRUE(submit(*bus.ctx, object).ok());
        ASSERT_TRUE(submit(*bus.ctx, entry).ok());
        ++described;
    };
    const auto busy = [](const auto& requests) {
        return std::ranges::any_of(requests, [](const auto& r) { return r.busy(); });
    };
    while ((busy(uploads) || busy(downloads)) && cycles < 2000) {
        stream();
        ASSERT_NO_FATAL_FAILURE(cycle());
    }
    while (list.busy() || object.busy() || entry.busy()) cycle();
    for (std::size_t n = 0; n < 4; ++n) {
        EXPECT_EQ(uploads[n].state(), RequestState::success) << bus.words(uploads[n].error());
        EXPECT_EQ(uploads[n].bytes, 10'000 + n);
        EXPECT_TRUE(std::equal(values[n].begin(), values[n].begin() + static_cast<long>(uploads[n].bytes),
                               slaves[n]->application.vast.begin()));
        EXPECT_EQ(downloads[n].state(), RequestState::success) << bus.words(downloads[n].error());
        EXPECT_TRUE(std::equal(value.begin(), value.end(), slaves[n + 4]->application.vast.begin()));
    }
    EXPECT_GE(lists, 1U);
    EXPECT_GE(described, 30U);
    EXPECT_EQ(most_frames, bus.ctx->group(0).frames);  // all datagrams travelled in the frames of the cycle
    EXPECT_LT(cycles, 500U);                           // three cycles per segment of 119 octets
    EXPECT_EQ(bus.ctx->statistics().lost, 0U);
}

TEST_F(CycleTest, AMappedBitTakesThePlaceOfLooking) {
    start(2, true);
    ASSERT_NE(bus.ctx->slave(1).image.mailbox_status_bit, SlaveImage::kNone);
    std::array<std::byte, 64> memory{};
    SdoUpload upload;
    upload.slave = 1;
    upload.data = memory;
    upload.index = 0x1008;
    const auto read = [&] {
        cycles = 0;
        ASSERT_TRUE(submit(*bus.ctx, upload).ok());
        while (upload.busy() && cycles < 100) cycle();
        EXPECT_EQ(upload.state(), RequestState::success) << bus.words(upload.error());
    };
    read();  // the first read checks whether the mailbox contains an old message
    const auto before = bus.ctx->statistics().datagrams_sent;
    const auto in_a_cycle = bus.ctx->group(0).datagrams.size();
    read();
    // Only the message and its reply are additional datagrams. The mailbox status in the cycle shows when the reply can
    // be read.
    EXPECT_EQ(bus.ctx->statistics().datagrams_sent - before, cycles * in_a_cycle + 2);
    EXPECT_LE(cycles, 4U);

    // A slow answer: the library looks at the mailbox with an additional datagram only from time to time, to make sure
    // that the bit is right.
    slaves[0]->application.slow_until = bus.osal.now() + 100ms;
    upload.index = 0x2007;
    const auto slow = bus.ctx->statistics().datagrams_sent;
    cycles = 0;
    ASSERT_TRUE(submit(*bus.ctx, upload).ok());
    while (upload.busy() && cycles < 200) cycle();
    EXPECT_EQ(upload.state(), RequestState::success) << bus.words(upload.error());
    EXPECT_GE(cycles, 85U);
    EXPECT_LE(bus.ctx->statistics().datagrams_sent - slow, cycles * in_a_cycle + 2 + 8);
}

TEST_F(CycleTest, AnEmergencyIsSeenByTheMappedBitWithoutADatagramOfItsOwn) {
    start(2, true);
    (void)watch_mailboxes(*bus.ctx, 5ms);
    for (int n = 0; n < 20; ++n) cycle();
    ASSERT_TRUE(slaves[1]->application.emergencies()->raise({.error_code = 0x4210, .error_register = 8}));
    for (int n = 0; n < 30; ++n) cycle();
    const auto emergency = emergencies(*bus.ctx, 2).take();
    ASSERT_TRUE(emergency.has_value());
    EXPECT_EQ(emergency->code, 0x4210);
    EXPECT_EQ(emergency->error_register, 8);
    const auto event = bus.ctx->events().take();
    ASSERT_TRUE(event.has_value());
    std::array<char, 200> text{};
    EXPECT_EQ(describe(*event, text), "slave 2: emergency 0x4210: device temperature, error register 0x08");
    EXPECT_EQ(event->at, emergency->at);
    EXPECT_FALSE(bus.ctx->events().take().has_value()) << "once";
}

// Fifty slow slaves: one datagram looks at all mailboxes.
TEST(SharedLook, ManySlavesThatWaitShareADatagram) {
    MailboxBus bus;
    constexpr std::size_t kSlowSlaves = 50;
    std::vector<ScriptedSlave*> slaves;
    for (std::size_t n = 0; n < kSlowSlaves; ++n) slaves.push_back(&bus.add_scripted(64));
    bus.start();
    for (ScriptedSlave* slave : slaves) {
        slave->delay = 200ms;
        slave->on_mail = [slave](const Mail&) { slave->reply({0x00, 0x30, 0x4B, 0x00, 0x20, 0x00, 7, 0, 0, 0}); };
    }
    std::vector<SdoUpload> requests(kSlowSlaves);
    std::vector<std::array<std::byte, 4>> values(kSlowSlaves);
    const auto before = bus.ctx->statistics().datagrams_sent;
    for (std::size_t n = 0; n < kSlowSlaves; ++n) {
        requests[n].slave = static_cast<std::uint16_t>(n + 1);
        requests[n].index = 0x2000;
        requests[n].data = values[n];
        ASSERT_TRUE(submit(*bus.ctx, requests[n]).ok());
    }
    for (const auto& r : requests) {
        bus.run(r);
        EXPECT_EQ(r.state(), RequestState::success) << bus.words(r.error());
    }
    // 200 ms with a look every millisecond. One look per slave would need 10 000 datagrams.
    EXPECT_LT(bus.ctx->statistics().datagrams_sent - before, 1800U);
}

}  // namespace
}  // namespace margay
