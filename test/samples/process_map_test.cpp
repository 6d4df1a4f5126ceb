// The layout of a process image, and the struct generated from it: the struct is compiled, and the offset of each
// member is checked.
#include "common/process_map.hpp"
#include "common/process_entries.hpp"
#include "common/process_struct.hpp"
#include "common/source.hpp"
#include "mailbox/mailbox_bus.hpp"
#include "process_data/bus.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>

namespace margay::samples {
namespace {

struct ProcessMapTest : testing::Test {
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(4096);
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-map-" + std::to_string(::getpid()));
    ProcessMapTest() { std::filesystem::create_directories(folder); }
    ~ProcessMapTest() override { std::filesystem::remove_all(folder); }

    // A program that sets one member after another to ones and compares all octets with the comment after the member.
    std::string program(const std::string& header, bool outputs) {
        const std::string type = outputs ? "process_outputs" : "process_inputs";
        const std::size_t first = header.find("typedef struct " + type + " ");
        if (first == std::string::npos) return {};
        const std::string body = header.substr(first, header.find("} " + type) - first);
        static const std::regex member(
            R"(\n    (\w+) (s\d+_\w+)( : (\d+))?(\[(\d+)\])?; /\* [^\n]* at (\d+)\.(\d+) \*/)");
        std::string text;
        for (std::sregex_iterator m(body.begin(), body.end(), member), none; m != none; ++m) {
            const auto bits = (*m)[4].matched ? (*m)[4].str() : fmt::format("sizeof(at->{}) * 8", (*m)[2].str());
            text += "    memset(image, 0, sizeof image);\n";
            text += (*m)[4].matched
                        ? fmt::format("    at->{} = ~at->{};\n", (*m)[2].str(), (*m)[2].str())
                        : fmt::format("    memset(&at->{}, 255, sizeof at->{});\n", (*m)[2].str(), (*m)[2].str());
            text += fmt::format("    failed |= check(image, {} * 8 + {}, {}, \"{}\");\n", (*m)[7].str(), (*m)[8].str(),
                                bits, (*m)[2].str());
            ++members;
        }
        return fmt::format("{{\n    {}* at = ({}*)(image + k{}Offset);\n{}}}\n", type, type,
                           outputs ? "ProcessOutputs" : "ProcessInputs", text);
    }
    int members = 0;

