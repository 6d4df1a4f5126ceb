// The strict check of SII images: a good image, each kind of fault, and random images.
#include "wire/sii_check.hpp"

#include "sii_image.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <ostream>
#include <random>
#include <set>

namespace margay::wire::sii {

void PrintTo(const Finding& f, std::ostream* out) {
    *out << to_text(f.fault) << ", category " << f.category << ", word " << f.word << ", expected " << f.expected
         << ", actual " << f.actual;
}

namespace {

std::vector<Finding> findings_of(Bytes image) {
    std::vector<Finding> out(64);
    const auto count = check_image(image, out);
    EXPECT_LE(count, out.size());
    out.resize(std::min(count, out.size()));
    return out;
}

// The findings after a change of the made-up device. The checksum is corrected.
std::vector<Finding> findings_after(const std::function<void(std::vector<std::byte>&)>& change) {
    auto image = MadeUpDevice{}.image();
    change(image);
    return findings_of(image);
}

// The first word of a category's content.
std::uint32_t content_of(Bytes image, std::uint16_t type) {
    CategoryWalker walker(image);
    while (const auto found = walker.next())
        if (found->place.type == type) return found->place.word;
    ADD_FAILURE() << "no category " << type;
    return 0;
}

using Findings = std::vector<Finding>;
constexpr auto kNone = category::kEnd;

TEST(SiiCheck, HasNothingToSayAboutAGoodImage) { EXPECT_EQ(findings_of(MadeUpDevice{}.image()), Findings{}); }

TEST(SiiCheck, Blank) {
    EXPECT_EQ(findings_of(std::vector<std::byte>(2048, std::byte{0xFF})), (Findings{{Fault::blank, kNone, 0, 0, 0}}));
    EXPECT_EQ(findings_of(std::vector<std::byte>(1, std::byte{0xFF})), (Findings{{Fault::blank, kNone, 0, 0, 0}}));
}

TEST(SiiCheck, Zeros) {
    EXPECT_EQ(findings_of(std::vector<std::byte>(2048)), (Findings{{Fault::checksum, kNone, 7, 0x30, 0},
                                                                   {Fault::size_mismatch, kNone, 0x3E, 2048, 128},
                                                                   {Fault::no_end, kNone, 0x40, 0, 0}}));
}

TEST(SiiCheck, Truncated) {
    EXPECT_EQ(findings_of({}), (Findings{{Fault::truncated, kNone, 0, 128, 0}}));
    const auto image = MadeUpDevice{}.image();
    EXPECT_EQ(findings_of(Bytes(image).first(126)), (Findings{{Fault::truncated, kNone, 0, 128, 126}}));
    const auto general = content_of(image, category::kGeneral);
    EXPECT_EQ(findings_of(Bytes(image).first(general * 2 + 10)),
              (Findings{{Fault::size_mismatch, kNone, 0x3E, general * 2 + 10, 2048},
                        {Fault::category_past_end, kNone, general - 2, 0, 0}}));
}

// A truncation is found at every place, except behind the end mark, where only the size shows it.
TEST(SiiCheck, TruncatedAnywhere) {
    const auto image = MadeUpDevice{}.image();
    CategoryWalker walker(image);
    while (walker.next()) {
    }
    const std::size_t used = (walker.stopped_at() + 1) * 2;
    for (std::size_t size = 0; size < image.size(); ++size) {
        const auto copy = std::make_unique<std::byte[]>(size);  // so that ASan detects an access beyond the end
        std::copy_n(image.begin(), size, copy.get());
        const auto found = findings_of(Bytes(copy.get(), size));
        const auto has = [&](Fault fault) { return std::ranges::count(found, fault, &Finding::fault) == 1; };
        if (size < kFixedBytes) {
            EXPECT_TRUE(has(Fault::truncated)) << size;
        } else {
            EXPECT_TRUE(has(Fault::size_mismatch)) << size;
            EXPECT_EQ(has(Fault::category_past_end) || has(Fault::no_end), size < used) << size;
        }
        EXPECT_EQ(has(Fault::odd_length), size % 2 != 0) << size;
    }
}

TEST(SiiCheck, Checksum) {
    const auto found = findings_after([](auto& image) { image[4] ^= std::byte{1}; });
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].fault, Fault::checksum);
    EXPECT_EQ(found[0].word, 7U);
    EXPECT_NE(found[0].expected, found[0].actual);
    EXPECT_EQ(found[0].actual, std::to_integer<unsigned>(MadeUpDevice{}.image()[14]));
}

