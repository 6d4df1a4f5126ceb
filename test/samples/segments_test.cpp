// The ready-made segments of samples/segments: each is loaded, brought to OP by the master, and exchanges changing
// process data in both directions, in virtual time.
#include <places.hpp>
#include "common/segment_console.hpp"
#include "common/segment_file.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/process_data.hpp"
#include "wire/sync_manager.hpp"

#include <gtest/gtest.h>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <filesystem>
#include <set>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

const std::filesystem::path kFolder = std::filesystem::path(MARGAY_SOURCE_DIR) / "samples" / "segments";

std::vector<std::string> ready_made() {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(kFolder))
        if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
    std::sort(names.begin(), names.end());
    return names;
}

// A master on such a segment.
class Plant {
  public:
    explicit Plant(const std::string& name) : Plant(load_segment((kFolder / (name + ".toml")).string())) {}
    explicit Plant(LoadedSegment loaded) : loaded_(std::move(loaded)) {}

    VirtualOsal osal;
    HostContext ctx{Limits{.slaves = 256, .process_frames = 32}};
    std::vector<std::byte> image = std::vector<std::byte>(16384);

    [[nodiscard]] bool good() const { return static_cast<bool>(loaded_); }
    [[nodiscard]] const std::string& error() const { return loaded_.error(); }
    sim::Segment& segment() { return loaded_->segment; }
    SimulatedSegment& simulated() { return *loaded_; }

    std::string command(const std::string& text) { return execute(*loaded_, text, osal.now()); }

    Result<std::uint16_t> scan() {
        if (!nic_) {
            nic_.emplace(segment(), osal, SimulatedNic::Options{.round_trip = loaded_->round_trip, .wire_time = true});
            if (const auto ready = init(ctx, *nic_, osal); !ready) return ready.error();
        }
        return config_init(ctx);
    }
    Result<std::uint32_t> cycle() {
        osal.advance(1ms);
        if (const auto sent = send_processdata(ctx); !sent) return sent.error();
        const auto wkc = receive_processdata(ctx, 900us);
        (void)poll(ctx, osal.now());
        return wkc;
    }
    AlStatus to_op() {
        for (int i = 0; i < 5; ++i) (void)cycle();
        EXPECT_TRUE(writestate(ctx, 0, AlState::op));
        AlStatus reached;
        for (int i = 0; i < 200 && reached.state != AlState::op; ++i) {
            (void)cycle();
            if (const auto now = statecheck(ctx, 0, AlState::op, Duration{0})) reached = *now;
        }
        return reached;
    }
    // The device of the master's slave n, from 1; nullptr when it has no process data.
    sim::ProcessDataFirmware* device(std::size_t n) { return segment().slave(order().at(n - 1)).process_data(); }
    const std::vector<std::uint32_t>& order() {
        if (order_.empty()) order_ = segment().order();
        return order_;
    }
    std::string errors() {
        std::string all;
        while (const auto error = ctx.errors().take()) {
            std::array<char, 256> text{};
            all.append(describe(*error, text)).append("\n");
        }
        return all;
    }

  private:
    LoadedSegment loaded_;
    std::optional<SimulatedNic> nic_;
    std::vector<std::uint32_t> order_;
};

// Compares the bits of a part of the image with the octets of a device.
bool same_bits(const ImagePart& part, Bytes device) {
    const auto bit = [](Bytes bytes, std::size_t n) {
        return (std::to_integer<unsigned>(bytes[n / 8]) >> (n % 8)) & 1;
    };
    for (std::size_t n = 0; n < part.bits; ++n)
        if (bit(part.bytes, part.offset_bits % 8 + n) != bit(device, n)) return false;
    return true;
}

