// pcapng files octet by octet: sections of both byte orders, units of time, interfaces that are not Ethernet, and what
// contradicts the format.
#include "files.hpp"
#include "oshw/pcap/packet_reader.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace margay {
namespace {

using namespace std::chrono_literals;
using Direction = PacketOrigin::Direction;

constexpr std::uint16_t kCooked = 113;  // Linux "any"
constexpr std::uint16_t kWireless = 127;

// A section in one of the two byte orders.
class Section {
  public:
    explicit Section(bool big_endian = false) : big_endian_(big_endian) {
        text_ = block(0x0A0D0D0A, w(0x1A2B3C4D) + h(1) + h(0) + w(0xFFFFFFFF) + w(0xFFFFFFFF));
    }
    Section& interface(std::uint16_t link_type, const std::string& options = {}, std::uint32_t most_octets = 0) {
        text_ += block(1, h(link_type) + h(0) + w(most_octets) + options);
        return *this;
    }
    Section& packet(std::uint32_t interface, std::uint64_t time, const std::string& data,
                    const std::string& options = {}) {
        const auto size = static_cast<std::uint32_t>(data.size());
        text_ += block(6, w(interface) + w(static_cast<std::uint32_t>(time >> 32)) +
                              w(static_cast<std::uint32_t>(time)) + w(size) + w(size) + padded(data) + options);
        return *this;
    }
    Section& add(std::uint32_t type, const std::string& body) {
        text_ += block(type, body);
        return *this;
    }
    [[nodiscard]] std::string option(std::uint16_t code, const std::string& value) const {
        return h(code) + h(static_cast<std::uint16_t>(value.size())) + padded(value);
    }
    [[nodiscard]] std::string resolution(unsigned value) const {
        return option(9, std::string(1, static_cast<char>(value)));
    }
    [[nodiscard]] std::string h(std::uint16_t value) const {
        auto text = word16(value);
        if (big_endian_) std::ranges::reverse(text);
        return text;
    }
    [[nodiscard]] std::string w(std::uint32_t value) const {
        auto text = word32(value);
        if (big_endian_) std::ranges::reverse(text);
        return text;
    }
    [[nodiscard]] std::string d(std::uint64_t value) const {
        const auto low = w(static_cast<std::uint32_t>(value));
        const auto high = w(static_cast<std::uint32_t>(value >> 32));
        return big_endian_ ? high + low : low + high;
    }
    [[nodiscard]] std::string block(std::uint32_t type, const std::string& body) const {
        const auto length = static_cast<std::uint32_t>(padded(body).size() + 12);
        return w(type) + w(length) + padded(body) + w(length);
    }
    [[nodiscard]] const std::string& text() const { return text_; }

  private:
    static std::string padded(std::string text) {
        text.resize((text.size() + 3) / 4 * 4);
        return text;
    }
    bool big_endian_;
    std::string text_;
};

struct Read {
    Duration at{};
    std::uint64_t number = 0;
    std::string data{};
    PacketOrigin origin{};
    std::size_t length_on_wire = 0;
};

struct PcapngReading : testing::Test {
    TemporaryFolder folder;
    PacketReader reader;

