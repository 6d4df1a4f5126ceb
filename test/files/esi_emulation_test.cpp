// Devices whose ESI sets device emulation (0x0141 bit 0) and describes a mailbox: the chip mirrors AL control, and the
// program follows it.
#include <margay/files/esi.hpp>

#include "files/examples.hpp"
#include "files/machine.hpp"
#include "wire/esc.hpp"

#include <places.hpp>

namespace margay::files {
namespace {

std::vector<sim::Device> device_of(const std::string& text) {
    const auto esi = read_esi(text);
    EXPECT_TRUE(esi) << to_text(esi.problem);
    const auto made = make_sii(esi->devices.at(0));
    EXPECT_TRUE(made) << made.error;
    std::vector<sim::Device> devices;
    devices.push_back(sim::device_from_sii(made.octets));
    return devices;
}

// The example drive with the ConfigData of device emulation.
std::string emulated_drive() {
    std::string text = kExampleEsi;
    const std::string own = "050E03000A0000000000";
    const auto at = text.find(own);
    EXPECT_NE(at, std::string::npos);
    return text.replace(at, own.size(), "8003006EFF00FF000000");
}

std::uint32_t product_of(Context& ctx) {
    const auto read = SDOread<std::uint32_t>(ctx, 1, 0x1018, 2);
    EXPECT_TRUE(read) << words(read.error());
    return read ? *read : 0;
}

// Brings the device to OP and back, twice, with the requests of a master.
void expect_works(Machine& machine, std::uint32_t product) {
    Context& ctx = machine.ctx;
    for (int round = 0; round < 2; ++round) {
        const auto found = config_init(ctx);
        ASSERT_TRUE(found) << words(found.error());
        ASSERT_TRUE(ctx.slave(1).device_emulation);
        EXPECT_EQ(product_of(ctx), product);
        const auto mapped = config_map(ctx, machine.image);
        ASSERT_TRUE(mapped) << words(mapped.error());
        ASSERT_TRUE(machine.to_op(1ms));
        EXPECT_EQ(ctx.slave(1).al.state, AlState::op);

        auto& program = *machine.segment.slave(0).firmware()->process_data();
        const auto outputs = ctx.slave(1).image.outputs.bytes;
        const auto inputs = ctx.slave(1).image.inputs.bytes;
        ASSERT_FALSE(outputs.empty());
        ASSERT_FALSE(inputs.empty());
        std::ranges::fill(outputs, std::byte{0x5A});
        ASSERT_EQ(program.inputs().size(), inputs.size());
        std::ranges::fill(program.inputs(), std::byte{0xA5});
        program.poke();
        for (int cycle = 0; cycle < 3; ++cycle) {
            ASSERT_TRUE(send_processdata(ctx));
            const auto received = receive_processdata(ctx, 10ms);
            EXPECT_TRUE(received) << words(received.error());
        }
        EXPECT_EQ(program.outputs()[0], std::byte{0x5A});
        EXPECT_EQ(inputs[0], std::byte{0xA5});
        EXPECT_EQ(product_of(ctx), product) << "in OP";
        const auto down = reach(ctx, AlState::init, 1s, {});
        ASSERT_TRUE(down) << words(down.error());
    }
}

TEST(EsiEmulation, ADeviceWithAMailboxReachesOpAndServesIt) {
    Machine machine;
    machine.connect(device_of(emulated_drive()));
    expect_works(machine, 0x1234);
}

// The chip shows each requested state at once. After its watchdog has expired, the device does not apply outputs.
TEST(EsiEmulation, OutputsEndWithTheirWatchdog) {
    Machine machine;
    machine.connect(device_of(emulated_drive()));
    Context& ctx = machine.ctx;
    ASSERT_TRUE(config_init(ctx));
    ASSERT_TRUE(config_map(ctx, machine.image));
    ASSERT_TRUE(machine.to_op(1ms));
    std::ranges::fill(ctx.slave(1).image.outputs.bytes, std::byte{0x5A});
    for (int cycle = 0; cycle < 3; ++cycle) {
        ASSERT_TRUE(send_processdata(ctx));
        (void)receive_processdata(ctx, 10ms);
    }
    auto& program = *machine.segment.slave(0).firmware()->process_data();
    EXPECT_EQ(program.outputs()[0], std::byte{0x5A});
    EXPECT_EQ(product_of(ctx), 0x1234U);
    machine.osal.advance(1s);
    EXPECT_EQ(product_of(ctx), 0x1234U);
    EXPECT_EQ(program.outputs()[0], std::byte{0});
}

class FieldEmulation : public ::testing::TestWithParam<const char*> {};

TEST_P(FieldEmulation, ReachesOpAndServesItsMailbox) {
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    const auto text = read_file(std::string(MARGAY_XML_DIR) + "/esi/" + GetParam() + ".xml").octets;
    const auto esi = read_esi(text);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    Machine machine;
    machine.connect(device_of(text));
    expect_works(machine, esi->devices.at(0).identity.product);
}

INSTANTIATE_TEST_SUITE_P(Pollen, FieldEmulation,
                         ::testing::Values("pollen_Orbita2d", "pollen_Orbita3d", "pollen_NeckOrbita3d_15"));

}  // namespace
}  // namespace margay::files
