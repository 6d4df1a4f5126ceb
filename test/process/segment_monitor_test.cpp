// The programs segment_monitor and simple_io on a simulated segment in virtual time.
#include <places.hpp>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace margay::process {
namespace {

const std::string kBin = MARGAY_BIN_DIR;

struct MonitorRan {
    int status = -1;
    std::string output;  // standard output and standard error
};

MonitorRan run(const std::string& command) {
    MonitorRan ran;
    std::FILE* pipe = ::popen((command + " 2>&1 </dev/null").c_str(), "r");
    if (pipe == nullptr) return ran;
    char buffer[4096];
    while (const auto bytes = std::fread(buffer, 1, sizeof buffer, pipe)) ran.output.append(buffer, bytes);
    const int status = ::pclose(pipe);
    ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return ran;
}

bool contains(const std::string& text, const std::string& what) { return text.find(what) != std::string::npos; }

TEST(SegmentMonitor, PrintsWhatItHasSeenInPlainText) {
    const auto ran = run(kBin + "/segment_monitor sim:demo --cycles 500 --plain");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_TRUE(contains(ran.output, "sim:demo   5 slaves:  5 in OP\n")) << ran.output;
    EXPECT_TRUE(contains(ran.output, "cycle 500  working counter 6 of 6  wrong wkc 0  incomplete 0  overruns 0\n"))
        << ran.output;
    EXPECT_TRUE(contains(ran.output, "    3  OP               8-channel digital output\n")) << ran.output;
    EXPECT_TRUE(contains(ran.output, "slave 5: SAFEOP to OP")) << ran.output;
}

TEST(SegmentMonitor, PrintsThePictureInTheReadme) {
    const auto ran = run(kBin + "/segment_monitor sim:drives --plain --cycles 4501");
    EXPECT_EQ(ran.status, 0) << ran.output;
    std::ifstream in(MARGAY_SOURCE_DIR "/README.md");
    const std::string readme(std::istreambuf_iterator<char>(in), {});
    const auto from = readme.find("sim:drives   8 slaves");
    const auto picture = readme.substr(from, readme.find("    …\n", from) - from);
    EXPECT_GT(picture.size(), 200U);
    EXPECT_TRUE(contains(ran.output, picture)) << ran.output << picture;
}

TEST(SegmentMonitor, DrawsOnATerminalAndEndsByItself) {
    if (run("script -qec true /dev/null").status != 0)
        GTEST_SKIP() << "no script (bsdutils), or no pseudo-terminal for it";
    const auto ran = run("TERM=xterm script -qec '" + kBin + "/segment_monitor sim:demo --cycles 150' /dev/null");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_TRUE(contains(ran.output, "sim:demo   5 slaves:  5 in ")) << ran.output;
    EXPECT_TRUE(contains(ran.output, "slave 5: SAFEOP to OP")) << ran.output;
    EXPECT_TRUE(contains(ran.output, "8-channel digital output")) << ran.output;
}

TEST(SegmentMonitor, PrintsPlainTextIntoAFileOrAPipe) {
    const auto ran = run(kBin + "/segment_monitor sim:demo --cycles 500");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_TRUE(ran.output.starts_with("sim:demo   5 slaves:  5 in OP\ncycle 500 ")) << ran.output;
    EXPECT_FALSE(contains(ran.output, "\x1b")) << ran.output;
}

// ncurses would end the program here, with the slaves in OP.
TEST(SegmentMonitor, GoesOnWithPlainTextOnATerminalThatIsNotKnown) {
    if (run("script -qec true /dev/null").status != 0)
        GTEST_SKIP() << "no script (bsdutils), or no pseudo-terminal for it";
    // newterm() does not free what it has allocated when it fails.
    const auto ran = run("ASAN_OPTIONS=detect_leaks=0 TERM=no-such script -qec '" + kBin +
                         "/segment_monitor sim:demo --cycles 20' /dev/null");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_TRUE(contains(ran.output, "the terminal 'no-such' is not known (TERM): continuing as with --plain"))
        << ran.output;
    EXPECT_TRUE(contains(ran.output, "cycle 20  working counter 6 of 6")) << ran.output;
}

TEST(SegmentMonitor, NamesWhatItCannotOpen) {
    const auto ran = run(kBin + "/segment_monitor no-such-if --plain");
    EXPECT_EQ(ran.status, 3);
    EXPECT_TRUE(contains(ran.output, "segment_monitor: there is no interface \"no-such-if\"")) << ran.output;
}

TEST(SimpleIo, ReachesOpAndShowsHowPunctualItWas) {
    const auto picture =
        std::filesystem::temp_directory_path() / ("margay-simple-io-" + std::to_string(::getpid()) + ".svg");
    const auto ran = run(kBin + "/simple_io sim:demo --cycles 300 --histogram '" + picture.string() + "'");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_TRUE(
        contains(ran.output, "all slaves in OP\n300 cycles, 0 without all frames, 0 with a wrong working counter\n"))
        << ran.output;
    EXPECT_TRUE(contains(ran.output, "round trip: min ")) << ran.output;
    std::ifstream in(picture);
    const std::string svg(std::istreambuf_iterator<char>(in), {});
    EXPECT_EQ(svg.substr(0, 5), "<svg ");
    std::filesystem::remove(picture);
}

}  // namespace
}  // namespace margay::process
