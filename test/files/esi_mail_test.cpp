// EoE and AoE start-up commands in ESI files: the library reads, sends, compares and writes them.
#include <margay/aoe.hpp>
#include <margay/eoe.hpp>
#include <margay/files/esi.hpp>
#include <margay/host_configuration.hpp>
#include <margay/startup_mail.hpp>

#include "files/machine.hpp"

namespace margay::files {
namespace {

// Set IP: flags (MAC, address, mask), MAC, 192.168.0.102, 255.255.255.0, written by hand.
const std::string kEsiIp =
    "07000000"
    "020000000102"
    "6600a8c0"
    "00ffffff";
// Set address filter: one address, no masks, broadcasts do not pass.
const std::string kEsiFilter =
    "8100"
    "0200000000aa" +
    std::string(228, '0');
// Sets the NetID 5.1.2.3.2.1: an AoE write of six octets to index group 1, offset 3, with the NetID as target.
const std::string kEsiNetId =
    "0501020302010000"
    "0000000000000000"
    "0300"
    "0400"
    "12000000"
    "00000000"
    "07000000"
    "01000000"
    "03000000"
    "06000000"
    "050102030201";
// An AoE write of 11 22 33 44 to index group 0x100, offset 16 of port 1 of the device with this NetID.
const std::string kEsiAoeWrite =
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

std::string init_command(const std::string& transition, const std::string& data, const std::string& type = {}) {
    return "<InitCmd><Transition>" + transition + "</Transition>" +
           (type.empty() ? type : "<Type>" + type + "</Type>") + "<Data>" + data +
           "</Data><Comment>of the maker</Comment></InitCmd>";
}

// The ESI of a device of the library, with commands in the elements of its protocols.
std::string esi_with(const std::string& device, const std::string& eoe, const std::string& aoe) {
    const auto described = describe_sii(sim::make_device(device)->sii);
    EXPECT_TRUE(described);
    EsiFile esi;
    esi.vendor = described->identity.vendor;
    esi.devices.push_back(*described);
    std::string text = write_esi(esi).text;
    for (const auto& [name, commands] : {std::pair("EoE", eoe), std::pair("AoE", aoe)}) {
        if (commands.empty()) continue;
        const std::string empty = std::string("<") + name + " />";
        const auto at = text.find(empty);
        EXPECT_NE(at, std::string::npos) << text;
        text.replace(at, empty.size(), std::string("<") + name + ">" + commands + "</" + name + ">");
    }
    return text;
}

// A coupler and the device, which the ESI configures.
struct Described {
    Described(const std::string& device, const std::string& text) : machine({"coupler", device}) {
        set(text);
        expected = {{.number = 1}, {.number = 2, .config = config}};
        EXPECT_TRUE(expect(machine.ctx, expected));
    }
    void set(const std::string& text) {
        const auto esi = read_esi(text);
        EXPECT_TRUE(esi) << to_text(esi.problem);
        for (const Remark& one : esi.remarks) remarks.push_back(one.text);
        const auto made = configure(*esi, esi->devices[0], {}, owner);
        EXPECT_EQ(made.error, "");
        left_out = made.remarks;
        config = made.config;
    }
    Machine machine;
    HostConfiguration owner;
    std::vector<ExpectedSlave> expected;
    const SlaveConfiguration* config = nullptr;
    std::vector<std::string> remarks;
    std::vector<std::string> left_out;
};

TEST(EsiMail, TheParametersOfEoeAreSetAtTheirTransitions) {
    const std::string other =
        "0200000002000000"
        "0700a8c0";  // with its header
    Described described("eoe_gateway", esi_with("eoe_gateway",
                                                init_command("IP", kEsiIp, "2") + init_command("IP", kEsiFilter, "4") +
                                                    init_command("PS", other, "2"),
                                                ""));
    EXPECT_EQ(described.remarks, std::vector<std::string>());
    EXPECT_EQ(described.left_out, std::vector<std::string>());
    Context& ctx = described.machine.ctx;
    const auto found = config_init(ctx);
    ASSERT_TRUE(found) << words(found.error());
    auto ip = EOEget_ip(ctx, 2);
    ASSERT_TRUE(ip) << words(ip.error());
    EXPECT_EQ(ip->address, (Ipv4Address{192, 168, 0, 102})) << "at IP";
    const auto filter = EOEget_filter(ctx, 2);
    ASSERT_TRUE(filter) << words(filter.error());
    EXPECT_EQ(filter->address_count, 1);
    EXPECT_TRUE(filter->no_broadcasts);
    ASSERT_TRUE(config_map(ctx, described.machine.image));
    ip = EOEget_ip(ctx, 2);
    ASSERT_TRUE(ip) << words(ip.error());
    EXPECT_EQ(ip->mac, (MacAddress{2, 0, 0, 0, 1, 2})) << "at IP";
    EXPECT_EQ(ip->subnet_mask, (Ipv4Address{255, 255, 255, 0})) << "at IP";
    EXPECT_EQ(ip->address, (Ipv4Address{192, 168, 0, 7})) << "at PS";
}

TEST(EsiMail, TheCommandsOfAoeAreSentAtTheirTransitions) {
    Described described("aoe_gateway",
                        esi_with("aoe_gateway", "", init_command("IP", kEsiNetId) + init_command("PS", kEsiAoeWrite)));
    EXPECT_EQ(described.remarks, std::vector<std::string>());
    Context& ctx = described.machine.ctx;
    const auto found = config_init(ctx);
    ASSERT_TRUE(found) << words(found.error());
    const auto used = config_map(ctx, described.machine.image);
    ASSERT_TRUE(used) << words(used.error());
    std::array<std::byte, 4> data{};
    const auto read = AOEread(ctx, 2, {{{5, 1, 2, 3, 2, 1}}, 1}, 0x100, 16, data);
    ASSERT_TRUE(read) << words(read.error());
    EXPECT_EQ(data, (std::array{std::byte{0x11}, std::byte{0x22}, std::byte{0x33}, std::byte{0x44}}));
}

TEST(EsiMail, ARefusedCommandIsTheErrorOfItsTransition) {
    // No command has set the NetID of the device, so the AoE command finds no device.
    Described described("aoe_gateway", esi_with("aoe_gateway", "", init_command("PS", kEsiAoeWrite)));
    Context& ctx = described.machine.ctx;
    ASSERT_TRUE(config_init(ctx));
    const auto used = config_map(ctx, described.machine.image);
    ASSERT_FALSE(used);
    EXPECT_EQ(words(used.error()),
              "slave 2: command at PS (no. 1, AoE message): the AoE command was not executed (error code "
              "0x0007: no route to this NetID; index group 0x0100, offset 0x0010)");
}

// After a change of a command of IP, the slave must go through INIT again.
TEST(EsiMail, AnotherCommandOfIpIsNoticed) {
    const std::string first = init_command("IP", kEsiIp, "2");
    Described described("eoe_gateway", esi_with("eoe_gateway", first, ""));
    Context& ctx = described.machine.ctx;
    ASSERT_TRUE(config_init(ctx));
    std::string other = kEsiIp;
    other.replace(other.find("6600"), 4, "0700");
    described.set(esi_with("eoe_gateway", init_command("IP", other, "2"), ""));
    ctx.slave(2).config = *described.config;
    const auto used = config_map(ctx, described.machine.image);
    ASSERT_TRUE(used) << words(used.error());
    const auto ip = EOEget_ip(ctx, 2);
    ASSERT_TRUE(ip) << words(ip.error());
    EXPECT_EQ(ip->address, (Ipv4Address{192, 168, 0, 7}));
}

TEST(EsiMail, WhatIsReadIsWritten) {
    for (const char* device : {"eoe_gateway", "aoe_gateway"}) {
        const bool eoe = std::string(device) == "eoe_gateway";
        const auto esi =
            read_esi(esi_with(device, eoe ? init_command("IP", kEsiIp, "2") + init_command("PS", kEsiFilter, "4") : "",
                              eoe ? "" : init_command("IP", kEsiNetId) + init_command("PS", kEsiAoeWrite)));
        ASSERT_TRUE(esi) << to_text(esi.problem);
        const Written written = write_esi(*esi);
        const auto again = read_esi(written.text);
        ASSERT_TRUE(again) << to_text(again.problem) << "\n" << written.text;
        const auto& before = esi->devices[0].mailbox->commands;
        const auto& after = again->devices[0].mailbox->commands;
        ASSERT_EQ(before.size(), 2U);
        ASSERT_EQ(after.size(), 2U) << written.text;
        for (std::size_t n = 0; n < before.size(); ++n) {
            EXPECT_EQ(after[n].protocol, before[n].protocol);
            EXPECT_EQ(after[n].transitions, before[n].transitions);
            EXPECT_EQ(after[n].index, before[n].index);
            EXPECT_EQ(after[n].data, before[n].data);
            EXPECT_EQ(after[n].comment, "of the maker");
        }
    }
}

// The writer also writes the commands of modules, of each protocol.
TEST(EsiMail, CommandsOfModulesAreWritten) {
    auto esi = read_esi(esi_with("aoe_gateway", "", init_command("IP", kEsiNetId)));
    ASSERT_TRUE(esi) << to_text(esi.problem);
    EsiModule module{.ident = 7, .type = "M"};
    module.commands = esi->devices[0].mailbox->commands;
    module.commands.push_back({.protocol = mailbox_protocol::kSoE,
                               .transitions = Transition::preop_to_safeop,
                               .index = 32,
                               .subindex = 1,
                               .data = {std::byte{1}, std::byte{0}}});
    esi->modules.push_back(module);
    const Written written = write_esi(*esi);
    const auto again = read_esi(written.text);
    ASSERT_TRUE(again) << to_text(again.problem) << "\n" << written.text;
    ASSERT_EQ(again->modules.size(), 1U);
    ASSERT_EQ(again->modules[0].commands.size(), 2U) << written.text;
    EXPECT_EQ(again->modules[0].commands[0].data, module.commands[0].data);
    EXPECT_EQ(again->modules[0].commands[1].protocol, mailbox_protocol::kSoE);
}

TEST(EsiMail, WhatIsNoMessageIsNamedAndLeftOut) {
    const std::string no_eoe =
        "the start-up command of EoE is not sent: its data is neither that of IP parameters nor of an address filter";
    const std::string no_aoe = "the start-up command of AoE is not sent: its data is no AoE command that writes";
    // The data is too short; a filter has the type of IP parameters; flags are without a parameter. The last command is
    // valid and has no type.
    Described eoe("eoe_gateway",
                  esi_with("eoe_gateway",
                           init_command("PS", kEsiIp.substr(2), "2") + init_command("PS", kEsiFilter, "2") +
                               init_command("PS", "00000000", "2") + init_command("PS", kEsiIp),
                           ""));
    EXPECT_EQ(eoe.remarks, (std::vector<std::string>{no_eoe, no_eoe, no_eoe}));
    EXPECT_EQ(eoe.left_out, (std::vector<std::string>{no_eoe, no_eoe, no_eoe}));
    EXPECT_EQ(eoe.config->startup().size(), 1U);
    // One octet less than the message announces; a response; a read; no data.
    std::string answer = kEsiNetId;
    answer.replace(36, 4, "0500");
    std::string read = kEsiNetId;
    read.replace(32, 4, "0200");
    Described aoe("aoe_gateway",
                  esi_with("aoe_gateway", "",
                           init_command("PS", kEsiNetId.substr(0, kEsiNetId.size() - 2)) + init_command("PS", answer) +
                               init_command("PS", read) + init_command("PS", "")));
    EXPECT_EQ(aoe.remarks, (std::vector<std::string>{no_aoe, no_aoe, no_aoe, no_aoe}));
    EXPECT_TRUE(aoe.config->startup().empty());
}

}  // namespace
}  // namespace margay::files
