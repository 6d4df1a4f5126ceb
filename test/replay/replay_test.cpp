// Replays of recordings made by hand and of recordings of real segments, in virtual time.
#include "oshw/pcap/replay.hpp"
#include <places.hpp>
#include "files.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filters/chance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <set>

namespace margay {
namespace {

using namespace std::chrono_literals;
using wire::Command;
using wire::DatagramAddress;

constexpr MacAddress kMac{0x00, 0x4d, 0x41, 0x52, 0x47, 0x59};
constexpr StationAddress kStation{0x1001};

// A datagram of a test: the request, and the answer.
struct Exchange {
    Command command = Command::FPRD;
    DatagramAddress address{kStation, 0x0130};
    std::uint16_t answer = 0;
    std::uint16_t wkc = 1;
    std::uint16_t sent = 0;
};

Frame frame_of(const std::vector<Exchange>& exchanges, bool reply, std::uint8_t index) {
    Frame buffer(1514);
    wire::FrameBuilder builder(buffer, kMac);
    for (const auto& exchange : exchanges) {
        auto address = exchange.address;
        if (reply && wire::counts_position(exchange.command))  // three slaves
            address = {static_cast<std::uint16_t>(address.adp() + 3), address.ado()};
        store_le(builder.append(exchange.command, index++, address, 2), 0, reply ? exchange.answer : exchange.sent);
    }
    buffer.resize(builder.finish().size());
    std::size_t at = wire::kFramePrefixBytes + wire::kDatagramHeaderBytes + 2;
    for (const auto& exchange : exchanges) {
        if (reply) store_le(buffer, at, exchange.wkc);
        at += wire::kDatagramOverheadBytes + 2;
    }
    if (reply) buffer[6] |= wire::kPassedEscBit;
    return buffer;
}
Frame request(const std::vector<Exchange>& exchanges, std::uint8_t index = 0) {
    return frame_of(exchanges, false, index);
}
Frame reply(const std::vector<Exchange>& exchanges, std::uint8_t index = 0) { return frame_of(exchanges, true, index); }

struct Received {
    Time at;
    std::vector<std::uint16_t> data;
    std::vector<std::uint16_t> wkc;
    std::vector<std::uint8_t> index;
    std::vector<std::uint16_t> adp;
    Frame frame;
};

struct ReplayTest : testing::Test {
    TemporaryFolder folder;
    VirtualOsal clock{Time(10s)};
    std::string recording = pcap_header();

    void record(Duration at, const Frame& frame) {
        recording += pcap_packet(100, static_cast<std::uint32_t>(at.count()), frame);
    }
    void record_exchange(Duration at, const std::vector<Exchange>& exchanges, std::uint8_t index = 0) {
        record(at, request(exchanges, index));
        record(at + 100us, reply(exchanges, index));
    }
    void load(ReplayNic& nic) { ASSERT_TRUE(nic.load(folder.write("r.pcap", recording)).ok()) << nic.problem(); }

