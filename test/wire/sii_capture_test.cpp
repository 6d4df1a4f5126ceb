// The SII data that other masters read from real slaves. The test collects them from the output of tshark, reads them
// with our readers, and compares them with the values that these masters wrote to the SyncManagers of the slaves.
#include <places.hpp>
#include "sii_image.hpp"
#include "wire/sii_category.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <sstream>

namespace margay::wire::sii {
namespace {

// The output of tshark for replies: one line per frame, one column per field.
std::vector<std::vector<std::string>> printed(const std::string& capture, const std::string& filter,
                                              const std::vector<std::string>& fields) {
    std::string command = "tshark -n -r '" + (std::filesystem::path(MARGAY_CAPTURES_DIR) / capture).string() +
                          "' -Y '" + filter + "' -T fields";
    for (const auto& field : fields) command += " -e " + field;
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen((command + " 2>/dev/null").c_str(), "r"), pclose);
    std::string all;
    std::array<char, 4096> block{};
    while (const auto n = pipe ? std::fread(block.data(), 1, block.size(), pipe.get()) : 0) all.append(block.data(), n);
    std::vector<std::vector<std::string>> out;
    std::istringstream lines(all);
    for (std::string line; std::getline(lines, line);) {
        out.emplace_back();
        std::istringstream columns(line);
        for (std::string column; std::getline(columns, column, '\t');) out.back().push_back(column);
        out.back().resize(fields.size());
    }
    return out;
}

unsigned number(const std::string& text) { return static_cast<unsigned>(std::stoul(text, nullptr, 0)); }

// The EEPROM words of a slave that were read; other words are 0xFFFF.
class SeenEeprom {
  public:
    void see(std::uint32_t at, std::uint16_t value) {
        if (image_.size() < (at + 1) * 2) image_.resize((at + 1) * 2, std::byte{0xFF});
        if (seen_.size() <= at) seen_.resize(at + 1);
        store_le(image_, at * 2, value);
        seen_[at] = true;
    }
    [[nodiscard]] Bytes words(std::uint32_t at, std::size_t count) const {
        for (std::size_t i = at; i < at + count; ++i) EXPECT_TRUE(i < seen_.size() && seen_[i]) << "word " << i;
        return Bytes(image_).subspan(at * 2, count * 2);
    }
    // Follows the chain of categories as far as its headers were read.
    [[nodiscard]] std::map<std::uint16_t, CategoryPlace> categories() const {
        std::map<std::uint16_t, CategoryPlace> out;
        CategoryChain chain(0x400);
        while (chain.more() && chain.header_word() + 1 < seen_.size() && seen_[chain.header_word() + 1]) {
            const auto place = chain.step(words(chain.header_word(), 2));
            if (!place) break;
            out[place->type] = *place;
        }
        return out;
    }

