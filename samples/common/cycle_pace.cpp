#include "common/cycle_pace.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"

#include <margay/margay.hpp>
#include <margay/timed_send.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

namespace margay::samples {
namespace {

// Other work of the master ends this long before the deadline, so that it does not delay the cycle.
constexpr Duration kQuietBefore = std::chrono::microseconds(100);

CyclicOptions cyclic(const PaceOptions& options, Duration period, bool real) {
    return {.period = period,
            .spin = std::chrono::microseconds(options.spin_us),
            .priority = options.priority,
            .runtime = std::chrono::microseconds(options.runtime_us),
            .cpu = options.cpu,
            .lock_memory = real && (options.priority > 0 || options.runtime_us > 0),
            .hold_latency = real && (options.priority > 0 || options.runtime_us > 0),
            .overrun = options.overrun.value_or(OverrunPolicy::skip)};
}

}  // namespace

void add_period_options(Arguments& arguments, PaceOptions& options, const std::string& before) {
    arguments.option("--period", options.period_us, before + "cycle period in µs", Bounds{50, 1'000'000}, 1000);
    arguments.option("--spin", options.spin_us,
                     "time before each cycle, in µs, in which the program polls the clock instead of sleeping",
                     Bounds{0, 1'000'000});
    arguments.option("--priority", options.priority,
                     "real-time priority (SCHED_FIFO), with memory locked and no deep sleep; 0: none", Bounds{0, 99});
    arguments.option("--runtime", options.runtime_us,
                     "processor time, in µs, that the kernel reserves for the program in each period (SCHED_DEADLINE; "
                     "where it is refused, --priority is used); 0: none",
                     Bounds{0, 1'000'000});
    arguments.option("--cpu", options.cpu, "bind the program to this processor; without it the kernel chooses",
                     Bounds{0, 1023});
}

void add_pace_options(Arguments& arguments, PaceOptions& options, const std::string& before) {
    add_period_options(arguments, options, before);
    arguments.choice(
        "--overrun", options.overrun,
        "when a cycle took longer than its period: skip the missed cycles [default], catch-up: execute them "
        "without waiting (10 at most), or stop the program",
        {{"skip", OverrunPolicy::skip}, {"catch-up", OverrunPolicy::catch_up}, {"stop", OverrunPolicy::stop}});
    arguments.option("--histogram", options.histogram,
                     "print lateness, period, sending, receiving and round trip of the cycles, and write them to this "
                     "file: as JSON if its name ends with .json, else as SVG");
    add_frame_time_options(arguments, options.times);
}

CyclePace::CyclePace(Source& source, Context& ctx, const PaceOptions& options)
    : CyclePace(source, ctx, options, options.plan()) {}

CyclePace::CyclePace(Source& source, Context& ctx, const PaceOptions& options, const CyclePlan& plan)
    : source_(source),
      ctx_(ctx),
      options_(options),
      plan_(plan),
      due_(plan.every.size()),
      runner_(cyclic(options, plan.period, !source.virtual_time())),
      virtual_(plan.period, Duration::zero()),
      timing_(source.timing()) {
    if (plan.clock) clock_.emplace(*plan.clock);
    virtual_.set_policy(options.overrun.value_or(OverrunPolicy::skip));
}

void CyclePace::start() {
    unexpected_before_ = ctx_.statistics().unexpected;
    if (source_.virtual_time()) {
        for (const auto& [given, name] :
             {std::pair{options_.spin_us != 0, "--spin"}, std::pair{options_.priority != 0, "--priority"},
              std::pair{options_.runtime_us != 0, "--runtime"}, std::pair{options_.cpu >= 0, "--cpu"}})
            if (given) warn(fmt::format("{} has no effect: time is virtual on this SOURCE", name));
        virtual_.start(source_.osal().now());
    } else {
        for (const auto& refusal : runner_.prepare())
            warn(fmt::format("{}: {}", refusal.what, std::strerror(refusal.error)));
        const auto spin = std::chrono::duration_cast<std::chrono::microseconds>(runner_.spin()).count();
        if (spin < static_cast<std::int64_t>(options_.spin_us))
            warn(
                fmt::format("--spin {} is longer than a cycle allows; the program uses {} µs", options_.spin_us, spin));
        runner_.start();
    }
    continue_phase();
}

void CyclePace::continue_phase() {
    // Longest time without a cycle; after it the phase is a new one.
    constexpr Duration kLongest = std::chrono::seconds(1);
    if (!clock_ || clock_->record().at == Time{} || clock_->record().at + kLongest < source_.osal().now()) return;
    const Duration period = clock_period();
    const Duration off = (deadline() - clock_->record().at) % period;
    adjust(off > Duration{0} ? period - off : Duration{0});
    (void)wait();
    clear();
}

Duration CyclePace::wait() {
    const bool real = !source_.virtual_time();
    const Time until = real ? deadline() - runner_.spin() - kQuietBefore : deadline();
    Time now = source_.osal().now();
    do {  // poll() runs at least once a cycle, so that a cycle without spare time does not stop the other work
        const Time wake = poll(ctx_, now);
        if (now < until) source_.osal().wait(std::min(wake, until), source_.wait_handles());
        now = source_.osal().now();
    } while (now < until);
    const auto tick = real ? runner_.wait() : virtual_.wake(source_.osal().now());
    const auto came = [](const CyclicTick& one) { return one.deadline + one.lateness; };
    if (ticked_) figures_.period.record(came(tick) - came(tick_));
    const OverrunCounters& all = real ? runner_.overruns() : virtual_.counters();
    figures_.overruns += all.overruns - counted_.overruns;
    figures_.skipped += all.skipped - counted_.skipped;
    figures_.caught_up += all.caught_up - counted_.caught_up;
    counted_ = all;
    figures_.lateness.record(tick.lateness);
    if (tick.stopped && stopped_.empty())
        stopped_ = fmt::format("stopped (--overrun stop): cycle {} could not begin in its period, and {} missed",
                               tick.cycle - tick.skipped, counted(tick.skipped, "cycle was", "cycles were"));
    tick_ = tick;
    ticked_ = true;
    return tick.lateness;
}

void CyclePace::adjust(Duration by) {
    if (!source_.virtual_time()) runner_.adjust(by);
    if (source_.virtual_time()) virtual_.adjust(by);
}

Result<std::uint32_t> CyclePace::exchange(Duration timeout) {
    Times times{.start = source_.osal().now()};
    const auto received = exchange_groups(timeout, times);
    times.back = source_.osal().now();
    keep_in_step(times);
    count(times, received);
    ++cycle_;
    return received;
}

Result<std::uint32_t> CyclePace::exchange_groups(Duration timeout, Times& times) {
    Error first;
    std::uint32_t sum = 0;
    const auto keep = [&first](const Error& error) {
        if (first.code == Errc::none) first = error;
    };
    for (std::size_t n = 0; n < due_.size(); ++n) {
        due_[n] = cycle_ % plan_.every[n] == 0;
        const auto sent = due_[n] ? send(static_cast<std::uint8_t>(n)) : Result<>();
        if (sent) continue;
        keep(sent.error());
        due_[n] = false;
    }
    times.sent = source_.osal().now();
    for (std::size_t n = 0; n < due_.size(); ++n) {
        if (!due_[n]) continue;
        const auto received = receive_processdata(ctx_, timeout, static_cast<std::uint8_t>(n));
        if (received)
            sum += *received;
        else
            keep(received.error());
    }
    return first.code == Errc::none ? Result<std::uint32_t>(sum) : Result<std::uint32_t>(first);
}

// The lateness of the frames does not count as an error of the phase.
void CyclePace::keep_in_step(const Times& times) {
    if (!clock_ || cycle_ % plan_.every[clock_->settings().group] != 0) return;
    adjust(-clock_->update(ctx_, is_held() ? std::max(times.start - departure(), Duration{0}) : tick_.lateness));
}

Duration CyclePace::reply_timeout() const {
    return std::max<Duration>(std::chrono::microseconds(500), plan_.period * 9 / 10);
}

std::string CyclePace::advice() const {
    if (figures_.no_frame == 0) return {};
    auto text = fmt::format("a cycle waits {} µs for its frames: if they need longer, use a longer --period",
                            std::chrono::duration_cast<std::chrono::microseconds>(reply_timeout()).count());
    if (const auto unexpected = ctx_.statistics().unexpected - unexpected_before_; unexpected != 0)
        text += fmt::format(" ({} that no cycle waited for: late, doubled or unknown)",
                            counted(unexpected, "frame came back", "frames came back"));
    return text;
}

bool CyclePace::is_held() const { return options_.times.send_at_us != 0 && timing_.send_at != nullptr; }

Time CyclePace::departure() const {
    const Time begun = ticked_ ? tick_.deadline : source_.osal().now();
    return begun + std::chrono::microseconds(options_.times.send_at_us);
}

Result<> CyclePace::send(std::uint8_t group) {
    return is_held() ? send_processdata_at(ctx_, *timing_.send_at, departure(), group) : send_processdata(ctx_, group);
}

void CyclePace::clear() {
    figures_ = {};
    wire_.forget();
    unexpected_before_ = ctx_.statistics().unexpected;
    if (timing_.send_at != nullptr) missed_before_ = timing_.send_at->missed();
}

void CyclePace::count(const Times& times, const Result<std::uint32_t>& received) {
    ++figures_.cycles;
    if (ticked_) figures_.sent.record(times.sent - tick_.deadline);
    if (received || received.error().code == Errc::working_counter) {
        figures_.round_trip.record(times.back - times.start);
        if (ticked_) figures_.received.record(times.back - tick_.deadline);
        wire_.count(ctx_, timing_, figures_.wire);
    } else {
        wire_.forget();
    }
    if (!received) ++(received.error().code == Errc::working_counter ? figures_.wrong_wkc : figures_.no_frame);
}

std::string CyclePace::report() {
    if (timing_.send_at != nullptr) figures_.missed = timing_.send_at->missed() - missed_before_;
    if (figures_.missed != 0) warn(missed_text(figures_.missed));
    if (options_.histogram.empty()) {
        if (figures_.wire.any()) write_out(wire_text(figures_.wire));
        return {};
    }
    write_out(cycle_text(figures_));
    std::ofstream out(options_.histogram);
    out << (options_.histogram.ends_with(".json") ? cycle_json(figures_) : cycle_svg(figures_)) << std::flush;
    return out ? std::string() : fmt::format("{}: cannot be written: {}", options_.histogram, std::strerror(errno));
}

}  // namespace margay::samples