// The content of the input buffers of an ESC, for devices whose measured values differ in form from their inputs.
std::vector<std::byte> input_buffers(const sim::Esc& esc) {
    std::vector<std::byte> all;
    for (unsigned n = 0; n < esc.sync_managers().count(); ++n) {
        const auto raw = esc.peek(wire::reg::sync_manager(n).address, wire::reg::kSyncManagerStride);
        const auto sm = wire::load_sync_manager(raw);
        const auto at = esc.sync_managers().last_written(n);
        if (sm.mailbox() || sm.ecat_writes() || !at) continue;
        const auto data = esc.peek(static_cast<std::uint16_t>(*at), sm.length_bytes);
        all.insert(all.end(), data.begin(), data.end());
    }
    return all;
}

// Brings the segment to OP and exchanges changing data, in the directions that each slave has.
void reach_op_and_exchange(Plant& plant) {
    ASSERT_TRUE(plant.good()) << plant.error();
    const auto present = plant.order().size();
    const auto found = plant.scan();
    ASSERT_TRUE(found) << plant.errors();
    ASSERT_EQ(*found, present);
    for (const Slave& slave : plant.ctx.slaves()) {
        EXPECT_EQ(slave.al, (AlStatus{AlState::preop, false, 0})) << slave.number;
        EXPECT_NE(slave.name(), "") << slave.number;
    }
    const auto mapped = config_map(plant.ctx, plant.image);
    ASSERT_TRUE(mapped) << plant.errors();
    EXPECT_EQ(plant.to_op(), (AlStatus{AlState::op, false, 0})) << plant.errors();
    EXPECT_EQ(plant.errors(), "");

    const Group& group = plant.ctx.group(0);
    std::set<std::vector<std::byte>> seen;
    std::size_t compared_bits = 0;
    for (unsigned round = 1; round <= 3; ++round) {
        const auto pattern = [&](std::size_t slave, std::size_t octet) {
            return static_cast<std::byte>(slave * 31 + octet * 7 + round * 53);
        };
        for (std::size_t n = 1; n <= present; ++n)
            if (auto* device = plant.device(n)) {
                const auto inputs = device->inputs();
                for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i] = pattern(n, i);
                device->poke();
            }
        for (std::size_t i = 0; i < group.output_bytes; ++i) plant.image[i] = pattern(0, i);
        ASSERT_TRUE(plant.cycle());
        const auto wkc = plant.cycle();
        ASSERT_TRUE(wkc);
        EXPECT_EQ(*wkc, group.expected_wkc);
        std::size_t compared = 0;
        for (const Slave& slave : plant.ctx.slaves()) {
            auto* device = plant.device(slave.number);
            const ImagePart& outputs = slave.image.outputs;
            const ImagePart& inputs = slave.image.inputs;
            if (outputs.bits + inputs.bits == 0) continue;
            ASSERT_NE(device, nullptr) << slave.number;
            EXPECT_TRUE(same_bits(outputs, device->outputs())) << slave.name() << slave.number;
            const bool plain = device->inputs().size() * 8 >= inputs.bits;
            const auto buffers = input_buffers(plant.segment().slave(plant.order().at(slave.number - 1u)));
            EXPECT_TRUE(same_bits(inputs, plain ? Bytes(device->inputs()) : Bytes(buffers)))
                << slave.name() << slave.number;
            compared += outputs.bits + inputs.bits;
        }
        compared_bits = compared;
        seen.insert(std::vector<std::byte>(plant.image.begin() + group.output_bytes,
                                           plant.image.begin() + group.output_bytes + group.input_bytes));
    }
    EXPECT_LE(compared_bits, (group.output_bytes + group.input_bytes) * 8u);
    EXPECT_GE(compared_bits * 2, (group.output_bytes + group.input_bytes) * 8u) << "the rest is padding of the image";
    EXPECT_EQ(seen.size(), group.input_bytes != 0 ? 3u : 1u) << "inputs have changed with each round";
}

class ReadyMadeSegments : public testing::TestWithParam<std::string> {};

