// segment_monitor: brings a segment to OP, keeps it in OP, and shows a live view: states, working counters, lateness
// of the cycle, line errors of the ports, and events. Keys: up and down scroll, r clears the figures, q ends the
// program.
#include "common/counted.hpp"
#include "common/cycle_pace.hpp"
#include "common/monitor_view.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>
#include <ncurses.h>
#include <unistd.h>

#include <array>
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

namespace {

using namespace margay;

struct Options {
    samples::SourceArguments source;
    unsigned cycles = 0;
    bool plain = false;
    samples::PaceOptions pace;
};

constexpr Duration kRefresh = std::chrono::milliseconds(100);
constexpr Duration kLineInterval = std::chrono::milliseconds(100);
constexpr std::size_t kEventsKept = 100;

// The output of the monitor: a terminal or plain text.
class Screen {
  public:
    virtual ~Screen() = default;
    virtual void show(const samples::MonitorModel& model, std::size_t scroll) = 0;
    virtual int key() { return ERR; }
};

class Terminal final : public Screen {
  public:
    // nullptr: ncurses does not know the terminal.
    static std::unique_ptr<Screen> open() {
        std::setlocale(LC_ALL, "");
        // Not initscr(): it ends the program when it does not know the terminal, and the slaves would stay in OP.
        SCREEN* const screen = newterm(nullptr, stdout, stdin);
        if (screen == nullptr) return nullptr;
        return std::unique_ptr<Screen>(new Terminal(screen));
    }
    ~Terminal() override {
        (void)endwin();
        delscreen(screen_);
    }
    void show(const samples::MonitorModel& model, std::size_t scroll) override {
        const auto lines =
            samples::monitor_lines(model, static_cast<std::size_t>(COLS), static_cast<std::size_t>(LINES), scroll);
        (void)erase();
        for (int row = 0; row < static_cast<int>(lines.size()); ++row)
            (void)mvaddstr(row, 0, lines[static_cast<std::size_t>(row)].c_str());
        (void)refresh();
    }
    int key() override { return getch(); }

  private:
    explicit Terminal(SCREEN* screen) : screen_(screen) {
        (void)cbreak();
        (void)noecho();
        (void)curs_set(0);
        (void)keypad(stdscr, TRUE);
        (void)nodelay(stdscr, TRUE);
    }

    SCREEN* screen_;
};

class Plain final : public Screen {
  public:
    void show(const samples::MonitorModel& model, std::size_t scroll) override {
        for (const auto& line : samples::monitor_lines(model, 200, 11 + model.slaves.size(), scroll))
            samples::print_out("{}\n", line);
        samples::flush_out();
    }
};

class Monitor {
  public:
    Monitor(samples::Source& source, const Options& options) : source_(source), options_(options) {}

    Result<> bring_up() {
        if (const auto ready = source_.begin(ctx_); !ready) return ready.error();
        // The monitor shows errors of single slaves and continues with the other slaves.
        if (const auto found = config_init(ctx_); !found && found.error().slave == 0) return found.error();
        if (const auto bytes = config_map(ctx_, image_); !bytes && !ctx_.group(0).mapped) return bytes.error();
        line_errors_.resize(ctx_.slaves().size());
        supervise_.line_interval = kLineInterval;
        supervise_.line_errors = line_errors_;
        return submit(ctx_, supervise_);
    }

    void run(Screen& screen) {
        model_.source = options_.source.source;
        model_.line_errors = line_errors_;
        pace_.start();
        Time next_show = source_.osal().now();
        while (!samples::stop_asked() && (options_.cycles == 0 || pace_.figures().cycles < options_.cycles)) {
            cycle();
            if (!pace_.stopped().empty()) break;
            if (source_.osal().now() < next_show) continue;
            next_show = source_.osal().now() + kRefresh;
            // slows virtual time down, so that a person can read the screen
            if (source_.virtual_time() && !options_.plain) std::this_thread::sleep_for(kRefresh);
            if (!options_.plain) show(screen);
            if (!handle_key(screen.key())) break;
        }
        show(screen);
        supervise_.cancel();
        (void)writestate(ctx_, 0, AlState::init);
    }

    // Call it after the screen is closed. Prints the errors, and the figures if --histogram asks for them. Returns the
    // exit code.
    [[nodiscard]] int report() {
        store_errors();
        for (const auto& error : errors_) samples::warn(error);
        if (!pace_.stopped().empty()) samples::warn(pace_.stopped());
        if (errors_dropped_ + ctx_.errors().dropped() != 0)
            samples::warn(samples::counted(errors_dropped_ + ctx_.errors().dropped(), "more error is not shown",
                                           "more errors are not shown"));
        if (bad_cycles_ != 0)
            samples::warn(samples::counted(bad_cycles_, "cycle") +
                          " without all frames or with a wrong working counter");
        if (const auto advice = pace_.advice(); !advice.empty()) samples::warn(advice);
        if (const auto failed = pace_.report(); !failed.empty())
            return samples::fail(failed, samples::exit_code::kSystem);
        return bad_cycles_ != 0 || failed_ || !pace_.stopped().empty() ? samples::exit_code::kSegment
                                                                       : samples::exit_code::kWell;
    }

