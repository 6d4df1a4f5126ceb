// The mailbox engine: handshake, counters, repeat, order, errors, and any message of a master.
#include "subdevice/mailbox.hpp"

#include "bench_device.hpp"

#include <random>

namespace margay::subdevice {
namespace {

using namespace testing;
using wire::MailboxErrorCode;
using wire::MailboxType;

std::vector<std::byte> message(int type, int counter, std::vector<std::byte> data, int length = -1, int channel = 0) {
    std::vector<std::byte> out(6 + data.size());
    wire::store_mailbox_header(
        out, {.length = static_cast<std::uint16_t>(length < 0 ? static_cast<int>(data.size()) : length),
              .address = 0x1001,
              .channel = static_cast<std::uint8_t>(channel),
              .type = static_cast<MailboxType>(type),
              .counter = static_cast<std::uint8_t>(counter)});
    std::copy(data.begin(), data.end(), out.begin() + 6);
    return out;
}

std::vector<std::byte> ask(int index, int counter = 0) { return message(3, counter, sdo_request(0x40, index, 0)); }
int index_of(const std::vector<std::byte>& reply) {
    return reply.size() < 12 ? -1 : wire::coe::SdoLayout::index::load(Bytes(reply).subspan(6));
}
int counter_of(const std::vector<std::byte>& reply) {
    return reply.empty() ? -1 : wire::load_mailbox_header(reply).counter;
}

TEST(MailboxEngine, RepliesAreCountedOneToSevenWhateverTheMasterCounts) {
    Bench bench;
    for (const int expected : {1, 2, 3, 4, 5, 6, 7, 1, 2}) {
        ASSERT_TRUE(bench.put(ask(0x1000)));
        (void)bench.step();
        EXPECT_EQ(counter_of(bench.fetch()), expected);
    }
}

TEST(MailboxEngine, TheReplyIsAddressedAsTheRequestWas) {
    Bench bench;
    ASSERT_TRUE(bench.put(ask(0x1000)));
    (void)bench.step();
    EXPECT_EQ(wire::load_mailbox_header(bench.fetch()).address, 0x1001);
}

TEST(MailboxEngine, RepliesQueueInOrderAndTheRequestsBehindThemWait) {
    Bench bench(128, 4);
    const int indices[] = {0x1000, 0x1001, 0x1008, 0x2000, 0x2001, 0x2002, 0x2004};
    std::size_t taken = 0;
    while (taken < std::size(indices) && bench.put(ask(indices[taken]))) {
        ++taken;
        bench.settle();
    }
    EXPECT_EQ(taken, 5u) << "four replies wait, one request is still in SM0";
    for (std::size_t i = 0; i < taken; ++i) EXPECT_EQ(index_of(bench.fetch()), indices[i]);
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_TRUE(bench.put(ask(0x1000))) << "and goes on";
}

TEST(MailboxEngine, ADuplicateIsDropped) {
    Bench bench;
    ASSERT_TRUE(bench.put(ask(0x1000, 3)));
    (void)bench.step();
    ASSERT_TRUE(bench.put(ask(0x1000, 3)));
    bench.settle();
    EXPECT_FALSE(bench.esc.full(0)) << "it left the mailbox";
    EXPECT_EQ(index_of(bench.fetch()), 0x1000);
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_EQ(bench.mailbox->counters().duplicates, 1u);
    ASSERT_TRUE(bench.put(ask(0x1001, 4)));
    (void)bench.step();
    EXPECT_EQ(index_of(bench.fetch()), 0x1001);
}

TEST(MailboxEngine, CounterZeroIsNeverADuplicate) {
    Bench bench;
    for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE(bench.put(ask(0x1000, 0)));
        (void)bench.step();
        EXPECT_EQ(index_of(bench.fetch()), 0x1000);
    }
}

TEST(MailboxEngine, AnotherMasterStartsAfresh) {
    Bench bench;
    ASSERT_TRUE(bench.put(ask(0x1000, 1)));
    bench.settle();
    ASSERT_EQ(bench.request(0x11).state, AlState::init);
    EXPECT_FALSE(bench.put(ask(0x1000, 1))) << "locked in INIT";
    ASSERT_EQ(bench.request(0x02).state, AlState::preop);
    EXPECT_TRUE(bench.fetch().empty()) << "nothing of the old one";
    ASSERT_TRUE(bench.put(ask(0x1001, 1)));
    (void)bench.step();
    const auto reply = bench.fetch();
    EXPECT_EQ(index_of(reply), 0x1001);
    EXPECT_EQ(counter_of(reply), 1);
}

void toggle_repeat(Bench& bench) {
    const auto activate = bench.esc.get<std::uint8_t>(0x080E);
    bench.esc.ecat_set(0x080E, static_cast<std::uint8_t>(activate ^ 0x02));
    (void)bench.step();
    EXPECT_EQ(bench.esc.get<std::uint8_t>(0x080F) & 2, bench.esc.get<std::uint8_t>(0x080E) & 2) << "acknowledged";
}

TEST(MailboxRepeat, TheLastReplyComesAgainUnchanged) {
    Bench bench;
    ASSERT_TRUE(bench.put(ask(0x1000)));
    (void)bench.step();
    const auto first = bench.fetch();
    for (int i = 0; i < 3; ++i) {
        toggle_repeat(bench);
        EXPECT_EQ(bench.fetch(), first);
    }
    ASSERT_TRUE(bench.put(ask(0x1001)));
    (void)bench.step();
    const auto next = bench.fetch();
    EXPECT_EQ(index_of(next), 0x1001);
    EXPECT_EQ(counter_of(next), 2);
}

TEST(MailboxRepeat, TheLostReplyGoesBeforeTheOneThatIsThereAlready) {
    Bench bench;
    ASSERT_TRUE(bench.put(ask(0x1000)));
    (void)bench.step();
    ASSERT_TRUE(bench.put(ask(0x1001)));
    (void)bench.step();
    ASSERT_TRUE(bench.put(ask(0x1008)));
    (void)bench.step();
    const auto lost = bench.fetch();
    EXPECT_EQ(index_of(lost), 0x1000);
    toggle_repeat(bench);
    EXPECT_EQ(bench.fetch(), lost);
    EXPECT_EQ(index_of(bench.fetch()), 0x1001);
    EXPECT_EQ(index_of(bench.fetch()), 0x1008);
    EXPECT_TRUE(bench.fetch().empty());
}

TEST(MailboxRepeat, NothingToRepeatIsAcknowledgedAllTheSame) {
    Bench bench;
    toggle_repeat(bench);
    EXPECT_TRUE(bench.fetch().empty());
    ASSERT_TRUE(bench.put(ask(0x1000)));
    (void)bench.step();
    toggle_repeat(bench);
    EXPECT_EQ(index_of(bench.fetch()), 0x1000) << "what was never fetched is not repeated";
    EXPECT_TRUE(bench.fetch().empty());
}

TEST(MailboxRepeat, AToggleLeftByAnEarlierMasterRepeatsNothing) {
    Bench bench;
    toggle_repeat(bench);
    (void)bench.request(0x11);
    bench.configure(128);
    (void)bench.request(0x02);
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_EQ(bench.esc.get<std::uint8_t>(0x080F) & 2, bench.esc.get<std::uint8_t>(0x080E) & 2);
}

TEST(MailboxErrors, EachHasItsDetail) {
    using enum MailboxErrorCode;
    const auto sdo = sdo_request(0x40, 0x1000, 0);
    const std::pair<std::vector<std::byte>, MailboxErrorCode> cases[] = {
        {message(1, 0, sdo), unsupported_protocol},
        {message(2, 0, sdo), unsupported_protocol},
        {message(4, 0, sdo), unsupported_protocol},
        {message(5, 0, sdo), unsupported_protocol},
        {message(15, 0, sdo), unsupported_protocol},
        {message(9, 0, sdo), unsupported_protocol},
        {message(3, 0, sdo, -1, 5), invalid_channel},
        {message(3, 0, sdo, 123), invalid_size},
        {message(3, 0, sdo, 0xFFFF), invalid_size},
        {message(3, 0, {}), size_too_short},
        {message(3, 0, raw({0})), size_too_short},
        {message(3, 0, raw({0, 0x20})), size_too_short},
        {message(3, 0, raw({0, 0x20, 0x40, 0, 0x10, 0, 0, 0, 0})), size_too_short},
        {message(3, 0, raw({0, 0x80, 1, 0, 0, 0, 1})), size_too_short},
        {message(3, 0, raw({0, 0x80, 5, 0, 0, 0, 0, 0x10})), size_too_short},
        {message(3, 0, raw({0, 0x00, 0, 0})), invalid_header},
        {message(3, 0, raw({0, 0xF0, 0, 0})), invalid_header},
        {message(3, 0, raw({0, 0x10, 0, 0})), service_not_supported},
        {message(3, 0, raw({0, 0x30, 0, 0})), service_not_supported},
        {message(3, 0, raw({0, 0x50, 0, 0})), service_not_supported},
    };
    Bench bench;
    for (const auto& [request, code] : cases) {
        ASSERT_TRUE(bench.put(request));
        (void)bench.step();
        const auto reply = bench.receive(MailboxType::error);
        ASSERT_EQ(reply.size(), 4u);
        EXPECT_EQ(load_le<std::uint16_t>(reply, 0), 1);
        EXPECT_EQ(wire::MailboxErrorLayout::detail::load(reply), code) << to_text(code);
    }
}

TEST(MailboxErrors, AnErrorIsNotAnsweredByAnError) {
    Bench bench;
    ASSERT_TRUE(bench.put(message(0, 0, raw({1, 0, 2, 0}))));
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_FALSE(bench.esc.full(0));
}

TEST(MailboxEngine, PollsWhereTheMasterSwitchedEventsOff) {
    Bench bench;
    (void)bench.request(0x11);
    bench.esc.configure(0, {0x1000, 128, 0x06, 1});
    bench.esc.configure(1, {0x1100, 128, 0x02, 1});
    (void)bench.request(0x02);
    EXPECT_EQ(bench.step(), bench.esc.time + 1ms);
    bench.configure(128);
    (void)bench.request(0x11);
    (void)bench.request(0x02);
    EXPECT_EQ(bench.step(), kNever) << "events tell";
}

TEST(MailboxEngine, TooLargeForItsMemoryIsRefused) {
    Bench bench;
    bench.application.description_value.mailbox.receive.max_bytes = 1000;
    (void)bench.request(0x11);
    bench.esc.configure(1, {0x1400, 128, 0x22, 1});
    bench.application.description_value.mailbox.send.start = 0x1400;
    bench.esc.configure(0, {0x1000, 257, 0x26, 1});
    EXPECT_EQ(bench.request(0x02),
              (AlStatus{AlState::init, true, static_cast<std::uint16_t>(AlStatusCode::no_memory)}));
}

// Octets of any content and length in any state: the slave answers or stays silent, and the mailbox is never stuck.
TEST(MailboxNoise, NeverStuck) {
    std::mt19937 random(4711);
    Bench bench;
    for (int round = 0; round < 20'000; ++round) {
        std::vector<std::byte> noise(random() % 129);
        for (auto& b : noise) b = static_cast<std::byte>(random());
        if (noise.size() >= 8 && random() % 4 != 0) {  // mostly plausible messages
            wire::store_mailbox_header(
                noise, {.length = static_cast<std::uint16_t>(random() % 3 ? noise.size() - 6 : random() % 200),
                        .type = static_cast<MailboxType>(random() % 3 ? 3 : random() % 16),
                        .counter = static_cast<std::uint8_t>(random() % 8)});
            noise[7] = static_cast<std::byte>((random() % 9) << 4);
            if (noise.size() >= 11)
                store_le(MutableBytes(noise), 9, table::kObjects[random() % std::size(table::kObjects)].index);
        }
        if (noise.empty()) noise.resize(1);
        noise.resize(128);
        (void)bench.esc.ecat_write(0x1000, noise);
        (void)bench.step();
        if (random() % 3 == 0) {
            std::vector<std::byte> reply(128);
            (void)bench.esc.ecat_read(0x1100, reply);
        }
        if (random() % 50 == 0 && bench.mailbox->running()) toggle_repeat(bench);
        if (random() % 100 == 0) bench.esc.al_control(static_cast<std::uint16_t>(0x10 | (1u << (random() % 4))));
        bench.esc.time += 1ms;
    }
    (void)bench.request(0x11);
    bench.configure(128);
    ASSERT_EQ(bench.request(0x12), (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u);
}

}  // namespace
}  // namespace margay::subdevice