TEST(SiiCheck, Mailboxes) {
    const auto change_word = [](std::uint32_t at, std::uint16_t value) {
        return findings_after([=](auto& image) { store_le(image, at * 2, value); });
    };
    EXPECT_EQ(change_word(0x1B, 0), (Findings{{Fault::mailbox_one_sided, kNone, 0x18, 0, 0}}));
    EXPECT_EQ(change_word(0x18, 0x0100), (Findings{{Fault::mailbox_outside, kNone, 0x18, 0, 0}}));
    EXPECT_EQ(change_word(0x19, 0xFFFF), (Findings{{Fault::mailbox_too_large, kNone, 0x19, 1486, 0xFFFF}}));
    EXPECT_EQ(change_word(0x1B, 1487), (Findings{{Fault::mailbox_too_large, kNone, 0x1B, 1486, 1487}}));
    EXPECT_EQ(change_word(0x15, 1500), (Findings{{Fault::mailbox_too_large, kNone, 0x15, 1486, 1500}}));
    EXPECT_EQ(change_word(0x1A, 0x1040), (Findings{{Fault::mailbox_overlap, kNone, 0x18, 0, 0}}));
    EXPECT_EQ(change_word(0x16, 0x10FF), (Findings{{Fault::mailbox_overlap, kNone, 0x14, 0, 0}}));
    EXPECT_EQ(findings_after([](auto& image) { std::fill_n(image.begin() + 0x30, 8, std::byte{0}); }),
              (Findings{{Fault::mailbox_without_size, kNone, 0x18, 0, 0}}));
    EXPECT_EQ(findings_after([](auto& image) { std::fill_n(image.begin() + 0x28, 8, std::byte{0}); }), Findings{});
}

TEST(SiiCheck, Size) {
    EXPECT_EQ(findings_after([](auto& image) { store_le<std::uint16_t>(image, 0x7C, 7); }),
              (Findings{{Fault::size_mismatch, kNone, 0x3E, 2048, 1024}}));
}

TEST(SiiCheck, EndlessCategories) {
    // The end mark is missing, and zeros follow.
    const auto image = MadeUpDevice{}.image();
    CategoryWalker walker(image);
    while (walker.next()) {
    }
    const auto end = walker.stopped_at();
    EXPECT_EQ(findings_after([&](auto& i) { std::fill(i.begin() + end * 2, i.end(), std::byte{0}); }),
              (Findings{{Fault::no_end, kNone, end, 0, 0}}));
    // Categories without content up to the end of the EEPROM: type 1, length 0.
    EXPECT_EQ(findings_after([&](auto& i) {
                  i.resize(i.size() - (i.size() - end * 2) % kCategoryHeaderBytes);
                  for (std::size_t at = end * 2; at < i.size(); ++at)
                      i[at] = static_cast<std::byte>((at - end * 2) % 4 == 0);
              }).back(),
              (Finding{Fault::no_end, kNone, 0x3FF, 0, 0}));
}

TEST(SiiCheck, OverlappingCategories) {
    const auto image = MadeUpDevice{}.image();
    const auto pdos = content_of(image, category::kTxPdo);
    EXPECT_EQ(findings_after([&](auto& i) { i[pdos * 2 + 2] = std::byte{200}; }),
              (Findings{{Fault::category_overlap, category::kTxPdo, pdos, 0, 0}}));
    const auto strings = content_of(image, category::kStrings);
    EXPECT_EQ(findings_after([&](auto& i) { i[strings * 2] = std::byte{100}; }),
              (Findings{{Fault::string_past_end, category::kStrings, strings, 0, 0}}));
    // A category whose length includes a word of the next category: its last word and the following categories are
    // wrong.
    const auto managers = content_of(image, category::kSyncManager);
    const auto found = findings_after([&](auto& i) { i[managers * 2 - 2] = std::byte{17}; });
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0], (Finding{Fault::trailing, category::kSyncManager, managers + 17, 0, 0}));
}

TEST(SiiCheck, RepeatedCategories) {
    MadeUpDevice device;
    const auto uses = bytes({1, 2});
    const RawCategory again[] = {{category::kFmmu, uses}};
    device.description.others = again;
    const auto image = device.image();
    std::uint32_t last = 0;
    CategoryWalker walker(image);
    while (const auto found = walker.next()) last = found->place.word;
    EXPECT_EQ(findings_of(image), (Findings{{Fault::category_repeated, category::kFmmu, last, 0, 0}}));
}

