// The scripts for new users. Test programs replace the programs of the system, so that nothing is installed and
// nothing is built.
#include <places.hpp>
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::process {
namespace {

namespace fs = std::filesystem;

// A checkout with only samples/ and test/run.sh. On its system the user is root, and the file `installed` holds the
// names of the installed packages.
struct Checkout : testing::Test {
    ShellFolder folder;

    void SetUp() override {
        fs::create_directories(folder.path() / "samples");
        fs::create_directories(folder.path() / "test");
        for (const auto* name : {"samples/quickstart.sh", "samples/packages.sh", "test/run.sh"})
            fs::copy_file(fs::path(MARGAY_SOURCE_DIR) / name, folder.path() / name);
        folder.write("log", "");
        folder.write("installed", "");
        folder.write_script("bin/id", "echo 0\n");
        folder.write_script("bin/dpkg-query",
                            "for name; do :; done\n"
                            "grep -qx -- \"$name\" '" +
                                file("installed") + "' && echo 'install ok installed'\n");
        folder.write_script("bin/apt-get", "echo \"apt-get $*\" >>'" + file("log") +
                                               "'\n"
                                               "case $* in *clang-16*) echo unknown package; exit 100;; esac\n"
                                               "case $* in *install*) for name; do echo \"$name\" >>'" +
                                               file("installed") + "'; done;; esac\n");
        folder.write_script("bin/nproc", "echo 2\n");
        tests_pass("7");
        folder.write_script("bin/cmake", "echo \"cmake $*\" >>'" + file("log") + "'\n");
    }
    // Replaces ctest: `number` tests pass; "": ctest finds no test.
    void tests_pass(const std::string& number) {
        const std::string summary =
            number.empty() ? "No tests were found!!!" : "100%% tests passed, 0 tests failed out of " + number;
        folder.write_script("bin/ctest",
                            "echo \"ctest $*\" >>'" + file("log") +
                                "'\n"
                                "while [ $# -gt 0 ]; do case $1 in --output-log) log=$2;; esac; shift; done\n"
                                "printf '" +
                                summary + "\\n' >\"$log\"\n");
    }
    [[nodiscard]] std::string file(const std::string& name) const { return (folder.path() / name).string(); }
    [[nodiscard]] Ran script(const std::string& command) const {
        return folder.run("PATH='" + file("bin") + "':$PATH; " + command);
    }
    [[nodiscard]] std::string log() const { return content_of(file("log")); }
};

TEST_F(Checkout, OneUnknownUsefulPackageLeavesTheOthersInstalled) {
    const auto ran = script("sh test/run.sh");
    EXPECT_EQ(ran.status, 0) << ran.err;
    for (const auto* name : {"g++", "libgtest-dev", "valgrind", "tshark", "libclang-rt-16-dev", "gcc-arm-none-eabi"})
        EXPECT_TRUE(contains("\n" + content_of(file("installed")), "\n" + std::string(name) + "\n")) << name;
    EXPECT_TRUE(contains(ran.err, "Going on without: clang-16\n")) << ran.err;
    EXPECT_TRUE(contains(log(), "cmake --build build --parallel ")) << log();
    const auto all = log();
    EXPECT_EQ(all.find("apt-get -q update"), all.rfind("apt-get -q update")) << "once is enough";
}

TEST_F(Checkout, AQuickRunInstallsNoOtherCompilers) {
    const auto ran = script("sh test/run.sh --quick");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto installed = content_of(file("installed"));
    EXPECT_TRUE(contains(installed, "\ntshark\n")) << installed;
    for (const auto* name : {"arm-none-eabi", "clang", "s390x", "qemu"})
        EXPECT_FALSE(contains(installed, name)) << installed;
}

TEST_F(Checkout, AnUnknownNeededPackageEndsTheRun) {
    folder.write_script("bin/apt-get", "case $* in *libfmt-dev*) exit 100;; esac\n");
    const auto ran = script("sh test/run.sh --quick");
    EXPECT_EQ(ran.status, 1);
    EXPECT_TRUE(contains(ran.err, "Missing packages:")) << ran.err;
    EXPECT_FALSE(contains(log(), "cmake")) << log();
}

// Replaces ctest: the output of a run with a skipped test.
TEST_F(Checkout, ASkippedTestFailsTheRunWhereThatIsAskedFor) {
    folder.write_script("bin/ctest",
                        "while [ $# -gt 0 ]; do case $1 in --output-log) log=$2;; esac; shift; done\n"
                        "printf '100%% tests passed, 0 tests failed out of 2\\n\\nThe following tests did not run:\\n"
                        "\\t  2 - replay/Drive.Starts (Skipped)\\n' >\"$log\"\n");
    const auto skipped = script("sh test/run.sh --quick");
    EXPECT_EQ(skipped.status, 0) << skipped.err;
    const auto refused = script("sh test/run.sh --quick --no-skips");
    EXPECT_EQ(refused.status, 1) << refused.out;
    EXPECT_TRUE(contains(refused.err, "replay/Drive.Starts")) << refused.err;
}

// ctest ignores options that it does not know, and its --help executes no test.
TEST_F(Checkout, AWrongOptionOfARunIsAnError) {
    for (const auto* wrong :
         {"--quik", "--no-skip", "-R wire --quik", "-quick", "--rerun-failed", "quick", "-R wire wire"}) {
        const auto ran = script("sh test/run.sh " + std::string(wrong));
        EXPECT_EQ(ran.status, 2) << wrong;
        EXPECT_TRUE(contains(ran.err, "unknown option '")) << ran.err;
    }
    for (const auto* wrong : {"-R", "--quick -E", "-L --quick"}) {
        const auto ran = script("sh test/run.sh " + std::string(wrong));
        EXPECT_EQ(ran.status, 2) << wrong;
        EXPECT_TRUE(contains(ran.err, "needs a value")) << ran.err;
    }
    const auto help = script("sh test/run.sh --help");
    EXPECT_EQ(help.status, 0);
    EXPECT_TRUE(contains(help.out, "\n  --no-skips   a test that is skipped fails the run\n")) << help.out;
    EXPECT_FALSE(contains(help.out, "set -eu")) << help.out;
    EXPECT_EQ(log(), "") << "nothing was installed or built";
    const auto ran = script("sh test/run.sh -R wire --quick -- --rerun-failed --stop-on-failure");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(log(), " -R wire --rerun-failed --stop-on-failure\n")) << log();
    EXPECT_FALSE(contains(log(), "build-sanitized")) << log();
}

TEST_F(Checkout, TheQuickstartKnowsNoOptionButHelp) {
    const auto wrong = script("sh samples/quickstart.sh now");
    EXPECT_EQ(wrong.status, 2);
    EXPECT_TRUE(contains(wrong.err, "unknown option 'now'")) << wrong.err;
    const auto help = script("sh samples/quickstart.sh --help");
    EXPECT_EQ(help.status, 0);
    EXPECT_TRUE(contains(help.out, "installs the packages")) << help.out;
    EXPECT_FALSE(contains(help.out, "set -eu")) << help.out;
    EXPECT_EQ(log(), "") << "nothing was installed or built";
}

TEST_F(Checkout, ARunWithoutATestIsAnError) {
    tests_pass("");
    for (const auto* options : {"-R NoSuchTest", "--quick -R NoSuchTest"}) {
        const auto ran = script("sh test/run.sh " + std::string(options));
        EXPECT_EQ(ran.status, 1) << options;
        EXPECT_TRUE(ran.err.ends_with("test/run.sh: no test was run\n")) << ran.err;
    }
    const auto listed = script("sh test/run.sh --quick -N");
    EXPECT_EQ(listed.status, 0) << listed.err;
}

TEST_F(Checkout, ARunEndsWithTheTimeOfEachStepAndTheSummaries) {
    const auto ran = script("sh test/run.sh");
    ASSERT_EQ(ran.status, 0) << ran.err;
    for (const auto* build : {"build", "build-sanitized", "build-threads"})
        for (const auto* step : {"configure", "build", "tests"})
            EXPECT_TRUE(contains(ran.out, std::string("  ") + build + ": " + step + " ")) << build << " " << step;
    const std::string end = "\nbuild-threads: 100% tests passed, 0 tests failed out of 7\n";
    EXPECT_TRUE(ran.out.ends_with(end)) << ran.out;
}

// Replaces ctest: one of several tests failed. `output`: what the test printed. `alone`: what ctest prints for the
// second run.
TEST_F(Checkout, AFailedTestRunsOnceMoreAloneUnlessASanitizerOrACrashReportedIt) {
    const auto run = [&](const std::string& output, const std::string& alone, int status) {
        folder.write_script("bin/ctest",
                            "echo \"ctest $*\" >>'" + file("log") +
                                "'\n"
                                "case $* in *--rerun-failed*) again=yes;; esac\n"
                                "while [ $# -gt 0 ]; do case $1 in --output-log) log=$2;; esac; shift; done\n"
                                "if [ \"$again\" ]; then echo '1/1 Test #3: service/shard_2 ........ " +
                                alone + "  0.10 sec' >\"$log\"; exit " + std::to_string(status) +
                                "; fi\n"
                                "printf '%s\\n' '3/7 Test #3: service/shard_2 ...***Failed  1.0 sec' '" +
                                output + "' '86% tests passed, 1 tests failed out of 7' >\"$log\"; exit 8\n");
        folder.write("log", "");
        return script("sh test/run.sh --quick");
    };
    const auto late = run("too late", "  Passed ", 0);
    EXPECT_EQ(late.status, 0) << late.err;
    EXPECT_TRUE(contains(late.out, "too late")) << "what failed is shown: " << late.out;
    EXPECT_TRUE(
        late.out.ends_with("\nbuild: service/shard_2 failed among others and passed alone\n"
                           "build: 86% tests passed, 1 tests failed out of 7\n"))
        << late.out;

    const auto wrong = run("wrong", "***Failed", 8);
    EXPECT_EQ(wrong.status, 1);
    EXPECT_TRUE(contains(wrong.err, "Failed in build:\n3/7 Test #3: service/shard_2")) << wrong.err;

    for (const auto* report :
         {"==7==ERROR: AddressSanitizer: heap-use-after-free", "WARNING: ThreadSanitizer: data race",
          "a.cpp:3:1: runtime error: signed integer overflow", "8/9 Test #8: a ...***Exception: SegFault"}) {
        const auto ran = run(report, "  Passed ", 0);
        EXPECT_EQ(ran.status, 1) << report;
        EXPECT_FALSE(contains(log(), "--rerun-failed")) << report;
    }
}

TEST_F(Checkout, CompilersFitIntoTheMemory) {
    const auto compilers = [&](const std::string& meminfo) {
        folder.write("meminfo", meminfo);
        return script(". samples/packages.sh; meminfo='" + file("meminfo") + "'; compilers").out;
    };
    folder.write_script("bin/nproc", "echo 8\n");
    EXPECT_EQ(compilers("MemTotal: 99999999 kB\nMemAvailable:    33554432 kB\n"), "8\n");
    EXPECT_EQ(compilers("MemTotal: 99999999 kB\nMemAvailable:     3400000 kB\n"), "3\n");
    EXPECT_EQ(compilers("MemAvailable:      400000 kB\n"), "1\n");
    EXPECT_EQ(compilers("nothing that is known\n"), "8\n");
    fs::remove(file("meminfo"));
    EXPECT_EQ(script(". samples/packages.sh; meminfo='" + file("meminfo") + "'; compilers").out, "8\n");
}

// CMake also writes its cache when it fails.
TEST_F(Checkout, QuickstartConfiguresAgainAfterAFailure) {
    folder.write_script("bin/cmake",
                        "echo \"cmake $*\" >>'" + file("log") +
                            "'\n"
                            "case $1 in -S) [ ! -e build/CMakeCache.txt ] || echo with a cache >>'" +
                            file("log") +
                            "'\n"
                            "mkdir -p build; : >build/CMakeCache.txt; [ -e works ] || exit 1\n"
                            ": >build/Makefile;; *) [ -e build/Makefile ] || exit 1; mkdir -p build/bin; echo 'echo "
                            "seen' >build/bin/slaveinfo\n"
                            "chmod +x build/bin/slaveinfo;; esac\n");
    folder.write_script("bin/ninja", "");
    EXPECT_NE(script("sh samples/quickstart.sh").status, 0);
    EXPECT_TRUE(contains(log(), "cmake -S . -B build -G Ninja ")) << log();
    folder.write("works", "");
    const auto second = script("sh samples/quickstart.sh");
    EXPECT_EQ(second.status, 0) << second.err;
    EXPECT_TRUE(contains(second.out, "\nseen\n")) << second.out;
    EXPECT_FALSE(contains(log(), "with a cache\n")) << "the cache keeps the compiler of the failed attempt";
    const auto configured = log().size();
    EXPECT_EQ(script("sh samples/quickstart.sh").status, 0);
    EXPECT_FALSE(contains(log().substr(configured), "cmake -S")) << "a configured folder keeps its settings";
}

// A test in layers/ permits no other files at the top level.
TEST_F(Checkout, QuickstartSuggestsNothingThatLeavesFilesInTheCheckout) {
    const auto text = content_of(file("samples/quickstart.sh"));
    ASSERT_TRUE(contains(text, "--record "));
    for (auto at = text.find("--record "); at != std::string::npos; at = text.find("--record ", at + 1))
        EXPECT_EQ(text.substr(at + 9, 5), "/tmp/") << text.substr(at, 30);
}

// The first build makes the programs that the script suggests before the line that builds the rest.
TEST_F(Checkout, QuickstartBuildsTheProgramsThatItSuggests) {
    const auto text = content_of(file("samples/quickstart.sh"));
    const auto targets_at = text.find(" --target ");
    ASSERT_NE(targets_at, std::string::npos);
    const auto targets = text.substr(targets_at, text.find('\n', targets_at) - targets_at) + " ";
    const auto rest = text.find("\n  cmake --build build ");
    ASSERT_NE(rest, std::string::npos);
    int programs = 0;
    for (auto at = text.find("build/bin/"); at < rest; at = text.find("build/bin/", at + 1), ++programs) {
        const auto name = text.substr(at + 10, text.find_first_of(" \n", at) - at - 10);
        EXPECT_TRUE(contains(targets, " " + name + " ")) << name;
    }
    EXPECT_GT(programs, 4);
}

}  // namespace
}  // namespace margay::process
