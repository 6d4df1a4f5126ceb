// SoE headers, IDNs, attributes and texts compared with ETG.1000.6 "Servo drive profile over EtherCAT", and the header
// compared with tshark.
#include "wire/soe.hpp"

#include "wire/mailbox_pcap.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <set>

namespace margay::wire::soe {
namespace {

std::string text_of(Idn idn) {
    std::array<char, 16> text{};
    return std::string(to_text(idn, text));
}

TEST(SoeHeader, BitsLieWhereTheStandardPutsThem) {
    std::array<std::byte, kHeaderBytes> bytes{};
    store_header(bytes, {.opcode = Opcode::write_request,
                         .incomplete = true,
                         .drive = 5,
                         .elements = soe_element::kValue | soe_element::kName,
                         .number = 0x0102});
    const std::array<int, 4> fragment{0xAB, 0x42, 0x02, 0x01};
    for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(std::to_integer<int>(bytes[i]), fragment[i]) << i;
    // The error reply to a read of S-0-0047 of drive 0.
    store_header(bytes, {.opcode = Opcode::read_response,
                         .error = true,
                         .elements = soe_element::kValue,
                         .number = Idn::standard(47).value});
    const std::array<int, 4> error{0x12, 0x40, 0x2F, 0x00};
    for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(std::to_integer<int>(bytes[i]), error[i]) << i;
}

TEST(SoeHeader, EveryHeaderComesBackAsItWasStoredAndAsTsharkReadsIt) {
    std::vector<Header> headers;
    for (unsigned opcode = 1; opcode <= 6; ++opcode)
        for (unsigned flags = 0; flags < 4; ++flags)
            for (unsigned drive = 0; drive < kDrives; ++drive)
                for (unsigned bit = 0; bit < 8; ++bit)
                    headers.push_back({static_cast<Opcode>(opcode), (flags & 1) != 0, (flags & 2) != 0,
                                       static_cast<std::uint8_t>(drive), static_cast<std::uint8_t>(1U << bit),
                                       static_cast<std::uint16_t>(0x8000U >> (opcode + bit))});
    const auto path = std::filesystem::temp_directory_path() / ("margay-soe-" + std::to_string(::getpid()) + ".pcap");
    {
        testing_tshark::MailboxPcap file(path.string());
        for (const Header& header : headers) {
            std::vector<std::byte> message(kMailboxHeaderBytes + kHeaderBytes + kErrorBytes);
            store_mailbox_header(message,
                                 {.length = kHeaderBytes + kErrorBytes, .type = MailboxType::soe, .counter = 1});
            const auto data = MutableBytes(message).subspan(kMailboxHeaderBytes);
            store_header(data, header);
            EXPECT_EQ(load_header(data), header);
            store_le(data, kHeaderBytes, ErrorCode::value_protected);
            file.add(message);
        }
    }
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    const auto seen = testing_tshark::fields_of(
        path.string(),
        {"ecat_mailbox.soe_opcode", "ecat_mailbox.soe_header_incomplete", "ecat_mailbox.soe_header_error",
         "ecat_mailbox.soe_header_driveno", "ecat_mailbox.soe_header", "ecat_mailbox.soe_idn", "ecat_mailbox.soe_frag",
         "_ws.col.Info", "_ws.malformed", "ecat_mailbox.soe_header_value", "ecat_mailbox.soe_header_datastate"});
    ASSERT_EQ(seen.size(), headers.size());
    const auto value = [](const std::string& text) {
        return text.empty() ? 0xFFFFFFFFUL : std::stoul(text, nullptr, 0);
    };
    for (std::size_t n = 0; n < headers.size(); ++n) {
        const Header& h = headers[n];
        EXPECT_EQ(value(seen[n][0]), static_cast<unsigned>(h.opcode)) << n;
        EXPECT_EQ(value(seen[n][1]), h.incomplete ? 1U : 0U) << n;
        EXPECT_EQ(value(seen[n][2]), h.error ? 1U : 0U) << n;
        EXPECT_EQ(value(seen[n][3]), h.drive) << n;
        EXPECT_EQ(value(seen[n][4]) >> 8, h.elements) << n;
        EXPECT_EQ(value(seen[n][9]), h.elements == soe_element::kValue ? 1U : 0U) << n;
        EXPECT_EQ(value(seen[n][10]), h.elements == soe_element::kDataState ? 1U : 0U) << n;
        EXPECT_EQ(seen[n][8], "") << n;
        if (h.error && h.incomplete) continue;                           // no such message exists
        if (h.opcode == Opcode::slave_info) continue;                    // tshark does not decode more of this message
        EXPECT_EQ(value(seen[n][h.incomplete ? 6 : 5]), h.number) << n;  // fragments left, or the IDN
        if (h.error) {
            EXPECT_NE(seen[n][7].find("Error 7005"), std::string::npos) << seen[n][7];
        }
    }
    std::filesystem::remove(path);
}

TEST(IdnTest, NotationAndBits) {
    EXPECT_EQ(Idn::standard(47).value, 0x002F);
    EXPECT_EQ(Idn::standard(4095, 7).value, 0x7FFF);
    EXPECT_EQ(Idn::product(10).value, 0x800A);
    EXPECT_EQ(Idn::product(1, 2).value, 0xA001);
    EXPECT_EQ(text_of({0x002F}), "S-0-0047");
    EXPECT_EQ(text_of({0xFFFF}), "P-7-4095");
    std::array<char, 3> narrow{};
    EXPECT_EQ(to_text(Idn{0x002F}, narrow), "S-0");
}

TEST(IdnTest, ReadsWhatPeopleWrite) {
    for (unsigned value = 0; value < 0x10000; ++value) {
        const Idn idn{static_cast<std::uint16_t>(value)};
        ASSERT_EQ(parse_idn(text_of(idn)), idn) << value;
    }
    EXPECT_EQ(parse_idn("s-0-47"), Idn::standard(47));
    EXPECT_EQ(parse_idn("P-0100"), Idn::product(100));
    for (const char* wrong : {"", "S", "S-", "X-0-1", "S-0-", "S-8-1", "S-0-4096", "S-0-1-2", "S-0-1x", "S--1", "0x2F",
                              "S-0-99999999999999999999"})
        EXPECT_FALSE(parse_idn(wrong)) << wrong;
}

// IEC 61800-7-204, element 3: conversion factor, length, list, command, data type, decimals, write protection.
TEST(SoeAttributeTest, BitsLieWhereTheStandardPutsThem) {
    const SoeAttribute position = soe_attribute(0x4422'0001);
    EXPECT_EQ(
        position,
        (SoeAttribute{.scale = 1, .bytes = 4, .type = SoeType::signed_decimal, .decimals = 4, .protected_op = true}));
    EXPECT_EQ(soe_attribute_bits(position), 0x4422'0001U);
    const SoeAttribute list = soe_attribute(0x7055'0001);
    EXPECT_EQ(list, (SoeAttribute{.bytes = 2,
                                  .list = true,
                                  .type = SoeType::idn,
                                  .protected_preop = true,
                                  .protected_safeop = true,
                                  .protected_op = true}));
    EXPECT_EQ(soe_attribute_bits({.bytes = 2, .command = true}), 0x0009'0001U);
    for (const std::uint8_t bytes : std::initializer_list<std::uint8_t>{1, 2, 4, 8})
        EXPECT_EQ(soe_attribute(soe_attribute_bits({.bytes = bytes})).bytes, bytes);
}

TEST(SoeErrorText, EveryCodeHasItsOwnWords) {
    std::set<std::string_view> texts;
    unsigned known = 0;
    for (unsigned code = 0; code < 0x10000; ++code) {
        const auto text = to_text(static_cast<ErrorCode>(code));
        if (text == "unknown SoE error code") continue;
        ++known;
        EXPECT_TRUE(texts.insert(text).second) << text;
    }
    EXPECT_EQ(known, 52U);
    EXPECT_EQ(to_text(ErrorCode::value_protected), "the value is write-protected in this state");
}

}  // namespace
}  // namespace margay::wire::soe
