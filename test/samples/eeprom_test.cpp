// Reading, writing and verifying an EEPROM with many kinds of faults, and image files.
#include "common/eeprom.hpp"

#include "wire/sii_writer.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <numeric>

namespace margay::samples {
namespace {

namespace sii = wire::sii;
constexpr std::uint32_t kNever = 0xFFFFFFFF;

std::vector<std::byte> image(std::uint32_t product, std::size_t size = 1024) {
    std::vector<std::byte> out(size);
    EXPECT_TRUE(
        sii::write_image({.identity = {0x4D47, product, 1, 1}, .name = "Made up " + std::to_string(product)}, out)
            .ok());
    return out;
}

// An EEPROM with faults.
struct FaultyEeprom final : Eeprom {
    explicit FaultyEeprom(std::vector<std::byte> content) : octets(std::move(content)) {}

    std::string name() const override { return "it"; }
    std::string read(std::uint32_t word, MutableBytes into) override {
        if (words_written >= lost_after_words) return "no answer";
        last_read = std::max(last_read, word * 2 + into.size());
        for (std::size_t i = 0; i < into.size(); ++i) into[i] = octets[(word * 2 + i) % octets.size()];
        return {};
    }
    Written write(std::uint32_t word, Bytes data) override {
        Written done;
        for (; done.words < data.size() / 2; ++done.words) {
            const auto at = word + done.words;
            if (words_written >= lost_after_words) return {done.words, "no answer"};
            if (read_only) return {.words = done.words, .error = "reading only", .refused = true};
            if (at == refused_word) return {done.words, "refused"};
            if (at != forgotten_word) {
                const auto place = at * 2 % octets.size();
                octets[place] = data[done.words * 2];
                octets[place + 1] = data[done.words * 2 + 1];
            }
            order.push_back(static_cast<std::uint32_t>(at));
            ++words_written;
        }
        return done;
    }
    std::string keep() override {
        ++kept;
        return keep_error;
    }

    std::vector<std::byte> octets;  // the real size: addresses beyond it wrap around
    std::vector<std::uint32_t> order;
    std::size_t words_written = 0;
    std::size_t last_read = 0;  // the end of the last read
    std::size_t lost_after_words = kNever;
    std::uint32_t refused_word = kNever;
    std::uint32_t forgotten_word = kNever;
    std::string keep_error;
    int kept = 0;
    bool read_only = false;
};

std::size_t different_words(Bytes a, Bytes b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.size(); i += 2) count += load_le<std::uint16_t>(a, i) != load_le<std::uint16_t>(b, i);
    return count;
}

TEST(EepromWrite, WritesOnlyWhatDiffers) {
    FaultyEeprom eeprom(image(1));
    const auto wanted = image(2);
    const auto different = different_words(eeprom.octets, wanted);
    ASSERT_GT(different, 0U);
    const auto report = write_eeprom(eeprom, wanted, no_progress());
    EXPECT_EQ(report.error, "");
    EXPECT_TRUE(report.verified);
    EXPECT_EQ(report.words, 512U);
    EXPECT_EQ(report.different, different);
    EXPECT_EQ(report.written, different);
    EXPECT_EQ(eeprom.words_written, different);
    EXPECT_EQ(eeprom.octets, wanted);
    EXPECT_EQ(eeprom.kept, 1);

    const auto again = write_eeprom(eeprom, wanted, no_progress());
    EXPECT_TRUE(again.verified);
    EXPECT_EQ(again.different, 0U);
    EXPECT_EQ(eeprom.words_written, different);
}

TEST(EepromWrite, WritesTheConfigurationAreaLast) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    ASSERT_TRUE(write_eeprom(eeprom, image(2), no_progress()).verified);
    ASSERT_GT(eeprom.order.size(), 8U);
    const std::vector<std::uint32_t> last(eeprom.order.end() - 8, eeprom.order.end());
    EXPECT_EQ(last, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_EQ(*std::min_element(eeprom.order.begin(), eeprom.order.end() - 8), 8U);
}

TEST(EepromWrite, LeavesTheRestOfALargerEeprom) {
    FaultyEeprom eeprom(image(1, 2048));
    eeprom.octets[2000] = std::byte{0x5A};
    auto before = eeprom.octets;
    const auto wanted = image(2, 1024);
    ASSERT_TRUE(write_eeprom(eeprom, wanted, no_progress()).verified);
    EXPECT_TRUE(std::equal(wanted.begin(), wanted.end(), eeprom.octets.begin()));
    EXPECT_TRUE(std::equal(before.begin() + 1024, before.end(), eeprom.octets.begin() + 1024));
}

// Nothing is in doubt, and nothing has to be restored.
TEST(EepromWrite, AnApplicationThatRefusesEverythingIsNoFailedWrite) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    eeprom.read_only = true;
    const auto report = write_eeprom(eeprom, image(2), no_progress());
    EXPECT_EQ(report.error, "reading only");
    EXPECT_EQ(report.left, "");
    EXPECT_EQ(report.written, 0U);
    EXPECT_FALSE(report.verified);
    EXPECT_EQ(eeprom.kept, 0);
}

