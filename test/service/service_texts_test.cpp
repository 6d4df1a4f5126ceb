// The texts that margayd makes from its tables, and the files that are installed for systemd.
#include "service/service_fixture.hpp"

#include "common/service_configuration.hpp"
#include "margayd/texts.hpp"

#include <filesystem>

namespace margay::process {
namespace {

using ServiceTexts = ServiceTest;

const std::string kServiceTexts = std::string(MARGAY_BIN_DIR) + "/../texts/";

TEST_F(ServiceTexts, HelpAndManualNameEachOptionAndKey) {
    const auto help = folder.run(std::string(MARGAY_BIN_DIR) + "/margayd --help");
    EXPECT_EQ(help.status, 0) << help.err;
    EXPECT_EQ(help.out, service::help_text());
    const auto page = content_of(kServiceTexts + "margayd.8");
    EXPECT_EQ(page, service::man_page());
    for (const auto& option : service::program_options())
        EXPECT_TRUE(contains(help.out, "  --" + std::string(option.name))) << option.name;
    for (const auto& key : samples::service_keys())
        EXPECT_TRUE(contains(help.out, "\n  " + std::string(key.name) + " = ")) << key.name;
    for (std::size_t at = 0; at < help.out.size();) {
        const auto end = help.out.find('\n', at);
        EXPECT_LE(end - at, 110U) << help.out.substr(at, end - at);
        at = end + 1;
    }
    if (folder.run("command -v groff").status != 0) GTEST_SKIP() << "groff is not installed";
    const auto shown = folder.run("groff -man -ww -Tascii -P-c -P-b -P-u '" + kServiceTexts + "margayd.8'");
    EXPECT_EQ(shown.status, 0);
    EXPECT_EQ(shown.err, "");
    for (const auto& key : samples::service_keys())
        EXPECT_TRUE(contains(shown.out, std::string(key.name) + " = ")) << key.name;
    EXPECT_TRUE(contains(shown.out, "source = \"SOURCE\"")) << "TOML needs the quotes: " << shown.out;
}

TEST_F(ServiceTexts, TheExampleOfTheManualIsAConfiguration) {
    const auto help = service::help_text();
    const auto from = help.find("\nExample:\n") + 10;
    configure("example.toml", help.substr(from, help.find("\n\n", from) - from) + "\n");
    const auto ran = shell("margayd --check");
    // The user provides the ENI and the group.
    EXPECT_TRUE(contains(ran.err, "example.toml: line 3: ")) << ran.err;
    EXPECT_TRUE(contains(ran.err, "example.toml: line 5: there is no group 'automation'")) << ran.err;
    EXPECT_FALSE(contains(ran.err, "line 1: ") || contains(ran.err, "line 4: ")) << ran.err;
}

TEST_F(ServiceTexts, TheCompletionOffersOptionsAndFolders) {
    EXPECT_EQ(content_of(kServiceTexts + "margayd"), service::bash_completion());
    const auto offered = [&](const std::string& words, int last) {
        folder.write("complete.bash", "source '" + kServiceTexts + "margayd'\ncompopt() { :; }\nCOMP_WORDS=(" + words +
                                          ")\nCOMP_CWORD=" + std::to_string(last) +
                                          "\n_margayd\necho \"${COMPREPLY[0]}\"\n");
        const auto ran = folder.run("bash -u complete.bash");
        EXPECT_EQ(ran.status, 0) << ran.err;
        return ran.out;
    };
    EXPECT_EQ(offered("margayd --ch", 1), "--check\n");
    EXPECT_EQ(offered("margayd --config et", 2), "etc\n");
    std::filesystem::create_directory(folder.path() / "my service");
    EXPECT_EQ(offered("margayd --config my", 2), "my service\n") << "one name, not two";
}

}  // namespace
}  // namespace margay::process
