// Comparison with another master: the recording of a segment that ethercrab brought to OP, and the same simulated
// segment that our master brings to OP. Both must write the same to the slaves, and our cycle must accept the answers
// of the hardware to ethercrab's cycles.
#include <places.hpp>
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/pcap/capture_file.hpp"
#include "oshw/pcap/replay.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "wire/esc.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <fstream>
#include <map>

namespace margay {
namespace {

using namespace std::chrono_literals;
using wire::Command;

constexpr unsigned kSlaves = 3;  // EK1100, EL2828, EL2889
constexpr std::uint16_t kFmmus = wire::reg::kFmmuBase;
constexpr std::uint16_t kSyncManagers = wire::reg::kSyncManagerBase;

// The configuration of process data that a master wrote to a slave.
struct Written {
    std::map<std::uint16_t, std::byte> registers;
    std::vector<std::uint16_t> al_controls;

    [[nodiscard]] std::vector<std::byte> octets(std::uint16_t from, std::size_t count) const {
        std::vector<std::byte> found(count);
        for (std::size_t n = 0; n < count; ++n)
            if (const auto at = registers.find(static_cast<std::uint16_t>(from + n)); at != registers.end())
                found[n] = at->second;
        return found;
    }
};

// A datagram of process data: the request, and the working counter of the answer.
struct Cycle {
    Command command{};
    std::uint32_t address = 0;
    std::size_t bytes = 0;
    std::uint16_t wkc = 0;
    friend bool operator==(const Cycle&, const Cycle&) = default;
};

struct Story {
    std::uint16_t first_station = 0;
    std::array<Written, kSlaves> slaves;
    std::vector<Cycle> cycles;

    void take(Bytes reply) {
        wire::DatagramReader reader(reply);
        while (const auto d = reader.next()) {
            const auto& header = d->header;
            const bool logical =
                header.command == Command::LRW || header.command == Command::LRD || header.command == Command::LWR;
            if (logical) cycles.push_back({header.command, header.address.value, d->data.size(), d->wkc});
            if (d->wkc == 0) continue;
            if (header.command == Command::BWR)
                for (Written& slave : slaves) store(slave, header.address.ado(), d->data);
            const unsigned n = header.address.adp() - unsigned{first_station};
            if (header.command == Command::FPWR && n < kSlaves) store(slaves[n], header.address.ado(), d->data);
        }
    }

    static void store(Written& slave, std::uint16_t address, Bytes data) {
        if (address == wire::reg::kAlControl.address && data.size() == 2) {
            const auto control = load_le<std::uint16_t>(data);
            // Requests of INIT are not compared: masters differ in waiting and acknowledging there.
            if ((control & 0x0F) != 1 && (slave.al_controls.empty() || slave.al_controls.back() != control))
                slave.al_controls.push_back(control);
        }
        for (std::size_t n = 0; n < data.size(); ++n)
            slave.registers[static_cast<std::uint16_t>(address + n)] = data[n];
    }
};

// The logical address of each octet of a slave's memory. One FMMU for two adjacent areas is equal to two FMMUs.
std::map<std::uint16_t, std::uint32_t> mapping_of(const Written& slave) {
    std::map<std::uint16_t, std::uint32_t> found;
    for (std::uint16_t n = 0; n < 4; ++n) {
        const auto registers =
            slave.octets(static_cast<std::uint16_t>(kFmmus + n * wire::reg::kFmmuStride), wire::reg::kFmmuStride);
        const auto fmmu = wire::load_fmmu(registers);
        if (!fmmu.active) continue;
        EXPECT_TRUE(fmmu.write && !fmmu.read && fmmu.logical_start_bit == 0 && fmmu.logical_end_bit == 7);
        for (std::uint16_t at = 0; at < fmmu.length_bytes; ++at)
            found[static_cast<std::uint16_t>(fmmu.physical_start + at)] = fmmu.logical_start.value + at;
    }
    return found;
}

// Records the frames that come back. When `recording` is set, the recording answers. ethercrab writes outputs by LRW,
// which counts two for each slave with outputs. Our master uses LWR for them, which counts one.
class Listener final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    Story story;
    Nic* recording = nullptr;
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (recording == nullptr) return inner().send(frame);
        std::vector<std::byte> asked(frame.begin(), frame.end());
        exchange(asked, Command::LWR, Command::LRW);
        return recording->send(asked);
    }
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override {
        const std::size_t length = recording != nullptr ? recording->receive(into) : inner().receive(into);
        if (length == 0) return 0;
        story.take(Bytes(into).first(length));
        if (recording != nullptr) exchange(into.first(length), Command::LRW, Command::LWR);
        return length;
    }
    // Changes the command of the only datagram, and its working counter accordingly.
    static void exchange(MutableBytes frame, Command from, Command to) {
        auto& command = frame[wire::kFramePrefixBytes];
        if (command != static_cast<std::byte>(from)) return;
        command = static_cast<std::byte>(to);
        const std::size_t bytes = load_le<std::uint16_t>(frame, wire::kFramePrefixBytes + 6) & 0x7FFU;
        const std::size_t at = wire::kFramePrefixBytes + wire::kDatagramHeaderBytes + bytes;
        const auto wkc = load_le<std::uint16_t>(frame, at);
        if (to == Command::LWR) store_le(frame, at, static_cast<std::uint16_t>(wkc / 2));
    }
    [[nodiscard]] Time next_arrival() const noexcept override {
        return recording != nullptr ? recording->next_arrival() : inner().next_arrival();
    }
};

