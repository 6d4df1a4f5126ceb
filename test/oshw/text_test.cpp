// Datagrams and registers as text.
#include "wire/text.hpp"

#include <gtest/gtest.h>

#include <string>

namespace margay::wire {
namespace {

std::string register_text(std::uint16_t address) {
    std::array<char, 64> buffer{};
    TextWriter text(buffer);
    describe_register(text, address);
    return std::string(text.text());
}

TEST(RegisterText, NamesRegistersArraysAndRam) {
    EXPECT_EQ(register_text(0x0000), "type");
    EXPECT_EQ(register_text(0x0130), "AL status");
    EXPECT_EQ(register_text(0x0131), "AL status +1");
    EXPECT_EQ(register_text(0x0132), "");  // reserved
    EXPECT_EQ(register_text(0x0502), "SII control");
    EXPECT_EQ(register_text(0x050C), "SII data +4");
    EXPECT_EQ(register_text(0x0600), "FMMU 0");
    EXPECT_EQ(register_text(0x0630), "FMMU 3");
    EXPECT_EQ(register_text(0x0634), "FMMU 3 +4");
    EXPECT_EQ(register_text(0x0700), "");  // behind the last of the 16 FMMUs
    EXPECT_EQ(register_text(0x0805), "SM 0 status");
    EXPECT_EQ(register_text(0x080D), "SM 1 status");
    EXPECT_EQ(register_text(0x0880), "");
    EXPECT_EQ(register_text(0x092C), "system time difference");
    EXPECT_EQ(register_text(0x0F80), "user RAM");
    EXPECT_EQ(register_text(0x1000), "process RAM");
    EXPECT_EQ(register_text(0xFFFF), "process RAM");
}

TEST(RegisterText, EveryAddressIsSafe) {
    for (unsigned address = 0; address <= 0xFFFF; ++address)
        EXPECT_LT(register_text(static_cast<std::uint16_t>(address)).size(), 40u);
}

std::string request_text(Command command, DatagramAddress address, std::uint16_t length) {
    std::array<char, 96> buffer{};
    TextWriter text(buffer);
    DatagramHeader header;
    header.command = command;
    header.address = address;
    header.length = length;
    describe_request(text, header);
    return std::string(text.text());
}

TEST(RequestText, SaysWhoAndWhat) {
    EXPECT_EQ(request_text(Command::FPRD, {StationAddress{0x1001}, 0x0130}, 2),
              "FPRD 0x1001 AL status (0x0130), 2 octets");
    EXPECT_EQ(request_text(Command::APWR, {RingPosition{2}, 0x0010}, 2),
              "APWR position 2 station address (0x0010), 2 octets");
    EXPECT_EQ(request_text(Command::BRD, {std::uint16_t{0}, 0x0000}, 1), "BRD type (0x0000), 1 octet");
    EXPECT_EQ(request_text(Command::LRW, LogicalAddress{0x10000}, 12), "LRW logical 0x00010000, 12 octets");
    EXPECT_EQ(request_text(Command::FPRD, {StationAddress{1}, 0x0132}, 2), "FPRD 0x0001 (0x0132), 2 octets");
}

TEST(DatagramText, IsOneLineOfColumns) {
    const std::byte data[] = {std::byte{0x08}, std::byte{0x00}};
    std::array<char, 200> buffer{};
    DatagramView view;
    view.header.command = Command::APRD;
    view.header.index = 0x1F;
    view.header.address = {std::uint16_t{0xFFFE}, std::uint16_t{0x0130}};
    view.header.length = 2;
    view.header.irq = 4;
    view.data = data;
    view.wkc = 1;
    EXPECT_EQ(describe(view, buffer), "0x1f APRD -2:0x0130 AL status                n2 wkc 1 irq 0x0004 : 08 00");
    for (std::size_t room = 0; room < 80; ++room)  // truncated, never written beyond the end
        EXPECT_LE(describe(view, std::span(buffer).first(room)).size(), room);
}

TEST(DatagramText, AnUnknownCommandIsShownByItsNumber) {
    std::array<char, 200> buffer{};
    DatagramView view;
    view.header.command = static_cast<Command>(99);
    EXPECT_NE(describe(view, buffer).find("?99"), std::string_view::npos);
    EXPECT_EQ(to_text(static_cast<Command>(15)), "unknown");
}

}  // namespace
}  // namespace margay::wire
