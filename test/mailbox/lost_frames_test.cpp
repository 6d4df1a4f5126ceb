// Every kind of transfer. Each of its frames in turn is lost on the way out, lost on the way back, or sent twice. The
// transfer succeeds, each value is written once, and the channel works afterwards.
#include "mailbox/foe_bus.hpp"
#include "sim/library/quirks.hpp"

namespace margay {
namespace {

enum class Fault { lost_out, lost_in, twice };

struct Outcome {
    std::uint64_t frames = 0;  // frames of the transfer
    unsigned writes = 0;       // write accesses that the application of the slave received
    MailboxStatistics statistics;
};

using Transfer = void (*)(MailboxBus& bus, StackSlave& slave);

// Executes `transfer` with a fault at its frame number `at` (negative: no fault).
Outcome run(Transfer transfer, std::uint16_t mailbox_bytes, Fault fault, int at) {
    MailboxBus bus;
    auto& slave = bus.add_stack(mailbox_bytes);
    bus.start();
    EXPECT_TRUE(SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0).ok());  // the channel is empty and in use
    const std::uint64_t before = bus.nic->sent;
    if (at >= 0) {
        const auto number = before + static_cast<std::uint64_t>(at);
        (fault == Fault::lost_out  ? bus.nic->lose_out
         : fault == Fault::lost_in ? bus.nic->lose_in
                                   : bus.nic->twice)
            .insert(number);
    }
    transfer(bus, slave);
    Outcome outcome{bus.nic->sent - before, slave.application.writes, *mailbox_statistics(*bus.ctx, 1)};
    // The next requests succeed.
    EXPECT_EQ(*SDOread<std::uint64_t>(*bus.ctx, 1, 0x2001, 0), 0x1122334455667788U);
    const auto none = SDOread<std::uint8_t>(*bus.ctx, 1, 0x3000, 0);
    EXPECT_EQ(none.error().detail, 0x06020000U);
    return outcome;
}

void try_all(const char* name, Transfer transfer, std::uint16_t mailbox_bytes, unsigned writes) {
    const Outcome clean = run(transfer, mailbox_bytes, Fault::twice, -1);
    EXPECT_EQ(clean.writes, writes) << name;
    ASSERT_LT(clean.frames, 200U) << name;
    unsigned repeats = 0;
    unsigned resent = 0;
    for (const Fault fault : {Fault::lost_out, Fault::lost_in, Fault::twice}) {
        for (int at = 0; at < static_cast<int>(clean.frames); ++at) {
            SCOPED_TRACE(testing::Message() << name << ", fault " << static_cast<int>(fault) << " at frame " << at
                                            << " of " << clean.frames);
            const Outcome spoilt = run(transfer, mailbox_bytes, fault, at);
            EXPECT_EQ(spoilt.writes, writes);
            repeats += spoilt.statistics.repeats;
            resent += spoilt.statistics.resent;
        }
    }
    EXPECT_GT(repeats, 0U) << name;  // both methods of recovery were used
    EXPECT_GT(resent, 0U) << name;
}

TEST(LostFrames, ExpeditedUpload) {
    try_all(
        "expedited upload",
        [](MailboxBus& bus, StackSlave&) { EXPECT_EQ(*SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0), 100); }, 128, 0);
}

TEST(LostFrames, NormalUpload) {
    try_all(
        "normal upload",
        [](MailboxBus& bus, StackSlave&) {
            std::array<char, 40> text{};
            const auto name = SDOread_text(*bus.ctx, 1, 0x1008, 0, text);
            ASSERT_TRUE(name.ok()) << bus.words(name.error());
            EXPECT_EQ(*name, "Bench device of many words");
        },
        128, 0);
}