// The sum of offset and number of octets has more than 64 bits.
TEST(SegmentConsole, InputsAreSetWithinTheirBounds) {
    Plant plant(load_segment("digital_in_8"));
    ASSERT_TRUE(plant.good()) << plant.error();
    EXPECT_EQ(plant.command("set 1 0 7"), "07");
    for (const std::string wrong :
         {"set 1 0xffffffffffffffff 1", "set 1 0xfffffffffffffffe 1 2 3", "set 1 1 1", "set 1 0 1 2", "set 1 2 1"})
        EXPECT_EQ(plant.command(wrong), "slave 1 has 1 octet of inputs now") << wrong;
    EXPECT_EQ(plant.command("get 1 in"), "07");
}

TEST_P(ReadyMadeSegments, ReachOpAndExchangeProcessData) {
    Plant plant(GetParam());
    reach_op_and_exchange(plant);
    EXPECT_GT(plant.ctx.group(0).output_bytes + plant.ctx.group(0).input_bytes, 4u);
}

INSTANTIATE_TEST_SUITE_P(Each, ReadyMadeSegments, testing::ValuesIn(ready_made()),
                         [](const auto& each) { return each.param; });

// The segments that the README files list.
TEST(SegmentsFolder, HoldsWhatIsPromised) {
    EXPECT_EQ(ready_made(), (std::vector<std::string>{"bootloader", "coupler", "dc_bench", "drives", "eoe",
                                                      "hot_connect", "mixed200", "servodrives", "tree"}));
    Plant mixed("mixed200");
    ASSERT_TRUE(mixed.good()) << mixed.error();
    EXPECT_EQ(mixed.order().size(), 200u);
}

// The order of processing, calculated by hand: port 3 first, then 1, then 2 (ETG.1000.4 "Frame processing order").
TEST(SegmentsFolder, TreeIsProcessedInPortOrder) {
    Plant plant("tree");
    ASSERT_TRUE(plant.good()) << plant.error();
    std::vector<std::string> names;
    for (const auto n : plant.order()) names.push_back(plant.simulated().names[n]);
    EXPECT_EQ(names, (std::vector<std::string>{"trunk", "left", "left_axis", "left_coupler", "left_inputs",
                                               "left_outputs", "right_coupler", "right_inputs", "right_outputs",
                                               "drop_axis1", "drop_axis2", "end_axis"}));
    ASSERT_TRUE(plant.scan());
    EXPECT_EQ(plant.ctx.slave(3).parent, 2);
    EXPECT_EQ(plant.ctx.slave(10).parent, 7) << "the drop line hangs on the coupler, behind its terminals";
    EXPECT_EQ(plant.ctx.slave(10).parent_port, 2);
    EXPECT_EQ(plant.ctx.slave(12).parent, 1);
}

TEST(SegmentsFolder, ToolsOfTheHotConnectGroupCanBeChanged) {
    Plant plant("hot_connect");
    ASSERT_TRUE(plant.good()) << plant.error();
    auto found = plant.scan();
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, 8);
    EXPECT_EQ(plant.ctx.slave(5).alias, 0x0101);
    EXPECT_EQ(plant.command("break gripper"), "the cable at port 0 of slave 5 is broken");
    found = plant.scan();
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, 5);
    (void)plant.command("heal welder");
    found = plant.scan();
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, 7);
    EXPECT_EQ(plant.ctx.slave(5).alias, 0x0102);
}

// Images of real devices, each alone and all in a line.
TEST(SegmentsFromSii, RealImagesReachOpAndExchangeProcessData) {
    const std::filesystem::path images = MARGAY_SII_DIR;
    if (images.empty()) GTEST_SKIP() << "the folder of SII images is not there";
    std::string all;
    for (const auto* name : {"ek1100", "el2004", "el2262", "el2828", "el2889", "akd"}) {
        const auto path = (images / (std::string(name) + ".bin")).string();
        SCOPED_TRACE(path);
        Plant plant(load_segment(path));
        reach_op_and_exchange(plant);
        all += (all.empty() ? "" : ",") + path;
    }
    Plant line(load_segment(all));
    reach_op_and_exchange(line);
    EXPECT_EQ(line.order().size(), 6u);
    EXPECT_EQ(line.ctx.group(0).output_bytes, 1u + 14 + 1 + 2 + 6);
}

}  // namespace
}  // namespace margay::samples