TEST(EepromWrite, ARefusedWordEndsIt) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    eeprom.refused_word = 0x45;
    const auto report = write_eeprom(eeprom, image(2), no_progress());
    EXPECT_EQ(report.error, "it is uncertain whether word 0x0045 was written: refused");
    EXPECT_FALSE(report.verified);
    EXPECT_LT(report.written, report.different);
    EXPECT_EQ(eeprom.words_written, 2 * report.written) << "and back";
    EXPECT_EQ(eeprom.kept, 0);
    EXPECT_TRUE(report.restored);
    EXPECT_EQ(report.left, "the old content was restored");
    EXPECT_TRUE(sii::is_blank(eeprom.octets));
}

// The EEPROM is lost at any word: the words that count as written were written, and nothing is reported as verified.
TEST(EepromWrite, LostHalfwayAnywhere) {
    FaultyEeprom whole(image(1));
    const auto wanted = image(2000000000);
    const auto different = write_eeprom(whole, wanted, no_progress()).different;
    ASSERT_GT(different, 5U);
    for (std::size_t words = 0; words <= different; ++words) {
        FaultyEeprom eeprom(image(1));
        eeprom.lost_after_words = words;
        const auto report = write_eeprom(eeprom, wanted, no_progress());
        EXPECT_NE(report.error.find("no answer"), std::string::npos) << report.error;
        EXPECT_FALSE(report.verified);
        EXPECT_FALSE(report.restored);
        EXPECT_EQ(report.left.empty(), words == 0) << words << ": " << report.left;
        EXPECT_EQ(report.written, words);
        const bool halfway = words > 0 && words < different;
        EXPECT_EQ(report.left.starts_with("the present content could not be read"), halfway) << words;
    }
}

// When any word is refused, the old content is restored. When the connection ends at any word, the area has the old
// content, the new content, or a wrong checksum.
TEST(EepromWrite, AnAbortAtAnyWordLeavesARightChecksumOrTheOldContent) {
    const auto old = image(1);
    auto wanted = image(2000000000);
    for (std::size_t i = 0; i < 14; ++i) wanted[i] = static_cast<std::byte>(7 * i + 1);
    wanted[14] = static_cast<std::byte>(sii::checksum(wanted));
    for (std::uint32_t word = 0; word < 512; ++word) {
        if (load_le<std::uint16_t>(old, word * 2) == load_le<std::uint16_t>(wanted, word * 2)) continue;
        FaultyEeprom eeprom(old);
        eeprom.refused_word = word;
        const auto report = write_eeprom(eeprom, wanted, no_progress());
        EXPECT_EQ(report.error, fmt::format("it is uncertain whether word 0x{:04x} was written: refused", word));
        EXPECT_TRUE(report.restored) << word;
        EXPECT_EQ(eeprom.octets, old) << word;
    }
    FaultyEeprom whole(old);
    const auto different = write_eeprom(whole, wanted, no_progress()).different;
    for (std::size_t words = 0; words <= different; ++words) {
        FaultyEeprom eeprom(old);
        eeprom.lost_after_words = words;
        (void)write_eeprom(eeprom, wanted, no_progress());
        const auto area = Bytes(eeprom.octets).first(16);
        const bool is_old = std::equal(area.begin(), area.end(), old.begin());
        const bool is_new = std::equal(area.begin(), area.end(), wanted.begin());
        EXPECT_TRUE(is_old || is_new || !sii::checksum_right(area)) << words;
        EXPECT_TRUE(words > different - 8 || is_old) << words;
    }
}

