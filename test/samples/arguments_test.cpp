// Numbers on the command line, and includes that determine the compile time.
#include "common/arguments.hpp"
#include <places.hpp>

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

TEST(ParseNumber, IsDecimalOrHexadecimalNeverOctal) {
    EXPECT_EQ(parse_number("0"), 0);
    EXPECT_EQ(parse_number("010"), 10);
    EXPECT_EQ(parse_number("0x10"), 16);
    EXPECT_EQ(parse_number("0XfF"), 255);
    EXPECT_EQ(parse_number("-3"), -3);
    EXPECT_EQ(parse_number("9223372036854775807"), INT64_MAX);
    for (const auto* wrong : {"", "-", "0x", "1x", "ff", "1.5", " 1", "1 ", "--1", "-0x-1", "9223372036854775808"})
        EXPECT_FALSE(parse_number(wrong)) << wrong;
}

TEST(HelpForACommand, NeedsNoArgumentsBeforeTheCommand) {
    std::string source;
    Arguments arguments("tool", "Does something.");
    arguments.positional("SOURCE", source, "where");
    arguments.command("alias", "shows the alias", [] {});
    std::array<std::string, 3> words{"tool", "alias", "--help"};
    std::array<char*, 3> argv{words[0].data(), words[1].data(), words[2].data()};
    testing::internal::CaptureStdout();
    EXPECT_EQ(arguments.run(3, argv.data(), [] { return 7; }), 0);
    const auto text = testing::internal::GetCapturedStdout();
    EXPECT_NE(text.find("shows the alias"), std::string::npos) << text;
    EXPECT_EQ(text.find("SOURCE"), std::string::npos) << text;
}

// Each inclusion costs seconds of processor time per file: CLI11 12 s, the whole of nlohmann-json 3 s.
TEST(CompileTime, ExpensiveHeadersStayInTheFilesThatNeedThem) {
    const auto samples = std::filesystem::path(MARGAY_SOURCE_DIR) / "samples";
    std::size_t with_arguments = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(samples)) {
        if (entry.path().extension() != ".cpp" && entry.path().extension() != ".hpp") continue;
        std::ifstream in(entry.path());
        const std::string text(std::istreambuf_iterator<char>(in), {});
        const bool has_arguments = text.find("#include <CLI/") != std::string::npos;
        with_arguments += has_arguments;
        EXPECT_EQ(has_arguments, entry.path().filename() == "arguments.cpp") << entry.path();
        const bool header = entry.path().extension() == ".hpp";
        EXPECT_FALSE(header && text.find("#include <nlohmann/json.hpp>") != std::string::npos) << entry.path();
    }
    EXPECT_EQ(with_arguments, 1u);
}

}  // namespace
}  // namespace margay::samples
