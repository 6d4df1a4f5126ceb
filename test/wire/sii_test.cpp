// The fixed part of the SII, its chain of categories and the readers of the categories, compared with bytes written by
// hand.
#include "sii_image.hpp"
#include "wire/sii_category.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

namespace margay::wire::sii {
namespace {

// Configuration areas of real devices, with the vendor's checksum.
TEST(SiiChecksum, IsThatOfPublishedImages) {
    EXPECT_EQ(checksum(bytes({0x09, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0})), 0x10);
    EXPECT_EQ(checksum(bytes({0x00, 0x0D, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0})), 0x46);
    EXPECT_EQ(checksum(bytes({0x06, 0x05, 0, 0, 0x10, 0, 1, 0, 0, 0, 0, 0, 0, 0})), 0x2B);
}

TEST(SiiChecksum, OnlyTheLowOctetCounts) {
    auto area = bytes({0x09, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x10, 0xA5});
    EXPECT_TRUE(checksum_right(area));
    for (std::size_t i = 0; i < 15; ++i) {
        auto changed = area;
        changed[i] ^= std::byte{0x40};
        EXPECT_FALSE(checksum_right(changed)) << i;
    }
}

TEST(SiiFixedPart, EveryWordIsWhereTheStandardHasIt) {
    std::vector<std::byte> image(kFixedBytes);
    for (std::size_t i = 0; i < 0x40; ++i) store_le(image, 2 * i, static_cast<std::uint16_t>(0x0100 + i));
    const auto fixed = load_fixed_part(image);
    EXPECT_EQ(fixed.fault, Fault::checksum);  // reported, and all values are read
    const auto& c = fixed.value.configuration;
    EXPECT_EQ(c.pdi_control, 0x0100);
    EXPECT_EQ(c.pdi_configuration, 0x0101);
    EXPECT_EQ(c.sync_pulse_length_10ns, 0x0102);
    EXPECT_EQ(c.extended_pdi_configuration, 0x0103);
    EXPECT_EQ(c.alias, 0x0104);
    EXPECT_EQ(c.checksum, 0x0107);
    EXPECT_EQ(fixed.value.identity, (Identity{0x01090108, 0x010B010A, 0x010D010C, 0x010F010E}));
    const auto& [boot, standard] = fixed.value.mailboxes;
    EXPECT_EQ(boot.out_start, 0x0114);
    EXPECT_EQ(boot.out_bytes, 0x0115);
    EXPECT_EQ(boot.in_start, 0x0116);
    EXPECT_EQ(boot.in_bytes, 0x0117);
    EXPECT_EQ(standard.out_start, 0x0118);
    EXPECT_EQ(standard.out_bytes, 0x0119);
    EXPECT_EQ(standard.in_start, 0x011A);
    EXPECT_EQ(standard.in_bytes, 0x011B);
    EXPECT_EQ(standard.protocols, 0x011C);
    EXPECT_EQ(fixed.value.eeprom_bytes, (0x013E + 1) * 128U);
    EXPECT_EQ(fixed.value.version, 0x013F);
}

TEST(SiiFixedPart, StoringIsTheInverseOfLoading) {
    std::vector<std::byte> at(kConfigurationBytes);
    const Configuration c{1, 2, 3, 4, 5, {6, 7}, 0};
    store_configuration(at, c);
    EXPECT_TRUE(checksum_right(at));
    auto loaded = load_configuration(at);
    loaded.checksum = 0;
    EXPECT_EQ(loaded, c);
}

TEST(SiiFixedPart, ShorterThanItIsTruncated) {
    const auto image = MadeUpDevice{}.image();
    EXPECT_EQ(load_fixed_part(Bytes(image).first(kFixedBytes - 1)).fault, Fault::truncated);
    EXPECT_EQ(load_fixed_part({}).fault, Fault::truncated);
    EXPECT_TRUE(load_fixed_part(Bytes(image).first(kFixedBytes)).ok());
}

TEST(SiiFixedPart, SizeWordCountsKiBitLessOne) {
    EXPECT_EQ(eeprom_bytes(0x000F), 2048U);
    EXPECT_EQ(eeprom_bytes(0), 128U);
    EXPECT_EQ(eeprom_bytes(0xFFFF), 8U * 1024 * 1024);
    EXPECT_EQ(size_word(2048), 0x000F);
}

TEST(SiiMailbox, NamesWhatCannotBeUsed) {
    const auto fault = [](MailboxInfo mailbox) { return mailbox_fault(mailbox); };
    EXPECT_EQ(fault({}), Fault::none);
    EXPECT_EQ(fault({0x1000, 128, 0x1080, 128, 4}), Fault::none);
    EXPECT_EQ(fault({0x1080, 128, 0x1000, 128, 4}), Fault::none);  // the other order
    EXPECT_EQ(fault({0, 0, 0, 0, 4}), Fault::mailbox_without_size);
    EXPECT_EQ(fault({0x1000, 0, 0x1080, 128, 4}), Fault::mailbox_one_sided);
    EXPECT_EQ(fault({0x1000, 128, 0x1080, 0, 0}), Fault::mailbox_one_sided);
    EXPECT_EQ(fault({0x1000, 5, 0x1080, 128, 4}), Fault::mailbox_too_short);
    EXPECT_EQ(fault({0x1000, 6, 0x1080, 128, 4}), Fault::none);
    EXPECT_EQ(fault({0x0F80, 128, 0x1080, 128, 4}), Fault::mailbox_outside);  // the registers
    EXPECT_EQ(fault({0x1000, 128, 0xFFC0, 0x40, 4}), Fault::none);
    EXPECT_EQ(fault({0x1000, 128, 0xFFC0, 0x41, 4}), Fault::mailbox_outside);
    EXPECT_EQ(fault({0x1000, 1486, 0x2000, 1486, 4}), Fault::none);  // the most that one datagram can carry
    EXPECT_EQ(fault({0x1000, 1487, 0x2000, 128, 4}), Fault::mailbox_too_large);
    EXPECT_EQ(fault({0x1000, 128, 0x2000, 1487, 4}), Fault::mailbox_too_large);
    EXPECT_EQ(fault({0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF}), Fault::mailbox_too_large);  // a blank EEPROM
    EXPECT_EQ(fault({0x1000, 129, 0x1080, 128, 4}), Fault::mailbox_overlap);
    EXPECT_EQ(fault({0x1000, 128, 0x1000, 128, 4}), Fault::mailbox_overlap);
}

// An image of zeros with these octets as its categories.
std::vector<std::byte> with_categories(const std::vector<std::byte>& octets) {
    std::vector<std::byte> image(kFixedBytes + octets.size());
    std::copy(octets.begin(), octets.end(), image.begin() + kFixedBytes);
    return image;
}

struct Walk {
    std::vector<std::uint16_t> types;
    Fault fault = Fault::none;
    std::uint32_t stopped_at = 0;
    friend bool operator==(const Walk&, const Walk&) = default;
};
Walk walk(const std::vector<std::byte>& image) {
    CategoryWalker walker(image);
    Walk out;
    while (const auto found = walker.next()) out.types.push_back(found->place.type);
    EXPECT_FALSE(walker.next());  // at the end the walker stays at the end
    out.fault = walker.fault();
    out.stopped_at = walker.stopped_at();
    return out;
}
void PrintTo(const Walk& w, std::ostream* out) {
    *out << to_text(w.fault) << " at " << w.stopped_at << " after " << ::testing::PrintToString(w.types);
}

TEST(SiiCategories, AreWalkedToTheEndMark) {
    const auto image = with_categories(bytes({10, 0, 1, 0, 0xAA, 0xBB, 30, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF}));
    CategoryWalker walker(image);
    const auto first = walker.next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->place.type, category::kStrings);
    EXPECT_EQ(first->place.word, 0x42U);
    EXPECT_EQ(first->place.words, 1);
    EXPECT_EQ(text(first->content), "\xAA\xBB");
    const auto second = walker.next();
    ASSERT_TRUE(second);
    EXPECT_EQ(second->place.type, category::kGeneral);
    EXPECT_EQ(second->place.word, 0x45U);
    EXPECT_TRUE(second->content.empty());
    EXPECT_EQ(walk(image), (Walk{{10, 30}, Fault::none, 0x45}));
}

TEST(SiiCategories, EndMarkAsTheLastWordNeedsNoLength) {
    EXPECT_EQ(walk(with_categories(bytes({10, 0, 0, 0, 0xFF, 0xFF}))), (Walk{{10}, Fault::none, 0x42}));
}

TEST(SiiCategories, WithoutEndMark) {
    EXPECT_EQ(walk(with_categories({})), (Walk{{}, Fault::no_end, 0x40}));
    EXPECT_EQ(walk(with_categories(bytes({10, 0, 1, 0, 0, 0}))), (Walk{{10}, Fault::no_end, 0x43}));
    EXPECT_EQ(walk(std::vector<std::byte>(2048)), (Walk{{}, Fault::no_end, 0x40}));  // zeros are no categories
    EXPECT_EQ(walk({}), (Walk{{}, Fault::no_end, 0x40}));
    EXPECT_EQ(walk(std::vector<std::byte>(50)), (Walk{{}, Fault::no_end, 0x40}));
}

TEST(SiiCategories, LongerThanTheEeprom) {
    EXPECT_EQ(walk(with_categories(bytes({10, 0, 2, 0, 1, 1}))), (Walk{{}, Fault::category_past_end, 0x40}));
    EXPECT_EQ(walk(with_categories(bytes({10, 0, 0, 0, 30, 0, 0xFF, 0xFF, 0, 0}))),
              (Walk{{10}, Fault::category_past_end, 0x42}));
    // without a length word
    EXPECT_EQ(walk(with_categories(bytes({10, 0}))), (Walk{{}, Fault::category_past_end, 0x40}));
}

// The chain for reading over the wire needs only the headers, and always ends.
TEST(SiiCategories, ChainOfHeadersAlwaysEnds) {
    std::mt19937 random(1);
    for (int round = 0; round < 2000; ++round) {
        CategoryChain chain(0x400);
        std::uint32_t last = 0;
        int steps = 0;
        while (chain.more()) {
            ASSERT_LT(chain.header_word(), 0x400U);
            ASSERT_GT(chain.header_word(), last);
            last = chain.header_word();
            ++steps;
            std::array<std::byte, kCategoryHeaderBytes> header{};
            store_le(header, 0, static_cast<std::uint16_t>(random() % 70));
            store_le(header, 2, static_cast<std::uint16_t>(random() % 5));
            const auto place = chain.step(header);
            if (!place) break;
            ASSERT_LE(place->word + place->words, 0x400U);
        }
        ASSERT_FALSE(chain.more());
        ASSERT_NE(chain.fault(), Fault::none);  // the end mark is missing
        ASSERT_LE(steps, (0x400 - 0x40) / 2);
    }
}

TEST(SiiCategories, AreFoundByType) {
    const auto image = with_categories(bytes({10, 0, 1, 0, 1, 2, 10, 0, 1, 0, 3, 4, 0xFF, 0xFF}));
    ASSERT_TRUE(find_category(image, 10));
    EXPECT_EQ(text(*find_category(image, 10)), "\x01\x02");
    EXPECT_FALSE(find_category(image, 30));
}

TEST(SiiCategories, HaveNames) {
    EXPECT_EQ(category::name(41), "SyncManager");
    EXPECT_EQ(category::name(5), "device specific");
    EXPECT_EQ(category::name(0x0801), "vendor specific");
    EXPECT_EQ(category::name(0x8001), "vendor specific");
    EXPECT_EQ(category::name(0x1234), "unknown");
}

TEST(SiiStrings, ByNumber) {
    const auto strings = bytes({3, 2, 'a', 'b', 0, 1, 'c', 0});
    EXPECT_EQ(string_count(strings), 3);
    EXPECT_EQ(text(string(strings, 1).value), "ab");
    EXPECT_TRUE(string(strings, 2).ok());
    EXPECT_EQ(text(string(strings, 2).value), "");
    EXPECT_EQ(text(string(strings, 3).value), "c");
    EXPECT_TRUE(string(strings, 0).ok());  // number 0 means no string, which is no fault
    EXPECT_TRUE(string({}, 0).ok());
    EXPECT_EQ(string(strings, 4).fault, Fault::string_missing);
    EXPECT_EQ(string({}, 1).fault, Fault::string_missing);
}

TEST(SiiStrings, PastTheEnd) {
    EXPECT_EQ(string(bytes({1}), 1).fault, Fault::string_past_end);
    EXPECT_EQ(string(bytes({1, 2, 'a'}), 1).fault, Fault::string_past_end);
    EXPECT_EQ(string(bytes({2, 1, 'a'}), 2).fault, Fault::string_past_end);
    EXPECT_EQ(string(bytes({2, 200, 'a', 0}), 2).fault, Fault::string_past_end);
    EXPECT_TRUE(string(bytes({2, 1, 'a', 200}), 1).ok());  // the string before it is good
    EXPECT_EQ(string(bytes({0xFF, 0xFF, 0xFF, 0xFF}), 1).fault, Fault::string_past_end);
}

std::string utf8(std::vector<std::byte> octets, std::size_t room = 100) {
    std::string out(room, '#');
    return std::string(to_utf8(octets, std::span(out.data(), room)));
}

TEST(SiiStrings, AsUtf8) {
    EXPECT_EQ(utf8(bytes({'A', 'b'})), "Ab");
    EXPECT_EQ(utf8(bytes({'1', 0xB5, 's'})), "1\u00B5s");        // ISO 8859-1
    EXPECT_EQ(utf8(bytes({'1', 0xC2, 0xB5, 's'})), "1\u00B5s");  // UTF-8 is not changed
    EXPECT_EQ(utf8(bytes({0xE2, 0x82, 0xAC})), "\u20AC");
    EXPECT_EQ(utf8(bytes({0xF0, 0x9F, 0x98, 0x80})), "\U0001F600");
    EXPECT_EQ(utf8(bytes({0xC3})), "\u00C3");                       // truncated UTF-8 is read as ISO 8859-1
    EXPECT_EQ(utf8(bytes({0xC0, 0x80})), "\u00C0?");                // an overlong zero
    EXPECT_EQ(utf8(bytes({0xED, 0xA0, 0x80})), "\u00ED\u00A0?");    // a surrogate
    EXPECT_EQ(utf8(bytes({0xF4, 0x90, 0x80, 0x80})), "\u00F4???");  // above U+10FFFF
    EXPECT_EQ(utf8(bytes({'a', 0x1B, '[', 0x7F, '\n'})), "a?[??");  // no characters that move the cursor of a terminal
    EXPECT_EQ(utf8(bytes({0xC2, 0x9B, 'a'})), "?a");                // a control character in UTF-8
    EXPECT_EQ(utf8(bytes({'a', ' ', ' ', 0, 0})), "a");
    EXPECT_EQ(utf8({}), "");
}

TEST(SiiStrings, AsUtf8AreNeverCutInACharacter) {
    EXPECT_EQ(utf8(bytes({'a', 0xB5, 'b'}), 2), "a");
    EXPECT_EQ(utf8(bytes({'a', 0xB5, 'b'}), 3), "a\u00B5");
    EXPECT_EQ(utf8(bytes({0xE2, 0x82, 0xAC, 'x'}), 2), "");
    EXPECT_EQ(utf8(bytes({'a'}), 0), "");
}

TEST(SiiGeneral, FieldByField) {
    std::vector<std::byte> content(32);
    for (std::size_t i = 0; i < 32; ++i) content[i] = static_cast<std::byte>(0x80 + i);
    const auto general = parse_general(content);
    ASSERT_TRUE(general.ok());
    const General expected{.group = 0x80,
                           .image = 0x81,
                           .order = 0x82,
                           .name = 0x83,
                           .coe_details = 0x85,
                           .foe_details = 0x86,
                           .eoe_details = 0x87,
                           .soe_channels = 0x88,
                           .ds402_channels = 0x89,
                           .sysman_class = 0x8A,
                           .flags = 0x8B,
                           .ebus_current_ma = -29300,  // 0x8D8C
                           .physical_ports = 0x9190,
                           .identification_address = 0x9392};
    EXPECT_EQ(general.value, expected);
}

TEST(SiiGeneral, ShorterThanItShouldBe) {
    std::vector<std::byte> content(32, std::byte{0x11});
    for (std::size_t size = 0; size < 32; ++size) {
        const auto general = parse_general(Bytes(content).first(size));
        EXPECT_EQ(general.fault, Fault::truncated) << size;
        EXPECT_EQ(general.value.ebus_current_ma, size >= 14 ? 0x1111 : 0) << size;  // never half of a value
        EXPECT_EQ(general.value.name, size >= 4 ? 0x11 : 0) << size;
    }
}

TEST(SiiGeneral, Ports) {
    const General general{.physical_ports = 0x4310};
    EXPECT_EQ(physical_port(general, 0), PhysicalPort::unused);
    EXPECT_EQ(physical_port(general, 1), PhysicalPort::mii);
    EXPECT_EQ(physical_port(general, 2), PhysicalPort::ebus);
    EXPECT_EQ(physical_port(general, 3), PhysicalPort::fast_hot_connect);
}

TEST(SiiFmmus, BothOctetsForUnusedAndWhatIsUnknown) {
    const auto content = bytes({1, 2, 3, 0, 0xFF, 4});
    FmmuUses uses(content);
    EXPECT_EQ(uses.next(), FmmuUse::outputs);
    EXPECT_EQ(uses.next(), FmmuUse::inputs);
    EXPECT_EQ(uses.next(), FmmuUse::mailbox_status);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(uses.next(), FmmuUse::unused);
    EXPECT_FALSE(uses.next());
    EXPECT_EQ(uses.fault(), Fault::none);
}

TEST(SiiSyncManagers, FieldByFieldAndTheRestBehindThem) {
    const auto content = bytes({0x00, 0x18, 0x00, 0x04, 0x26, 0x77, 0x09, 0x01, 0xAA, 0xBB});
    SyncManagers managers(content);
    EXPECT_EQ(managers.count(), 1U);
    EXPECT_EQ(managers.fault(), Fault::trailing);
    const auto manager = managers.next();
    ASSERT_TRUE(manager);
    EXPECT_EQ(manager->start, 0x1800);
    EXPECT_EQ(manager->length_bytes, 0x0400);
    EXPECT_EQ(manager->control, 0x26);
    EXPECT_EQ(manager->enable, 0x09);
    EXPECT_EQ(manager->type, SmType::mailbox_out);
    EXPECT_FALSE(managers.next());
}

TEST(SiiPdos, FieldByField) {
    const auto content = bytes({0x00, 0x1A, 2, 3,    1, 5, 0x11, 0x00,  //
                                0x00, 0x60, 4, 6,    7, 8, 0x34, 0x12,  //
                                0x00, 0x00, 0, 0,    0, 9, 0x00, 0x00,  //
                                0x01, 0x1A, 0, 0xFF, 0, 0, 0,    0});
    Pdos pdos(content);
    const auto first = pdos.next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->index, 0x1A00);
    EXPECT_EQ(first->entry_count, 2);
    EXPECT_EQ(first->sync_manager, 3);
    EXPECT_EQ(first->synchronization, 1);
    EXPECT_EQ(first->name, 5);
    EXPECT_EQ(first->flags, 0x0011);
    PdoEntries entries(first->entries);
    EXPECT_EQ(entries.next(), (PdoEntry{0x6000, 4, 6, 7, 8, 0x1234}));
    EXPECT_EQ(entries.next(), (PdoEntry{0, 0, 0, 0, 9, 0}));  // a gap of nine bits
    EXPECT_FALSE(entries.next());
    const auto second = pdos.next();
    ASSERT_TRUE(second);
    EXPECT_EQ(second->index, 0x1A01);
    EXPECT_FALSE(second->assigned());
    EXPECT_FALSE(pdos.next());
    EXPECT_EQ(pdos.fault(), Fault::none);
}