TEST(EepromWrite, VerifyFindsAWordThatDidNotStick) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    eeprom.forgotten_word = 0x0A;
    const auto report = write_eeprom(eeprom, image(0x1234), no_progress());
    EXPECT_FALSE(report.verified);
    EXPECT_EQ(report.error.find("word 0x000a reads 0xffff, written was 0x1234 (1 of 512 words are wrong"), 0U)
        << report.error;
}

// A small EEPROM accepts all words, and words behind its end overwrite its beginning.
TEST(EepromWrite, VerifyFindsAnEepromThatWrapsAround) {
    FaultyEeprom eeprom(std::vector<std::byte>(512, std::byte{0xFF}));
    std::vector<std::byte> large(1024);
    const std::string names[] = {std::string(200, 'a'), std::string(200, 'b'), std::string(200, 'c')};
    ASSERT_TRUE(sii::write_image({.group = names[0], .order = names[1], .name = names[2]}, large).ok());
    const auto report = write_eeprom(eeprom, large, no_progress());
    EXPECT_FALSE(report.verified);
    EXPECT_NE(report.error.find("the EEPROM is probably smaller than its size word says"), std::string::npos)
        << report.error;
}

TEST(EepromWrite, StopsBetweenWords) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    const auto report = write_eeprom(eeprom, image(2), [&](std::string_view what, std::size_t done, std::size_t) {
        return !(what == "writing" && done >= 16);
    });
    EXPECT_EQ(report.error, "stopped");
    EXPECT_FALSE(report.verified);
    EXPECT_GE(report.written, 16U);
    EXPECT_LT(report.written, 24U);
    EXPECT_TRUE(report.restored);
    EXPECT_TRUE(sii::is_blank(eeprom.octets));
}

TEST(EepromWrite, ProgressGoesOnlyForward) {
    FaultyEeprom eeprom(std::vector<std::byte>(1024, std::byte{0xFF}));
    std::string last_what;
    std::size_t last = 0;
    std::vector<std::string> phases;
    const auto report = write_eeprom(eeprom, image(2), [&](std::string_view what, std::size_t done, std::size_t total) {
        if (what != last_what) phases.emplace_back(what);
        EXPECT_TRUE(what != last_what || done >= last);
        EXPECT_LE(done, total);
        last_what = what;
        last = done;
        return true;
    });
    EXPECT_TRUE(report.verified);
    EXPECT_EQ(phases, (std::vector<std::string>{"reading", "writing", "verifying"}));
}

TEST(EepromWrite, AnEepromThatCannotBeKeptIsNotVerified) {
    FaultyEeprom eeprom(image(1));
    eeprom.keep_error = "disk full";
    const auto report = write_eeprom(eeprom, image(2), no_progress());
    EXPECT_EQ(report.error, "disk full");
    EXPECT_FALSE(report.verified);
}

TEST(EepromSize, IsToldByItsWord) {
    FaultyEeprom eeprom(image(1));
    EXPECT_EQ(eeprom_size(eeprom).octets, 1024U);
    FaultyEeprom blank(std::vector<std::byte>(1024, std::byte{0xFF}));
    EXPECT_EQ(eeprom_size(blank).octets, 0U);
    EXPECT_NE(eeprom_size(blank).error.find("--size"), std::string::npos);
    eeprom.lost_after_words = 0;
    EXPECT_EQ(eeprom_size(eeprom).error, "no answer");
}

TEST(EepromAlias, IsWrittenWithItsChecksum) {
    FaultyEeprom eeprom(image(1));
    EXPECT_EQ(write_alias(eeprom, 0xABCD, false).error, "");
    EXPECT_TRUE(sii::checksum_right(eeprom.octets));
    EXPECT_EQ(sii::load_configuration(eeprom.octets).alias, 0xABCD);
    EXPECT_EQ(read_alias(eeprom).after, 0xABCD);
    const auto second = write_alias(eeprom, 1, false);
    EXPECT_EQ(second.before, 0xABCD);
    EXPECT_EQ(second.after, 1);
    for (const auto word : eeprom.order) EXPECT_TRUE(word == 4 || word == 7) << word;  // no other word is written
}