    std::vector<Read> read(const std::string& content) {
        std::vector<Read> all;
        EXPECT_TRUE(reader.open(folder.write("x.pcapng", content)).ok()) << reader.problem();
        while (const auto p = reader.next())
            all.push_back({p->at, p->number, octets(p->bytes), p->origin, p->length_on_wire});
        EXPECT_FALSE(reader.next()) << "the end stays the end";
        return all;
    }
    void says(const std::string& content, const std::string& what) {
        (void)read(content);
        EXPECT_NE(reader.problem().find(what), std::string::npos) << reader.problem() << "\n" << what;
    }
};

TEST_F(PcapngReading, ReadsSectionsOfBothByteOrders) {
    for (const bool big_first : {false, true}) {
        Section first(big_first);
        Section second(!big_first);
        first.interface(1, first.resolution(6)).packet(0, 5'000'000'007, "one", first.option(2, first.w(1)));
        second.interface(1, second.resolution(9) + second.option(14, second.d(4000)))
            .interface(1)
            .packet(0, 1'000'000'009'123, "second", second.option(2, second.w(2)))
            .packet(1, 5'000'000'008, "third");
        const auto all = read(first.text() + second.text());
        EXPECT_EQ(reader.problem() + reader.cut_off() + reader.left_out(), "");
        ASSERT_EQ(all.size(), 3U);
        EXPECT_EQ(all[0].data, "one");
        EXPECT_EQ(all[0].at, 0ns);
        EXPECT_EQ(all[0].origin.direction, Direction::received);
        EXPECT_EQ(all[1].data, "second");
        EXPECT_EQ(all[1].at, 2'123ns) << "4000 s of the interface, and 1000.000009123 s of the packet";
        EXPECT_EQ(all[1].origin.direction, Direction::sent);
        EXPECT_EQ(all[2].at, 1us);
        EXPECT_EQ(all[2].origin.interface, 1U);
        EXPECT_EQ(all[2].number, 3U);
    }
}

TEST_F(PcapngReading, ReadsEveryUnitOfTime) {
    struct Case {
        unsigned resolution;
        std::uint64_t begin, end;
        Duration between;
    };
    for (const auto& c :
         {Case{0, 7, 9, 2s}, Case{3, 7, 9, 2ms}, Case{9, 0x7FFF'FFFF'FFFF'FFF0, 0x7FFF'FFFF'FFFF'FFF9, 9ns},
          Case{12, 1'000'000'000'999, 1'000'000'001'001, 1ns},
          Case{19, 0xFFFF'FFFF'FFFF'0000, 0xFFFF'FFFF'FFFF'FFFF, 0ns}, Case{0x80, 7, 9, 2s},
          Case{0x80 + 10, 1024, 1024 + 512, 500ms}, Case{0x80 + 34, 0, std::uint64_t{1} << 33, 500ms},
          Case{0x80 + 63, 0, std::uint64_t{1} << 62, 500ms}, Case{0x80 + 63, 0, ~std::uint64_t{0}, 2s - 1ns}}) {
        Section s;
        s.interface(1, s.resolution(c.resolution)).packet(0, c.begin, "a").packet(0, c.end, "b");
        const auto all = read(s.text());
        ASSERT_EQ(all.size(), 2U) << c.resolution << reader.problem();
        EXPECT_EQ(all[1].at, c.between) << c.resolution;
    }
    for (const unsigned resolution : {20U, 127U, 0x80U + 64, 0xFFU}) {
        Section s;
        says(s.interface(1, s.resolution(resolution)).packet(0, 1, "a").text(), "interface 0 counts time in units of");
    }
}

TEST_F(PcapngReading, LeavesOutWhatIsNotEthernet) {
    Section s;
    s.interface(kCooked, s.option(2, "any"))
        .interface(1, s.option(2, "eth0"))
        .interface(kWireless, s.resolution(99))
        .interface(1, s.option(2, "eth1"));
    s.packet(0, 10, "cooked").packet(1, 12, "first").packet(2, ~std::uint64_t{0}, "air").packet(3, 15, "second");
    const auto all = read(s.text());
    EXPECT_EQ(reader.problem() + reader.cut_off(), "");
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].data, "first");
    EXPECT_EQ(all[0].number, 2U) << "as in Wireshark";
    EXPECT_EQ(all[0].at, 2us) << "since the first packet, as in Wireshark";
    EXPECT_EQ(all[0].origin.interface, 0U);
    EXPECT_EQ(all[1].data, "second");
    EXPECT_EQ(all[1].number, 4U);
    EXPECT_EQ(all[1].origin.interface, 1U);
    EXPECT_EQ(reader.packets(), 4U);
    EXPECT_EQ(reader.interfaces(), (std::vector<std::uint32_t>{1, 3}));
    EXPECT_EQ(reader.left_out(),
              "interface 0 (any, link type Linux cooked v1, 1 packet), "
              "interface 2 (link type 802.11 plus radiotap header, 1 packet)");
}

// The clock of the interface that is left out is not set yet. This is no damage of the Ethernet packets.
TEST_F(PcapngReading, TheClockOfAnInterfaceThatIsLeftOutMayBeFarAway) {
    constexpr std::uint64_t kToday = 1'790'000'000'000'000;
    Section s;
    s.interface(kCooked, s.option(2, std::string(5000, 'n'))).interface(1);
    s.packet(0, 0, "cooked").packet(1, kToday, "first").packet(0, 0, "cooked").packet(1, kToday + 7, "second");
    const auto all = read(s.text());
    ASSERT_EQ(all.size(), 2U) << reader.problem();
    EXPECT_EQ(all[0].at, 0ns);
    EXPECT_EQ(all[1].at, 7us);
    EXPECT_EQ(reader.left_out(), "interface 0 (" + std::string(64, 'n') + ", link type Linux cooked v1, 2 packets)");
    Section damaged;
    damaged.interface(1).packet(0, 0, "x").packet(0, kToday, "y");
    says(damaged.text(), "packet 2 is years away from the first");
}

TEST_F(PcapngReading, AnInterfaceOfSeveralSectionsIsNamedOnce) {
    Section s;
    s.interface(1).interface(kCooked).packet(1, 1, "x").packet(1, 1, "y");
    (void)read(s.text() + s.text());
    EXPECT_EQ(reader.left_out(), "interface 1 (link type Linux cooked v1, 4 packets)");
    Section many;
    many.interface(1);
    for (unsigned n = 0; n < 500; ++n) many.interface(kCooked).packet(n + 1, 1, "x");
    (void)read(many.text());
    EXPECT_TRUE(reader.left_out().ends_with("interface 8 (link type Linux cooked v1, 1 packet) and 56 more"))
        << reader.left_out();
}

TEST_F(PcapngReading, AFileWithoutAnEthernetInterfaceSaysSo) {
    Section one;
    says(one.interface(kCooked).packet(0, 1, "x").text(), "its link type is Linux cooked v1, not Ethernet");
    Section two;
    says(two.interface(kCooked).interface(kWireless).packet(0, 1, "x").text(),
         "it has no Ethernet interface: interface 0");
    says(two.text().substr(0, two.text().size() - 3), "it has no Ethernet interface: interface 0");
    EXPECT_TRUE(read(Section().text()).empty());
    EXPECT_EQ(reader.problem(), "");
}

// A packet block without time belongs to the first interface, and the interface says how much was recorded.
TEST_F(PcapngReading, ReadsPacketsOfOlderForms) {
    for (const bool big_endian : {false, true}) {
        Section s(big_endian);
        s.interface(1, {}, 4).interface(1).packet(1, 100, "packet");
        s.add(3, s.w(6) + "simp");
        s.add(2, s.h(1) + s.h(0) + s.w(0) + s.w(109) + s.w(3) + s.w(3) + "old");
        const auto all = read(s.text());
        ASSERT_EQ(all.size(), 3U) << reader.problem();
        EXPECT_EQ(all[1].data, "simp");
        EXPECT_EQ(all[1].length_on_wire, 6U);
        EXPECT_EQ(all[1].origin.interface, 0U);
        EXPECT_EQ(all[1].at, 0ns);
        EXPECT_EQ(reader.untimed(), 1U);
        EXPECT_EQ(all[2].data, "old");
        EXPECT_EQ(all[2].at, 9us);
        EXPECT_EQ(all[2].origin.interface, 1U);
    }
}

// Recorders write different limits for their interfaces.
TEST_F(PcapngReading, TheLimitsOfInterfacesMayDiffer) {
    Section s;
    s.interface(1, {}, 262'144).interface(1, {}, 65'535).packet(0, 1, "a").packet(1, 2, "b");
    EXPECT_EQ(read(s.text()).size(), 2U) << reader.problem();
}

TEST_F(PcapngReading, CountsWhatTheRecorderHasDroppedOfEthernetInterfaces) {
    Section s(true);
    s.interface(1).interface(kCooked).packet(0, 1, "x");
    for (const std::uint32_t interface : {0U, 1U, 7U})
        for (const std::uint64_t count : {3U, 5U})
            s.add(5, s.w(interface) + s.w(0) + s.w(0) + s.option(5, s.d(count)) + s.option(7, s.d(100)));
    (void)read(s.text());
    EXPECT_EQ(reader.dropped(), 105U);
}

TEST_F(PcapngReading, SaysWhatContradictsTheFormat) {
    Section good;
    good.interface(1).packet(0, 1, "good");
    Section s;
    const auto behind = [&](const std::string& block, const std::string& what) {
        says(good.text() + block, "it breaks off or is damaged behind packet 1 (" + what);
    };
    behind(s.w(6) + s.w(8) + s.w(8), "a block of 8 octets)");
    behind(s.w(0) + s.w(0) + s.w(0), "a block of 0 octets)");
    behind(s.w(6) + s.w(0xFFFFFFF0) + std::string(100, 'x'), "a block of 4294967280 octets)");
    behind(s.w(6) + s.w(33) + std::string(100, 'x'), "a block of 33 octets)");
    behind(s.w(6) + s.w(16) + std::string(8, 'x'), "the two lengths of a block differ)");
    behind(s.block(6, std::string(16, '\0')), "a packet without its length)");
    behind(s.block(3, ""), "a packet without its length)");
    behind(s.block(6, s.w(0) + s.w(0) + s.w(0) + s.w(9) + s.w(9) + "12345678"),
           "a packet of 9 octets, which is longer than its block)");
    behind(s.block(6, s.w(0) + s.w(0) + s.w(0) + s.w(0xFFFFFFFF) + s.w(9) + "12345678"),
           "a packet of 4294967295 octets, which is longer than its block)");
    behind(s.block(3, s.w(0xFFFFFFFF) + "1234"), "a packet of 4294967295 octets, which is longer than its block)");
    behind(s.block(6, s.w(1) + s.w(0) + s.w(0) + s.w(0) + s.w(0)), "a packet of interface 1, which the file does not");
    behind(s.block(1, ""), "an interface without its link type)");
    behind(s.block(0x0A0D0D0A, s.w(0x12345678) + s.h(1) + s.h(0) + s.d(0)), "a section without byte order)");
    behind(s.block(0x0A0D0D0A, s.w(0x1A2B3C4D) + s.h(2) + s.h(0) + s.d(0)), "a section of an unknown version)");
    behind(s.block(0x0A0D0D0A, s.w(0x1A2B3C4D)), "a section of an unknown version)");
    Section interfaces;
    for (int n = 0; n < 65'537; ++n) interfaces.interface(1);
    says(interfaces.text(), "behind packet 0 (more than 65536 interfaces)");
    // The first section ends, and its interfaces with it.
    says(good.text() + Section().packet(0, 1, "x").text(), "a packet of interface 0, which the file does not describe");
}

TEST_F(PcapngReading, EveryCutIsNoticedAndGivesThePacketsBefore) {
    Section s;
    s.interface(kCooked).interface(1).packet(1, 1, "first").packet(0, 1, "cooked").packet(1, 2, "second");
    const auto& whole = s.text();
    std::vector<std::size_t> ends;  // of the blocks
    for (std::size_t at = 0; at < whole.size(); at += static_cast<unsigned char>(whole[at + 4])) ends.push_back(at);
    for (std::size_t cut = 4; cut < whole.size(); ++cut) {
        const auto packets = read(whole.substr(0, cut)).size();
        const bool between = std::ranges::count(ends, cut) != 0;
        EXPECT_EQ(reader.cut_off().empty(), between) << cut;
        EXPECT_EQ(packets, cut >= ends[4] ? 1U : 0U) << cut;
        EXPECT_EQ(reader.problem().empty(), cut >= ends[3] || cut < ends[2]) << cut << reader.problem();
    }
}

}  // namespace
}  // namespace margay