    void compile_and_check(const std::string& header, const std::string& name) {
        std::ofstream(folder / "image.h") << header;
        const std::string source =
            "#include \"image.h\"\n#include <stdio.h>\n#include <string.h>\nstatic unsigned char image[4096];\n"
            "static int check(const unsigned char* i, size_t first, size_t n, const char* name) {\n"
            "    for (size_t b = 0; b < sizeof image * 8; ++b)\n"
            "        if (((i[b / 8] >> (b % 8)) & 1) != (b >= first && b < first + n)) { printf(\"%s: bit %u\\n\", "
            "name, (unsigned)b); return 1; }\n"
            "    return 0;\n}\nint main(void) {\n    int failed = 0;\n" +
            program(header, true) + program(header, false) + "    return failed;\n}\n";
        for (const std::string& compiler : {std::string("cc -std=c11 -x c"), std::string("c++ -std=c++20 -x c++")}) {
            std::ofstream(folder / "program.c") << source;
            const auto out = (folder / "program").string();
            const std::string compile =
                compiler + " -Wall -Wextra -Werror -o " + out + " " + (folder / "program.c").string();
            ASSERT_EQ(std::system(compile.c_str()), 0) << name << "\n" << compile << "\n" << header;
            EXPECT_EQ(std::system(out.c_str()), 0) << name << "\n" << header;
        }
    }
};

TEST_F(ProcessMapTest, StructHasEveryEntryWhereTheImageHasIt) {
    const std::pair<std::uint32_t, std::uint32_t> sizes[] = {{4, 2}, {3, 7},    {0, 12},  {16, 0},
                                                             {2, 2}, {100, 60}, {32, 64}, {9, 31}};
    for (const auto& [out, in] : sizes) bus.add(out, in);
    bus.start();
    for (const Packing packing : {Packing::bytes, Packing::bits}) {
        bus.ctx->group(0).config.packing = packing;
        ASSERT_TRUE(config_map(*bus.ctx, image).ok());
        const auto map = read_process_map(*bus.ctx);
        EXPECT_EQ(map.remarks, std::vector<std::string>());
        std::uint32_t bits = 0;
        for (const MapEntry& e : map.entries) bits += e.bits;
        EXPECT_EQ(bits, 4U + 2 + 3 + 7 + 12 + 16 + 2 + 2 + 100 + 60 + 32 + 64 + 9 + 31);
        compile_and_check(map_cstruct(*bus.ctx, map), packing == Packing::bits ? "packed" : "bytes");
    }
    EXPECT_GE(members, 20) << "the test has seen the members";
}

// A size word of 0x7FFF means 4 MiB, which would need 187 s of bus time. Reading stops at the end mark.
TEST_F(ProcessMapTest, AnAbsurdSizeWordIsNotFollowed) {
    for (int n = 0; n < 3; ++n) bus.add(8, 8);
    for (std::uint32_t n = 0; n < 3; ++n)
        store_le<std::uint16_t>(MutableBytes(bus.segment.slave(n).sii().image()), 0x3E * 2, 0x7FFF);
    bus.start();
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    const Time before = bus.osal.now();
    const auto map = read_process_map(*bus.ctx);
    EXPECT_EQ(map.remarks, std::vector<std::string>());
    EXPECT_EQ(map.entries.size(), 6U);
    EXPECT_LT(bus.osal.now() - before, std::chrono::milliseconds(500));
}

TEST_F(ProcessMapTest, NamesComeFromTheSii) {
    auto source = open_source("sim:demo");
    ASSERT_TRUE(source) << source.error();
    HostContext ctx;
    ASSERT_TRUE(init(ctx, source->nic(), source->osal()).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    ASSERT_TRUE(config_map(ctx, image).ok());
    const auto map = read_process_map(ctx);
    const auto text = map_text(ctx, map);
    EXPECT_NE(text.find("         0.3  1 bit       SM0  0x7030:1 Channel 4 / Value\n"), std::string::npos) << text;
    const auto json = map_json(ctx, map);
    EXPECT_EQ(json["output_bytes"], 5);
    EXPECT_EQ(json["entries"][3]["index"], 0x7030);
    EXPECT_EQ(json["entries"][3]["offset_bits"], 3);
    const auto header = map_cstruct(ctx, map);
    EXPECT_NE(header.find("int16_t s5_channel_1_value;"), std::string::npos) << header;
    compile_and_check(header, "demo");
}

// PDOs of the application have names, too, when the SII has their objects; gaps have no names.
TEST_F(ProcessMapTest, ObjectsAreThoseThatTheDictionaryAssigns) {
    std::ofstream(folder / "odd.toml") << "[[slave]]\ndevice = \"odd_device\"\n";
    auto source = open_source("sim:" + (folder / "odd.toml").string());
    ASSERT_TRUE(source) << source.error();
    HostContext ctx;
    ASSERT_TRUE(init(ctx, source->nic(), source->osal()).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    static constexpr PdoEntry kEntries[] = {{0x7000, 2, 16}, {0, 0, 8}, {0x7000, 1, 16}, {0x7000, 3, 16}};
    static constexpr Pdo kOutputs[] = {{0x1600, kEntries}};
    static constexpr SmPdos kPdos[] = {{2, kOutputs}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};
    ctx.slave(1).config.setup = &kSetup;
    ASSERT_TRUE(config_map(ctx, image).ok());
    const auto map = read_process_map(ctx);
    EXPECT_EQ(map.remarks, std::vector<std::string>());
    ASSERT_GE(map.entries.size(), 4U);
    EXPECT_EQ(map.entries[0].index, 0x7000);
    EXPECT_EQ(map.entries[0].subindex, 2);
    EXPECT_FALSE(map.entries[0].name.empty());
    EXPECT_EQ(map.entries[1].index, 0);
    EXPECT_EQ(map.entries[2].offset_bits, 24U);
    const auto header = map_cstruct(ctx, map);
    EXPECT_NE(header.find("    uint8_t pad_2[1];\n"), std::string::npos) << header;
    compile_and_check(header, "odd");
}

// Objects that the SII does not have get the names of the dictionary.
TEST_F(ProcessMapTest, NamesComeFromTheDictionaryWhereTheSiiHasNone) {
    std::ofstream(folder / "odd.toml") << "[[slave]]\ndevice = \"odd_device\"\n";
    auto source = open_source("sim:" + (folder / "odd.toml").string());
    ASSERT_TRUE(source) << source.error();
    HostContext ctx;
    ASSERT_TRUE(init(ctx, source->nic(), source->osal()).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    static constexpr PdoEntry kEntries[] = {{0x7000, 31, 16}, {0x7000, 1, 16}};
    static constexpr Pdo kOutputs[] = {{0x1600, kEntries}};
    static constexpr SmPdos kPdos[] = {{2, kOutputs}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};
    ctx.slave(1).config.setup = &kSetup;
    ASSERT_TRUE(config_map(ctx, image).ok());
    const auto map = read_process_map(ctx);
    ASSERT_GE(map.entries.size(), 2U);
    EXPECT_EQ(map.entries[0].subindex, 31);
    EXPECT_EQ(map.entries[0].name, "SubIndex 031");
    EXPECT_EQ(map.entries[0].data_type, 0x06) << "UNSIGNED16";
}

// An entry of the assignment can be 0. Object 0x0000 is not read, and the other PDOs are described.
TEST_F(ProcessMapTest, PlacesWithoutAPdoArePassedOver) {
    MailboxBus mail;
    auto& slave = mail.add_scripted(64, mailbox_protocol::kCoE, coe_detail::kSdo);
    std::vector<unsigned> asked;
    slave.on_mail = [&](const Mail& m) {
        const auto at = [&](std::size_t n) { return std::to_integer<unsigned>(m[n]); };
        const unsigned index = at(9) | at(10) << 8;
        asked.push_back(index);
        const auto answer = [&](unsigned value, unsigned octets) {
            slave.reply({0x00, 0x30, 0x43 | (4 - octets) << 2, at(9), at(10), at(11), value & 0xFF, value >> 8 & 0xFF,
                         value >> 16 & 0xFF, value >> 24});
        };
        if (index == 0x1C12) return at(11) == 0 ? answer(2, 1) : answer(at(11) == 1 ? 0 : 0x1600, 2);
        if (index == 0x1600) return at(11) == 0 ? answer(1, 1) : answer(0x70000108, 4);
        slave.reply({0x00, 0x20, 0x80, at(9), at(10), at(11), 0x00, 0x00, 0x02, 0x06});
    };
    mail.start();
    ASSERT_TRUE(config_map(*mail.ctx, image).ok());
    const auto map = read_process_map(*mail.ctx);
    EXPECT_EQ(std::ranges::count(asked, 0U), 0) << "object 0x0000 is not asked for";
    ASSERT_EQ(map.entries.size(), 1U);
    EXPECT_EQ(map.entries[0].pdo, 0x1600);
    EXPECT_EQ(map.entries[0].index, 0x7000);
    EXPECT_EQ(map.entries[0].pdo_place, 2);
}

// The printed declarations compile, and config_map() finds their entries.
TEST_F(ProcessMapTest, DeclarationsAreThoseOfHandles) {
    ProcessMap map;
    const auto entry = [&](Direction direction, std::uint16_t index, std::uint32_t bits, std::uint8_t type,
                           std::string name) {
        map.entries.push_back({.slave = 3, .direction = direction, .sync_manager = 2, .pdo = 0x1600, .pdo_place = 1});
        MapEntry& e = map.entries.back();
        e.entry_place = static_cast<std::uint8_t>(map.entries.size());
        e.index = index;
        e.bits = bits;
        e.data_type = type;
        e.name = std::move(name);
    };
    entry(Direction::outputs, 0x7000, 1, 0x01, "Enable drive");
    entry(Direction::outputs, 0, 7, 0, "");
    entry(Direction::outputs, 0x6071, 16, 0x03, "Torque");
    entry(Direction::inputs, 0x6041, 16, 0x06, "Status");
    entry(Direction::inputs, 0x6041, 16, 0x06, "Status");
    entry(Direction::inputs, 0x2000, 24, 0, "");
    entry(Direction::inputs, 0x2001, 32, 0x08, "Speed");
    entry(Direction::inputs, 0x2002, 80, 0x09, "Serial");
    EXPECT_EQ(entries_code(map),
              "margay::Output<bool> s3_enable_drive{3, 0x7000, 0};\n"
              "margay::Output<std::int16_t> s3_torque{3, 0x6071, 0};\n"
              "margay::Input<std::uint16_t> s3_status{3, 0x6041, 0};\n"
              "margay::Input<std::uint16_t> s3_status_2{margay::EntryAddress::at(3, 2, 1, 5)};\n"
              "margay::Input<std::uint32_t> s3_x2000_00{3, 0x2000, 0};\n"
              "margay::Input<float> s3_speed{3, 0x2001, 0};\n"
              "margay::InputOctets s3_serial{margay::EntryAddress::object(3, 0x2002, 0), 10};\n"
              "margay::EntryHandle* const entries[] = {&s3_enable_drive, &s3_torque, &s3_status, &s3_status_2, "
              "&s3_x2000_00, &s3_speed, &s3_serial};\n");
    EXPECT_EQ(entry_declarations(map)[1], "") << "a gap";
    EXPECT_EQ(entries_code({}), "");
}

// The application maps an object that the SII does not describe: it is reported, and has its place in the map.
TEST_F(ProcessMapTest, WhatTheSiiDoesNotDescribeIsTold) {
    bus.add(16, 16);
    bus.start();
    const Slave& slave = bus.ctx->slave(1);
    slave.config.source = ConfigurationSource::application;
    slave.config.add({0, Direction::outputs, 0x64, 0x1100, 16});
    slave.config.add({1, Direction::inputs, 0x20, 0x2000, 8});
    (void)config_map(*bus.ctx, image);  // the slave refuses the PDOs; the map shows the layout
    ASSERT_TRUE(bus.ctx->group(0).mapped);
    const auto map = read_process_map(*bus.ctx);
    ASSERT_EQ(map.remarks.size(), 1U);
    EXPECT_EQ(map.remarks[0], "slave 1: SyncManager 1 is mapped with 8 bits, the PDOs of its SII have 16");
    ASSERT_EQ(map.entries.size(), 2U);
    EXPECT_EQ(map.entries[1].pdo, 0);
    EXPECT_EQ(map.entries[1].offset_bits, 16U);
}

}  // namespace
}  // namespace margay::samples
