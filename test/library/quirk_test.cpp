// Each quirk of the odd device is visible in its answers to datagrams.
#include "hand.hpp"

#include "sim/library/quirks.hpp"
#include "wire/sii.hpp"

#include <algorithm>
#include <set>

namespace margay::sim::test {
namespace {

namespace coe = wire::coe;
using coe::SdoLayout;
using wire::MailboxType;

Device odd(std::initializer_list<std::string_view> names) {
    auto device = make_device("odd_device").value();
    for (const auto name : names) EXPECT_TRUE(add_quirk(device, name)) << name;
    return device;
}

std::vector<std::byte> question(unsigned index, unsigned subindex = 0, unsigned command = 0x40) {
    std::vector<std::byte> request(coe::kSdoBytes);
    coe::store_header(request, {0, coe::Service::sdo_request});
    request[2] = static_cast<std::byte>(command);
    SdoLayout::index::store(request, static_cast<std::uint16_t>(index));
    SdoLayout::subindex::store(request, static_cast<std::uint8_t>(subindex));
    return request;
}
unsigned command_of(const Hand::Mail& mail) {
    return mail.data.size() > 2 ? std::to_integer<unsigned>(mail.data[2]) : 0;
}

// The odd device in PREOP, with these quirks.
struct Odd : Hand {
    explicit Odd(std::initializer_list<std::string_view> names) : Hand(odd(names)) {
        EXPECT_EQ(to(AlState::preop), (AlStatus{AlState::preop, false, 0}));
    }
    Mail ask_for(unsigned index, unsigned subindex = 0, unsigned command = 0x40) {
        EXPECT_TRUE(put(MailboxType::coe, question(index, subindex, command)));
        return take().value_or(Mail{});
    }
};

TEST(OddDevice, GoesToOpAndHas64KiBOfObjectsWhenNothingIsOdd) {
    Odd hand({});
    std::size_t bytes = 0;
    for (unsigned index = 0x2000; index < 0x2040; ++index) {
        const auto block = hand.upload(index);
        ASSERT_EQ(hand.last_abort, Abort::none);
        for (std::size_t i = 0; i < block.size(); ++i)
            ASSERT_EQ(block[i], static_cast<std::byte>((bytes + i) / 1024 + bytes + i)) << index;
        bytes += block.size();
    }
    EXPECT_EQ(bytes, 65'536u);
    ASSERT_EQ(hand.to(AlState::op), (AlStatus{AlState::op, false, 0}));
    hand.out<std::uint16_t>(2, 0xBEEF);
    hand.cycle(2);
    EXPECT_EQ(hand.in<std::uint16_t>(2), 0xBEEF);
}

TEST(OddDevice, SlowObjectTakesItsTime) {
    Odd hand({});
    const auto before = hand.rig.now;
    EXPECT_EQ(hand.number(0x2100), 0);
    EXPECT_GE(hand.rig.now - before, 500ms);
    EXPECT_LT(hand.rig.now - before, 600ms);
}

TEST(Quirks, NamesAreUniqueAndAllCanBeSwitchedOn) {
    std::set<std::string_view> names;
    for (const auto& quirk : quirks()) {
        EXPECT_TRUE(names.insert(quirk.name).second) << quirk.name;
        auto device = make_device("odd_device").value();
        EXPECT_TRUE(add_quirk(device, quirk.name)) << quirk.name;
    }
    EXPECT_GE(names.size(), 45u);
    auto device = make_device("odd_device").value();
    EXPECT_FALSE(add_quirk(device, "no_such_manner"));
    auto plain = make_device("digital_in_8").value();
    EXPECT_FALSE(add_quirk(plain, "replies_twice"));
    EXPECT_TRUE(add_quirk(plain, "sii_blank"));
}

// --- SII and chip ---

TEST(SiiQuirks, ShowInTheImage) {
    EXPECT_EQ(odd({"sii_blank"}).sii[0x100], std::byte{0xFF});
    EXPECT_FALSE(wire::sii::checksum_right(odd({"sii_bad_checksum"}).sii));
    const auto sizes = odd({"sii_no_mailbox_sizes"}).sii;  // ETG.1000.6 "Slave information interface area"
    EXPECT_EQ(load_le<std::uint16_t>(sizes, 2 * 0x19), 0);
    EXPECT_EQ(load_le<std::uint16_t>(sizes, 2 * 0x1B), 0);
    EXPECT_EQ(load_le<std::uint16_t>(sizes, 2 * 0x1C), 0x0004);  // CoE
    const auto plain = read_sii_model(odd({}).sii);
    ASSERT_EQ(plain.areas.size(), 2u);
    EXPECT_EQ(plain.areas[0].pdo_bits, 64u);
    EXPECT_EQ(plain.areas[0].info.control, 0x64);
    EXPECT_EQ(read_sii_model(odd({"sii_no_pdos"}).sii).areas[0].pdo_bits, 0u);
    EXPECT_EQ(read_sii_model(odd({"sii_no_watchdog_trigger"}).sii).areas[0].info.control, 0x24);
    const auto off = read_sii_model(odd({"sii_sync_managers_off", "sii_no_pdos"}).sii);
    for (const auto& area : off.areas) EXPECT_EQ(area.info.length_bytes, 0);
    EXPECT_EQ(plain.name, "Device of odd manners");
    EXPECT_NE(read_sii_model(odd({"sii_null_strings"}).sii).name, plain.name);
    EXPECT_LE(read_sii_model(odd({"sii_endless"}).sii).areas.size(), 2u);
    EXPECT_NE(odd({"sii_endless"}).sii, odd({}).sii);
}

TEST(SiiQuirks, ShowInTheEepromInterface) {
    const auto read = [](Hand& hand) {
        hand.rig.put<std::uint32_t>(0, reg::kSiiAddress.address, 8);
        hand.rig.put<std::uint16_t>(0, reg::kSiiControl.address, 0x0100);
        hand.wait(10ms);
        return hand.rig.get<std::uint16_t>(0, reg::kSiiControl.address);
    };
    Hand plain(odd({}));
    EXPECT_EQ(read(plain) & 0x2000, 0);
    Hand nacks(odd({"sii_nacks"}));
    EXPECT_EQ(read(nacks) & 0x2000, 0x2000);
    EXPECT_EQ(read(nacks) & 0x2000, 0x2000);
    EXPECT_EQ(read(nacks) & 0x2000, 0);
    Hand slow(odd({"sii_slow"}));
    slow.rig.put<std::uint32_t>(0, reg::kSiiAddress.address, 8);
    slow.rig.put<std::uint16_t>(0, reg::kSiiControl.address, 0x0100);
    slow.wait(2ms);
    EXPECT_EQ(slow.rig.get<std::uint16_t>(0, reg::kSiiControl.address) & 0x8000, 0x8000);
    const auto status_after_write = [](Hand hand) {
        hand.rig.write(0, reg::kSiiControl.address, bytes({1, 2, 0x40, 0, 0, 0, 0x12, 0x34}));
        hand.wait(1ms);
        return hand.rig.get<std::uint16_t>(0, reg::kSiiControl.address);
    };
    EXPECT_EQ(status_after_write(Hand(odd({}))) & 0x8000, 0);
    EXPECT_EQ(status_after_write(Hand(odd({"sii_busy_until_stored"}))) & 0x8000, 0x8000);
    const auto stored = [](Hand hand) {
        hand.rig.write(0, reg::kSiiControl.address, bytes({1, 2, 0x60, 0, 0, 0, 0x12, 0x34}));
        hand.wait(10ms);
        EXPECT_EQ(hand.rig.get<std::uint16_t>(0, reg::kSiiControl.address) & 0x6000, 0) << "no error shows";
        hand.rig.put<std::uint16_t>(0, reg::kSiiControl.address, 0x0100);
        hand.wait(10ms);
        return hand.rig.get<std::uint16_t>(0, reg::kSiiData.address);
    };
    EXPECT_EQ(stored(Hand(odd({}))), 0x3412);
    EXPECT_NE(stored(Hand(odd({"sii_write_protected"}))), 0x3412);
    auto et = make_device("odd_device").value();
    et.chip.sii.reads_8_bytes = true;
    ASSERT_TRUE(add_quirk(et, "sii_4_bytes"));
    Hand four(std::move(et));
    EXPECT_EQ(four.rig.get<std::uint16_t>(0, reg::kSiiControl.address) & 0x0040, 0);
}

TEST(ChipQuirks, Show) {
    Hand lrw(odd({"no_lrw"}));
    EXPECT_EQ(lrw.rig.get<std::uint16_t>(0, reg::kFeatures.address) & 0x0200, 0x0200);
    Hand bits(odd({"clock_32_bits"}));
    EXPECT_EQ(bits.rig.get<std::uint16_t>(0, reg::kFeatures.address) & 0x000C, 0x0004);
    Hand none(odd({"no_clock"}));
    EXPECT_EQ(none.rig.get<std::uint16_t>(0, reg::kFeatures.address) & 0x0004, 0);
    EXPECT_EQ(odd({"receive_times_only"}).chip.dc, DcUnit::receive_times);
    Hand slow(odd({"slow_firmware"}));
    slow.configure_mailboxes();
    EXPECT_EQ(slow.ask(AlState::preop, 2ms).state, AlState::init);
    EXPECT_EQ(slow.ask(AlState::preop, 50ms).state, AlState::preop);
}

// --- States ---

TEST(StateQuirks, AnErrorGoesAwayByInitOnly) {
    Odd hand({"ignores_acknowledge"});
    EXPECT_TRUE(hand.ask(AlState::op).error);
    EXPECT_TRUE(hand.ask(AlState::preop, 20ms, wire::al::kErrorAcknowledge).error);
    (void)hand.ask(AlState::init);
    hand.wait(5ms);
    EXPECT_EQ(hand.status(), (AlStatus{AlState::init, false, 0}));
}

TEST(StateQuirks, NeedsTheEeprom) {
    Hand hand(odd({"needs_eeprom"}));
    hand.configure_mailboxes();
    EXPECT_EQ(hand.ask(AlState::preop), (AlStatus{AlState::init, true, 0x0050}));
    hand.rig.put<std::uint8_t>(0, reg::kSiiConfig.address, 1);
    EXPECT_EQ(hand.ask(AlState::preop, 20ms, wire::al::kErrorAcknowledge).state, AlState::preop);
}

TEST(StateQuirks, StrictSyncManagers) {
    for (const std::uint8_t other : {std::uint8_t{0x24}, std::uint8_t{0x44}}) {
        Odd hand({"strict_sync_managers"});
        for (auto& area : hand.model.areas)
            if (area.info.type == SmType::outputs) area.info.control = other;
        EXPECT_EQ(hand.to(AlState::safeop), (AlStatus{AlState::preop, true, 0x001D}));
    }
    Odd right({"strict_sync_managers"});
    EXPECT_EQ(right.to(AlState::op), (AlStatus{AlState::op, false, 0}));
}

TEST(StateQuirks, SlowAndReluctant) {
    Hand slow(odd({"slow_state_changes"}));
    const auto before = slow.rig.now;
    EXPECT_EQ(slow.to(AlState::op).state, AlState::op);
    EXPECT_GE(slow.rig.now - before, 900ms);
    Odd reluctant({"refuses_op_once"});
    EXPECT_EQ(reluctant.to(AlState::op), (AlStatus{AlState::safeop, true, 0x0052}));
    EXPECT_EQ(reluctant.ask(AlState::op, 1s, wire::al::kErrorAcknowledge), (AlStatus{AlState::op, false, 0}));
}

TEST(StateQuirks, NoCycle1) {
    Odd hand({"no_cycle1"});
    hand.rig.put<std::uint32_t>(0, reg::kSync1CycleTime.address, 1'000'000);
    EXPECT_EQ(hand.to(AlState::safeop), (AlStatus{AlState::preop, true, 0x0037}));
    hand.rig.put<std::uint32_t>(0, reg::kSync1CycleTime.address, 0);
    EXPECT_EQ(hand.ask(AlState::safeop, 20ms, wire::al::kErrorAcknowledge).state, AlState::safeop);
}

// --- Mailbox ---

TEST(MailQuirks, OldMailIsThereBeforeAnyQuestion) {
    Odd hand({"old_mail"});
    const auto mail = hand.take(10ms);
    ASSERT_TRUE(mail);
    EXPECT_EQ(SdoLayout::index::load(mail->data), 0x1008);
    Odd clean({});
    EXPECT_FALSE(clean.take(10ms));
}

TEST(MailQuirks, Counters) {
    Odd zero({"counter_zero"});
    EXPECT_EQ(zero.ask_for(0x1000).header.counter, 0);
    Odd plain({});
    EXPECT_EQ(plain.ask_for(0x1000).header.counter, 1);
    EXPECT_EQ(plain.ask_for(0x1000).header.counter, 2);
}

TEST(MailQuirks, RepliesTwice) {
    Odd hand({"replies_twice"});
    const auto first = hand.ask_for(0x1000);
    const auto second = hand.take(20ms);
    ASSERT_TRUE(second);
    EXPECT_EQ(first.data, second->data);
    EXPECT_NE(first.header.counter, second->header.counter);
    EXPECT_FALSE(hand.take(20ms));
}

TEST(MailQuirks, SomethingComesBeforeTheReply) {
    Odd emergency({"emergency_first"});
    EXPECT_EQ(coe::load_header(emergency.ask_for(0x1000).data).service, coe::Service::emergency);
    EXPECT_EQ(SdoLayout::index::load(emergency.take()->data), 0x1000);
    Odd ethernet({"ethernet_first"});
    EXPECT_EQ(ethernet.ask_for(0x1000).header.type, MailboxType::eoe);
    EXPECT_EQ(SdoLayout::index::load(ethernet.take()->data), 0x1000);
    Odd others({"mail_for_others"});
    EXPECT_EQ(others.ask_for(0x1000).header.address, 0x1FFF);
    EXPECT_EQ(others.take()->header.address, 0);
    Odd foreign({"foreign_replies"});
    EXPECT_EQ(SdoLayout::index::load(foreign.ask_for(0x1000).data), 0x5FFF);
    EXPECT_EQ(SdoLayout::index::load(foreign.take()->data), 0x1000);
}

TEST(MailQuirks, SlowSilentAndFull) {
    Odd slow({"slow_replies"});
    const auto before = slow.rig.now;
    EXPECT_EQ(SdoLayout::index::load(slow.ask_for(0x1000).data), 0x1000);
    EXPECT_GE(slow.rig.now - before, 100ms);
    Odd silent({"never_replies"});
    EXPECT_TRUE(silent.put(MailboxType::coe, question(0x1000)));
    EXPECT_FALSE(silent.take(200ms));
    Odd full({"mailbox_full"});
    EXPECT_TRUE(full.put(MailboxType::coe, question(0x1000)));
    full.wait(10ms);
    EXPECT_FALSE(full.put(MailboxType::coe, question(0x1000))) << "still there: working counter 0";
    EXPECT_TRUE(full.take(100ms));
    Odd left({"mailbox_full"});
    EXPECT_TRUE(left.put(MailboxType::coe, question(0x1000)));
    left.wait(10ms);
    EXPECT_EQ(left.to(AlState::init), (AlStatus{AlState::init, false, 0}));
    left.wait(100ms);
    EXPECT_GT(left.rig.slave(0).next_event(), left.rig.now) << "no event of a message that nobody will read";
}

TEST(MailQuirks, ErrorsAndLengths) {
    Odd errors({"error_replies"});
    const auto error = errors.ask_for(0x1000);
    EXPECT_EQ(error.header.type, MailboxType::error);
    EXPECT_EQ(load_le<std::uint16_t>(error.data, 2), 4);  // service not supported
    Odd overlong({"overlong_replies"});
    EXPECT_GT(overlong.ask_for(0x1000).header.length, overlong.mailbox_bytes);
    Odd empty({"empty_replies"});
    EXPECT_EQ(empty.ask_for(0x1000).header.length, 0);
    Odd brief({"short_replies"});
    EXPECT_EQ(brief.ask_for(0x1000).header.length, 4);
}

// --- CoE ---

TEST(CoeQuirks, CompleteAccess) {
    Odd plain({});
    const auto whole = plain.upload(0x1018, 0, true);
    ASSERT_EQ(whole.size(), 18u);
    Odd refuses({"refuses_complete_access"});
    EXPECT_NE(read_sii_model(odd({"refuses_complete_access"}).sii).general.coe_details & 0x20, 0) << "it is promised";
    (void)refuses.upload(0x1018, 0, true);
    EXPECT_EQ(refuses.last_abort, Abort::unsupported_access);
    Odd unpadded({"unpadded_complete_access"});
    auto without = whole;
    without.erase(without.begin() + 1);
    EXPECT_EQ(unpadded.upload(0x1018, 0, true), without);
}

TEST(CoeQuirks, FormsOfUploads) {
    Odd plain({});
    EXPECT_EQ(command_of(plain.ask_for(0x1018, 0)), 0x4Fu);
    Odd unsized({"no_size_indicated"});
    EXPECT_EQ(command_of(unsized.ask_for(0x1018, 0)), 0x42u);
    Odd normal({"never_expedited"});
    const auto reply = normal.ask_for(0x1018, 0);
    EXPECT_EQ(command_of(reply), 0x41u);
    EXPECT_EQ(SdoLayout::complete_size::load(reply.data), 1u);
    EXPECT_EQ(reply.data.size(), 11u);
    EXPECT_EQ(reply.data[10], std::byte{4});
    Odd segments({"segments_only"});
    EXPECT_EQ(segments.ask_for(0x1008).data.size(), 10u);
    for (const auto* name : {"segments_only", "small_segments", "never_expedited"}) {
        SCOPED_TRACE(name);
        Odd hand({name});
        EXPECT_EQ(hand.upload(0x1008), plain.upload(0x1008));
        EXPECT_EQ(hand.upload(0x1018, 1), plain.upload(0x1018, 1));
        EXPECT_EQ(hand.upload(0x2005), plain.upload(0x2005));
    }
}

TEST(CoeQuirks, SegmentsGoWrong) {
    Odd empty({"empty_segments"});
    (void)empty.ask_for(0x2000);
    EXPECT_EQ(empty.ask_for(0, 0, 0x60).header.length, 0);
    Odd midway({"aborts_midway"});
    EXPECT_LT(midway.upload(0x2000).size(), 1024u);
    EXPECT_EQ(midway.last_abort, Abort::general);
    Odd stuck({"toggle_stuck"});
    (void)stuck.ask_for(0x2000);
    EXPECT_EQ(command_of(stuck.ask_for(0, 0, 0x60)) & 0x10, 0u);
    EXPECT_EQ(command_of(stuck.ask_for(0, 0, 0x70)) & 0x10, 0u);
}

TEST(CoeQuirks, PdoObjects) {
    Odd none({"no_assignment"});
    (void)none.upload(0x1C12, 0);
    EXPECT_EQ(none.last_abort, Abort::no_object);
    EXPECT_EQ(none.to(AlState::op), (AlStatus{AlState::op, false, 0})) << "its SII tells all";
    for (const bool few : {false, true}) {
        auto hand = few ? Odd({"few_mapping_entries"}) : Odd({});
        hand.download(0x1600, 0, 0, 1);
        ASSERT_EQ(hand.last_abort, Abort::none);
        for (unsigned n = 1; n <= 10; ++n) {
            hand.download(0x1600, n, 0x70000010 + (n << 8), 4);
            EXPECT_EQ(hand.last_abort, few && n > 8 ? Abort::exceeds_pdo : Abort::none) << n;
        }
        hand.download(0x1600, 0, 10, 1);
        EXPECT_EQ(hand.last_abort, few ? Abort::exceeds_pdo : Abort::none);
    }
}

TEST(CoeQuirks, PdosThatDiffer) {
    Odd disagrees({"coe_disagrees"});
    EXPECT_EQ(disagrees.number(0x1C12, 1), 0x1601);
    EXPECT_EQ(disagrees.model.areas[0].pdo_bits, 64u);
    EXPECT_EQ(disagrees.to(AlState::safeop), (AlStatus{AlState::preop, true, 0x001D})) << "the SII's word is wrong";
    Odd other({"other_pdos"});
    EXPECT_EQ(other.number(0x1C12, 1), 0x1601);
    EXPECT_EQ(other.model.areas[0].pdo_bits, 128u);
    EXPECT_EQ(other.model.fixed.identity.product, disagrees.model.fixed.identity.product);
    EXPECT_EQ(other.to(AlState::op), (AlStatus{AlState::op, false, 0}));
}

}  // namespace
}  // namespace margay::sim::test
