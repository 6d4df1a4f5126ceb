// Problems of users of another slave stack, from public issue threads (O#n is the number). None of them may occur
// here.
#include "bench_device.hpp"

#include <algorithm>

namespace margay::subdevice::testing {
namespace {

void to_safeop(Bench& bench) { ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0})); }

// O#122: in SAFEOP, outputs are read, which triggers the watchdog and frees the buffer, but they are not applied.
TEST(FieldNotes, SafeopReadsOutputsAndDoesNotApplyThem) {
    Bench bench;
    to_safeop(bench);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0x55, 0x66, 0x77, 1})));
    ASSERT_NE(bench.esc.events() & al_event::sync_manager(2), 0u);
    (void)bench.step();
    EXPECT_EQ(bench.esc.events() & al_event::sync_manager(2), 0u) << "read";
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "the initial value, not what the master sent";
    EXPECT_FALSE(bench.application.last_valid);
}

// O#115: a missing subindex gives 0x06090011, a missing object 0x06020000, for every kind of access.
TEST(FieldNotes, AbortCodesAreThoseOfTheStandard) {
    Bench bench;
    EXPECT_EQ(upload(bench, 0x1018, 5).abort, Abort::no_subindex);
    EXPECT_EQ(download(bench, 0x1018, 5, number(0, 4)).abort, Abort::no_subindex);
    EXPECT_EQ(upload(bench, 0x4000, 0).abort, Abort::no_object);
    EXPECT_EQ(upload(bench, 0x4000, 0, true).abort, Abort::no_object);
    EXPECT_EQ(download(bench, 0x1000, 0, number(0, 4)).abort, Abort::read_only);
    EXPECT_EQ(upload(bench, 0x2005).abort, Abort::write_only);
}

// O#198: complete access of 0x1018 has subindex 0 in 16 bits and four values of 32 bits: 18 octets, not 17 and not 20.
TEST(FieldNotes, CompleteAccessHasTheLengthOfTheStandard) {
    Bench bench;
    const auto whole = upload(bench, 0x1018, 0, true);
    ASSERT_EQ(whole.data.size(), 18u);
    EXPECT_EQ(whole.data[1], std::byte{0});
    EXPECT_EQ(load_le<std::uint32_t>(whole.data, 2), 0x00004D47u);
    EXPECT_EQ(upload(bench, 0x1018, 1, true).data.size(), 16u);
}

// O#211: the AL event request is read again at every step, so that the next step handles all events since the last
// one.
TEST(FieldNotes, EventsAreReadAfreshAtEveryStep) {
    Bench bench;
    for (int round = 0; round < 20; ++round) {
        ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
        bench.esc.al_control(round % 2 == 0 ? 4 : 2);  // both events at once, between two steps
        (void)bench.step();
        EXPECT_EQ(bench.esc.al_status().state, round % 2 == 0 ? AlState::safeop : AlState::preop);
        const auto reply = bench.receive();
        ASSERT_EQ(reply.size(), 10u);
        EXPECT_EQ(load_le<std::uint32_t>(reply, 6), 0x191u);
        EXPECT_EQ(bench.esc.events() & al_event::kAlControl, 0u);
    }
}

// O#197: an emergency and replies are sent in the order of their creation, with consecutive counters.
TEST(FieldNotes, MailLeavesInOrderOfItsCounters) {
    Bench bench;
    std::vector<unsigned> services;
    unsigned counter = 0;
    for (int round = 0; round < 30; ++round) {
        if (round % 2 == 0) {
            EXPECT_TRUE(bench.application.emergencies()->raise({0x8000, 0x81, {}}));
        }
        ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
        (void)bench.step();
        for (auto mail = bench.fetch(); !mail.empty(); mail = bench.fetch()) {
            counter = counter % 7 + 1;
            EXPECT_EQ(wire::load_mailbox_header(mail).counter, counter);
            services.push_back(static_cast<unsigned>(wire::coe::load_header(Bytes(mail).subspan(6)).service));
        }
    }
    EXPECT_EQ(std::count(services.begin(), services.end(), 1u), 15);
    EXPECT_EQ(std::count(services.begin(), services.end(), 3u), 30);
}

}  // namespace
}  // namespace margay::subdevice::testing
