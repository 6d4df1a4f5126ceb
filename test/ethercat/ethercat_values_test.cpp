// The values, selections and arguments of ethercat.
#include "ethercat/parse.hpp"
#include "ethercat/values.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace margay::ethercat {
namespace {

std::string octets(std::string_view type, std::string_view text) {
    const auto value = parse_value(*type_by_name(type), text);
    return value ? hex(*value) : "refused";
}

// Converts a text to a value and back.
std::string round_trip(std::string_view type, std::string_view text) {
    const auto value = parse_value(*type_by_name(type), text);
    if (!value) return value.problem().text;
    const auto shown = value_text(*type_by_name(type), *value);
    return shown ? *shown : shown.problem().text;
}

TEST(EthercatValues, OfEachType) {
    EXPECT_EQ(octets("bool", "1"), "01");
    EXPECT_EQ(octets("bool", "2"), "refused");
    EXPECT_EQ(octets("int8", "-128"), "80");
    EXPECT_EQ(octets("int8", "128"), "refused");
    EXPECT_EQ(octets("uint16", "0x1234"), "3412");
    EXPECT_EQ(octets("uint16", "017"), "0f00");
    EXPECT_EQ(octets("uint16", "-1"), "refused");
    EXPECT_EQ(octets("uint16", ""), "refused");
    EXPECT_EQ(octets("uint32", "4294967295"), "ffffffff");
    EXPECT_EQ(octets("uint32", "4294967296"), "refused");
    EXPECT_EQ(octets("int64", "-9223372036854775808"), "0000000000000080");
    EXPECT_EQ(octets("int64", "-9223372036854775809"), "refused");
    EXPECT_EQ(octets("uint64", "18446744073709551615"), "ffffffffffffffff");
    EXPECT_EQ(octets("int24", "-2"), "feffff");
    EXPECT_EQ(octets("float", "1.5"), "0000c03f");
    EXPECT_EQ(octets("float", "1e39"), "refused");
    EXPECT_EQ(octets("double", "-2"), "00000000000000c0");
    EXPECT_EQ(octets("double", "2x"), "refused");
    EXPECT_EQ(octets("sm8", "-127"), "ff");
    EXPECT_EQ(octets("sm8", "-128"), "refused");
    EXPECT_EQ(octets("sm16", "5"), "0500");
    EXPECT_EQ(octets("string", "ab"), "6162");
    EXPECT_EQ(octets("unicode_string", "\xC3\xA4"), "e400");
    EXPECT_EQ(octets("unicode_string", "\xF0\x9F\x98\x80"), "3dd800de");
    EXPECT_EQ(octets("unicode_string", "\xC3"), "refused");
}

// A message is one line, whatever the value is. The value may come from a file or from another program.
TEST(EthercatValues, ARefusedValueIsShownInALine) {
    EXPECT_EQ(round_trip("uint8", std::string_view("\x01\0a\n", 4)),
              "'\\x01\\x00a\\x0a' is no value of type uint8: a whole number from 0 to 255 is needed");
    EXPECT_EQ(round_trip("uint8", std::string(1000, '7')),
              "'" + std::string(60, '7') + "…' is no value of type uint8: a whole number from 0 to 255 is needed");
}

TEST(EthercatValues, AsText) {
    EXPECT_EQ(round_trip("int16", "-1"), "0xffff -1");
    EXPECT_EQ(round_trip("uint8", "200"), "0xc8 200");
    EXPECT_EQ(round_trip("int64", "-1"), "0xffffffffffffffff -1");
    EXPECT_EQ(round_trip("sm32", "-7"), "0x80000007 -7");
    EXPECT_EQ(round_trip("sm64", "-7"), "0x8000000000000007 -7");
    EXPECT_EQ(round_trip("float", "0.1"), "0.1");
    EXPECT_EQ(round_trip("bool", "true"), "0x01 1");
    EXPECT_EQ(round_trip("string", "a b"), "a b");
    EXPECT_EQ(round_trip("octet_string", "ab"), "0x61 0x62");
    EXPECT_EQ(round_trip("unicode_string", "\xF0\x9F\x98\x80z"), "\xF0\x9F\x98\x80z");
    const std::byte octet{0x47};
    EXPECT_EQ(value_text(*type_by_name("uint16"), {&octet, 1}).problem().text,
              "the value has 1 octet, and type uint16 has 2: 0x47");
    EXPECT_EQ(type_text(0x0007), "uint32");
    EXPECT_EQ(type_text(0x0022), "type 0x0022");
    EXPECT_EQ(type_by_code(0x0030)->name, "uint8") << "BIT1 is read as an octet";
    EXPECT_EQ(type_by_code(0x0022), nullptr);
}

TEST(EthercatNumbers, ListsAndRanges) {
    const auto all = [](std::string_view text) {
        const auto numbers = Numbers::parse(text);
        if (!numbers) return std::string("refused");
        std::string found;
        for (std::uint32_t n = 0; n < 10; ++n)
            if (numbers->contains(n)) found += std::to_string(n);
        return found;
    };
    EXPECT_EQ(all("1,4,5,7-9"), "145789");
    EXPECT_EQ(all("-"), "0123456789");
    EXPECT_EQ(all("-3"), "0123");
    EXPECT_EQ(all("8-"), "89");
    EXPECT_EQ(all("0x8"), "8");
    for (const auto* text : {"", ",", "1,", "a", "3-1", "1-2-3", "1 2", "4294967296"})
        EXPECT_EQ(all(text), "refused") << text;
}

// A slave of a running application is absent from the ring. The slaves behind it keep their positions.
TEST(EthercatNumbers, AMissingSlaveLeavesAGapInThePositions) {
    std::vector<SlaveFacts> slaves(3);
    slaves[0] = {.position = 1, .alias = 7};
    slaves[1] = {.position = 3};
    slaves[2] = {.position = 4, .alias = 9};
    const auto addresses = alias_addresses(slaves);
    const auto* third = at_position(addresses, 3);
    ASSERT_NE(third, nullptr);
    EXPECT_EQ(third->alias, 7);
    EXPECT_EQ(third->relative, 2) << "a place whose slave is missing counts";
    ASSERT_NE(at_position(addresses, 4), nullptr);
    EXPECT_EQ(at_position(addresses, 4)->alias, 9);
    EXPECT_EQ(at_position(addresses, 0), nullptr);
    EXPECT_EQ(at_position(addresses, 2), nullptr);
    const auto seven = Numbers::parse("7");
    const auto found = select(slaves, seven, Numbers::parse("2"));
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].position, 3);
    EXPECT_EQ(unmatched(slaves, seven, Numbers::parse("2")), std::nullopt);
    EXPECT_EQ(unmatched(slaves, seven, Numbers::parse("1")), "--position 1");
    slaves.erase(slaves.begin());
    EXPECT_EQ(alias_addresses(slaves)[0].relative, 3) << "without an alias it is the position";
}

TEST(EthercatArguments, AreReadByTheTable) {
    const auto read = parse({"-vp3", "download", "0x6060", "0", "-5", "--type=int8", "--", "-x"});
    ASSERT_FALSE(read) << "one argument too many";
    EXPECT_EQ(read.problem().text, "unexpected argument '-x'; see ethercat download --help");
    const auto well = parse({"-vp3", "download", "0x6060", "0", "-5", "--type=int8"});
    ASSERT_TRUE(well);
    EXPECT_EQ(well->command->name, "download");
    EXPECT_EQ(well->words, (std::vector<std::string>{"0x6060", "0", "-5"}));
    EXPECT_EQ(well->value("position"), "3");
    EXPECT_EQ(well->value("type"), "int8");
    EXPECT_TRUE(well->has("verbose"));
    EXPECT_FALSE(well->has("json"));
}

}  // namespace
}  // namespace margay::ethercat