TEST(SiiPdos, EntriesThatReachIntoTheNextCategory) {
    const auto content = bytes({0x00, 0x1A, 0, 3, 0, 0, 0, 0, 0x01, 0x1A, 2, 3, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8});
    Pdos pdos(content);
    ASSERT_TRUE(pdos.next());
    EXPECT_EQ(pdos.fault(), Fault::none);
    EXPECT_FALSE(pdos.next());
    EXPECT_EQ(pdos.fault(), Fault::category_overlap);
    EXPECT_FALSE(pdos.next());

    Pdos rest(Bytes(content).first(2));
    EXPECT_FALSE(rest.next());
    EXPECT_EQ(rest.fault(), Fault::trailing);
}

TEST(SiiDc, FieldByField) {
    const auto content = bytes({0x01, 0x02, 0x03, 0x04, 0xFF, 0xFF, 0xFF, 0xFF, 0x10, 0, 0,    0,
                                0xFE, 0xFF, 0x30, 0x07, 0xF8, 0xFF, 5,    6,    0,    0, 0xAA, 0xBB});
    DcOpModes modes(content);
    EXPECT_EQ(modes.next(), (DcOpMode{0x04030201, -1, 16, -2, 0x0730, -8, 5, 6}));
    EXPECT_FALSE(modes.next());
    EXPECT_EQ(modes.fault(), Fault::none);
    DcOpModes cut(Bytes(content).first(2));
    EXPECT_EQ(cut.fault(), Fault::trailing);
    EXPECT_FALSE(cut.next());
}

TEST(SiiBlank, IsEveryOctet) {
    std::vector<std::byte> eeprom(2048, std::byte{0xFF});
    EXPECT_TRUE(is_blank(eeprom));
    eeprom.back() = std::byte{0xFE};
    EXPECT_FALSE(is_blank(eeprom));
    EXPECT_FALSE(is_blank({}));
}

}  // namespace
}  // namespace margay::wire::sii