class BesideEthercrab : public testing::Test {
  protected:
    void SetUp() override {
        if (std::string(MARGAY_CAPTURES_DIR).empty() || std::string(MARGAY_SII_DIR).empty())
            GTEST_SKIP() << "the folders of recordings and SII images are not there";
    }

    static Story of_recording(const std::string& path) {
        Story story;
        story.first_station = 0x1000;
        CaptureFile capture;
        EXPECT_TRUE(capture.load(path).ok()) << capture.problem();
        for (const CapturedFrame& frame : capture.frames())
            if (frame.reply) story.take(capture.bytes(frame));
        return story;
    }

    void add(const char* sii, bool clock) {
        std::ifstream file(std::string(MARGAY_SII_DIR) + "/" + sii, std::ios::binary);
        std::string text((std::istreambuf_iterator<char>(file)), {});
        ASSERT_FALSE(text.empty()) << sii;
        const auto bytes = std::as_bytes(std::span(text));
        auto device = sim::device_from_sii({bytes.begin(), bytes.end()});
        if (clock) device.chip.features = 0x00FC;  // the EL2889 of the recordings has its DC unit switched on
        const auto n = static_cast<std::uint32_t>(segment.add(std::move(device).assemble()));
        ASSERT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
    }

    // Brings the simulated segment of these devices to OP.
    void bring_up() {
        add("ek1100.bin", false);
        add("el2828.bin", false);
        add("el2889.bin", true);
        segment.power_up(osal.now());
        listener.story.first_station = 0x1001;
        ASSERT_TRUE(init(ctx, listener, osal));
        ASSERT_EQ(*config_init(ctx), kSlaves);
        ASSERT_TRUE(config_map(ctx, image).ok());
        for (int n = 0; n < 3; ++n) ASSERT_TRUE(cycle(1).ok());
        for (std::uint16_t n = 1; n <= kSlaves; ++n) ASSERT_TRUE(writestate(ctx, n, AlState::op));
        ASSERT_TRUE(cycle(1).ok());
        ASSERT_EQ(statecheck(ctx, 0, AlState::op, 100ms)->state, AlState::op);
    }
    Result<std::uint32_t> cycle(unsigned value) {
        image.fill(static_cast<std::byte>(value));
        osal.advance(1ms);
        const auto sent = send_processdata(ctx);
        return sent ? receive_processdata(ctx, 5ms) : sent.error();
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic simulated{segment, osal};
    Listener listener{simulated};
    HostContext ctx{Limits{.slaves = kSlaves}};
    std::array<std::byte, 3> image{};
    const std::string captures = MARGAY_CAPTURES_DIR;
};

// In one group: the same SyncManagers, FMMUs and states, in the same order.
TEST_F(BesideEthercrab, TheSlavesAreConfiguredAlike) {
    bring_up();
    const Story theirs = of_recording(captures + "/replay-dc.pcapng");
    const Story& ours = listener.story;
    for (unsigned n = 0; n < kSlaves; ++n) {
        SCOPED_TRACE("slave " + std::to_string(n + 1));
        EXPECT_EQ(ours.slaves[n].octets(kSyncManagers, 32), theirs.slaves[n].octets(kSyncManagers, 32));
        EXPECT_EQ(mapping_of(ours.slaves[n]), mapping_of(theirs.slaves[n]));
        EXPECT_EQ(mapping_of(ours.slaves[n]).size(), n);  // EK1100: no octets, EL2828: one, EL2889: two
        EXPECT_EQ(ours.slaves[n].al_controls.size(), 3u);
        ASSERT_GE(theirs.slaves[n].al_controls.size(), 3u);
        for (unsigned state = 0; state < 3 && state < ours.slaves[n].al_controls.size(); ++state)
            EXPECT_EQ(ours.slaves[n].al_controls[state] & 0x0F, theirs.slaves[n].al_controls[state] & 0x0F);
    }
}

// The answers to ethercrab's cycles, recorded on hardware in SAFEOP and OP, are accepted for our cycles.
TEST_F(BesideEthercrab, OurCycleTakesWhatTheHardwareAnsweredToTheirs) {
    bring_up();
    const Story theirs = of_recording(captures + "/replay-dc.pcapng");
    ASSERT_GT(theirs.cycles.size(), 40u);
    PcapReplayNic replay(osal, PcapReplayNic::UsedUp::unanswered);
    ASSERT_TRUE(replay.load(captures + "/replay-dc.pcapng").ok()) << replay.problem();
    listener.recording = &replay;
    listener.story.cycles.clear();
    for (std::size_t n = 0; n < theirs.cycles.size(); ++n) {
        const auto wkc = cycle(static_cast<unsigned>(n));
        ASSERT_TRUE(wkc.ok()) << n << ' ' << replay.problem();
        EXPECT_EQ(*wkc, ctx.group(0).expected_wkc);
        EXPECT_TRUE(ctx.group(0).datagrams[0].right());
    }
    EXPECT_EQ(listener.story.cycles, theirs.cycles);
    EXPECT_EQ(replay.counters().answered, theirs.cycles.size());
    EXPECT_EQ(cycle(0).error().code, Errc::no_frame);  // the recording ends there
}

}  // namespace
}  // namespace margay