  private:
    std::vector<std::byte> image_;
    std::vector<bool> seen_;
};

std::map<unsigned, SeenEeprom> eeproms_in(const std::string& capture) {
    std::map<unsigned, SeenEeprom> out;
    std::map<unsigned, std::uint32_t> asked;
    for (const auto& line : printed(capture, "ecat.cnt == 1 && (ecat.ado == 0x0502 || ecat.ado == 0x0508)",
                                    {"ecat.cmd", "ecat.adp", "ecat.reg.addrl", "ecat.reg.data0", "ecat.reg.data1",
                                     "ecat.reg.data2", "ecat.reg.data3"})) {
        const auto slave = number(line[1]);
        if (number(line[0]) == 5 && !line[2].empty()) asked[slave] = number(line[2]);
        if (number(line[0]) != 4) continue;
        for (std::uint32_t i = 0; i < 4; ++i)
            if (!line[3 + i].empty()) out[slave].see(asked[slave] + i, static_cast<std::uint16_t>(number(line[3 + i])));
    }
    return out;
}

// The values written to the SyncManagers of a slave, by number.
struct WrittenSyncManager {
    unsigned start = 0, length = 0, control = 0, activate = 0;
};
std::map<unsigned, WrittenSyncManager> sync_managers_written(const std::string& capture, unsigned slave) {
    std::map<unsigned, WrittenSyncManager> out;
    const auto split = [](const std::string& list) {
        std::vector<unsigned> values;
        std::istringstream in(list);
        for (std::string value; std::getline(in, value, ',');) values.push_back(number(value));
        return values;
    };
    for (const auto& line :
         printed(capture,
                 "ecat.cmd == 5 && ecat.cnt == 1 && ecat.ado >= 0x0800 && ecat.ado < 0x0880 && ecat.adp == " +
                     std::to_string(slave),
                 {"ecat.ado", "ecat.syncman.start", "ecat.syncman.len", "ecat.syncman.ctrlstatus",
                  "ecat.syncman.smenable"})) {
        const auto starts = split(line[1]), lengths = split(line[2]), controls = split(line[3]),
                   enables = split(line[4]);
        const auto first = (number(line[0]) - 0x0800) / 8;
        for (unsigned i = 0; i < starts.size(); ++i)
            out[first + i] = {starts[i], lengths[i], controls[i] & 0xFF, enables[i] & 0xFF};
    }
    return out;
}

class SiiCaptures : public ::testing::Test {
  protected:
    void SetUp() override {
        if (std::string_view(MARGAY_CAPTURES_DIR).empty())
            GTEST_SKIP() << "MARGAY_CAPTURES_DIR is not set: no captures";
        if (std::system("command -v tshark >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
    }

    // Compares the SyncManagers of the SII with the SyncManagers that the master configured. Lengths of 0 come from the
    // PDOs.
    static void expect_as_written(const std::string& capture, unsigned slave, Bytes content, std::size_t count) {
        const auto written = sync_managers_written(capture, slave);
        ASSERT_EQ(written.size(), count);
        SyncManagers managers(content);
        for (unsigned i = 0; const auto manager = managers.next(); ++i) {
            SCOPED_TRACE(i);
            ASSERT_TRUE(written.contains(i));
            EXPECT_EQ(manager->start, written.at(i).start);
            if (manager->length_bytes != 0) {
                EXPECT_EQ(manager->length_bytes, written.at(i).length);
            }
            EXPECT_EQ(manager->control, written.at(i).control);
            EXPECT_EQ(manager->enable & sm_enable::kEnable, written.at(i).activate);
        }
    }
};

TEST_F(SiiCaptures, Lan9252Board) {
    const std::string capture = "soem-single-lan9252.pcapng";
    const auto eeproms = eeproms_in(capture);
    ASSERT_EQ(eeproms.size(), 1U);
    const auto& eeprom = eeproms.at(0x1001);
    const auto identity = eeprom.words(word::kIdentity, 6);
    EXPECT_EQ(load_le<std::uint32_t>(identity, 0), 9U);       // vendor: Microchip
    EXPECT_EQ(load_le<std::uint32_t>(identity, 4), 0x9252U);  // the number in the name of the chip
    const auto mailbox = eeprom.words(word::kMailbox, 5);
    EXPECT_EQ(load_le<std::uint16_t>(mailbox, 8), mailbox_protocol::kCoE);

    const auto categories = eeprom.categories();
    ASSERT_TRUE(categories.contains(category::kSyncManager));
    const auto place = categories.at(category::kSyncManager);
    EXPECT_EQ(place.words, 16);
    const auto content = eeprom.words(place.word, place.words);
    expect_as_written(capture, 0x1001, content, 4);
    SyncManagers managers(content);
    const auto out = managers.next().value_or(SmInfo{});
    EXPECT_EQ(out.type, SmType::mailbox_out);
    EXPECT_EQ(out.start, load_le<std::uint16_t>(mailbox, 0));
    EXPECT_EQ(out.length_bytes, load_le<std::uint16_t>(mailbox, 2));
    const auto in = managers.next().value_or(SmInfo{});
    EXPECT_EQ(in.type, SmType::mailbox_in);
    EXPECT_EQ(in.start, load_le<std::uint16_t>(mailbox, 4));
    EXPECT_EQ(in.length_bytes, load_le<std::uint16_t>(mailbox, 6));
    EXPECT_EQ(managers.next().value_or(SmInfo{}).type, SmType::outputs);
    EXPECT_EQ(managers.next().value_or(SmInfo{}).type, SmType::inputs);

    const auto strings = categories.at(category::kStrings);
    const auto name = string(eeprom.words(strings.word, 9), 1);
    EXPECT_EQ(text(name.value), "LAN9252-EVB-HBI");
    FmmuUses uses(eeprom.words(categories.at(category::kFmmu).word, 2));
    EXPECT_EQ(uses.next(), FmmuUse::outputs);
    EXPECT_EQ(uses.next(), FmmuUse::inputs);
    EXPECT_EQ(uses.next(), FmmuUse::mailbox_status);
}

TEST_F(SiiCaptures, DigitalInputTerminal) {
    const std::string capture = "soem-sdinfo-ek1100-el1004.pcapng";
    const auto eeproms = eeproms_in(capture);
    ASSERT_EQ(eeproms.size(), 2U);
    const auto& eeprom = eeproms.at(0x1002);
    const auto categories = eeprom.categories();
    std::vector<unsigned> types;
    for (const auto& [type, place] : categories) types.push_back(type);
    EXPECT_EQ(types, (std::vector<unsigned>{10, 30, 40, 41, 43, 50}));
    const auto general = parse_general(eeprom.words(categories.at(category::kGeneral).word, 10)).value;
    EXPECT_EQ(general.ebus_current_ma, 90);  // from the catalogue
    EXPECT_EQ(physical_port(general, 0), PhysicalPort::ebus);
    expect_as_written(capture, 0x1002, eeprom.words(categories.at(category::kSyncManager).word, 4), 1);

    // SOEM does not read the index and name words of an entry. It reads the lengths and configures their sum: one
    // octet of inputs.
    const auto place = categories.at(category::kTxPdo);
    unsigned bits = 0;
    for (std::uint32_t at = place.word; at < place.word + place.words; at += 8) {
        EXPECT_EQ(load_le<std::uint16_t>(eeprom.words(at, 1)), 0x1A00 + (at - place.word) / 8);
        EXPECT_EQ(load_le<std::uint8_t>(eeprom.words(at + 1, 1)), 1);  // entries
        bits += load_le<std::uint8_t>(eeprom.words(at + 6, 1), 1);
    }
    EXPECT_EQ(bits, 4U);
    EXPECT_EQ(sync_managers_written(capture, 0x1002).at(0).length, (bits + 7) / 8);
}

TEST_F(SiiCaptures, DriveWithVendorSpecificCategories) {
    const std::string capture = "soem-sdinfo-akd.pcapng";
    const auto eeproms = eeproms_in(capture);
    const auto& eeprom = eeproms.at(0x1001);
    const auto categories = eeprom.categories();
    EXPECT_TRUE(categories.contains(0x0800));
    EXPECT_TRUE(categories.contains(0x0801));
    const auto place = categories.at(category::kSyncManager);
    expect_as_written(capture, 0x1001, eeprom.words(place.word, place.words), 4);
}

// The images beside the recordings come from the same kinds of devices: their categories are at the words where the
// masters found them.
TEST_F(SiiCaptures, HaveTheCategoriesOfTheImages) {
    if (!have_images()) GTEST_SKIP() << "MARGAY_SII_DIR is not set: no images of real devices";
    const auto expect_same = [](const std::string& capture, unsigned slave, const std::string& file,
                                std::size_t least) {
        SCOPED_TRACE(file);
        const auto image = image_of(file);
        std::map<std::uint16_t, CategoryPlace> in_image;
        CategoryWalker walker(image);
        while (const auto found = walker.next()) in_image[found->place.type] = found->place;
        const auto eeproms = eeproms_in(capture);
        const auto seen = eeproms.at(slave).categories();
        ASSERT_GE(seen.size(), least);
        for (const auto& [type, place] : seen) {
            ASSERT_TRUE(in_image.contains(type)) << type;
            EXPECT_EQ(in_image.at(type).word, place.word) << type;
            EXPECT_EQ(in_image.at(type).words, place.words) << type;
        }
    };
    expect_same("replay-dc.pcapng", 0x1001, "el2828.bin", 6);
    expect_same("replay-dc.pcapng", 0x1002, "el2889.bin", 6);
    expect_same("rs-example-sii-el2004.pcapng", 0x1001, "el2004.bin", 5);
    expect_same("soem-sdinfo-akd.pcapng", 0x1001, "akd.bin", 5);
}

}  // namespace
}  // namespace margay::wire::sii
