// Requests: their states, reuse, other threads, and the blocking calls.
#include "mailbox/mailbox_bus.hpp"
#include "real_osal.hpp"

#include <atomic>
#include <thread>

namespace margay {
namespace {

class RequestTest : public testing::Test {
  protected:
    MailboxBus bus;
    StackSlave& slave = bus.add_stack(128);
    void SetUp() override { bus.start(); }
    std::array<std::byte, 64> memory{};
};

TEST_F(RequestTest, IsReusableWithAnotherIndex) {
    SdoUpload request;
    EXPECT_EQ(request.state(), RequestState::unused);
    request.slave = 1;
    request.data = memory;
    for (const auto& [index, bytes] :
         {std::pair<std::uint16_t, std::size_t>{0x2000, 2}, {0x1008, 26}, {0x2001, 8}, {0x3000, 0}, {0x1000, 4}}) {
        request.index = index;
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        EXPECT_EQ(request.state(), RequestState::busy);
        EXPECT_EQ(submit(*bus.ctx, request).error().code, Errc::busy);
        bus.run(request);
        EXPECT_EQ(request.state(), bytes == 0 ? RequestState::error : RequestState::success) << std::hex << index;
        EXPECT_EQ(request.bytes, bytes);
        EXPECT_EQ(request.error().code, bytes == 0 ? Errc::sdo_abort : Errc::none);
    }
    SdoDownload write;
    const auto value = pattern(2);
    write.slave = 1;
    write.index = 0x2000;
    write.data = Bytes(value).first(1);  // too short
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    bus.run(write);
    EXPECT_EQ(write.error().code, Errc::sdo_abort);
    EXPECT_EQ(write.error().detail, 0x06070013U);
    write.data = Bytes(value);
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    bus.run(write);
    EXPECT_EQ(write.error().detail, 0x06090031U);  // value too high: −500 … 500
}

TEST_F(RequestTest, WhatIsWrongWithItIsItsError) {
    const auto error_of = [&](auto& request) {
        const auto refused = submit(*bus.ctx, request);  // the owner gets the refusal at once
        EXPECT_EQ(refused.error(), request.error());
        return request.error();
    };
    SdoUpload request;
    request.data = memory;
    request.slave = 0;
    EXPECT_EQ(error_of(request).code, Errc::unknown_slave);
    request.slave = 2;
    EXPECT_EQ(bus.words(error_of(request)), "slave 2: SDO upload of 0x0000:0: there is no such slave (there are 1)");
    request.slave = 1;
    request.complete_access = true;
    request.subindex = 2;
    EXPECT_EQ(error_of(request).code, Errc::invalid_argument);
    HostContext fresh{Limits{.slaves = 1}};
    EXPECT_EQ(submit(fresh, request).error().code, Errc::wrong_state);
    EXPECT_EQ(SDOread<std::uint8_t>(fresh, 1, 0x1000, 0).error().code, Errc::wrong_state);
}

TEST_F(RequestTest, DestroyedOrCanceledAtAnyTime) {
    for (int polls = -1; polls < 10; ++polls) {
        {
            SdoUpload request;
            request.slave = 1;
            request.index = 0x1008;
            request.data = memory;
            ASSERT_TRUE(submit(*bus.ctx, request).ok());
            for (int n = 0; n < polls; ++n) bus.step();
        }
        EXPECT_EQ(*SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0), 100) << polls;
    }
    const std::size_t quiet = bus.ctx->arena_bytes();
    SdoUpload request;
    request.slave = 1;
    request.index = 0x1008;
    request.data = memory;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.step();
    request.cancel();
    bus.step();
    EXPECT_EQ(request.error().code, Errc::canceled);
    EXPECT_LE(bus.ctx->arena_peak_bytes(), quiet);
}

TEST_F(RequestTest, OutlivesItsContextAndARescan) {
    std::vector<SdoUpload> requests(40);
    const auto submit_all = [&](std::size_t count) {
        for (auto& request : std::span(requests).first(count)) {
            request.slave = 1;
            request.index = 0x1008;
            request.data = memory;
            ASSERT_TRUE(submit(*bus.ctx, request).ok());
        }
    };
    submit_all(1);
    bus.step();
    // A scan closes the mailbox during the request, and the error of the request reports this.
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    EXPECT_EQ(requests.front().error().code, Errc::mailbox_closed);
    EXPECT_EQ(bus.words(requests.front().error()),
              "slave 1: SDO upload of 0x1008:0: the mailbox was closed while the message waited, because the slave has "
              "gone to INIT, is started or is found anew");
    submit_all(requests.size());
    SdoUpload never_seen;
    never_seen.slave = 1;
    never_seen.data = memory;
    bus.step();
    ASSERT_TRUE(submit(*bus.ctx, never_seen).ok());
    bus.ctx.reset();
    for (const auto& request : requests) EXPECT_EQ(request.error().code, Errc::canceled);
    EXPECT_EQ(never_seen.error().code, Errc::canceled);
}

TEST_F(RequestTest, DozensToOneSlaveWaitInTurnInLittleMemory) {
    std::vector<SdoUpload> requests(300);
    std::vector<std::array<std::byte, 8>> values(requests.size());
    for (std::size_t n = 0; n < requests.size(); ++n) {
        requests[n].slave = 1;
        requests[n].index = 0x2001;
        requests[n].data = values[n];
        ASSERT_TRUE(submit(*bus.ctx, requests[n]).ok());
    }
    requests[150].cancel();
    for (std::size_t n = 0; n < requests.size(); ++n) {
        bus.run(requests[n]);
        EXPECT_EQ(requests[n].state(), n == 150 ? RequestState::error : RequestState::success)
            << bus.words(requests[n].error());
    }
    SdoUpload late;  // its timeout ends before it is sent
    late.slave = 1;
    late.index = 0x2007;  // answered after 50 ms
    late.data = memory;
    late.timeout = 5ms;
    slave.application.slow_until = bus.osal.now() + 50ms;
    ASSERT_TRUE(submit(*bus.ctx, late).ok());
    bus.run(late);
    EXPECT_EQ(late.error().code, Errc::timeout);
}

TEST_F(RequestTest, CallsThatWaitAreForbiddenToTheOwnerWhenTheProgramSaysSo) {
    std::vector<std::byte> image(64);
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    ASSERT_TRUE(send_processdata(*bus.ctx).ok());
    ASSERT_TRUE(SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0).ok()) << "the owner polls, and the cycle stands still";
    ASSERT_TRUE(allow_waiting(*bus.ctx, false));
    const auto refused = SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0);
    EXPECT_EQ(refused.error().code, Errc::waiting_forbidden);
    EXPECT_NE(bus.words(refused.error()).find("submit() a request"), std::string::npos) << bus.words(refused.error());
    EXPECT_EQ(SDOwrite(*bus.ctx, 1, 0x2000, 0, std::int16_t{1}).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(read_object_description(*bus.ctx, 1, 0x2000).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(config_init(*bus.ctx).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(config_map(*bus.ctx, image).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(readstate(*bus.ctx).error().code, Errc::waiting_forbidden);
    ASSERT_TRUE(allow_waiting(*bus.ctx, true));
    EXPECT_EQ(*SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0), 100);
}

// The test uses real time, because each of the two threads would advance a shared virtual clock. No result depends on
// durations.
TEST(RequestThreads, OtherThreadsSubmitAndWaitWhileTheOwnerCycles) {
    RealOsal osal;
    sim::Segment segment;
    auto firmware = std::make_unique<StackSlave>(128);
    auto esc = std::make_unique<sim::Esc>(StackSlave::chip(), firmware->sii());
    esc->set_firmware(std::move(firmware));
    (void)segment.add(std::move(esc));
    ASSERT_TRUE(segment.connect_master({0, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx{Limits{.slaves = 1}};
    ASSERT_TRUE(init(ctx, nic, osal));
    ASSERT_TRUE(config_init(ctx).ok());
    std::vector<std::byte> image(64);
    ASSERT_TRUE(config_map(ctx, image).ok());

    std::atomic<bool> done{false};
    std::atomic<bool> cycling{false};
    std::thread owner([&] {
        ASSERT_TRUE(take_ownership(ctx));
        while (!done.load()) {
            (void)send_processdata(ctx);
            cycling.store(true);
            (void)receive_processdata(ctx, 500us);
            (void)poll(ctx, osal.now());
            osal.wait(osal.now() + 1ms, -1);
        }
    });
    while (!cycling.load()) std::this_thread::yield();
    std::atomic<unsigned> good{0};
    const auto work = [&] {
        std::array<std::byte, 64> memory{};
        for (int n = 0; n < 10; ++n) {
            if (SDOread<std::uint64_t>(ctx, 1, 0x2001, 0).ok()) ++good;  // waits for the owner
            SdoUpload request;
            request.slave = 1;
            request.index = 0x1008;
            request.data = memory;
            if (!submit(ctx, request)) continue;
            while (request.busy()) std::this_thread::yield();
            if (request.bytes == 26) ++good;
            request.bytes = 0;
            if (submit(ctx, request) && wait(ctx, request) && request.bytes == 26)
                ++good;  // the owner does the polling
            if (!submit(ctx, request)) continue;
            request.cancel();
            while (request.busy()) std::this_thread::yield();
        }
    };
    std::thread first(work);
    std::thread second(work);
    first.join();
    second.join();
    done.store(true);
    owner.join();
    EXPECT_EQ(good.load(), 60U);
}

// There is no supervision. Another device may be at the address of a slave that was away.
TEST(RequestsToASlaveThatWasAway, AreRefusedUntilReadstateComparesItsIdentity) {
    MailboxBus bus;
    for (int n = 0; n < 2; ++n) bus.add_device(sim::make_device("digital_io_16").value());
    bus.start();
    const auto read = [&] { return bus.words(SDOread<std::uint32_t>(*bus.ctx, 2, 0x1018, 2).error()); };
    EXPECT_EQ(read(), "no error");
    bus.segment.disconnect({1, 0});
    bus.idle(5ms);
    (void)readstate(*bus.ctx);
    EXPECT_EQ(read(), "slave 2: SDO upload of 0x1018:2: the slave is missing");
    ASSERT_TRUE(bus.segment.connect({0, 1}, {1, 0}));
    bus.idle(5ms);
    bus.segment.slave(1).sii().fail_next(1'000'000);
    EXPECT_FALSE(readstate(*bus.ctx).ok()) << "its identity cannot be read";
    EXPECT_EQ(read(),
              "slave 2: SDO upload of 0x1018:2: the slave was away, and its identity was not compared since: "
              "readstate() or a supervision does it");
    bus.segment.slave(1).sii().fail_next(0);
    EXPECT_TRUE(readstate(*bus.ctx).ok());
    EXPECT_EQ(read(), "no error");
}

// Nothing was sent for three seconds, and meanwhile slave 2 was exchanged for another product. The first call sends
// mail.
TEST(RequestsToASlaveThatWasAway, TheFirstMailAfterAPauseIsRefused) {
    for (const bool supervised : {true, false}) {
        MailboxBus bus;
        for (int n = 0; n < 2; ++n) bus.add_device(sim::make_device("digital_io_16").value());
        bus.start();
        SuperviseRequest supervision;
        supervision.target = AlState::preop;
        if (supervised) {
            ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
        }
        bus.idle(500ms);
        const auto write = [&] { return SDOwrite<std::uint16_t>(*bus.ctx, 2, 0x8000, 1, 5).error(); };
        const Error before = write();
        ASSERT_EQ(before.code, Errc::none) << bus.words(before);
        bus.osal.advance(3s);
        bus.segment.slave(1).sii().image()[20] ^= std::byte{0x77};  // the product
        if (!supervised) {
            EXPECT_EQ(readstate(*bus.ctx).error().code, Errc::other_slave);
        }
        const Error refused = write();
        EXPECT_EQ(refused.slave, 2U) << "supervised " << supervised << ": " << bus.words(refused);
        bus.idle(500ms);
        EXPECT_EQ(write().code, Errc::missing_slave) << bus.words(write());
        EXPECT_TRUE(SDOread<std::uint32_t>(*bus.ctx, 1, 0x1018, 2).ok());
    }
}

}  // namespace
}  // namespace margay
