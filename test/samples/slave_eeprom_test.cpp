// The EEPROM of a slave on a simulated segment, in virtual time, with faults of real EEPROMs.
#include "common/slave_eeprom.hpp"

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "wire/sii_writer.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

namespace margay::samples {
namespace {

std::vector<std::byte> image(std::uint32_t product, std::size_t size = 1024) {
    std::vector<std::byte> out(size);
    EXPECT_TRUE(wire::sii::write_image({.configuration = {.pdi_control = 0x0104},
                                        .identity = {0x4D47, product, 1, 1},
                                        .name = "Made up " + std::to_string(product)},
                                       out)
                    .ok());
    return out;
}

struct SlaveEepromTest : testing::Test {
    sim::Segment segment;
    VirtualOsal osal;
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    std::optional<SimulatedNic> nic;
    HostContext ctx{Limits{.slaves = 4}};

    void build(std::vector<std::byte> one, std::vector<std::byte> two) {
        first = segment.add(std::make_unique<sim::Esc>(sim::junction(), std::move(one)));
        second = segment.add(std::make_unique<sim::Esc>(sim::junction(), std::move(two)));
        ASSERT_TRUE(segment.connect_master({first, 0}));
        ASSERT_TRUE(segment.connect({first, 1}, {second, 0}));
        segment.power_up(osal.now());
        nic.emplace(segment, osal);
        ASSERT_TRUE(init(ctx, *nic, osal).ok());
        const auto found = config_init(ctx);
        ASSERT_TRUE(found.ok() || found.error().slave != 0);  // a blank EEPROM is an error of this slave
        ASSERT_EQ(ctx.slaves().size(), 2U);
    }
    [[nodiscard]] std::vector<std::byte>& memory(std::uint32_t slave) { return segment.slave(slave).sii().image(); }
};

TEST_F(SlaveEepromTest, IsReadAndWrittenWhole) {
    build(image(1), image(2));
    SlaveEeprom eeprom(ctx, 2);
    const auto content = read_eeprom(eeprom, eeprom_size(eeprom).octets, no_progress());
    EXPECT_EQ(content.error, "");
    EXPECT_EQ(content.octets, image(2));
    const auto report = write_eeprom(eeprom, image(3), no_progress());
    EXPECT_EQ(report.error, "");
    EXPECT_TRUE(report.verified);
    EXPECT_EQ(memory(second), image(3));
    EXPECT_EQ(memory(first), image(1));
    EXPECT_EQ(write_alias(eeprom, 77, false).error, "");
    EXPECT_EQ(wire::sii::load_configuration(memory(second)).alias, 77);
    EXPECT_TRUE(wire::sii::checksum_right(memory(second)));
}

TEST_F(SlaveEepromTest, BlankOneIsWritten) {
    build(image(1), std::vector<std::byte>(1024, std::byte{0xFF}));
    SlaveEeprom eeprom(ctx, 2);
    EXPECT_NE(eeprom_size(eeprom).error, "");
    EXPECT_TRUE(write_eeprom(eeprom, image(3), no_progress()).verified);
    EXPECT_EQ(memory(second), image(3));
}

// The EEPROM acknowledges no command.
TEST_F(SlaveEepromTest, RefusedWriteIsNotReportedAsDone) {
    build(image(1), std::vector<std::byte>(1024, std::byte{0xFF}));
    SlaveEeprom eeprom(ctx, 2);
    const auto report = write_eeprom(eeprom, image(3), [&](std::string_view what, std::size_t done, std::size_t) {
        if (what == "writing" && done >= 8) segment.slave(second).sii().fail_next(1000);
        return true;
    });
    EXPECT_NE(report.error.find(" was written: slave 2: "), std::string::npos) << report.error;
    EXPECT_FALSE(report.verified);
    EXPECT_EQ(report.written, 8U);
}

// As on a recorded EK1100, the EEPROM acknowledges nothing for 3.8 ms after each word, which is the default of the
// simulation. At one word it needs 60 ms.
TEST_F(SlaveEepromTest, AWordThatTakesItsTimeIsWaitedFor) {
    build(image(1), image(2));
    SlaveEeprom eeprom(ctx, 2);
    bool once = true;
    const auto report = write_eeprom(eeprom, image(3), [&](std::string_view what, std::size_t, std::size_t) {
        if (what == "writing" && std::exchange(once, false)) segment.slave(second).sii().fail_next(60);
        return true;
    });
    EXPECT_EQ(report.error, "");
    EXPECT_TRUE(report.verified);
}

// The alias is written, but its checksum is not acknowledged: the old alias is restored, and the error says so.
TEST_F(SlaveEepromTest, AnAliasWhoseChecksumFailsIsTakenBack) {
    build(image(1), image(2));
    SlaveEeprom eeprom(ctx, 2);
    struct Failing final : Eeprom {
        SlaveEeprom& real;
        sim::SiiUnit& unit;
        Failing(SlaveEeprom& to, sim::SiiUnit& of) : real(to), unit(of) {}
        std::string name() const override { return real.name(); }
        std::string read(std::uint32_t word, MutableBytes into) override { return real.read(word, into); }
        Written write(std::uint32_t word, Bytes octets) override {
            unit.fail_next(word == 7 ? 100000 : 0);
            auto written = real.write(word, octets);
            unit.fail_next(0);
            return written;
        }
    };
    Failing failing(eeprom, segment.slave(second).sii());
    const auto report = write_alias(failing, 77, false);
    EXPECT_TRUE(report.error.starts_with(
        "it is uncertain whether word 0x0007 was written: slave 2: writing the SII at word 0x0007"))
        << report.error;
    EXPECT_TRUE(wire::sii::checksum_right(memory(second))) << report.error;
    EXPECT_TRUE(report.error.ends_with("the old content was restored")) << report.error;
    EXPECT_EQ(memory(second), image(2));
}

// The cable breaks behind the first slave.
TEST_F(SlaveEepromTest, SlaveLostHalfway) {
    build(image(1), std::vector<std::byte>(1024, std::byte{0xFF}));
    SlaveEeprom eeprom(ctx, 2);
    const auto report = write_eeprom(eeprom, image(3), [&](std::string_view what, std::size_t done, std::size_t) {
        if (what == "writing" && done >= 16) segment.set_cable({second, 0}, false);
        return true;
    });
    EXPECT_NE(report.error.find(" was written: slave 2: "), std::string::npos) << report.error;
    EXPECT_FALSE(report.verified);
    EXPECT_EQ(report.written, 16U);
    std::size_t written = 0;
    for (std::size_t i = 0; i < 1024; i += 2) written += load_le<std::uint16_t>(memory(second), i) != 0xFFFF;
    EXPECT_LE(written, report.written);
}

TEST_F(SlaveEepromTest, ContentThatChangesBehindOurBackFailsTheVerification) {
    build(image(1), image(2));
    SlaveEeprom eeprom(ctx, 2);
    const auto report = write_eeprom(eeprom, image(3), [&](std::string_view what, std::size_t done, std::size_t) {
        if (what == "verifying" && done == 0) memory(second)[0x20] = std::byte{0x99};
        return true;
    });
    EXPECT_FALSE(report.verified);
    EXPECT_EQ(report.error.find("word 0x0010 reads 0x0099, written was 0x0000"), 0U) << report.error;
}

TEST_F(SlaveEepromTest, SmallerThanTheImage) {
    build(image(1), image(2, 512));
    std::vector<std::byte> large(1024);
    const std::string name(250, 'x');
    ASSERT_TRUE(wire::sii::write_image({.group = name, .name = name.substr(1), .general = {}}, large).ok());
    SlaveEeprom eeprom(ctx, 2);
    const auto report = write_eeprom(eeprom, large, no_progress());
    EXPECT_EQ(report.error.find("it is uncertain whether word 0x0100 was written: slave 2: "), 0U) << report.error;
    EXPECT_FALSE(report.verified);
}

}  // namespace
}  // namespace margay::samples