TEST(EepromAlias, DoesNotVouchForAnAreaThatIsWrong) {
    FaultyEeprom eeprom(image(1));
    eeprom.octets[0] ^= std::byte{1};
    const auto report = write_alias(eeprom, 5, false);
    EXPECT_NE(report.error.find("--force"), std::string::npos) << report.error;
    EXPECT_EQ(eeprom.words_written, 0U);
    EXPECT_EQ(write_alias(eeprom, 5, true).error, "");
    EXPECT_TRUE(sii::checksum_right(eeprom.octets));

    FaultyEeprom blank(std::vector<std::byte>(1024, std::byte{0xFF}));
    EXPECT_NE(write_alias(blank, 5, false).error.find("blank"), std::string::npos);
    EXPECT_EQ(blank.words_written, 0U);
}

TEST(EepromAlias, LostBetweenAliasAndChecksum) {
    FaultyEeprom eeprom(image(1));
    eeprom.lost_after_words = 1;
    const auto error = write_alias(eeprom, 5, false).error;
    EXPECT_TRUE(error.starts_with("it is uncertain whether word 0x0007 was written: no answer\nthe present content"))
        << error;
}

TEST(EepromAlias, AChecksumThatIsRefusedGivesTheOldAliasBack) {
    FaultyEeprom eeprom(image(1));
    eeprom.refused_word = 7;
    EXPECT_EQ(write_alias(eeprom, 5, false).error,
              "it is uncertain whether word 0x0007 was written: refused\nthe old content was restored");
    EXPECT_EQ(eeprom.octets, image(1));
}

// The size word gives 4 MiB: only the described part is read.
TEST(EepromReadDescribed, StopsAtTheEndMark) {
    FaultyEeprom eeprom(image(1));
    const auto content = [&] {
        store_le<std::uint16_t>(MutableBytes(eeprom.octets), sii::word::kSize * 2, 0x7FFF);
        return read_used_part(eeprom, no_progress());
    }();
    EXPECT_EQ(content.error, "");
    ASSERT_GT(content.octets.size(), 130U);
    EXPECT_LT(content.octets.size(), 300U);
    EXPECT_EQ(load_le<std::uint16_t>(content.octets, content.octets.size() - 2), 0xFFFF);
    EXPECT_EQ(eeprom.last_read, content.octets.size());
    sii::CategoryWalker walker(content.octets);
    while (walker.next()) continue;
    EXPECT_EQ(walker.fault(), sii::Fault::none);
}

// Reading the categories stops at 64 KiB, whatever their lengths say.
TEST(EepromReadDescribed, HasABoundWhateverTheImageSays) {
    for (const auto words : {std::uint16_t{0}, std::uint16_t{1}, std::uint16_t{0x7FFF}, std::uint16_t{0xFFFF}}) {
        FaultyEeprom eeprom(image(1, 256 * 1024));
        store_le<std::uint16_t>(MutableBytes(eeprom.octets), sii::word::kSize * 2, 0xFFFE);
        for (std::size_t at = sii::word::kCategories * 2; at + 4 <= eeprom.octets.size();
             at += 4 + std::size_t{2} * words) {
            store_le<std::uint16_t>(MutableBytes(eeprom.octets), at, 0x0801);
            store_le<std::uint16_t>(MutableBytes(eeprom.octets), at + 2, words);
        }
        EXPECT_EQ(read_used_part(eeprom, no_progress()).error, "");
        EXPECT_LE(eeprom.last_read, sii::kMostContentBytes) << words;
    }
}

TEST(WhyNotToWrite, OnlyWhatIsGravelyWrong) {
    const auto good = image(1);
    EXPECT_EQ(image_fault(good), "");
    EXPECT_EQ(image_fault(Bytes(good).first(600)), "");  // without the unused end of the EEPROM
    EXPECT_NE(image_fault(Bytes(good).first(130)), "");
    EXPECT_NE(image_fault(Bytes(good).first(601)), "");
    EXPECT_NE(image_fault({}), "");
    EXPECT_NE(image_fault(std::vector<std::byte>(1024, std::byte{0xFF})), "");
    auto wrong = good;
    wrong[14] ^= std::byte{1};
    EXPECT_NE(image_fault(wrong).find("checksum"), std::string::npos);
    auto longer = good;
    longer.resize(2048);
    EXPECT_NE(image_fault(longer).find("size"), std::string::npos);
    auto odd_mailbox = good;  // a fault that the user may write
    odd_mailbox[sii::word::kMailboxProtocols * 2] = std::byte{4};
    EXPECT_EQ(image_fault(odd_mailbox), "");
}