    std::vector<Received> run_dry(Nic& nic) {
        std::vector<Received> all;
        Frame buffer(1518);
        for (;;) {
            while (const auto length = nic.receive(buffer)) {
                auto& one = all.emplace_back();
                one.at = clock.now();
                one.frame.assign(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(length));
                wire::DatagramReader reader(one.frame);
                while (const auto datagram = reader.next()) {
                    one.data.push_back(datagram->data.size() < 2 ? 0 : load_le<std::uint16_t>(datagram->data));
                    one.wkc.push_back(datagram->wkc);
                    one.index.push_back(datagram->header.index);
                    one.adp.push_back(datagram->header.address.adp());
                }
            }
            if (nic.next_arrival() == kNever) return all;
            clock.wait(nic.next_arrival(), -1);
        }
    }
    std::vector<Received> ask(Nic& nic, const Frame& frame) {
        EXPECT_EQ(nic.send(frame), SendStatus::sent);
        return run_dry(nic);
    }
};

TEST_F(ReplayTest, AnswersAsLongAfterTheRequestAsRecorded) {
    record_exchange(0us, {{.answer = 0x0008}});
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_EQ(nic.source_mac(), kMac);
    EXPECT_EQ(nic.next_arrival(), kNever);
    EXPECT_EQ(nic.send(request({{}}, 77)), SendStatus::sent);
    Frame buffer(1518);
    EXPECT_EQ(nic.receive(buffer), 0u);
    EXPECT_EQ(nic.next_arrival(), Time(10s + 100us));
    const auto all = run_dry(nic);
    ASSERT_EQ(all.size(), 1u);
    EXPECT_EQ(all[0].at, Time(10s + 100us));
    // The index is the one of the present request; all other octets are as recorded.
    EXPECT_EQ(all[0].frame, reply({{.answer = 0x0008}}, 77));
    EXPECT_EQ(nic.counters().answered, 1u);
    EXPECT_EQ(nic.problem(), "");
}

TEST_F(ReplayTest, TheNthRequestGetsTheNthAnswer) {
    record_exchange(0us, {{.answer = 1}});
    record_exchange(1000us, {{.answer = 2}});
    record_exchange(2000us, {{.address = {StationAddress{0x1002}, 0x0130}, .answer = 9}});
    record_exchange(3000us, {{.answer = 3}});
    PcapReplayNic nic(clock);
    load(nic);
    for (const int expected : {1, 2, 3}) EXPECT_EQ(ask(nic, request({{}})).at(0).data.at(0), expected);
    EXPECT_EQ(ask(nic, request({{.address = {StationAddress{0x1002}, 0x0130}}})).at(0).data.at(0), 9);
}

TEST_F(ReplayTest, PackingMayChange) {
    const Exchange a{.answer = 0xA};
    const Exchange b{.command = Command::APRD, .address = {RingPosition{1}, 0x0110}, .answer = 0xB};
    const Exchange c{
        .command = Command::BRD, .address = {std::uint16_t{0}, std::uint16_t{0x0130}}, .answer = 0xC, .wkc = 3};
    record_exchange(0us, {a});
    record_exchange(500us, {b, c});
    record_exchange(900us, {a});
    PcapReplayNic nic(clock);
    load(nic);
    const auto all = ask(nic, request({c, a, b, a}, 9));
    ASSERT_EQ(all.size(), 1u);
    EXPECT_EQ(all[0].data, (std::vector<std::uint16_t>{0xC, 0xA, 0xB, 0xA}));
    EXPECT_EQ(all[0].wkc, (std::vector<std::uint16_t>{3, 1, 1, 1}));
    EXPECT_EQ(all[0].index, (std::vector<std::uint8_t>{9, 10, 11, 12}));
    EXPECT_EQ(all[0].adp, (std::vector<std::uint16_t>{3, 0x1001, 2, 0x1001}));
}

TEST_F(ReplayTest, WritesKeepTheirData) {
    record_exchange(0us, {{.command = Command::FPWR, .answer = 5, .wkc = 1, .sent = 5}});
    record_exchange(200us, {{.command = Command::FPRW, .answer = 6, .wkc = 3, .sent = 5}});
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_EQ(ask(nic, request({{.command = Command::FPWR, .sent = 0x77}})).at(0).data.at(0), 0x77);
    EXPECT_EQ(ask(nic, request({{.command = Command::FPRW, .sent = 0x77}})).at(0).data.at(0), 6);
}

TEST_F(ReplayTest, ALossStaysALossAndTheRetryIsAnswered) {
    record(0us, request({{}}, 1));
    record_exchange(5000us, {{.answer = 4}}, 1);  // a retry with the same index
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_TRUE(ask(nic, request({{}})).empty());
    EXPECT_EQ(nic.counters().lost_as_recorded, 1u);
    const auto before = clock.now();
    const auto all = ask(nic, request({{}}));
    ASSERT_EQ(all.size(), 1u);
    EXPECT_EQ(all[0].data[0], 4);
    EXPECT_EQ(all[0].at - before, 100us);
}

TEST_F(ReplayTest, EqualRequestsBackToBackAreAnsweredInOrder) {
    record(0us, request({{}}, 1));
    record(5us, request({{}}, 1));
    record(100us, reply({{.answer = 1}}, 1));
    record(105us, reply({{.answer = 2}}, 1));
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_EQ(ask(nic, request({{}})).at(0).data.at(0), 1);
    EXPECT_EQ(ask(nic, request({{}})).at(0).data.at(0), 2);
}

TEST_F(ReplayTest, ALossTakesNothingFromTheOthersInItsFrame) {
    const Exchange other{.address = {kStation, 0x0110}, .answer = 0x11};
    record_exchange(0us, {other}, 1);
    record(1000us, request({{}}, 2));  // lost
    record_exchange(6000us, {{.answer = 4}}, 3);
    record_exchange(7000us, {{.address = {kStation, 0x0110}, .answer = 0x12}}, 1);
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_TRUE(ask(nic, request({other, {}})).empty());
    EXPECT_EQ(ask(nic, request({other, {}})).at(0).data, (std::vector<std::uint16_t>{0x11, 4}));
    EXPECT_EQ(ask(nic, request({other})).at(0).data, (std::vector<std::uint16_t>{0x12}));
}

TEST_F(ReplayTest, NamesTheFirstRequestItDoesNotKnow) {
    record_exchange(0us, {{.answer = 1}});
    PcapReplayNic nic(clock);
    load(nic);
    EXPECT_TRUE(ask(nic, request({{}, {.address = {kStation, 0x0134}}})).empty());
    EXPECT_EQ(nic.counters().unknown, 1u);
    EXPECT_EQ(nic.problem(), "the recording has no FPRD 0x1001 AL status code (0x0134), 2 octets");
    EXPECT_TRUE(ask(nic, request({{.command = Command::LRW}})).empty());
    EXPECT_EQ(nic.counters().unknown, 2u);
    EXPECT_NE(nic.problem().find("AL status code"), std::string::npos) << "the first stays";
    EXPECT_EQ(ask(nic, request({{}})).at(0).data.at(0), 1) << "its neighbour in the frame was not used up";
}

TEST_F(ReplayTest, UsedUpAnswersAreRepeatedOrMissed) {
    record_exchange(0us, {{.answer = 1}}, 1);
    record_exchange(1000us, {{.answer = 2}}, 2);
    PcapReplayNic repeats(clock);
    load(repeats);
    for (const int expected : {1, 2, 2, 2}) EXPECT_EQ(ask(repeats, request({{}})).at(0).data.at(0), expected);
    EXPECT_EQ(repeats.counters().repeated, 2u);
    EXPECT_EQ(repeats.problem(), "");
    PcapReplayNic misses(clock, PcapReplayNic::UsedUp::unanswered);
    load(misses);
    for (const int expected : {1, 2}) EXPECT_EQ(ask(misses, request({{}})).at(0).data.at(0), expected);
    EXPECT_TRUE(ask(misses, request({{}})).empty());
    EXPECT_EQ(misses.counters().used_up, 1u);
    EXPECT_EQ(misses.problem(), "the recording has FPRD 0x1001 AL status (0x0130), 2 octets only 2 times");
}

TEST_F(ReplayTest, ASegmentThatNeverAnsweredDoesNotNow) {
    record(0us, request({{}}));
    PcapReplayNic nic(clock);
    load(nic);
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(ask(nic, request({{}})).empty());
    EXPECT_EQ(nic.counters().answered, 0u);
}

TEST_F(ReplayTest, ARecordingWithoutRequestsIsRefused) {
    record(0us, reply({{}}));
    PcapReplayNic nic(clock);
    EXPECT_FALSE(nic.load(folder.write("r.pcap", recording)).ok());
    EXPECT_NE(nic.problem().find("no frame is a request"), std::string::npos) << nic.problem();
    EXPECT_FALSE(nic.load(folder.write("n.pcap", "noise")).ok());
    EXPECT_NE(nic.problem().find("n.pcap"), std::string::npos) << nic.problem();
}

TEST_F(ReplayTest, SurvivesNoiseAndAFloodOfRequests) {
    record_exchange(0us, {{.answer = 1}});
    PcapReplayNic nic(clock);
    load(nic);
    Chance chance(3);
    for (std::size_t size = 0; size <= 1600; ++size) {
        Frame noise(size);
        for (auto& octet : noise) octet = static_cast<std::byte>(chance.next());
        if (size > 16) noise[12] = std::byte{0x88}, noise[13] = std::byte{0xA4}, noise[15] = std::byte{0x10};
        EXPECT_EQ(nic.send(noise), SendStatus::sent);
    }
    EXPECT_TRUE(run_dry(nic).empty());
    int taken = 0;
    while (nic.send(request({{}})) == SendStatus::sent && taken < 100'000) ++taken;
    EXPECT_LT(taken, 100'000) << "busy once there is no more room";
    EXPECT_EQ(run_dry(nic).size(), static_cast<std::size_t>(taken));
    EXPECT_EQ(nic.send(request({{}})), SendStatus::sent);
}

TEST_F(ReplayTest, SurvivesRecordingsWithTurnedBits) {
    const std::vector<Exchange> two = {{.answer = 1}, {.command = Command::BRD, .address = DatagramAddress(0)}};
    record_exchange(0us, two);
    const auto good = recording;
    const auto frames_at = pcap_header().size();
    int accepted = 0;
    for (std::size_t bit = 8 * frames_at; bit < 8 * good.size(); bit += 5) {
        recording = good;
        recording[bit / 8] = static_cast<char>(recording[bit / 8] ^ (1 << (bit % 8)));
        const auto file = folder.write("t.pcap", recording);
        PcapReplayNic nic(clock);
        PcapStrictReplayNic strict(clock);
        if (!nic.load(file).ok()) continue;
        ++accepted;
        ASSERT_TRUE(strict.load(file).ok());
        for (ReplayNic* one : {static_cast<ReplayNic*>(&nic), static_cast<ReplayNic*>(&strict)})
            for (const auto& answer : ask(*one, request(two))) EXPECT_LE(answer.frame.size(), HeldFrame::kMaxBytes);
    }
    EXPECT_GT(accepted, 50);
}

TEST_F(ReplayTest, StrictWantsEveryOctetInOrder) {
    record_exchange(0us, {{.answer = 1}}, 1);
    record_exchange(1000us, {{.answer = 2}}, 2);
    PcapStrictReplayNic nic(clock);
    load(nic);
    EXPECT_FALSE(nic.finished());
    const auto start = clock.now();
    const auto first = ask(nic, request({{}}, 1));
    ASSERT_EQ(first.size(), 1u);
    EXPECT_EQ(first[0].frame, reply({{.answer = 1}}, 1));
    EXPECT_EQ(first[0].at - start, 100us);
    EXPECT_EQ(ask(nic, request({{}}, 2)).at(0).data.at(0), 2);
    EXPECT_TRUE(nic.finished());
    EXPECT_TRUE(ask(nic, request({{}}, 3)).empty());
    EXPECT_TRUE(nic.diverged());
    EXPECT_NE(nic.problem().find("the recording is over"), std::string::npos) << nic.problem();
}

TEST_F(ReplayTest, StrictSaysWhereItDiverged) {
    record_exchange(0us, {{.answer = 1}}, 1);
    record_exchange(1000us, {{.answer = 2}}, 2);
    PcapStrictReplayNic nic(clock);
    load(nic);
    EXPECT_EQ(ask(nic, request({{}}, 1)).size(), 1u);
    EXPECT_TRUE(ask(nic, request({{}}, 3)).empty());  // the index
    EXPECT_TRUE(nic.diverged());
    EXPECT_FALSE(nic.finished());
    EXPECT_EQ(nic.problem().substr(0, 50), "packet 3 of the recording differs from octet 17: r") << nic.problem();
    EXPECT_TRUE(ask(nic, request({{}}, 2)).empty()) << "too late to come back";
}

TEST_F(ReplayTest, StrictKeepsBurstsAsTheyWere) {
    record(0us, request({{}}, 1));
    record(10us, request({{}}, 2));
    record(100us, reply({{.answer = 1}}, 1));
    record(110us, reply({{.answer = 2}}, 2));
    PcapStrictReplayNic nic(clock);
    load(nic);
    EXPECT_TRUE(ask(nic, request({{}}, 1)).empty());
    const auto all = ask(nic, request({{}}, 2));
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[0].data[0], 1);
    EXPECT_EQ(all[1].data[0], 2);
}

// Recordings of real segments: requests that are sent at the recorded times get the recorded replies at the recorded
// times.
struct RecordedSegmentTest : testing::TestWithParam<std::string> {};

TEST_P(RecordedSegmentTest, RequestsAtTheirTimesBringTheRepliesAtTheirs) {
    const auto path = std::string(MARGAY_CAPTURES_DIR) + "/" + GetParam();
    if (std::string(MARGAY_CAPTURES_DIR).empty()) GTEST_SKIP() << "no captures of real segments";
    CaptureFile capture;
    ASSERT_TRUE(capture.load(path).ok()) << capture.problem();
    VirtualOsal clock;
    PcapReplayNic nic(clock, PcapReplayNic::UsedUp::unanswered);
    ASSERT_TRUE(nic.load(path).ok()) << nic.problem();
    EXPECT_EQ(nic.counters().malformed, 0u);

    // One recording contains replies to requests of another sender that were not recorded. They have another source
    // address.
    const auto sender = [&](const CapturedFrame& frame) {
        const auto source = capture.bytes(frame).subspan(wire::kSourceMacOffset, 6);
        Frame mac(source.begin(), source.end());
        mac[0] &= ~wire::kPassedEscBit;
        return mac;
    };
    std::set<Frame> senders;
    std::vector<CapturedFrame> replies;
    for (const auto& frame : capture.frames()) {
        if (!frame.reply) senders.insert(sender(frame));
    }
    for (const auto& frame : capture.frames())
        if (frame.reply && senders.contains(sender(frame))) replies.push_back(frame);
    const auto all =
        std::count_if(capture.frames().begin(), capture.frames().end(), [](auto& frame) { return frame.reply; });
    EXPECT_EQ(nic.counters().stray, static_cast<std::size_t>(all) - replies.size());

    std::vector<std::pair<Time, Frame>> answers;
    Frame buffer(1518);
    const auto drain = [&](Time until) {
        for (;;) {
            while (const auto length = nic.receive(buffer))
                answers.emplace_back(clock.now(),
                                     Frame(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(length)));
            if (nic.next_arrival() > until) return;
            clock.wait(nic.next_arrival(), -1);
        }
    };
    for (const auto& frame : capture.frames()) {
        if (frame.reply) continue;
        drain(Time(frame.at));
        clock.wait(Time(frame.at), -1);
        ASSERT_EQ(nic.send(capture.bytes(frame)), SendStatus::sent);
    }
    drain(kNever - 1ns);
    EXPECT_EQ(nic.problem(), "");
    ASSERT_EQ(answers.size(), replies.size());
    std::size_t i = 0;
    for (const auto& frame : replies) {
        const auto& [at, answer] = answers[i++];
        ASSERT_EQ(at, Time(frame.at)) << "packet " << frame.number;
        const auto recorded = capture.bytes(frame);
        wire::DatagramReader end(recorded);
        // Behind the datagrams there is padding, of the request or of the recording. Only the length of the request is
        // compared.
        const auto length = std::min(std::min(end.end(), answer.size()), recorded.size());
        ASSERT_GE(length, wire::kFramePrefixBytes + wire::kDatagramOverheadBytes);
        ASSERT_EQ(std::memcmp(answer.data(), recorded.data(), length), 0) << "packet " << frame.number;
    }
}

INSTANTIATE_TEST_SUITE_P(Captures, RecordedSegmentTest,
                         testing::Values("soem-sdinfo-no-slaves.pcapng", "soem-sdinfo-ek1100-only.pcapng",
                                         "soem-sdinfo-ek1100-el1004.pcapng", "soem-single-lan9252.pcapng",
                                         "soem-dual-lan9252.pcapng", "soem-sdinfo-akd.pcapng",
                                         "rs-example-sii-el2004.pcapng", "replay-dc.pcapng",
                                         "replay-ek1100-el2828-el2889.pcapng", "twincat-run-ek1100-el1004.pcapng",
                                         "twincat-scan-boxes.pcapng"),
                         [](const auto& instance) {
                             auto name = instance.param.substr(0, instance.param.rfind('.'));
                             for (auto& c : name)
                                 if (c == '-') c = '_';
                             return name;
                         });

}  // namespace
}  // namespace margay