TEST(LostFrames, SegmentedUpload) {
    try_all(
        "segmented upload",
        [](MailboxBus& bus, StackSlave& slave) {
            slave.application.vast = pattern(70'000);
            slave.application.vast_bytes = 100;
            std::vector<std::byte> value(200);
            const auto bytes = SDOread(*bus.ctx, 1, 0x2008, 0, false, value);
            ASSERT_TRUE(bytes.ok()) << bus.words(bytes.error());
            EXPECT_EQ(*bytes, 100U);
            EXPECT_TRUE(std::equal(value.begin(), value.begin() + 100, slave.application.vast.begin()));
        },
        40, 0);
}

TEST(LostFrames, SegmentedDownload) {
    try_all(
        "segmented download",
        [](MailboxBus& bus, StackSlave& slave) {
            const auto value = pattern(100);
            const auto done = SDOwrite(*bus.ctx, 1, 0x2008, 0, false, value);
            ASSERT_TRUE(done.ok()) << bus.words(done.error());
            EXPECT_EQ(slave.application.vast_bytes, 100U);
            EXPECT_TRUE(std::equal(value.begin(), value.end(), slave.application.vast.begin()));
        },
        40, 1);
}

TEST(LostFrames, Streams) {
    try_all(
        "upload to a sink",
        [](MailboxBus& bus, StackSlave& slave) {
            slave.application.vast = pattern(70'000);
            slave.application.vast_bytes = 100;
            SlowSink sink;
            const auto bytes = SDOread(*bus.ctx, 1, 0x2008, 0, false, sink);
            ASSERT_TRUE(bytes.ok()) << bus.words(bytes.error());
            EXPECT_EQ(*bytes, 100U);
            EXPECT_TRUE(std::equal(sink.content.begin(), sink.content.end(), slave.application.vast.begin()));
        },
        40, 0);
    try_all(
        "download from a source",
        [](MailboxBus& bus, StackSlave& slave) {
            const auto value = pattern(100);
            SlowSource source(value);
            const auto done = SDOwrite(*bus.ctx, 1, 0x2008, 0, false, source, value.size());
            ASSERT_TRUE(done.ok()) << bus.words(done.error());
            EXPECT_EQ(slave.application.vast_bytes, 100U);
            EXPECT_TRUE(std::equal(value.begin(), value.end(), slave.application.vast.begin()));
        },
        40, 1);
}

TEST(LostFrames, ObjectList) {
    try_all(
        "object list",
        [](MailboxBus& bus, StackSlave&) {
            std::vector<std::uint16_t> all;
            const auto count = read_object_list(
                *bus.ctx, 1, ObjectList::all,
                [](std::span<const std::uint16_t> some, void* user) {
                    auto& list = *static_cast<std::vector<std::uint16_t>*>(user);
                    list.insert(list.end(), some.begin(), some.end());
                },
                &all);
            ASSERT_TRUE(count.ok()) << bus.words(count.error());
            ASSERT_EQ(all.size(), std::size(subdevice::testing::table::kObjects));
            for (std::size_t i = 0; i < all.size(); ++i)
                EXPECT_EQ(all[i], subdevice::testing::table::kObjects[i].index);
        },
        40, 0);
}

// The same with a slave that acknowledges repeat requests and has no message to repeat. The master sends the request
// again after each lost reply, and the value is right.
TEST(LostFrames, WhereNothingIsRepeated) {
    const auto run_all = [](MailboxBus& bus) {
        std::vector<std::byte> block(1024);
        const auto read = SDOread(*bus.ctx, 1, 0x2000, 0, false, block);
        ASSERT_TRUE(read.ok()) << bus.words(read.error());
        ASSERT_EQ(*read, block.size());
        for (std::size_t i = 0; i < block.size(); ++i) ASSERT_EQ(block[i], static_cast<std::byte>(i)) << i;
        const auto value = pattern(300);
        const auto written = SDOwrite(*bus.ctx, 1, 0x2001, 0, false, value);
        ASSERT_TRUE(written.ok()) << bus.words(written.error());
        const auto again = SDOread(*bus.ctx, 1, 0x2001, 0, false, block);
        ASSERT_TRUE(again.ok()) << bus.words(again.error());
        EXPECT_TRUE(std::equal(value.begin(), value.end(), block.begin()));
        std::vector<std::uint16_t> all;
        const auto count = read_object_list(
            *bus.ctx, 1, ObjectList::all,
            [](std::span<const std::uint16_t> some, void* user) {
                auto& list = *static_cast<std::vector<std::uint16_t>*>(user);
                list.insert(list.end(), some.begin(), some.end());
            },
            &all);
        ASSERT_TRUE(count.ok()) << bus.words(count.error());
        EXPECT_EQ(all.size(), *count);
        EXPECT_EQ(all.size(), 81U);
        EXPECT_TRUE(std::ranges::is_sorted(all)) << "none is told twice";
        const auto described = read_object_description(*bus.ctx, 1, 0x1018);
        ASSERT_TRUE(described.ok()) << bus.words(described.error());
        EXPECT_EQ(described->name(), "Identity");
    };
    std::uint64_t frames = 1;
    unsigned repeats = 0;
    for (std::uint64_t at = 0; at < frames; ++at) {
        MailboxBus bus;
        auto device = sim::make_device("odd_device").value();
        ASSERT_TRUE(sim::add_quirk(device, "empty_repeats"));
        bus.add_device(std::move(device));
        bus.start();
        EXPECT_TRUE(SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0).ok());
        const std::uint64_t before = bus.nic->sent;
        if (at > 0) bus.nic->lose_in.insert(before + at - 1);
        SCOPED_TRACE(testing::Message() << "reply " << at << " of " << frames);
        run_all(bus);
        if (at == 0) frames = bus.nic->sent - before;
        repeats += mailbox_statistics(*bus.ctx, 1)->repeats;
        if (testing::Test::HasFailure()) return;
    }
    EXPECT_GT(repeats, 10U);
}

}  // namespace
}  // namespace margay
