// EoE and AoE messages in ENI files, and modules: the library reads, sends, compares and writes them.
#include "files/examples.hpp"
#include "files/machine.hpp"

#include "wire/aoe.hpp"
#include "wire/eoe.hpp"

#include <margay/aoe.hpp>
#include <margay/eoe.hpp>
#include <margay/files/eni.hpp>
#include <margay/startup_mail.hpp>
#include <margay/supervision.hpp>

#include <gtest/gtest.h>

namespace margay::files {
namespace {

// Set IP: header, flags (MAC, address, mask), MAC, 192.168.0.102, 255.255.255.0. Configuration tools write these octets
// (fact sheet of ENI files from the field).
const std::string kIpWithHeader =
    "0200000007000000"
    "020000000102"
    "6600a8c0"
    "00ffffff";
const std::string kIpFull =
    "07000000"
    "020000000102"
    "6600a8c0"
    "00ffffff" +
    std::string(80, '0');
// Set address filter: one address, no masks, broadcasts do not pass.
const std::string kFilter =
    "04000000"
    "8100"
    "0200000000aa" +
    std::string(228, '0');

std::string command(const std::string& transition, const std::string& data) {
    return "<InitCmd><Transition>" + transition + "</Transition><Timeout>0</Timeout><Data>" + data +
           "</Data></InitCmd>";
}
std::string eoe(const std::string& commands) { return "<EoE><InitCmds>" + commands + "</InitCmds></EoE>"; }

// An AoE write of four octets to index group 0x100, offset 16 of the device with the NetID 5.1.2.3.2.1, port 1. Its
// parts are: addresses of target and source, command 3, flags 4, octets, error, invoke ID 7, group, offset, octets,
// data.
const std::string kAoeWrite =
    "0501020302010100"
    "0000000000000000"
    "0300"
    "0400"
    "10000000"
    "00000000"
    "07000000"
    "00010000"
    "10000000"
    "04000000"
    "11223344";

// The example, with `what` in place of the element EoE of the first slave.
std::string with_mail(const std::string& what) {
    std::string text = kExampleEni;
    const auto from = text.find("<EoE>");
    const auto to = text.find("</EoE>") + 6;
    return text.replace(from, to - from, what);
}

std::vector<std::string> said(const Read<EniConfiguration>& eni) {
    std::vector<std::string> all;
    for (const Remark& one : eni.remarks)
        if (one.text.find("oE") != std::string::npos) all.push_back(one.text);
    return all;
}

// The start-up commands of EoE and AoE of a slave.
std::vector<StartupCommand> mail_of(const EniConfiguration& eni, unsigned number) {
    std::vector<StartupCommand> all;
    for (const StartupCommand& one : eni.expected()[number - 1].config->startup())
        if (one.kind == StartupCommand::Kind::send_aoe || one.kind == StartupCommand::Kind::send_eoe)
            all.push_back(one);
    return all;
}
std::optional<EoeIp> ip_in(const StartupCommand& command) {
    EXPECT_EQ(command.kind, StartupCommand::Kind::send_eoe);
    EXPECT_EQ(command.octets()[0], std::byte{2});
    return wire::eoe::load_ip(command.octets().subspan(wire::eoe::kHeaderBytes));
}
std::optional<EoeFilter> filter_in(const StartupCommand& command) {
    EXPECT_EQ(command.kind, StartupCommand::Kind::send_eoe);
    EXPECT_EQ(command.octets()[0], std::byte{4});
    return wire::eoe::load_filter(command.octets().subspan(wire::eoe::kHeaderBytes));
}
void expect_net_id(const StartupCommand& command, const AoeNetId& id) {
    EXPECT_EQ(command.kind, StartupCommand::Kind::send_aoe);
    EXPECT_EQ(command.transitions, Transition::init_to_preop);
    EXPECT_TRUE(std::ranges::equal(command.octets(), aoe_net_id_command(id)));
}

TEST(EniMail, IpParametersAreReadWithAndWithoutTheirHeader) {
    for (const std::string& data : {kIpWithHeader, "02000000" + kIpFull, kIpFull, kIpWithHeader.substr(8)}) {
        const auto eni = read_eni(with_mail(eoe(command("PS", data))));
        ASSERT_TRUE(eni) << to_text(eni.problem);
        EXPECT_EQ(said(eni), std::vector<std::string>());
        const auto mail = mail_of(*eni, 1);
        ASSERT_EQ(mail.size(), 1U) << data;
        EXPECT_EQ(mail[0].transitions, Transition::preop_to_safeop);
        const auto ip = ip_in(mail[0]);
        ASSERT_TRUE(ip);
        EXPECT_EQ(ip->mac, (MacAddress{2, 0, 0, 0, 1, 2}));
        EXPECT_EQ(ip->address, (Ipv4Address{192, 168, 0, 102}));
        EXPECT_EQ(ip->subnet_mask, (Ipv4Address{255, 255, 255, 0}));
        EXPECT_FALSE(ip->default_gateway);
    }
}

TEST(EniMail, FlagsThatLookLikeAHeaderAreFlags) {
    // The message has room for all parameters and sets only the address: its flags are 2. The header has the same
    // octets.
    const auto eni =
        read_eni(with_mail(eoe(command("IP", "02000000" + std::string(12, '0') + "0100a8c0" + std::string(88, '0')))));
    ASSERT_TRUE(eni);
    const auto mail = mail_of(*eni, 1);
    ASSERT_EQ(mail.size(), 1U);
    EXPECT_EQ(ip_in(mail[0])->address, (Ipv4Address{192, 168, 0, 1}));
    EXPECT_FALSE(ip_in(mail[0])->mac);
}

TEST(EniMail, FiltersNetIdsAndCommandsAreRead) {
    const auto eni = read_eni(with_mail(eoe(command("IP", kFilter)) + "<AoE><InitCmds>" + command("PS", kAoeWrite) +
                                        "</InitCmds><NetId>1.1.1.1.3.234</NetId></AoE>"));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(said(eni), std::vector<std::string>());
    const auto mail = mail_of(*eni, 1);
    ASSERT_EQ(mail.size(), 3U);
    EXPECT_EQ(filter_in(mail[0])->address_count, 1);
    EXPECT_TRUE(filter_in(mail[0])->no_broadcasts);
    expect_net_id(mail[1], {{1, 1, 1, 1, 3, 234}});
    EXPECT_EQ(mail[2].kind, StartupCommand::Kind::send_aoe);
    EXPECT_EQ(mail[2].octets().size(), 48U);
}

TEST(EniMail, TheTimeoutOfACommandIsUsed) {
    std::string timed = command("PS", kAoeWrite);
    timed.replace(timed.find(">0<"), 3, ">250<");
    const auto eni = read_eni(with_mail("<AoE><InitCmds>" + timed + "</InitCmds></AoE>"));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_EQ(mail_of(*eni, 1).size(), 1U);
    EXPECT_EQ(mail_of(*eni, 1)[0].timeout, 250ms);
}

TEST(EniMail, WhatIsNoMessageIsNamedOrRefused) {
    auto eni =
        read_eni(with_mail(eoe(command("PS", "0200000007") + command("PS", kFilter.substr(0, 40)) + command("PS", "")) +
                           "<AoE><InitCmds>" + command("PS", kAoeWrite.substr(2)) + "</InitCmds></AoE>" +
                           "<FoE><InitCmds>" + command("PS", "00") + "</InitCmds></FoE>"));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    const std::string no_eoe =
        "the start-up command of EoE is not sent: its data is neither that of IP parameters nor of an address filter";
    EXPECT_EQ(said(eni), (std::vector<std::string>{
                             no_eoe, no_eoe, no_eoe,
                             "the start-up command of AoE is not sent: its data is no AoE command that writes",
                             "the start-up command of FoE is not supported and not sent"}));
    EXPECT_TRUE(mail_of(*eni, 1).empty());
    for (const char* id : {"1.2.3.4.5", "1.2.3.4.5.256", "1.2.3.4.5.6.7", "a.b.c.d.e.f", "1,2,3,4,5,6"}) {
        eni = read_eni(with_mail(std::string("<AoE><NetId>") + id + "</NetId></AoE>"));
        ASSERT_FALSE(eni) << id;
        EXPECT_EQ(eni.problem.text,
                  "NetId is '" + std::string(id) + "', and not six numbers from 0 to 255 with dots between them");
    }
}

TEST(EniMail, TheSwitchOfTheMasterIsRead) {
    std::string text = kExampleEni;
    text.insert(text.find("</Master>"),
                "<EoE><MaxPorts>3</MaxPorts><MaxFrames>120</MaxFrames><MaxMACs>100</MaxMACs></EoE>");
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_TRUE(eni->eoe);
    EXPECT_EQ(eni->eoe->ports, 3U);
    EXPECT_EQ(eni->eoe->frames, 120U);
    EXPECT_EQ(eni->eoe->macs, 100U);
}

// ------------------------------------------------------------------ on a segment

// The ENI of these devices, with `what` in the mailbox of slave `number`.
std::string eni_of(const std::vector<std::string>& devices, unsigned number, const std::string& what) {
    Machine machine(devices);
    EXPECT_TRUE(config_init(machine.ctx));
    EXPECT_TRUE(config_map(machine.ctx, machine.image));
    std::string text = write_eni(machine.ctx).text;
    std::size_t at = 0;
    for (unsigned n = 0; n < number; ++n) at = text.find("<Slave>", at + 1);
    return text.insert(text.find("</Mailbox>", at), what);
}

EoeIp ip_of(Context& ctx, std::uint16_t slave) {
    const auto ip = EOEget_ip(ctx, slave);
    EXPECT_TRUE(ip) << words(ip.error());
    return ip ? *ip : EoeIp{};
}

const std::vector<std::string> kGateways{"coupler", "eoe_gateway", "aoe_gateway"};

TEST(EniMail, ASlaveGetsItsIpParametersAlsoWhenItComesBack) {
    const std::vector<std::string> devices{"coupler", "digital_in_8", "eoe_gateway"};
    const std::string other =
        "0200000002000000"
        "0700a8c0";  // at PS: another address
    const auto eni = read_eni(eni_of(devices, 3, eoe(command("IP", kIpWithHeader) + command("PS", other))));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    Machine machine(devices, eni->limits());
    const auto up = bring_up(machine.ctx, *eni, machine.image);
    ASSERT_TRUE(up) << words(up.error());
    SuperviseRequest supervise;
    ASSERT_TRUE(submit(machine.ctx, supervise));
    ASSERT_TRUE(machine.to_op(1ms));
    const auto expect_set = [&] {
        const EoeIp ip = ip_of(machine.ctx, 3);
        EXPECT_EQ(ip.mac, (MacAddress{2, 0, 0, 0, 1, 2})) << "IP";
        EXPECT_EQ(ip.subnet_mask, (Ipv4Address{255, 255, 255, 0})) << "IP";
        EXPECT_EQ(ip.address, (Ipv4Address{192, 168, 0, 7})) << "PS";
    };
    expect_set();
    // Without power, the device loses its parameters.
    machine.segment.set_power(2, false, machine.osal.now());
    bool lost = false;
    const auto seen = run_cycle(machine.ctx, {.period = 1ms}, [&](const CycleInfo& info) {
        const bool in_op = machine.ctx.slave(3).al.state == AlState::op;
        if (!in_op && !lost) machine.segment.set_power(2, true, machine.osal.now());
        lost = lost || !in_op;
        return !(lost && in_op) && info.number < 20'000;
    });
    ASSERT_TRUE(seen) << words(seen.error());
    ASSERT_TRUE(lost);
    ASSERT_EQ(machine.ctx.slave(3).al.state, AlState::op);
    expect_set();
}

TEST(EniMail, ASlaveGetsItsNetIdAndItsAoeCommands) {
    const auto eni = read_eni(eni_of(
        kGateways, 3, "<AoE><InitCmds>" + command("PS", kAoeWrite) + "</InitCmds><NetId>5.1.2.3.2.1</NetId></AoE>"));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(said(eni), std::vector<std::string>());
    Machine machine(kGateways, eni->limits());
    const auto up = bring_up(machine.ctx, *eni, machine.image);
    ASSERT_TRUE(up) << words(up.error());
    std::array<std::byte, 4> data{};
    const auto read = AOEread(machine.ctx, 3, {{{5, 1, 2, 3, 2, 1}}, 1}, 0x100, 16, data);
    ASSERT_TRUE(read) << words(read.error());
    EXPECT_EQ(data, (std::array{std::byte{0x11}, std::byte{0x22}, std::byte{0x33}, std::byte{0x44}}));
}

TEST(EniMail, ARefusedAoeCommandIsTheErrorOfItsSlave) {
    // The device has the NetID of the file. The command has another NetID, so it finds no device.
    for (const char* transition : {"IP", "PS"}) {
        const auto eni = read_eni(
            eni_of(kGateways, 3,
                   "<AoE><InitCmds>" + command(transition, kAoeWrite) + "</InitCmds><NetId>5.1.2.3.2.9</NetId></AoE>"));
        ASSERT_TRUE(eni) << to_text(eni.problem);
        Machine machine(kGateways, eni->limits());
        const auto up = bring_up(machine.ctx, *eni, machine.image);
        ASSERT_FALSE(up) << transition;
        EXPECT_EQ(up.error().code, Errc::aoe_error) << words(up.error());
        EXPECT_EQ(up.error().slave, 3);
        EXPECT_EQ(up.error().detail, 7U);
    }
}

TEST(EniMail, AnErrorOfASlaveIsTheErrorOfBringingItUp) {
    // The drive does not support EoE.
    for (const char* transition : {"IP", "PS"}) {
        const auto eni = read_eni(eni_of({"coupler", "drive"}, 2, eoe(command(transition, kIpWithHeader))));
        ASSERT_TRUE(eni) << to_text(eni.problem);
        Machine machine({"coupler", "drive"}, eni->limits());
        const auto up = bring_up(machine.ctx, *eni, machine.image);
        ASSERT_FALSE(up) << transition;
        EXPECT_EQ(up.error().code, Errc::unsupported) << words(up.error());
        EXPECT_EQ(up.error().slave, 2);
        EXPECT_EQ(words(up.error()), std::string("slave 2: command at ") + transition +
                                         " (no. 1, EoE message): not supported by the slave");
    }
}

TEST(EniMail, WhatIsSentIsWrittenAgain) {
    const auto eni = read_eni(eni_of(kGateways, 2, eoe(command("IP", kIpWithHeader) + command("PS", kFilter))));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    Machine machine(kGateways, eni->limits());
    ASSERT_TRUE(bring_up(machine.ctx, *eni, machine.image));
    const Written written = write_eni(machine.ctx, {.eoe = EniEoe{.ports = 2, .frames = 10, .macs = 20}});
    ASSERT_TRUE(written) << written.error;
    const auto again = read_eni(written.text);
    ASSERT_TRUE(again) << to_text(again.problem) << written.text;
    EXPECT_EQ(said(again), std::vector<std::string>());
    const auto before = mail_of(*eni, 2);
    const auto after = mail_of(*again, 2);
    ASSERT_EQ(after.size(), 2U);
    EXPECT_EQ(ip_in(after[0]), ip_in(before[0]));
    EXPECT_EQ(after[0].transitions, Transition::init_to_preop);
    EXPECT_EQ(filter_in(after[1]), filter_in(before[1]));
    EXPECT_EQ(again->eoe->macs, 20U);
    const auto named = read_eni(eni_of(kGateways, 3, "<AoE><NetId>5.1.2.3.2.1</NetId></AoE>"));
    ASSERT_TRUE(named);
    Machine third(kGateways, named->limits());
    ASSERT_TRUE(bring_up(third.ctx, *named, third.image));
    const auto net_id = read_eni(write_eni(third.ctx).text);
    ASSERT_TRUE(net_id) << to_text(net_id.problem);
    ASSERT_EQ(mail_of(*net_id, 3).size(), 1U) << "once, though the file has the element and the command";
    expect_net_id(mail_of(*net_id, 3)[0], {{5, 1, 2, 3, 2, 1}});
}

TEST(EniMail, AConfigurationMayBeMovedAfterwards) {
    auto eni = read_eni(eni_of(kGateways, 2, eoe(command("PS", kIpWithHeader))));
    ASSERT_TRUE(eni);
    Machine machine(kGateways, eni->limits());
    ASSERT_TRUE(apply(machine.ctx, *eni));
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(check_modules(machine.ctx, *eni));
    const EniConfiguration moved = std::move(*eni);
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    EXPECT_EQ(ip_of(machine.ctx, 2).address, (Ipv4Address{192, 168, 0, 102}));
}

// ------------------------------------------------------------------ modules

TEST(EniModules, TheConfiguredListIsWrittenAndTheDetectedOneCompared) {
    Machine machine({"modular_io"});
    ASSERT_TRUE(config_init(machine.ctx));
    constexpr std::array<std::uint32_t, 4> kThere{0x104, 0x208, 0x302, 0x401};
    ASSERT_TRUE(SDOwrite(machine.ctx, 1, 0xF030, 0, std::uint8_t{0}));
    for (std::uint8_t n = 0; n < kThere.size(); ++n)
        ASSERT_TRUE(SDOwrite(machine.ctx, 1, 0xF030, static_cast<std::uint8_t>(n + 1), kThere[n]));
    ASSERT_TRUE(SDOwrite(machine.ctx, 1, 0xF030, 0, std::uint8_t{kThere.size()}));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    std::string text = write_eni(machine.ctx).text;
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->slaves[0].modules, std::vector<std::uint32_t>(kThere.begin(), kThere.end()));
    Machine second({"modular_io"}, eni->limits());
    const auto up = bring_up(second.ctx, *eni, second.image);
    ASSERT_TRUE(up) << words(up.error());
    EXPECT_EQ(machine.registers(0), second.registers(0));
    EXPECT_EQ(*SDOread<std::uint32_t>(second.ctx, 1, 0xF030, 3), 0x302U) << "written to the slave";

