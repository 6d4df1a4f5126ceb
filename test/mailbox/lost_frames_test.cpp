// Every frame of every kind of transfer lost on its way out, lost on its way back, and sent twice: the transfer ends
// well all the same, what is written is written once, and the channel goes on.
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

enum class Fault { lost_out, lost_in, twice };

struct Outcome {
    std::uint64_t frames = 0;  // that the transfer took
    unsigned writes = 0;       // that the application saw
    MailboxStatistics statistics;
};

using Transfer = void (*)(MailboxBus& bus, StackSlave& slave);

// Runs `transfer` with frame number `at` of it spoilt (none when negative).
Outcome run(Transfer transfer, std::uint16_t mailbox_bytes, Fault fault, int at) {
    MailboxBus bus;
    auto& slave = bus.add_stack(mailbox_bytes);
    bus.start();
    EXPECT_TRUE(SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0).ok());  // the channel is drained and in use
    const std::uint64_t before = bus.nic->sent;
    if (at >= 0) {
        const auto number = before + static_cast<std::uint64_t>(at);
        (fault == Fault::lost_out  ? bus.nic->lose_out
         : fault == Fault::lost_in ? bus.nic->lose_in
                                   : bus.nic->twice)
            .insert(number);
    }
    transfer(bus, slave);
    Outcome outcome{bus.nic->sent - before, slave.application.writes, mailbox_statistics(*bus.ctx, 1)};
    // What comes afterwards is right.
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
    EXPECT_GT(repeats, 0U) << name;  // both ways out of a loss have been gone
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

TEST(LostFrames, ObjectList) {
    try_all(
        "object list",
        [](MailboxBus& bus, StackSlave&) {
            std::vector<std::uint16_t> all;
            const auto count = object_list(
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

}  // namespace
}  // namespace margay