TEST(SiiCheck, Strings) {
    const auto image = MadeUpDevice{}.image();
    const auto general = content_of(image, category::kGeneral);
    const auto strings = find_category(image, category::kStrings).value_or(Bytes{});
    const unsigned count = string_count(strings);
    EXPECT_EQ(findings_after([&](auto& i) { i[general * 2 + 3] = static_cast<std::byte>(count + 1); }),
              (Findings{{Fault::string_missing, category::kGeneral, general + 1, count, count + 1}}));
    const auto pdos = content_of(image, category::kRxPdo);
    EXPECT_EQ(findings_after([&](auto& i) { i[pdos * 2 + 8 + 3] = std::byte{0xFF}; }),
              (Findings{{Fault::string_missing, category::kRxPdo, pdos + 4, count, 0xFF}}));
    const auto modes = content_of(image, category::kDc);
    EXPECT_EQ(findings_after([&](auto& i) { i[modes * 2 + 24 + 18] = std::byte{0xFE}; }),
              (Findings{{Fault::string_missing, category::kDc, modes + 12, count, 0xFE}}));
}

TEST(SiiCheck, UnknownValues) {
    const auto image = MadeUpDevice{}.image();
    const auto fmmus = content_of(image, category::kFmmu);
    EXPECT_EQ(findings_after([&](auto& i) { i[fmmus * 2 + 2] = std::byte{9}; }),
              (Findings{{Fault::unknown_value, category::kFmmu, fmmus + 1, 0, 9}}));
    const auto managers = content_of(image, category::kSyncManager);
    EXPECT_EQ(findings_after([&](auto& i) { i[managers * 2 + 8 + 7] = std::byte{5}; }),
              (Findings{{Fault::unknown_value, category::kSyncManager, managers + 4, 0, 5}}));
}

TEST(SiiCheck, CountsWhatThereIsNoRoomFor) {
    std::array<Finding, 1> one{};
    EXPECT_EQ(check_image(std::vector<std::byte>(2048), one), 3U);
    EXPECT_EQ(one[0].fault, Fault::checksum);
    EXPECT_EQ(check_image(std::vector<std::byte>(2048), {}), 3U);
}

// The check handles any damage; every octet of the image is set to several values.
TEST(SiiCheck, AnyOctetMayBeAnything) {
    const auto image = MadeUpDevice{}.image(1024);
    std::size_t unharmed = 0;
    for (std::size_t at = 0; at < image.size(); ++at)
        for (const int value : {0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF}) {
            auto changed = image;
            changed[at] = static_cast<std::byte>(value);
            const auto found = findings_of(changed);
            unharmed += found.empty();
            for (const auto& finding : found) ASSERT_LE(finding.word * 2, image.size());
        }
    EXPECT_GT(unharmed, 0U);
    EXPECT_LT(unharmed, image.size() * 6);
}

TEST(SiiCheck, NoiseIsSurvived) {
    std::mt19937 random(7);
    for (int round = 0; round < 3000; ++round) {
        const std::size_t size = random() % 600;
        const auto noise = std::make_unique<std::byte[]>(size);
        for (std::size_t i = 0; i < size; ++i)
            noise[i] = static_cast<std::byte>(random() % 5 == 0 ? random() : random() % 64);
        EXPECT_GE(check_image(Bytes(noise.get(), size), {}), 1U);
    }
}

TEST(SiiFaults, EachHasWordsOfItsOwnAndAnErrorCode) {
    std::set<std::string_view> texts;
    for (int i = 0; i <= static_cast<int>(Fault::too_long); ++i) {
        const auto fault = static_cast<Fault>(i);
        EXPECT_NE(to_text(fault), "unknown fault") << i;
        EXPECT_TRUE(texts.insert(to_text(fault)).second) << to_text(fault);
        EXPECT_EQ(to_errc(fault) == Errc::none, fault == Fault::none) << to_text(fault);
    }
    EXPECT_EQ(to_text(static_cast<Fault>(static_cast<int>(Fault::too_long) + 1)), "unknown fault");
    EXPECT_EQ(to_errc(Fault::blank), Errc::sii_blank);
    EXPECT_EQ(to_errc(Fault::checksum), Errc::sii_checksum);
    EXPECT_EQ(to_errc(Fault::no_end), Errc::sii_truncated);
    EXPECT_EQ(to_errc(Fault::mailbox_without_size), Errc::sii_format);
}

}  // namespace
}  // namespace margay::wire::sii