    // The file has another module in slot 1.
    const auto at = text.find("<Data>08020000</Data>");
    ASSERT_NE(at, std::string::npos);
    const auto other = read_eni(text.replace(at, 21, "<Data>09020000</Data>"));
    ASSERT_TRUE(other) << to_text(other.problem);
    Machine third({"modular_io"}, other->limits());
    const auto refused = bring_up(third.ctx, *other, third.image);
    ASSERT_FALSE(refused);
    EXPECT_EQ(words(refused.error()),
              "slave 1: SDO upload of 0xf050:2: the value is not the required one (wanted 0x00000209, is 0x00000208)");
}

TEST(EniModules, CompleteAccessIsReadToo) {
    std::string text = kExampleEni;
    const std::string plain = "<InitCmd Fixed=\"1\">";
    const auto at = text.find(plain);
    ASSERT_NE(at, std::string::npos);
    text.insert(
        at,
        "<InitCmd CompleteAccess=\"1\"><Transition>IP</Transition><Timeout>0</Timeout><Ccs>1</Ccs><Index>61488</Index>"
        "<SubIndex>0</SubIndex><Data>02000401000008020000</Data></InitCmd>");
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->slaves[0].modules, (std::vector<std::uint32_t>{0x104, 0x208}));
}

}  // namespace
}  // namespace margay::files
