// dc_motion and dc_plot, as a user starts them.
#include <places.hpp>
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace margay::process {
namespace {

const std::string kBin = std::string(MARGAY_BIN_DIR) + "/";

// The number after `words` in the text.
double number_after(const std::string& text, const std::string& words) {
    const auto at = text.find(words);
    EXPECT_NE(at, std::string::npos) << words << " in " << text;
    return at == std::string::npos ? 1e9 : std::strtod(text.c_str() + at + words.size(), nullptr);
}

TEST(DcMotion, MovesTheDrivesOfASimulatedSegmentSynchronously) {
    const ShellFolder folder;
    const auto ran = folder.run(kBin + "dc_motion sim:drives --sines 2 --log motion.csv");
    EXPECT_EQ(ran.status, 0) << ran.err << ran.out;
    EXPECT_TRUE(contains(ran.out, "4 drives, reference clock of slave 1, all in OP")) << ran.out;
    EXPECT_LE(number_after(ran.out, "drives apart by "), 10) << ran.out;
    EXPECT_LE(number_after(ran.out, "ns off on average, "), 1000) << ran.out;
    EXPECT_LE(number_after(ran.out, "clocks of the slaves: "), 200) << ran.out;
    EXPECT_TRUE(contains(ran.out, ", 0 cycles wrong")) << ran.out;
    EXPECT_TRUE(contains(ran.out, ": in sync\n")) << ran.out;
    if (folder.run("command -v gnuplot").status != 0) GTEST_SKIP() << "no gnuplot";
    const auto plotted = folder.run(kBin + "dc_plot motion.csv --svg motion.svg");
    EXPECT_EQ(plotted.status, 0) << plotted.err;
    const auto svg = folder.run("head -c 300 motion.svg; grep -c '<path' motion.svg");
    EXPECT_TRUE(contains(svg.out, "<svg")) << svg.out;
    // /dev/full is written to and stays a device. A picture that cannot be stored is an error.
    const auto full =
        folder.run(kBin + "dc_plot motion.csv --svg /dev/full; echo $?; test -c /dev/full && echo device");
    EXPECT_EQ(full.out, "3\ndevice\n") << full.err;
    EXPECT_TRUE(contains(full.err, "/dev/full: cannot be written: No space left on device")) << full.err;
    const auto pipe = folder.run(kBin + "dc_plot motion.csv --svg /dev/stdout | grep -c '</svg>'");
    EXPECT_EQ(pipe.out, "1\n") << pipe.err;
}

// The simulated NIC holds the frames. Each frame leaves exactly one period after the previous frame, and the phase of
// SYNC0 is constant.
TEST(DcMotion, SendsAtATimeAndMeasuresByTheNic) {
    const ShellFolder folder;
    const auto ran = folder.run(kBin + "dc_motion sim:drives --sines 1 --send-at 150 --stamps hardware");
    EXPECT_EQ(ran.status, 0) << ran.err << ran.out;
    EXPECT_LE(number_after(ran.out, "ns off on average, "), 1000) << ran.out;
    EXPECT_TRUE(contains(ran.out, "time between cycles on the wire, by the NIC: min 1 ms, median 1 ms")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "round trip on the wire, by the NIC: min ")) << ran.out;
    EXPECT_FALSE(contains(ran.err, "did not leave at")) << ran.err;
    const auto late = folder.run(kBin + "dc_motion sim:drives --send-at 1000");
    EXPECT_EQ(late.status, 2);
    EXPECT_TRUE(contains(late.err, "--send-at 1000: the frames must leave within the period of 1000 µs")) << late.err;
}

TEST(DcMotion, SaysWhenThereIsNoDrive) {
    const ShellFolder folder;
    const auto ran = folder.run(kBin + "dc_motion sim:demo");
    EXPECT_EQ(ran.status, 1);
    EXPECT_TRUE(contains(ran.err, "there is no CiA 402 drive with CoE")) << ran.err;
}

// The replies of the simulated segment come after half of this period.
TEST(DcMotion, FailsWhenMostCyclesAreWrong) {
    const ShellFolder folder;
    const auto ran = folder.run(kBin + "dc_motion sim:drives --period 260 --sines 1");
    EXPECT_EQ(ran.status, 1);
    EXPECT_TRUE(contains(ran.err, "more than one cycle of a hundred was wrong")) << ran.err;
    EXPECT_EQ(folder.run(kBin + "dc_motion sim:drives --log a --svg ./a").status, 2);
}

TEST(DcPlot, SaysWhatIsWrong) {
    const ShellFolder folder;
    const auto same = folder.run("echo a,b >same.csv; " + kBin + "dc_plot same.csv --svg ./same.csv; cat same.csv");
    EXPECT_EQ(same.err, "dc_plot: --svg would replace the log\n");
    EXPECT_EQ(same.out, "a,b\n");
    EXPECT_EQ(folder.run(kBin + "dc_plot nothing.csv").status, 3);
    const auto ran = folder.run("echo a,b >odd.csv; " + kBin + "dc_plot odd.csv");
    EXPECT_EQ(ran.status, 3);
    EXPECT_EQ(ran.err, "dc_plot: odd.csv: the first line has no column Time\n");
}

}  // namespace
}  // namespace margay::process