struct ImageFiles : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-image-" + std::to_string(::getpid()));
    ImageFiles() { std::filesystem::create_directories(folder); }
    ~ImageFiles() override { std::filesystem::remove_all(folder); }
    [[nodiscard]] std::string file(const std::string& name) const { return folder / name; }
    [[nodiscard]] std::size_t files() const {
        return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
    }
};

TEST_F(ImageFiles, ComeBackAsTheyWere) {
    const auto octets = image(3);
    for (const auto format : {ImageFormat::binary, ImageFormat::intel_hex}) {
        EXPECT_EQ(save_image(file("x"), format, octets), "");
        const auto back = load_image(file("x"));
        EXPECT_EQ(back.error, "");
        EXPECT_EQ(back.octets, octets);
        EXPECT_EQ(back.format, format);
        EXPECT_EQ(files(), 1U);
    }
    EXPECT_EQ(format_by_name("a.hex"), ImageFormat::intel_hex);
    EXPECT_EQ(format_by_name("dir.hex/a.IHX"), ImageFormat::intel_hex);
    EXPECT_EQ(format_by_name("a.bin"), ImageFormat::binary);
    EXPECT_EQ(format_by_name("-"), ImageFormat::binary);
}

TEST_F(ImageFiles, FailWithTheirName) {
    EXPECT_EQ(load_image(file("none")).error, file("none") + ": cannot be read: No such file or directory");
    EXPECT_NE(load_image(folder).error, "");
    std::ofstream(file("empty")).close();
    EXPECT_EQ(load_image(file("empty")).error, file("empty") + ": the file is empty");
    std::ofstream(file("bad.hex")) << ":00000001FE\n";
    EXPECT_EQ(load_image(file("bad.hex")).error.find(file("bad.hex") + ": line 1: the checksum"), 0U);
    EXPECT_EQ(save_image(file("no/x"), ImageFormat::binary, image(1)),
              file("no/x") + ": cannot be written: No such file or directory");
    if (std::filesystem::exists("/dev/full")) {
        EXPECT_EQ(save_image("/dev/full", ImageFormat::binary, image(1)),
                  "/dev/full: cannot be written: No space left on device");
        EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));  // a device file is written, not replaced
    }
}

TEST_F(ImageFiles, KeepTheirModeAndTheirLinks) {
    EXPECT_EQ(save_image(file("x"), ImageFormat::binary, image(1)), "");
    std::filesystem::permissions(file("x"), std::filesystem::perms{0640});
    std::filesystem::create_symlink("x", file("link"));
    EXPECT_EQ(save_image(file("link"), ImageFormat::binary, image(2)), "");
    EXPECT_TRUE(std::filesystem::is_symlink(file("link")));
    EXPECT_EQ(load_image(file("x")).octets, image(2));
    EXPECT_EQ(std::filesystem::status(file("x")).permissions(), std::filesystem::perms{0640});
}

TEST_F(ImageFiles, AreEeproms) {
    EXPECT_EQ(save_image(file("x.hex"), ImageFormat::intel_hex, image(1)), "");
    FileEeprom eeprom(file("x.hex"), load_image(file("x.hex")));
    EXPECT_EQ(eeprom_size(eeprom).octets, 1024U);
    EXPECT_TRUE(write_eeprom(eeprom, image(2), no_progress()).verified);
    const auto back = load_image(file("x.hex"));
    EXPECT_EQ(back.octets, image(2));
    EXPECT_EQ(back.format, ImageFormat::intel_hex);
    std::array<std::byte, 4> words{};
    EXPECT_NE(eeprom.read(511, words), "");
    EXPECT_NE(eeprom.write(511, words).error, "");
    EXPECT_EQ(eeprom.read(510, words), "");
}

}  // namespace
}  // namespace margay::samples
