// The texts that ethercat makes from its table of commands: --help, the manual page, the completion. Also the
// arguments.
#include "ethercat/ethercat_fixture.hpp"

#include "common/slave_report.hpp"
#include "ethercat/table.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>

namespace margay::process {
namespace {

using EthercatTexts = EthercatTest;

const std::string kTexts = std::string(MARGAY_BIN_DIR) + "/../texts/";

TEST_F(EthercatTexts, HasTheCommandsOfTheManual) {
    std::string names;
    for (const auto& command : ethercat::commands()) names += std::string(command.name) + " ";
    EXPECT_EQ(
        names,
        "alias analyse config crc cstruct data debug domains download eoe foe_read foe_write graph ip master pdos "
        "reg_read reg_write rescan sdos sii_read sii_write slaves soe_read soe_write states upload version xml ");
}

// The user of a program calls no functions of the library, so the texts of errors name no functions.
TEST_F(EthercatTexts, ErrorsNameNoFunctions) {
    for (const Errc code :
         {Errc::identity_unread, Errc::no_place, Errc::remapping_needed, Errc::unknown_group, Errc::not_polled,
          Errc::no_cycle, Errc::not_supervised, Errc::place_unknown, Errc::supervised})
        for (const Step step : {Step::none, Step::identify, Step::request_state, Step::exchange_process_data}) {
            const Error error{.code = code, .step = step, .slave = 3};
            const auto words = samples::sentence(error);
            EXPECT_FALSE(contains(words, "()")) << words;
            EXPECT_TRUE(words.starts_with("slave 3: ") && words.size() > 20) << words;
            const auto event = samples::sentence({.kind = EventKind::recovery_failed, .slave = 3, .error = error});
            EXPECT_FALSE(contains(event, "()")) << event;
        }
    EXPECT_EQ(samples::sentence({.code = Errc::identity_unread, .step = Step::identify, .slave = 3}),
              "slave 3: comparing with what is expected: the slave was away, and its identity was not compared since");
    EXPECT_EQ(samples::sentence({.code = Errc::wrong_state, .step = Step::configure_sync, .slave = 3}),
              "slave 3: activating SYNC: not possible in this state (the clocks are not measured yet)");
}

TEST_F(EthercatTexts, HelpNamesEachCommandItsOptionsAndItsExitCodes) {
    const auto all = out("", "--help");
    for (const auto& command : ethercat::commands()) {
        const std::string name(command.name);
        EXPECT_TRUE(contains(all, "\n  " + name + " ")) << name;
        const auto help = out("", name + " --help");
        EXPECT_TRUE(help.starts_with("Usage: ethercat " + name + " [OPTIONS]")) << help;
        EXPECT_TRUE(contains(help, "\n" + std::string(command.summary.substr(0, 20)))) << help;
        for (const auto option : command.options) EXPECT_TRUE(contains(help, "--" + std::string(option))) << help;
        EXPECT_TRUE(contains(help, "Exit codes: 0 no error; 1 error of the segment or a device; 2 wrong arguments"))
            << help;
        for (std::size_t at = 0; at < help.size();) {
            const auto end = help.find('\n', at);
            const auto line = help.substr(at, end - at);
            EXPECT_TRUE(line.size() <= 110 || line.starts_with("Exit codes")) << line;
            at = end + 1;
        }
    }
}

TEST_F(EthercatTexts, ArgumentsAreRefusedInWords) {
    fails("sim:demo", "--nope", 2, "there is no option '--nope'; see ethercat --help");
    fails("sim:demo", "slaves -x", 2, "there is no option '-x'");
    fails("sim:demo", "slave5", 2, "unexpected argument or unknown command 'slave5'");
    fails("sim:demo", "s", 2, "'s' may be sdos, sii_read, sii_write, slaves, soe_read, soe_write, states");
    fails("sim:demo", "slaves --position", 2, "--position needs a value: LIST; see ethercat slaves --help");
    fails("sim:demo", "slaves --json=1", 2, "--json takes no value");
    fails("sim:demo", "", 2, "the command is missing: alias, analyse, config, ");
    fails("sim:demo", "slaves x", 2, "unexpected argument 'x'");
    EXPECT_EQ(out("sim:demo", "sla -p 0"), out("sim:demo", "slaves --pos 0")) << "shortened names";
    EXPECT_EQ(out("sim:demo", "-p 0 slaves"), out("sim:demo", "slaves -p0")) << "options before the command";
}

TEST_F(EthercatTexts, AShortNameOfSeveralCommandsNamesThem) {
    fails("sim:demo", "sii", 2, "'sii' may be sii_read, sii_write");
    fails("sim:demo", "nothing", 2, "unexpected argument or unknown command 'nothing'");
}

// A recording or a connection must not get the number of a standard stream that is closed.
TEST_F(EthercatTexts, AClosedStreamGetsNoOtherFile) {
    const auto ran = ethercat(
        "sim:demo", "slaves -p 99 --source sim:demo --record r.pcap 2>&-; " + program + " analyse r.pcap --quiet");
    EXPECT_EQ(ran.status, 0) << "the recording is whole\n" << ran.err;
    EXPECT_EQ(ran.err, "");
    fails("sim:demo", "slaves >&-", 3, "standard output cannot be written");
}

// Standard output is one JSON document, whatever fails.
TEST_F(EthercatTexts, ErrorsAreInTheJsonToo) {
    const auto error_of = [&](const std::string& arguments, int code) {
        const auto ran = ethercat("sim:demo", "--json " + arguments);
        EXPECT_EQ(ran.status, code) << arguments << ran.err;
        const auto json = nlohmann::json::parse(ran.out, nullptr, false);
        EXPECT_FALSE(json.is_discarded()) << arguments << "\n" << ran.out;
        if (json.is_discarded()) return std::string();
        const auto& where = json.contains("masters") ? json["masters"][0] : json;
        EXPECT_TRUE(where.contains("error")) << ran.out;
        const auto text = where.value("error", "");
        EXPECT_TRUE(ran.err.starts_with("ethercat: " + text + "\n")) << ran.err;
        return text;
    };
    const std::string unreachable = "missing.sock: no application can be reached: No such file or directory";
    for (const char* call :
         {"slaves", "upload -p 0 0x1018 1", "states PREOP", "graph", "reg_read -p 0 0x130 2", "data"})
        EXPECT_EQ(error_of(std::string(call) + " --attach missing.sock", 3), unreachable) << call;
    EXPECT_EQ(error_of("slaves -p 9", 1), "no slave of master 0 is selected by --position 9");
    EXPECT_TRUE(contains(error_of("slaves --source no-such-if", 3), "no-such-if"));
    EXPECT_TRUE(contains(error_of("slaves --master 5", 2), "no master is selected"));
    EXPECT_TRUE(contains(error_of("slaves --wrong", 2), "--wrong"));
    EXPECT_TRUE(contains(error_of("analyse missing.pcap", 3), "missing.pcap"));
    for (const std::string option :
         {"--source sim:demo", "--attach a.sock", "--record r.pcap", "--eni a.xml", "-m 7", "-f"})
        EXPECT_TRUE(contains(error_of("analyse missing.pcap " + option, 2), "analyse has no option --")) << option;
    // A file name may contain any octets, but JSON is UTF-8.
    folder.write("call", program + " --json analyse \"$(printf 'gro\\337.pcap')\"\n");
    const auto odd = folder.run("sh call");
    EXPECT_EQ(odd.status, 3) << odd.err;
    const auto json = nlohmann::json::parse(odd.out, nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << odd.out;
    EXPECT_TRUE(contains(json.value("error", ""), "gro\xEF\xBF\xBD.pcap")) << odd.out;
}

// When the help of a command names an option, the command has the option.
TEST_F(EthercatTexts, HelpNamesOnlyOptionsThatTheCommandHas) {
    for (const auto& command : ethercat::commands())
        for (const auto& option : ethercat::options()) {
            const auto named = "--" + std::string(option.name);
            const bool has = option.common || std::ranges::find(command.options, option.name) != command.options.end();
            for (const auto& paragraph : command.text) {
                auto at = paragraph.find(named);
                while (at != std::string_view::npos && at + named.size() < paragraph.size() &&
                       (std::isalpha(static_cast<unsigned char>(paragraph[at + named.size()])) ||
                        paragraph[at + named.size()] == '-'))
                    at = paragraph.find(named, at + 1);  // a longer name
                EXPECT_TRUE(has || at == std::string_view::npos) << command.name << ": " << named;
            }
        }
}

TEST_F(EthercatTexts, TheManualPageHasNoWarnings) {
    ASSERT_EQ(out("", "--man"), content_of(kTexts + "ethercat.1"));
    if (folder.run("command -v groff").status != 0) GTEST_SKIP() << "groff is not installed";
    const auto page = folder.run("groff -man -ww -Tascii -P-c -P-b -P-u '" + kTexts + "ethercat.1'");
    EXPECT_EQ(page.status, 0);
    EXPECT_EQ(page.err, "");
    for (const auto& command : ethercat::commands())
        EXPECT_TRUE(contains(page.out, "ethercat " + std::string(command.name) + " [OPTIONS]")) << command.name;
    EXPECT_TRUE(contains(page.out, "--output-file FILE")) << page.out.substr(0, 3000);
}

// The completion in a real bash: what it offers for the words of a command line. The last word is not finished.
struct EthercatCompletion : EthercatTest {
    [[nodiscard]] std::string offered(const std::string& words, int last, const std::string& shown = "[*]") const {
        const auto script = "source '" + kTexts + "ethercat'\ncompopt() { :; }\nCOMP_WORDS=(" + words +
                            ")\nCOMP_CWORD=" + std::to_string(last) + "\n_margay_ethercat\necho \"${COMPREPLY" + shown +
                            "}\"\n";
        folder.write("complete.bash", script);
        const auto ran = folder.run("bash -u complete.bash");
        EXPECT_EQ(ran.status, 0) << ran.err;
        EXPECT_EQ(ran.err, "");
        return ran.out.substr(0, ran.out.size() - 1);
    }
};

TEST_F(EthercatCompletion, OffersCommandsOptionsValuesAndFiles) {
    ASSERT_EQ(out("", "--completion"), content_of(kTexts + "ethercat"));
    EXPECT_EQ(offered("ethercat sl", 1), "slaves");
    EXPECT_EQ(offered("ethercat foe", 1), "foe_read foe_write");
    EXPECT_EQ(offered("ethercat slaves --pos", 2), "--position");
    EXPECT_EQ(offered("ethercat rescan --pos", 2), "") << "rescan selects no slaves";
    EXPECT_EQ(offered("ethercat analyse --ver", 2), "--verbose --version");
    EXPECT_EQ(offered("ethercat analyse --so", 2), "") << "analyse takes no SOURCE";
    EXPECT_EQ(offered("ethercat upload -t ui", 3), "uint8 uint16 uint32 uint64");
    EXPECT_EQ(offered("ethercat pdos --skin ''", 3), "default etherlab");
    EXPECT_EQ(offered("ethercat states S", 2), "SAFEOP");
    EXPECT_EQ(offered("ethercat states -p 1 O", 4), "OP");
    EXPECT_EQ(offered("ethercat graph ''", 2), "DC CRC");
    EXPECT_EQ(offered("ethercat slaves --source si", 3), "sim:");
    EXPECT_EQ(offered("ethercat slaves --source sim : dr", 5), "drives");
    EXPECT_TRUE(offered("ethercat slaves --source sim :", 4).starts_with("demo bootloader coupler ")) << "at the colon";
    EXPECT_EQ(offered("ethercat slaves --source = sim : serv", 6), "servodrives");
    folder.write("drive.toml", "");
    EXPECT_EQ(offered("ethercat slaves --source sim : dri", 5), "drives drive.toml") << "files too";
    EXPECT_EQ(offered("ethercat slaves --source pcap : dri", 5), "drive.toml") << "a recording has no segments";
    EXPECT_EQ(offered("ethercat slaves --source l", 3), "lo") << "an interface of this system";
    folder.write("image.bin", "x");
    EXPECT_EQ(offered("ethercat sii_write ima", 2), "image.bin");
    folder.write("my image.bin", "x");
    EXPECT_EQ(offered("ethercat sii_write my", 2, "[0]"), "my image.bin") << "one name, not two";
    EXPECT_EQ(offered("ethercat --ver", 1), "--verbose --version");
}

}  // namespace
}  // namespace margay::process
