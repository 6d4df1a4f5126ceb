// storm: random tests of complete systems, generated from seeds, in virtual time.
#include "storm/run.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <sstream>

namespace {

using namespace margay::storm;

struct Options {
    std::uint64_t first = 1;
    std::uint64_t seeds = 0;
    double seconds = 0;
    double hours = 0;
    std::string plan_file;
    bool show = false;
    bool no_shrink = false;
    bool keep_going = false;
    bool verbose = false;
};

int run_file(const Options& options) {
    std::ifstream file(options.plan_file);
    std::ostringstream text;
    text << file.rdbuf();
    std::string why = "it cannot be read";
    const auto plan = file ? parse_plan(text.str(), why) : std::nullopt;
    if (!plan) {
        std::fprintf(stderr, "%s: %s\n", options.plan_file.c_str(), why.c_str());
        return 2;
    }
    const auto verdict = execute(*plan);
    if (verdict.good()) {
        std::printf("everything held, %.3f simulated seconds\n", verdict.simulated_seconds);
        return 0;
    }
    std::printf("%s\n%s\n", verdict.rule.c_str(), verdict.detail.c_str());
    return 1;
}

volatile std::sig_atomic_t interrupted = 0;

class Storm {
  public:
    explicit Storm(const Options& options) : options_(options) {}

    int run() {
        const auto start = std::chrono::steady_clock::now();
        const auto elapsed = [&] {
            return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        };
        const double limit = options_.hours > 0 ? options_.hours * 3600 : options_.seconds;
        std::uint64_t seed = options_.first;
        double told = 0;
        std::signal(SIGINT, [](int) { interrupted = 1; });  // the seed that is executing still ends
        for (; interrupted == 0; ++seed) {
            if (options_.seeds != 0 && seed - options_.first >= options_.seeds) break;
            if (limit > 0 && elapsed() >= limit) break;
            one(seed);
            if (failed_ > 0 && !options_.keep_going) break;
            if (elapsed() < told + kProgress) continue;
            told = elapsed();
            print_count(told);
        }
        print_count(elapsed());
        for (const auto& [rule, all] : by_rule_) {
            std::printf("  %zu x %s:", all.size(), rule.c_str());
            for (std::size_t n = 0; n < all.size() && n < 12; ++n)
                std::printf(" %llu", static_cast<unsigned long long>(all[n]));
            std::printf("\n");
        }
        return failed_ > 0 ? 1 : 0;
    }

  private:
    static constexpr double kProgress = 60;  // s

    void print_count(double took) const {
        std::printf(
            "%llu seeds from %llu on in %.1f s, %.0f simulated seconds (%.1f a second), %u broke a rule, %u of "
            "them in a way that is known\n",
            static_cast<unsigned long long>(run_), static_cast<unsigned long long>(options_.first), took, simulated_,
            simulated_ / took, failed_ + known_, known_);
        std::fflush(stdout);
    }

    void one(std::uint64_t seed) {
        const Plan plan = make_plan(seed);
        const auto verdict = execute(plan);
        ++run_;
        simulated_ += verdict.simulated_seconds;
        if (options_.verbose) std::printf("%llu %s\n", static_cast<unsigned long long>(seed), verdict.rule.c_str());
        std::fflush(stdout);
        if (verdict.good()) return;
        const bool first = !by_rule_.contains(verdict.rule);
        by_rule_[verdict.rule].push_back(seed);
        if (const char* const reason = known_reason(verdict); reason != nullptr) {
            ++known_;
            if (first)
                std::printf("seed %llu: %s\n  known: %s\n", static_cast<unsigned long long>(seed), verdict.rule.c_str(),
                            reason);
            if (options_.seeds != 1) return;
        } else {
            ++failed_;
        }
        std::printf("seed %llu: %s\n  %.2000s\n", static_cast<unsigned long long>(seed), verdict.rule.c_str(),
                    verdict.detail.c_str());
        if (first && !options_.no_shrink) {
            const Plan small = shrink(plan, verdict.rule);
            std::printf("made smaller (a test: put it into test/storm/plans/NAME.plan):\n\n# %s\n%s\n",
                        verdict.rule.c_str(), to_text(small).c_str());
        }
        std::fflush(stdout);
    }

    const Options& options_;
    std::uint64_t run_ = 0;
    double simulated_ = 0;
    unsigned failed_ = 0;
    unsigned known_ = 0;
    std::map<std::string, std::vector<std::uint64_t>> by_rule_;
};

}  // namespace

int main(int argc, char** argv) {
    Options options;
    CLI::App app(
        "Random systems, random operations and random faults in virtual time, by seed; what must hold is checked "
        "at every step.");
    app.add_option("--seed", options.first, "The first seed")->capture_default_str()->check(CLI::NonNegativeNumber);
    constexpr double kLongest = 1e6;
    app.add_option("--seeds", options.seeds, "How many seeds")->check(CLI::PositiveNumber);
    app.add_option("--seconds", options.seconds, "For how long")->check(CLI::Range(0.0, kLongest));
    app.add_option("--hours", options.hours, "For how long, from a fresh seed on, past seeds that fail")
        ->check(CLI::Range(0.0, kLongest));
    app.add_option("--plan", options.plan_file, "Runs the plan of a file")
        ->check(CLI::ExistingFile)
        ->excludes("--seed");
    app.add_flag("--show", options.show, "Prints the plan of the seed and does not run it");
    app.add_flag("--no-shrink", options.no_shrink, "Plans that fail are not made smaller");
    app.add_flag("--keep-going", options.keep_going, "Goes on behind a seed that fails");
    app.add_flag("--verbose", options.verbose, "A line for each seed");
    constexpr int kUsage = 2;
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : kUsage;
    }
    if (!options.plan_file.empty()) return run_file(options);
    if (options.show) {
        std::fputs(to_text(make_plan(options.first)).c_str(), stdout);
        return 0;
    }
    if (options.hours > 0) {
        options.keep_going = true;
        if (app.count("--seed") == 0) options.first = static_cast<std::uint64_t>(std::time(nullptr)) << 20;
    }
    if (options.seeds == 0 && options.seconds <= 0 && options.hours <= 0) options.seeds = 1;
    return Storm(options).run();
}