    // After bring_up() has failed: prints this error, and the others of errors(). Returns the exit code.
    [[nodiscard]] int report_failure(const Error& error) {
        const std::string text = samples::sentence(error);
        (void)samples::fail(text);
        store_errors();
        std::erase(errors_, "error: " + text);  // errors() has it too
        (void)report();
        return samples::exit_code::kSegment;
    }

    // Copies the entries of errors() and warnings() to lines for the screen and for report().
    void store_errors() {
        while (const auto error = ctx_.errors().take()) {
            failed_ = true;
            keep("error: " + samples::sentence(*error));
        }
        while (const auto odd = ctx_.warnings().take()) keep("warning: " + samples::sentence(*odd));
    }

    void keep(const std::string& text) {
        add_line(text);
        if (errors_.size() < kEventsKept)
            errors_.push_back(text);
        else
            ++errors_dropped_;
    }

  private:
    void cycle() {
        model_.last = pace_.exchange(pace_.reply_timeout());
        if (!model_.last) ++bad_cycles_;
        pace_.wait();
        while (const auto event = ctx_.events().take()) {
            if (cables_.repeats(*event)) continue;
            std::array<char, 400> buffer{};
            add_line(std::string(describe(*event, buffer)));
        }
        store_errors();
    }

    void add_line(const std::string& text) {
        model_.events.push_back(fmt::format("cycle {}: {}", pace_.figures().cycles, text));
        if (model_.events.size() > kEventsKept) model_.events.pop_front();
    }

    void show(Screen& screen) {
        model_.slaves = ctx_.slaves();
        model_.expected_wkc = ctx_.group(0).expected_wkc;
        model_.figures = pace_.figures();
        screen.show(model_, scroll_);
    }

    // Returns false when the user asks the program to end.
    bool handle_key(int key) {
        if (key == KEY_UP && scroll_ > 0) --scroll_;
        if (key == KEY_DOWN && scroll_ + 1 < ctx_.slaves().size()) ++scroll_;
        if (key == 'r') pace_.clear();
        return key != 'q';
    }

    samples::Source& source_;
    const Options& options_;
    HostContext ctx_{source_.limits(Limits{.slaves = 1024, .process_frames = 64})};
    std::array<std::byte, 65536> image_{};
    std::vector<LineErrors> line_errors_;
    SuperviseRequest supervise_;
    samples::CyclePace pace_{source_, ctx_, options_.pace};
    samples::MonitorModel model_;
    samples::CableReports cables_{kLineInterval / 2};
    std::size_t scroll_ = 0;
    std::uint64_t bad_cycles_ = 0;  // since the start; the key r does not clear this counter
    std::vector<std::string> errors_;
    std::uint64_t errors_dropped_ = 0;
    bool failed_ = false;
};

// The screen for these options. Sets `plain` where a live screen is not possible: standard output is a file or a pipe,
// or ncurses does not know the terminal.
std::unique_ptr<Screen> open_screen(Options& options) {
    if (::isatty(STDOUT_FILENO) == 0) options.plain = true;
    if (!options.plain) {
        if (auto terminal = Terminal::open()) return terminal;
        const char* const name = std::getenv("TERM");
        samples::warn(fmt::format("the terminal '{}' is not known (TERM): continuing as with --plain",
                                  name == nullptr ? "" : name));
        options.plain = true;
    }
    return std::make_unique<Plain>();
}

int run(samples::Source& source, Options& options) {
    const auto monitor = std::make_unique<Monitor>(source, options);
    if (const auto ready = monitor->bring_up(); !ready) {
        return monitor->report_failure(ready.error());
    }
    samples::stop_at_signals();
    monitor->run(*open_screen(options));  // the screen is closed before report() prints
    return monitor->report();
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    samples::Arguments arguments(
        "segment_monitor",
        "Brings a segment to OP, keeps it there and shows a live view. Keys: up, down, r (clear figures), q (quit). "
        "Ends with 1 after lost frames, wrong working counters or errors.");
    add_source_arguments(arguments, options.source);
    arguments.option("--cycles", options.cycles, "end after this number of cycles; 0: run until q or a signal");
    arguments.flag(
        "--plain", options.plain,
        "print the last view as text at the end, in place of a live screen (always so when standard output is no "
        "terminal)");
    samples::add_pace_options(arguments, options.pace);
    return arguments.run(argc, argv, [&] {
        if (const auto wrong = options.pace.refusal(options.pace.plan()); !wrong.empty())
            return samples::fail(wrong, samples::exit_code::kUsage);
        options.source.options.times = wanted_times(options.pace.times);
        return run_on_source(options.source, [&](samples::Source& source) { return run(source, options); });
    });
}
