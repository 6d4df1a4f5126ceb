// SDO transfers of values of any size, from a source and to a sink.
#include "mailbox/foe_bus.hpp"

namespace margay {
namespace {

class SdoStreams : public testing::Test {
  protected:
    MailboxBus bus;
    StackSlave* slave = nullptr;

    void SetUp() override {
        slave = &bus.add_stack(128);
        bus.start();
    }
    HostContext& ctx() { return *bus.ctx; }
    // Checks that the slave has no open transfer and that the next transfer succeeds.
    void expect_idle() {
        bus.idle(10ms);
        EXPECT_EQ(mailbox_statistics(ctx(), 1)->unexpected, 0U);
        EXPECT_EQ(*SDOread<std::uint64_t>(ctx(), 1, 0x2001, 0), 0x1122334455667788U);
    }
};

TEST_F(SdoStreams, BringALongValueToASlowSink) {
    SlowSink sink;
    const auto read = SDOread(ctx(), 1, 0x2008, 0, false, sink);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(*read, 70'000U);
    EXPECT_EQ(sink.content, slave->application.vast);
}

// The library asks the sink for room for the whole value, and the sink has no room yet.
TEST_F(SdoStreams, TellTheSizeBeforeTheSinkTakesAnything) {
    struct Closed final : ByteSink {
        bool open = false;
        std::size_t taken = 0;
        Taken push(Bytes octets) override {
            const std::size_t bytes = open ? octets.size() : std::min<std::size_t>(octets.size(), 5 - taken);
            taken += bytes;
            return {.bytes = bytes};
        }
    } sink;
    SdoUploadStream request;
    request.slave = 1;
    request.index = 0x2008;
    request.sink = &sink;
    sink.taken = 5;
    ASSERT_TRUE(submit(ctx(), request).ok());
    bus.idle(20ms);
    ASSERT_TRUE(request.busy());
    EXPECT_EQ(request.total(), 70'000U);
    EXPECT_EQ(request.bytes(), 0U);
    sink.taken = 0;
    bus.idle(20ms);
    ASSERT_TRUE(request.busy());
    EXPECT_EQ(request.bytes(), 5U) << "what the sink has accepted";
    EXPECT_EQ(request.total(), 70'000U);
    sink.open = true;
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::none) << bus.words(request.error());
    EXPECT_EQ(request.bytes(), 70'000U);
}

TEST_F(SdoStreams, BringALongValueFromASlowSource) {
    const auto value = pattern(66'000);
    SlowSource source(value, 50);
    SdoDownloadStream request;
    request.slave = 1;
    request.index = 0x2008;
    request.source = &source;
    request.size = value.size();
    ASSERT_TRUE(submit(ctx(), request).ok());
    std::size_t before = 0;
    unsigned steps = 0;
    while (request.busy()) {
        bus.idle(1ms);
        EXPECT_GE(request.bytes(), before);
        steps += request.bytes() > before && !request.busy() ? 0U : 1U;
        before = request.bytes();
    }
    EXPECT_EQ(request.error().code, Errc::none) << bus.words(request.error());
    EXPECT_GT(steps, 100U);
    EXPECT_EQ(request.bytes(), value.size());
    EXPECT_EQ(request.total(), value.size());
    EXPECT_EQ(slave->application.vast_bytes, value.size());
    EXPECT_TRUE(std::equal(value.begin(), value.end(), slave->application.vast.begin()));
}

TEST_F(SdoStreams, BringShortValuesAndWholeObjects) {
    SlowSink two;
    EXPECT_EQ(*SDOread(ctx(), 1, 0x2000, 0, false, two), 2U);
    EXPECT_EQ(two.content, (std::vector<std::byte>{std::byte{100}, std::byte{0}}));
    SlowSink whole;
    std::array<std::byte, 100> same{};
    const auto bytes = SDOread(ctx(), 1, 0x1018, 0, true, same);
    EXPECT_EQ(SDOread(ctx(), 1, 0x1018, 0, true, whole).error(), bytes.error());
    ASSERT_TRUE(bytes.ok());
    EXPECT_TRUE(std::ranges::equal(whole.content, Bytes(same).first(*bytes)));
    const std::array value{std::byte{0xBF}, std::byte{0xFE}};
    SlowSource source(value);
    ASSERT_TRUE(SDOwrite(ctx(), 1, 0x2000, 0, false, source, 2).ok());
    EXPECT_EQ(*SDOread<std::int16_t>(ctx(), 1, 0x2000, 0), -321);
}

TEST_F(SdoStreams, EndWhenTheSinkOrTheSourceFails) {
    SlowSink sink;
    sink.fails_above = 30'000;
    const auto read = SDOread(ctx(), 1, 0x2008, 0, false, sink);
    EXPECT_EQ(read.error().code, Errc::stream_failed);
    EXPECT_EQ(read.error().detail, 28U);
    EXPECT_EQ(read.error().index, 0x2008);
    expect_idle();
    const auto value = pattern(66'000);
    SlowSource source(value, 50);
    source.fails_after = 500;
    const auto written = SDOwrite(ctx(), 1, 0x2008, 0, false, source, value.size());
    EXPECT_EQ(written.error().code, Errc::stream_failed);
    EXPECT_EQ(written.error().detail, 28U);
    expect_idle();
    EXPECT_EQ(slave->application.vast_bytes, 70'000U) << "a download that was aborted writes nothing";
}

TEST_F(SdoStreams, EndWhenTheSourceEndsEarly) {
    const auto value = pattern(1'000);
    for (const std::size_t given : {std::size_t{0}, std::size_t{3}, std::size_t{500}, std::size_t{999}}) {
        SlowSource source(Bytes(value).first(given), 50);
        const auto written = SDOwrite(ctx(), 1, 0x2008, 0, false, source, value.size());
        EXPECT_EQ(written.error().code, Errc::wrong_size) << given;
        EXPECT_EQ(written.error().expected, 1'000U);
        EXPECT_EQ(written.error().actual, given);
        expect_idle();
    }
    EXPECT_EQ(slave->application.vast_bytes, 70'000U);
}

TEST_F(SdoStreams, AreCanceledAtAnyMoment) {
    for (int steps = 0; steps < 60; ++steps) {
        SlowSink sink;
        SdoUploadStream request;
        request.slave = 1;
        request.index = 0x2008;
        request.sink = &sink;
        ASSERT_TRUE(submit(ctx(), request).ok());
        for (int n = 0; n < steps; ++n) (void)poll(ctx(), bus.osal.now()), bus.osal.advance(100us);
        request.cancel();
        EXPECT_FALSE(request.busy());
        EXPECT_EQ(*SDOread<std::uint64_t>(ctx(), 1, 0x2001, 0), 0x1122334455667788U);
    }
}

TEST_F(SdoStreams, ATimeoutIsForTheWholeTransferAlsoWhileTheSinkIsNotReady) {
    struct Never final : ByteSink {
        Taken push(Bytes) override { return {}; }
    } sink;
    const Time before = bus.osal.now();
    const auto read = SDOread(ctx(), 1, 0x2008, 0, false, sink, 200ms);
    EXPECT_EQ(bus.words(read.error()), "slave 1: SDO upload of 0x2008:0: timed out");
    EXPECT_LT(bus.osal.now() - before, 300ms);
    expect_idle();
}

// A sink that accepts a few octets, then waits until it is opened.
class HeldSink final : public ByteSink {
  public:
    Taken push(Bytes octets) override {
        if (!open && content.size() >= 200) return {};
        content.insert(content.end(), octets.begin(), octets.end());
        return {.bytes = octets.size()};
    }
    bool open = false;
    Mail content;
};

TEST_F(SdoStreams, EndWhenTheMailboxIsOpenedAgainWhileTheyWaitForTheirSink) {
    HeldSink sink;
    SdoUploadStream held;
    held.slave = 1;
    held.index = 0x2008;
    held.sink = &sink;
    ASSERT_TRUE(submit(ctx(), held).ok());
    bus.idle(50ms);
    ASSERT_TRUE(held.busy());
    ASSERT_GE(sink.content.size(), 200U);
    // The slave starts again, and another transfer of the same kind begins.
    for (const AlState state : {AlState::init, AlState::preop}) ASSERT_EQ(bring(bus, state).code, Errc::none);
    SlowSink other;
    SdoUploadStream next;
    next.slave = 1;
    next.index = 0x2008;
    next.sink = &other;
    ASSERT_TRUE(submit(ctx(), next).ok());
    sink.open = true;
    bus.run(next);
    EXPECT_EQ(next.error().code, Errc::none) << bus.words(next.error());
    EXPECT_EQ(other.content, slave->application.vast);
    EXPECT_FALSE(held.busy());
    EXPECT_EQ(held.error().code, Errc::mailbox_closed) << bus.words(held.error());
    expect_idle();
}

TEST_F(SdoStreams, WithoutSinkOrSourceAreRefused) {
    SdoUploadStream up;
    up.slave = 1;
    EXPECT_EQ(
        bus.words(submit(ctx(), up).error()),
        "slave 1: SDO upload of 0x0000:0: argument out of range: there is no source or sink, or the size has more "
        "than 32 bits");
    SdoDownloadStream down;
    down.slave = 1;
    EXPECT_EQ(submit(ctx(), down).error().code, Errc::invalid_argument);
    std::array<std::byte, 1> one{};
    SlowSource source(one);
    down.source = &source;
    down.size = std::size_t{1} << 32;
    EXPECT_EQ(submit(ctx(), down).error().code, Errc::invalid_argument);
    down.size = 1;
    down.slave = 9;
    EXPECT_EQ(submit(ctx(), down).error().code, Errc::unknown_slave);
}

}  // namespace
}  // namespace margay
