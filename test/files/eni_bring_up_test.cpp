// The library scans a segment, writes its ENI, and brings the same segment up by this ENI: the slaves have the same
// registers.
#include "files/machine.hpp"

#include <margay/files/eni.hpp>

#include <gtest/gtest.h>

namespace margay::files {
namespace {

using namespace std::chrono_literals;

// Writes the ENI of `first`, brings a new machine up by it and compares the registers of all slaves.
void expect_same(Machine& first, const std::vector<std::string>& devices, Duration cycle = 1ms) {
    const Written written = write_eni(first.ctx, {.cycle = cycle});
    ASSERT_TRUE(written) << written.error;
    auto eni = read_eni(written.text);
    ASSERT_TRUE(eni) << to_text(eni.problem) << "\n" << written.text;
    for (const Remark& remark : eni.remarks) ADD_FAILURE() << to_text(remark);
    EXPECT_EQ(eni->slaves.size(), devices.size());
    Machine second(devices, eni->limits());
    const auto up = bring_up(second.ctx, *eni, second.image);
    ASSERT_TRUE(up) << words(up.error());
    for (std::uint32_t n = 0; n < devices.size(); ++n) {
        EXPECT_EQ(first.registers(n), second.registers(n)) << "slave " << n + 1;
        EXPECT_EQ(first.ctx.slave(n + 1).image.outputs.offset_bits, second.ctx.slave(n + 1).image.outputs.offset_bits);
        EXPECT_EQ(first.ctx.slave(n + 1).image.inputs.offset_bits, second.ctx.slave(n + 1).image.inputs.offset_bits);
    }
    EXPECT_EQ(first.ctx.group(0).expected_wkc, second.ctx.group(0).expected_wkc);
    EXPECT_TRUE(second.to_op(cycle));
}

const std::vector<std::string> kDevices{"coupler", "digital_in_8", "digital_out_8", "analog_in_4", "drive"};

TEST(EniRoundTrip, TheSameRegisters) {
    Machine machine(kDevices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    expect_same(machine, kDevices);
}

// The configuration from a file has PDOs without types. The types come from the SIIs again.
TEST(EniRoundTrip, TheTypesOfEntriesAndVariablesRemain) {
    Machine first(kDevices);
    ASSERT_TRUE(config_init(first.ctx));
    ASSERT_TRUE(config_map(first.ctx, first.image));
    const std::string text = write_eni(first.ctx).text;
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    Machine second(kDevices, eni->limits());
    const auto up = bring_up(second.ctx, *eni, second.image);
    ASSERT_TRUE(up) << words(up.error());
    const auto types = [](const std::string& of) {
        std::vector<std::string> all;
        const std::string begin = "<DataType>";
        for (auto at = of.find(begin); at != std::string::npos; at = of.find(begin, at + 1))
            all.push_back(of.substr(at + begin.size(), of.find('<', at + 1) - at - begin.size()));
        return all;
    };
    EXPECT_GT(types(text).size(), 20U);
    EXPECT_EQ(types(write_eni(second.ctx).text), types(text));
}

TEST(EniRoundTrip, PackedBitByBitAndOverlapped) {
    for (const bool overlapped : {false, true}) {
        Machine machine(kDevices);
        machine.ctx.group(0).config = {.start = {0x0102'0000}, .packing = Packing::bits, .overlapped = overlapped};
        ASSERT_TRUE(config_init(machine.ctx));
        ASSERT_TRUE(config_map(machine.ctx, machine.image));
        expect_same(machine, kDevices);
    }
}

TEST(EniRoundTrip, WithClocksStartUpCommandsAndPdos) {
    static constexpr StartupCommand kCommands[] = {
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8}),
        write_register(Transition::preop_to_safeop, 0x0F80, std::uint16_t{0x1234})};
    static constexpr SlaveSetup kSetup{.startup = kCommands,
                                       .dc = {.source = SyncSettings::Source::application, .shift = 100us}};
    const std::vector<std::string> devices{"coupler", "drive", "drive"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    machine.ctx.slave(2).config.setup = &kSetup;
    ASSERT_TRUE(configdc(machine.ctx, {.cycle = 2ms}));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const Written written = write_eni(machine.ctx, {.cycle = 2ms});
    const auto eni = read_eni(written.text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_TRUE(eni->clocks);
    EXPECT_EQ(eni->clocks->cycle, 2ms);
    const SlaveConfiguration& config = *eni->expected()[1].config;
    EXPECT_EQ(config.dc().assign_activate, 0x0300);
    EXPECT_EQ(config.dc().shift, Duration(100us));
    ASSERT_EQ(config.startup().size(), 2U);
    EXPECT_EQ(config.startup()[0].index, 0x6060);
    EXPECT_EQ(config.startup()[1].index, 0x0F80);
    expect_same(machine, devices, 2ms);
}

// The cycle of the second group, or of the only group, carries the time.
TEST(EniRoundTrip, TheTimeStaysInTheCycleOfItsGroup) {
    for (const bool two : {true, false}) {
        Machine machine({"coupler", "digital_io_16", "drive"}, {.groups = 2});
        ASSERT_TRUE(config_init(machine.ctx));
        for (std::uint16_t n = two ? 3 : 1; n <= 3; ++n) machine.ctx.slave(n).config.group = 1;
        ASSERT_TRUE(configdc(machine.ctx, {.group = 1}));
        std::size_t used = 0;
        if (two) used = *config_map(machine.ctx, machine.image, 0);
        ASSERT_TRUE(config_map(machine.ctx, std::span(machine.image).subspan(used), 1));
        ASSERT_TRUE(send_processdata(machine.ctx, 1));
        (void)receive_processdata(machine.ctx, 2ms, 1);
        const auto eni = read_eni(write_eni(machine.ctx).text);
        ASSERT_TRUE(eni) << to_text(eni.problem);
        ASSERT_TRUE(eni->clocks);
        EXPECT_EQ(eni->groups.size(), two ? 2U : 1U);
        EXPECT_EQ(eni->clocks->group, two ? 1 : 0);
    }
}

TEST(EniRoundTrip, TheStatusOfMailboxesInTheImage) {
    const std::vector<std::string> devices{"coupler", "drive", "drive"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    for (const std::size_t n : {2U, 3U}) machine.ctx.slave(n).config.mailbox_status = true;
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    expect_same(machine, devices);
}

TEST(EniRoundTrip, WatchdogsAndTimeouts) {
    static constexpr StartupCommand kCommands[] = {
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8}),
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8}).within(1500us),
        write_parameter(Transition::preop_to_safeop, 0, Idn{1}, std::uint16_t{2}).within(9s)};
    SlaveSetup setup{.startup = std::span(kCommands).first(2), .times = {.mailbox = 7s}};
    setup.times.watchdog_divider = 998;
    setup.times.pdi_watchdog = 20ms;
    Machine machine({"coupler", "drive"});
    ASSERT_TRUE(config_init(machine.ctx));
    machine.ctx.slave(2).config.setup = &setup;
    machine.ctx.slave(2).config.process_data_watchdog = 50ms;
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const auto at = [&](std::uint16_t address) {
        return load_le<std::uint16_t>(machine.segment.slave(1).peek(address, 2), 0);
    };
    EXPECT_EQ(at(0x0400), 998);
    EXPECT_EQ(at(0x0410), 500);
    EXPECT_EQ(at(0x0420), 1250);
    expect_same(machine, {"coupler", "drive"});
    setup.startup = kCommands;
    setup.times.to_op = 500us;  // rounded up to 1 ms, because 0 means the time of the standard
    const auto eni = read_eni(write_eni(machine.ctx).text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    std::vector<Duration> times;
    for (const StartupCommand& one : eni->expected()[1].config->startup())
        if (one.kind != StartupCommand::Kind::write_register) times.push_back(one.timeout);
    EXPECT_EQ(times, (std::vector<Duration>{7s, 2ms, 9s}));
    EXPECT_EQ(eni->expected()[1].config->times().to_op, 1ms);
}

TEST(EniRoundTrip, WhatAnEniCannotSayIsNamed) {
    static constexpr std::byte kData[] = {std::byte{1}, std::byte{2}};
    static constexpr StartupCommand kCommands[] = {
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8}).that_may_fail(),
        write_whole_object(Transition::preop_to_safeop, 0x6061, kData),
        write_parameter(Transition::preop_to_safeop, 1, Idn{0x8001}, std::uint16_t{2}).afterwards(),
        execute_parameter(Transition::preop_to_safeop, 0, Idn{99}),
        write_register(Transition::preop_to_safeop, 0x0F80, std::uint16_t{1}).that_may_fail()};
    static constexpr SlaveSetup kSetup{.startup = kCommands};
    static constexpr SlaveToSlave kCopies[] = {{.from_slave = 1, .to_slave = 1, .bits = 8}};
    Machine machine({"drive"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    EXPECT_TRUE(write_eni(machine.ctx).remarks.empty());
    auto& config = machine.ctx.slave(1).config;
    config.setup = &kSetup;
    config.no_complete_access = true;
    config.highest = AlState::safeop;
    config.unchecked_pdos = true;
    machine.ctx.group(0).config.copies = kCopies;
    const Written written = write_eni(machine.ctx);
    ASSERT_TRUE(written) << written.error;
    const std::string cannot = " is executed after its transition or may fail, which an ENI cannot say";
    EXPECT_EQ(written.remarks,
              (std::vector<std::string>{
                  "slave 1: the command for object 0x6060" + cannot,
                  "slave 1: the command for object 0x6061 is executed without complete access, which an ENI cannot say",
                  "slave 1: the command for P-0-0001 of drive 1" + cannot,
                  "slave 1: the procedure command S-0-0099 of drive 0 is left out: an ENI can only write values",
                  "slave 1: it is brought to SAFEOP at most, which an ENI cannot say",
                  "slave 1: its PDOs are not compared when it starts up again, which an ENI cannot say",
                  "slave 1: the command for register 0x0f80" + cannot,
                  "group 0: the copies from slave to slave are left out"}));
}

TEST(EniRoundTrip, VariablesLeadToTheDataOfTheirSlaves) {
    Machine machine(kDevices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const auto eni = read_eni(write_eni(machine.ctx).text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_FALSE(eni->variables.empty());
    std::uint32_t bits = 0;
    for (const EniVariable& one : eni->variables) {
        ASSERT_NE(one.slave, 0) << one.name;
        const SlaveImage& image = machine.ctx.slave(one.slave).image;
        const ImagePart& part = one.direction == Direction::outputs ? image.outputs : image.inputs;
        EXPECT_LE(one.bit + one.bits, part.bits) << one.name;
        EXPECT_EQ(one.name.substr(0, 6), "Slave_");
        EXPECT_EQ(eni->find(one.name), &one) << one.name;
        bits += one.bits;
    }
    EXPECT_GT(bits, 100U);
}

// The entries of digital_io_16 are all called "Input" and "Output".
TEST(EniRoundTrip, EachVariableHasANameOfItsOwn) {
    Machine machine({"digital_io_16"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const auto eni = read_eni(write_eni(machine.ctx).text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->variables.size(), 32U);
    for (const EniVariable& one : eni->variables) EXPECT_EQ(eni->find(one.name), &one) << one.name;
    const std::string name = "Slave_1 [Digital I/O, 16 inputs, 16 outputs].Inputs.Input";
    ASSERT_NE(eni->find(name), nullptr);
    ASSERT_NE(eni->find(name + " 16"), nullptr);
    EXPECT_EQ(eni->find(name + " 16")->bit, eni->find(name)->bit + 15);
}

// The file has CoE commands and no other init commands. The CoE commands select the PDOs before the library reads them.
TEST(EniBringUp, PdosThatCoeCommandsSelectAreMapped) {
    std::string commands;
    for (const auto& [subindex, data] : {std::pair{"0", "00"}, std::pair{"1", "0116"}, std::pair{"0", "01"}})
        commands += std::string("<InitCmd><Transition>PS</Transition><Ccs>1</Ccs><Index>0x1c12</Index><SubIndex>") +
                    subindex + "</SubIndex><Data>" + data + "</Data></InitCmd>";
    const auto eni = read_eni(
        "<EtherCATConfig><Config><Master/><Slave><Info><Name>d</Name><VendorId>0x4d47</VendorId>"
        "<ProductCode>0x5402</ProductCode></Info><Mailbox><CoE><InitCmds>" +
        commands + "</InitCmds></CoE></Mailbox></Slave></Config></EtherCATConfig>");
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_FALSE(eni.remarks.empty());
    EXPECT_NE(to_text(eni.remarks.back()).find("up to the last one that selects PDOs are executed at IP, too"),
              std::string::npos)
        << to_text(eni.remarks.back());
    Machine machine({"drive"}, eni->limits());
    const auto up = bring_up(machine.ctx, *eni, machine.image);
    ASSERT_TRUE(up) << words(up.error());
    EXPECT_TRUE(reach(machine.ctx, AlState::op, 5s));
}

TEST(EniBringUp, AnotherSlaveIsAnError) {
    Machine machine({"coupler", "digital_in_8"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const auto eni = read_eni(write_eni(machine.ctx).text);
    ASSERT_TRUE(eni);
    Machine other({"coupler", "digital_out_8"});
    const auto up = bring_up(other.ctx, *eni, other.image);
    ASSERT_FALSE(up);
    EXPECT_EQ(up.error().code, Errc::other_slave);
    EXPECT_EQ(up.error().slave, 2);
}

TEST(EniBringUp, AWriteThatNobodyAnswersIsRepeatedAndMayBeIgnored) {
    // No chip of the simulation has memory at 0xF000: the working counter is 0.
    const auto time_of = [](std::uint16_t retries, bool any) {
        Machine machine({"coupler", "digital_in_8"});
        StartupCommand command = write_register(Transition::preop_to_safeop, 0xF000, std::uint16_t{1});
        command.retries = retries;
        command.any_counter = any;
        const SlaveSetup setup{.startup = std::span<const StartupCommand>(&command, 1)};
        EXPECT_TRUE(config_init(machine.ctx));
        machine.ctx.slave(2).config.setup = &setup;
        const Time before = machine.osal.now();
        const auto mapped = config_map(machine.ctx, machine.image);
        EXPECT_EQ(mapped.ok(), any) << words(mapped.error());
        return machine.osal.now() - before;
    };
    for (const bool any : {false, true}) EXPECT_GE(time_of(3, any) - time_of(0, any), Duration(3ms)) << any;
}

TEST(EniBringUp, AGreaterRevisionIsAcceptedWhereTheFileSaysSo) {
    std::uint32_t revision = 0;
    {
        Machine machine({"digital_in_8"});
        ASSERT_TRUE(config_init(machine.ctx));
        revision = machine.ctx.slave(1).identity.revision;
        ASSERT_GT(revision, 0U);
    }
    for (const bool newer : {false, true})
        for (const std::uint32_t wanted : {revision - 1, revision, revision + 1}) {
            Machine machine({"digital_in_8"});
            const ExpectedSlave expected[] = {{.number = 1, .revision = wanted, .newer_revision = newer}};
            ASSERT_TRUE(expect(machine.ctx, expected));
            const bool right = wanted == revision || (newer && wanted < revision);
            EXPECT_EQ(config_init(machine.ctx).ok(), right) << wanted << " wanted, " << revision << " found";
        }
}

TEST(ImagePlaces, AreTakenAndChecked) {
    Machine machine({"coupler", "digital_out_8", "digital_out_8"});
    ASSERT_TRUE(config_init(machine.ctx));
    SlaveSetup first{.place = {.outputs_bit = 64}};
    const SlaveSetup second{.place = {.outputs_bit = 8}};
    machine.ctx.slave(2).config.setup = &first;
    machine.ctx.slave(3).config.setup = &second;
    const auto used = config_map(machine.ctx, machine.image);
    ASSERT_TRUE(used) << words(used.error());
    EXPECT_EQ(*used, 9U);
    EXPECT_EQ(machine.ctx.slave(2).image.outputs.offset_bits, 64U);
    EXPECT_EQ(machine.ctx.slave(3).image.outputs.offset_bits, 8U);
    for (const std::uint32_t wrong : {8U, 12U}) {  // the place of slave 3; a place within an octet
        first.place.outputs_bit = wrong;
        const auto refused = config_map(machine.ctx, machine.image);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().code, Errc::invalid_argument);
        EXPECT_EQ(refused.error().detail, static_cast<std::uint32_t>(Argument::image_place));
    }
}

}  // namespace
}  // namespace margay::files
