// Our datagram reader compared with Wireshark's, on recordings of real segments: both must read the same value of
// every field.
#include <places.hpp>
#include "files.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string_view>

namespace margay {
namespace {

// A datagram in the output of tshark.
struct Printed {
    std::size_t at = 0;
    std::string octets;  // the whole datagram in hexadecimal digits
    std::optional<std::uint64_t> cmd, idx, adp, ado, lad, length, circulating, more, irq, wkc;
    std::size_t data_at = 0;
    std::string data;  // present when tshark prints the data itself, not as registers or mailbox
};
struct PrintedFrame {
    std::uint64_t number = 0;
    std::string time;
    std::optional<std::uint64_t> length, type;
    std::vector<Printed> datagrams;
};

// The value of an attribute in a line of PDML.
std::string attribute(std::string_view line, const std::string& name) {
    const auto key = " " + name + "=\"";
    const auto at = line.find(key);
    if (at == line.npos) return {};
    const auto from = at + key.size();
    return std::string(line.substr(from, line.find('"', from) - from));
}

std::uint64_t number_of(const std::string& text) { return std::stoull(text, nullptr, 0); }

void take_field(PrintedFrame& frame, std::string_view line) {
    const auto name = attribute(line, "name");
    const auto shown = attribute(line, "show");
    if (name == "num") frame.number = number_of(shown);
    if (name == "timestamp") frame.time = attribute(line, "value");
    if (name == "ecatf.length") frame.length = number_of(shown);
    if (name == "ecatf.type") frame.type = number_of(shown);
    if (name.empty() && shown.starts_with("EtherCAT datagram")) {
        frame.datagrams.emplace_back();
        frame.datagrams.back().at = number_of(attribute(line, "pos"));
        frame.datagrams.back().octets = attribute(line, "value");
    }
    if (frame.datagrams.empty()) return;
    auto& datagram = frame.datagrams.back();
    if (name == "ecat.data") {
        datagram.data_at = number_of(attribute(line, "pos"));
        datagram.data = attribute(line, "value");
    }
    const std::pair<std::string_view, std::optional<std::uint64_t>*> fields[] = {
        {"ecat.cmd", &datagram.cmd},
        {"ecat.idx", &datagram.idx},
        {"ecat.adp", &datagram.adp},
        {"ecat.ado", &datagram.ado},
        {"ecat.lad", &datagram.lad},
        {"ecat.subframe.length", &datagram.length},
        {"ecat.subframe.circulating", &datagram.circulating},
        {"ecat.subframe.more", &datagram.more},
        {"ecat.int", &datagram.irq},
        {"ecat.cnt", &datagram.wkc}};
    for (const auto& [field, value] : fields)
        if (name == field) *value = number_of(shown);
}

std::vector<PrintedFrame> ask_tshark(const std::string& file) {
    std::vector<PrintedFrame> frames;
    const auto command =
        "tshark -n -r '" + file + "' -Y 'ecatf && eth.type == 0x88a4' -T pdml -J 'frame ecatf ecat' 2>/dev/null";
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    if (!pipe) return frames;
    char* line = nullptr;
    std::size_t room = 0;
    for (ssize_t length = 0; (length = ::getline(&line, &room, pipe.get())) > 0;) {
        const std::string_view text(line, static_cast<std::size_t>(length));
        if (text.starts_with("<packet>"))
            frames.emplace_back();
        else if (!frames.empty() && text.find("<field ") != text.npos)
            take_field(frames.back(), text);
    }
    std::free(line);
    return frames;
}

std::string hex(Bytes bytes) {
    std::string out;
    for (const auto octet : bytes) {
        constexpr std::string_view digits = "0123456789abcdef";
        out += digits[std::to_integer<unsigned>(octet) >> 4];
        out += digits[std::to_integer<unsigned>(octet) & 15];
    }
    return out;
}

void compare(const wire::DatagramView& ours, const Printed& theirs) {
    EXPECT_EQ(ours.offset, theirs.at);
    EXPECT_EQ(static_cast<unsigned>(ours.header.command), theirs.cmd);
    EXPECT_EQ(ours.header.index, theirs.idx);
    if (wire::is_logical(ours.header.command)) {
        EXPECT_EQ(ours.header.address.value, theirs.lad);
        EXPECT_FALSE(theirs.adp);
    } else {
        EXPECT_EQ(ours.header.address.adp(), theirs.adp);
        EXPECT_EQ(ours.header.address.ado(), theirs.ado);
        EXPECT_FALSE(theirs.lad);
    }
    EXPECT_EQ(ours.header.length, theirs.length);
    EXPECT_EQ(ours.header.circulating ? 1u : 0u, theirs.circulating);
    EXPECT_EQ(ours.header.more ? 1u : 0u, theirs.more);
    EXPECT_EQ(ours.header.irq, theirs.irq);
    EXPECT_EQ(ours.wkc, theirs.wkc);
    // tshark does not always print the data, and behind a mailbox it prints only the rest. It always prints the octets
    // of the whole datagram.
    const auto data_at = ours.offset + wire::kDatagramHeaderBytes;
    if (!theirs.data.empty()) {
        ASSERT_GE(theirs.data_at, data_at);
        EXPECT_EQ(hex(ours.data).substr(2 * (theirs.data_at - data_at)), theirs.data);
    }
    ASSERT_EQ(theirs.octets.size(), 2 * (ours.data.size() + wire::kDatagramOverheadBytes));
    EXPECT_EQ(hex(ours.data), theirs.octets.substr(2 * wire::kDatagramHeaderBytes, 2 * ours.data.size()));
}

Duration time_of(const std::string& printed) {  // "1654432544.978820000"
    const auto dot = printed.find('.');
    return std::chrono::seconds(std::stoll(printed.substr(0, dot))) + Duration(std::stoll(printed.substr(dot + 1)));
}

std::vector<std::string> captures() {
    std::vector<std::string> all;
    const std::string folder = MARGAY_CAPTURES_DIR;
    if (folder.empty()) return all;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
        if (entry.path().extension() == ".pcapng" || entry.path().extension() == ".pcap")
            all.push_back(entry.path().filename());
    std::sort(all.begin(), all.end());
    return all;
}

struct TsharkTest : testing::TestWithParam<std::string> {};

TEST_P(TsharkTest, SeesTheSameInEveryField) {
    if (std::system("command -v tshark >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
    const auto file = std::string(MARGAY_CAPTURES_DIR) + "/" + GetParam();
    CaptureFile capture;
    ASSERT_TRUE(capture.load(file).ok()) << capture.problem();
    const auto printed = ask_tshark(file);
    ASSERT_EQ(capture.frames().size(), printed.size());
    ASSERT_FALSE(printed.empty());
    const auto start = time_of(printed[0].time) - capture.frames()[0].at;
    for (std::size_t i = 0; i < printed.size(); ++i) {
        const auto& theirs = printed[i];
        const auto& frame = capture.frames()[i];
        SCOPED_TRACE("packet " + std::to_string(theirs.number));
        ASSERT_EQ(frame.number, theirs.number);
        EXPECT_EQ(start + frame.at, time_of(theirs.time));
        const auto bytes = capture.bytes(frame);
        const auto header = wire::load_frame_header(bytes.subspan(wire::kEthernetHeaderBytes));
        EXPECT_EQ(header.length, theirs.length);
        EXPECT_EQ(header.type, theirs.type);
        wire::DatagramReader reader(bytes);
        std::size_t count = 0;
        while (const auto datagram = reader.next()) {
            ASSERT_LT(count, theirs.datagrams.size());
            compare(*datagram, theirs.datagrams[count++]);
        }
        EXPECT_EQ(count, theirs.datagrams.size());
        // One of the masters announces more octets than its datagrams have; tshark reads them as padding.
        std::size_t octets = 0;
        for (const auto& datagram : theirs.datagrams) octets += datagram.octets.size() / 2;
        EXPECT_EQ(reader.fault(), octets == theirs.length ? wire::FrameFault::none : wire::FrameFault::trailing);
        if (HasFailure()) return;  // the first difference is sufficient
    }
}

INSTANTIATE_TEST_SUITE_P(Captures, TsharkTest, testing::ValuesIn(captures()), [](const auto& instance) {
    auto name = instance.param.substr(0, instance.param.rfind('.'));
    for (auto& c : name)
        if (c == '-') c = '_';
    return name;
});
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(TsharkTest);

TEST(Captures, AreThere) {
    if (captures().empty()) GTEST_SKIP() << "no captures of real segments (MARGAY_CAPTURES_DIR is empty)";
    EXPECT_GE(captures().size(), 11u);
}

}  // namespace
}  // namespace margay
