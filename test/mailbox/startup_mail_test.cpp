// Start-up commands that are messages of AoE and EoE.
#include "mailbox/mailbox_bus.hpp"
#include "wire/aoe.hpp"

#include <margay/aoe.hpp>
#include <margay/eoe.hpp>
#include <margay/startup_mail.hpp>

namespace margay {
namespace {

using enum Transition;

constexpr AoeNetId kOwnNetId{{5, 1, 2, 3, 2, 1}};
constexpr AoeAddress kMemory{kOwnNetId, 1};

class StartupMail : public testing::Test {
  protected:
    MailboxBus bus;
    std::vector<std::byte> image = std::vector<std::byte>(4096);
    SlaveSetup setup;

    // Maps slave 1 with these commands.
    Result<> map(std::span<const StartupCommand> commands) {
        setup = {.startup = StartupCommands(commands)};
        bus.ctx->slave(1).config.setup = &setup;
        const auto used = config_map(*bus.ctx, image);
        return used ? Result<>() : Result<>(used.error());
    }
    std::string says(const StartupCommand& command) {
        const StartupCommand list[] = {command};
        const auto done = map(list);
        return done ? "" : bus.words(done.error());
    }
};

TEST_F(StartupMail, GivesASlaveItsNetIdAndWritesToItsDevices) {
    bus.add_device(sim::make_device("aoe_gateway").value());
    bus.start();
    const auto net_id = aoe_net_id_command(kOwnNetId);
    std::array<std::byte, kAoeWriteBytes + 3> memory{};
    const std::array data{std::byte{7}, std::byte{8}, std::byte{9}};
    const auto write = aoe_write_command(kMemory, 0x100, 16, data, memory);
    ASSERT_EQ(write.size(), memory.size());
    const StartupCommand commands[] = {send_aoe(init_to_preop, net_id),
                                       send_aoe(preop_to_safeop, Borrowed<std::byte>(write))};
    const auto done = map(commands);
    ASSERT_TRUE(done) << bus.words(done.error());
    std::array<std::byte, 3> there{};
    const auto read = AOEread(*bus.ctx, 1, kMemory, 0x100, 16, there);
    ASSERT_TRUE(read) << bus.words(read.error());
    EXPECT_EQ(there, data);
    EXPECT_TRUE(aoe_write_command(kMemory, 0x100, 16, data, MutableBytes(memory).first(46)).empty());
}

TEST_F(StartupMail, SetsIpParametersAndFilters) {
    bus.add_device(sim::make_device("eoe_gateway").value());
    bus.start();
    EoeIp ip;
    ip.address = {192, 168, 5, 2};
    ip.subnet_mask = {255, 255, 255, 0};
    EoeFilter filter;
    filter.addresses[0] = {2, 0, 0, 0, 0, 0xAA};
    filter.address_count = 1;
    const auto set_ip = eoe_ip_message(ip);
    const auto set_filter = eoe_filter_message(filter);
    const StartupCommand commands[] = {send_eoe(init_to_preop, set_ip), send_eoe(preop_to_safeop, set_filter)};
    const auto done = map(commands);
    ASSERT_TRUE(done) << bus.words(done.error());
    const auto has = EOEget_ip(*bus.ctx, 1);
    ASSERT_TRUE(has) << bus.words(has.error());
    EXPECT_EQ(has->address, ip.address);
    EXPECT_EQ(has->subnet_mask, ip.subnet_mask);
    const auto passes = EOEget_filter(*bus.ctx, 1);
    ASSERT_TRUE(passes) << bus.words(passes.error());
    EXPECT_EQ(*passes, filter);
}

TEST_F(StartupMail, WhatCannotBeSentIsNamed) {
    bus.add_device(sim::make_device("aoe_gateway").value());
    bus.start();
    const std::string no_message =
        "argument out of range: the message of the start-up command writes or sets nothing, contradicts itself or does "
        "not fit the mailbox";
    const auto net_id = aoe_net_id_command(kOwnNetId);
    EXPECT_EQ(says(send_aoe(preop_to_safeop, Bytes(net_id).first(49))),
              "slave 1: command at PS (no. 1, AoE message): " + no_message);
    EXPECT_EQ(says(send_aoe(preop_to_safeop, {})), "slave 1: command at PS (no. 1, AoE message): " + no_message);
    EXPECT_EQ(says(send_eoe(preop_to_safeop, Bytes(net_id))),
              "slave 1: command at PS (no. 1, EoE message): " + no_message);
    EoeFilter many;
    many.address_count = EoeFilter::kAddresses + 1;
    const auto filter = eoe_filter_message(many);
    EXPECT_EQ(says(send_eoe(preop_to_safeop, filter)), "slave 1: command at PS (no. 1, EoE message): " + no_message);
    std::vector<std::byte> memory(2000);
    const auto long_one = aoe_write_command(kMemory, 0x100, 0, pattern(1900), memory);
    EXPECT_EQ(says(send_aoe(preop_to_safeop, Borrowed<std::byte>(long_one))),
              "slave 1: command at PS (no. 1, AoE message): " + no_message);
    EoeIp ip;
    ip.address = {1, 2, 3, 4};
    const auto set_ip = eoe_ip_message(ip);
    EXPECT_EQ(says(send_eoe(preop_to_safeop, set_ip)),
              "slave 1: command at PS (no. 1, EoE message): not supported by the slave");
    StartupCommand bare = send_aoe(preop_to_safeop, net_id);
    bare.mail = nullptr;
    EXPECT_NE(says(bare).find("the kind or the moment of a start-up command is no known one"), std::string::npos);
    // A command with the kind of one command and the part of another command.
    const std::array<StartupCommand, 3> right{send_aoe(preop_to_safeop, net_id), send_eoe(preop_to_safeop, set_ip),
                                              write_parameter(preop_to_safeop, 0, Idn{1}, std::uint32_t{5})};
    for (const StartupCommand& command : right)
        for (const StartupCommand& other : right) {
            StartupCommand mixed = command;
            mixed.kind = other.kind;
            const bool refused = says(mixed).find("the kind or the moment") != std::string::npos;
            EXPECT_EQ(refused, mixed.kind != command.kind)
                << static_cast<int>(command.kind) << static_cast<int>(mixed.kind);
        }
    EXPECT_EQ(says(send_aoe(preop_to_safeop, net_id)), "");
}

// The late answer to a command that was given up is not the answer to the next command, although both commands have the
// same invoke ID in the file.
TEST_F(StartupMail, ALateAnswerIsNotThatOfTheNextCommand) {
    ScriptedSlave& slave = bus.add_scripted(128, mailbox_protocol::kAoE);
    bus.start();
    std::vector<Mail> asked;
    const auto answer = [&](const Mail& mail, std::uint32_t result) {
        Mail data(mail.begin() + wire::kMailboxHeaderBytes, mail.begin() + wire::kMailboxHeaderBytes + 32);
        wire::aoe::Layout::flags::store(data, 5);
        wire::aoe::Layout::data_bytes::store(data, 4);
        for (unsigned n = 0; n < 4; ++n) data.push_back(static_cast<std::byte>(result >> (8 * n)));
        slave.reply(data, MailboxType::aoe);
    };
    slave.on_mail = [&](const Mail& mail) {
        asked.push_back(mail);
        if (asked.size() != 2) return;
        answer(asked[0], 0);      // a late success
        answer(asked[1], 0x703);  // invalid index offset
    };
    const auto net_id = aoe_net_id_command(kOwnNetId);
    const StartupCommand commands[] = {send_aoe(preop_to_safeop, net_id).within(20ms).that_may_fail(),
                                       send_aoe(preop_to_safeop, net_id)};
    const auto done = map(commands);
    ASSERT_FALSE(done);
    EXPECT_EQ(bus.words(done.error()),
              "slave 1: command at PS (no. 2, AoE message): the device refused the AoE command (error code 0x0703: "
              "invalid index offset; index group 0x0001, offset 0x0003)");
}

}  // namespace
}  // namespace margay
