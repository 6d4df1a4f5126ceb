// The output of slaveinfo --sdo for a slave's dictionary.
#include "common/dictionary_report.hpp"
#include "common/json_text.hpp"
#include "common/slave_report.hpp"
#include "mailbox/mailbox_bus.hpp"

#include <nlohmann/json.hpp>

namespace margay::samples {
namespace {

TEST(DictionaryReport, PrintsObjectsEntriesAndValues) {
    MailboxBus bus;
    bus.add_stack(128);
    bus.start();
    const Dictionary dictionary = read_dictionary(*bus.ctx, 1);
    ASSERT_EQ(dictionary.problem, "");
    ASSERT_EQ(dictionary.objects.size(), std::size(subdevice::testing::table::kObjects));
    const std::string text = dictionary_text(dictionary);
    for (const char* line : {"    0x1000     VAR       Device type\n",
                             "      :0       UNSIGNED32         32 bit  ro       Device type = 401 (0x00000191)\n",
                             "Device name = \"Bench device of many words\"\n", "Setting = 100\n", "In b = 0\n",
                             "Secret = (not readable)\n", "Big = 1234605616436508552 (0x1122334455667788)\n"})
        EXPECT_NE(text.find(line), std::string::npos) << line << "in\n" << text;
    EXPECT_NE(text.find("… (70000 octets)"), std::string::npos);

    const auto json = dictionary_json(dictionary);
    EXPECT_TRUE(json["problem"].is_null());
    const auto object = std::find_if(json["objects"].begin(), json["objects"].end(),
                                     [](const auto& o) { return o["index"] == 0x2000; });
    ASSERT_NE(object, json["objects"].end());
    EXPECT_EQ((*object)["entries"][0]["value"], 100);
    EXPECT_EQ((*object)["entries"][0]["octets"], "6400");
    EXPECT_EQ((*object)["entries"][0]["data_type_text"], "INTEGER16");
}

// Some invisible characters change the direction of the following text in a terminal.
TEST(WordsOfSlave, HaveNoCharactersThatAreNotSeen) {
    for (const std::string hidden : {"\u202A", "\u202E", "\u2066", "\u2069", "\u200B", "\u200F", "\u061C", "\u2028",
                                     "\u2060", "\uFEFF", "\uFFFE", "\u00AD", "\U000E0041"}) {
        const auto name = "a" + hidden + "b";
        EXPECT_EQ(words_of_slave(name), "a?b");
        Slave slave{};
        std::ranges::copy(name, slave.name_text.begin());
        slave.name_bytes = static_cast<std::uint8_t>(name.size());
        EXPECT_NE(slave_text(slave).find("a?b"), std::string::npos) << slave_text(slave);
        EXPECT_EQ(slave_text(slave).find(hidden), std::string::npos);
    }
    const std::string seen = "\u2026 \u2013 \u00B5 \u20AC \U0001F600 \u2010";  // ellipsis, dash, micro, euro …
    EXPECT_EQ(words_of_slave(seen), seen);
}

// Many devices have names in ISO 8859-1. JSON and a terminal get UTF-8 without control characters.
TEST(DictionaryReport, NamesOfOtherEncodingsAreText) {
    const auto named = [](auto description, std::string_view name) {
        std::ranges::copy(name, description.name_text.begin());
        description.name_bytes = static_cast<std::uint8_t>(name.size());
        return description;
    };
    Dictionary dictionary;
    auto& object = dictionary.objects.emplace_back();
    object.description = named(ObjectDescription{}, "Ger\xE4t \x1B[31m");
    object.entries.emplace_back().description = named(EntryDescription{},
                                                      "Temperature in \xB0"
                                                      "C");
    const std::string text = dictionary_text(dictionary);
    EXPECT_NE(text.find("Ger\xC3\xA4t ?[31m\n"), std::string::npos) << text;
    EXPECT_NE(text.find("Temperature in \xC2\xB0"
                        "C"),
              std::string::npos)
        << text;
    const auto json = dictionary_json(dictionary);
    EXPECT_EQ(json["objects"][0]["name"], "Ger\xC3\xA4t ?[31m");
    EXPECT_EQ(json["objects"][0]["entries"][0]["name"],
              "Temperature in \xC2\xB0"
              "C");
    EXPECT_NE(json_text(json).find("Ger\xC3\xA4t"), std::string::npos);
    EXPECT_EQ(json_text({{"file", "a\xE4"}}), "{\n  \"file\": \"a\xEF\xBF\xBD\"\n}\n");
}

TEST(DictionaryReport, SaysWhyThereIsNone) {
    MailboxBus bus;
    auto& slave = bus.add_scripted(64);
    bus.start();
    slave.on_mail = [&](const Mail&) { slave.reply(mail_bytes({0x01, 0x00, 0x04, 0x00}), wire::MailboxType::error); };
    const Dictionary dictionary = read_dictionary(*bus.ctx, 1);
    EXPECT_EQ(dictionary.problem.find("slave 1: SDO information of 0x0000:0: mailbox error reply (detail 0x0004"), 0U)
        << dictionary.problem;
    EXPECT_EQ(dictionary_text(dictionary), "  Dictionary        none: " + dictionary.problem + "\n");
}

TEST(DictionaryReport, ValuesByTheirTypes) {
    const auto octets = [](std::initializer_list<unsigned> v) { return mail_bytes(v); };
    EXPECT_EQ(value_text(0x0001, octets({1})), "1");
    EXPECT_EQ(value_text(0x0002, octets({0xFF})), "-1");
    EXPECT_EQ(value_text(0x0003, octets({0x00, 0x80})), "-32768");
    EXPECT_EQ(value_text(0x0010, octets({0xFE, 0xFF, 0xFF})), "-2");
    EXPECT_EQ(value_text(0x0006, octets({0x34, 0x12})), "4660 (0x1234)");
    EXPECT_EQ(value_text(0x0008, octets({0x00, 0x00, 0xC0, 0x3F})), "1.5");
    EXPECT_EQ(value_text(0x0011, octets({0, 0, 0, 0, 0, 0, 0xF8, 0x3F})), "1.5");
    EXPECT_EQ(value_text(0x0009, octets({'a', 'b', 0, 'c'})), "\"ab\"");
    EXPECT_EQ(value_text(0x000A, octets({0xDE, 0xAD})), "dead");
    EXPECT_EQ(value_text(0x0007, octets({})), "(empty)");
}

}  // namespace
}  // namespace margay::samples
