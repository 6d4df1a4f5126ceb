// Measures distributed clocks in virtual time: how fast the clocks of a segment are in sync, how far they are from each
// other then, and how far the cycle of the master is from SYNC0. All numbers are against the simulation's true time.
// "first ns" is the greatest error in the first second after configdc(), "100 ns at ms" the time from which on it is
// 100 ns at most, "max ns" the greatest error after that second.
//
//     bench_dc [SEED [SECONDS]]          1 to 300 slaves in line and tree; 10 s each, 600 s are the ten minutes of the
//                                        issue
//     bench_dc SEED SECONDS back         a slave at the end loses its power for 50 ms: when it is in OP and its clock
//                                        100 ns from the reference at most, and the wrong SYNC0 edges of all others
//     bench_dc SEED SECONDS sweep [SLAVES]   one segment (100 slaves in a line), jitter of the cycle from 0 to 50 µs
//
// Random numbers follow from the seed. Every clock has a drift of up to ±100 ppm that wanders, frames are lost, and the
// cycle begins up to 10 µs late. The host measures how late it began, as run_cycle() does, up to an error of 100 ns.
// For comparison, each segment is also started without the burst and with one measurement, by waiting until the
// differences are small. The chips count in steps of 10 ns, and the arrival of each frame at each port has a jitter of
// ±5 ns. The phase is the true system time of the reference clock when the cycle is due, against the set value: it
// contains the way of the frame to the reference clock, 200 ns. When the frame passes, the lateness of the cycle is
// added to the phase.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/master_clock.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string_view>
#include <vector>

namespace {

using namespace margay;
using namespace std::chrono_literals;

enum class Shape { line, tree };
enum class Way { burst, wait };

struct Row {
    double in_sync_ms = 0;
    double start_most_ns = 0;  // between any two clocks, from in sync on for a second,
    double close_ms = 0;       // from then on it is 100 ns at most
    double most_ns = 0;
    double rms_ns = 0;
    double phase_rms_ns = 0;
    double phase_most_ns = 0;
    std::uint64_t edges_wrong = 0;
    bool ok = false;
};

class Bench {
  public:
    Bench(std::uint16_t slaves, Shape shape, double loss, std::uint64_t seed, std::int64_t jitter_ns = 10'000)
        : slaves_(slaves), random_(seed), nic_(segment_, osal_), ctx_({.slaves = slaves}), jitter_ns_(jitter_ns) {
        build(shape);
        loss_ = loss;
        segment_.power_up(osal_.now());
    }

    Row run(Way way, Duration duration) {
        Row row;
        if (!init(ctx_, nic_, osal_) || !config_init(ctx_)) return row;
        segment_.set_noise({.lost = loss_, .seed = random_()});
        for (std::uint16_t n = 1; n <= slaves_; ++n) ctx_.slave(n).config.setup = &setup_;
        ClockSettings settings{.timeout = 5s};
        if (way == Way::wait) settings.burst_frames = 0;
        if (way == Way::wait) settings.measurements = 1;
        const Time begin = osal_.now();
        row.ok = configdc(ctx_, settings).ok();
        place_of_ = segment_.order();
        row.in_sync_ms = std::chrono::duration<double, std::milli>(osal_.now() - begin).count();
        last_far_ = osal_.now();
        note_clocks(row);
        if (!config_map(ctx_, image_)) return row;
        MasterClock clock({.mode = MasterClock::Mode::master_shift, .set_value = kSetValue, .phase = {}});
        cycle(clock, 1s, row);  // the cycle learns phase and drift
        row.start_most_ns = row.most_ns;
        row.close_ms = std::max(row.in_sync_ms, std::chrono::duration<double, std::milli>(last_far_ - begin).count());
        row.most_ns = row.rms_ns = row.phase_rms_ns = row.phase_most_ns = 0;
        const auto cycles = cycle(clock, duration, row);
        row.rms_ns = std::sqrt(row.rms_ns / (static_cast<double>(cycles) * slaves_));
        row.phase_rms_ns = std::sqrt(row.phase_rms_ns / static_cast<double>(cycles));
        for (std::uint16_t n = 1; n <= slaves_; ++n) row.edges_wrong += wrong_edges(n);
        return row;
    }

    struct Return {
        double back_ms = 0;
        std::uint64_t edges_wrong = 0;
        bool ok = false;
    };
    // After run(), with a supervision: the last slave loses its power, so that the frames still reach all other slaves.
    Return lose_power() {
        Return result;
        MasterClock clock({.mode = MasterClock::Mode::master_shift, .set_value = kSetValue, .phase = {}});
        Row row;
        SuperviseRequest supervision;
        if (!submit(ctx_, supervision)) return result;
        cycle(clock, 2s, row);
        const std::uint16_t lost = slaves_;
        const std::uint32_t place = place_of_[lost - 1U];
        segment_.set_power(place, false, osal_.now());
        cycle(clock, 50ms, row);
        segment_.set_power(place, true, osal_.now());
        const Time on = osal_.now();
        constexpr Duration kLongest = 5s;
        while (!result.ok && osal_.now() - on < kLongest) {
            cycle(clock, 1ms, row);
            const auto away = static_cast<std::int64_t>(copy(lost, osal_.now()) - copy(1, osal_.now()));
            result.ok =
                ctx_.slave(lost).al.state == AlState::op && slave_clock(ctx_, lost).in_sync && std::abs(away) <= 100;
        }
        result.back_ms = std::chrono::duration<double, std::milli>(osal_.now() - on).count();
        cycle(clock, 1s, row);
        for (std::uint16_t n = 1; n < slaves_; ++n) result.edges_wrong += wrong_edges(n);
        return result;
    }

  private:
    static constexpr Duration kSetValue = -300us;
    void build(Shape shape) {
        std::uniform_int_distribution<std::int32_t> drift(-100'000, 100'000);
        std::uniform_int_distribution<std::int64_t> cable(5, 500);
        for (std::uint32_t n = 0; n < slaves_; ++n) {
            auto made = sim::device_from_sii(io_image(8, 8, {.emulation = true}));
            made.chip = shape == Shape::line ? sim::ip_core() : sim::junction();
            made.chip.ram_kib = 16;
            drifts_.push_back(drift(random_));
            made.chip.clock = {drifts_.back(), random_(), 10, 5};
            (void)segment_.add(std::move(made).assemble());
            if (n == 0) {
                (void)segment_.connect_master({0, 0});
            } else if (shape == Shape::line) {
                (void)segment_.connect({n - 1, 1}, {n, 0}, Duration(cable(random_)));
            } else {  // every slave has up to three others behind it
                static constexpr std::array<std::uint8_t, 3> kPorts{3, 1, 2};
                (void)segment_.connect({(n - 1) / 3, kPorts[(n - 1) % 3]}, {n, 0}, Duration(cable(random_)));
            }
        }
    }
    // Every clock becomes a little faster or slower.
    void wander() {
        std::uniform_int_distribution<std::int32_t> step(-20, 20);
        for (std::uint32_t n = 0; n < slaves_; ++n) {
            drifts_[n] = std::clamp(drifts_[n] + step(random_), -100'000, 100'000);
            segment_.slave(n).set_drift(drifts_[n], osal_.now());
        }
    }
    // The master numbers the slaves in the order in which a frame passes them. In a tree this order differs from the
    // order of build().
    sim::Esc& esc(std::uint16_t slave) { return segment_.slave(place_of_[slave - 1U]); }
    std::uint64_t copy(std::uint16_t slave, Time at) { return esc(slave).clock().copy(at); }

    std::uint64_t cycle(MasterClock& clock, Duration duration, Row& row) {
        std::uniform_int_distribution<std::int64_t> jitter(0, jitter_ns_);
        std::uniform_int_distribution<std::int64_t> mistake(-100, 100);
        const Time end = osal_.now() + duration;
        if (due_ == Time{}) due_ = osal_.now() + 1ms;
        std::uint64_t count = 0;
        for (; due_ < end; ++count) {
            const Duration late{jitter(random_)};
            osal_.wait(due_ + late, -1);
            (void)send_processdata(ctx_);
            (void)receive_processdata(ctx_, 500us);
            note(row);
            const Duration earlier = clock.update(ctx_, late + Duration{jitter_ns_ == 0 ? 0 : mistake(random_)});
            (void)poll(ctx_, osal_.now());
            if (count % 100 == 0) wander();
            due_ += 1ms - earlier;
        }
        return count;
    }
    // Returns the time of the reference clock.
    std::uint64_t note_clocks(Row& row) {
        constexpr std::int64_t kClose_ns = 100;
        const Time now = osal_.now();
        const std::uint64_t reference = copy(1, now);
        std::int64_t least = 0;
        std::int64_t most = 0;
        for (std::uint16_t n = 1; n <= slaves_; ++n) {
            const auto away = static_cast<std::int64_t>(copy(n, now) - reference);
            least = std::min(least, away);
            most = std::max(most, away);
            row.rms_ns += static_cast<double>(away) * static_cast<double>(away);
        }
        row.most_ns = std::max(row.most_ns, static_cast<double>(most - least));
        if (most - least > kClose_ns) last_far_ = now;
        return reference;
    }
    void note(Row& row) {
        const std::uint64_t reference = note_clocks(row);
        // The clock's rate differs from that of the simulation by 100 ppm at most: 50 ns in half a cycle.
        const std::uint64_t at_due = reference - static_cast<std::uint64_t>((osal_.now() - due_).count());
        const auto phase = static_cast<double>(phase_error_ns(at_due, 1'000'000, kSetValue.count()));
        row.phase_rms_ns += phase * phase;
        row.phase_most_ns = std::max(row.phase_most_ns, std::abs(phase));
    }
    // SYNC0 edges since the start time, too many or too few.
    std::uint64_t wrong_edges(std::uint16_t slave) {
        segment_.advance(osal_.now());
        const SlaveClock& clock = slave_clock(ctx_, slave);
        const std::uint64_t since = copy(slave, osal_.now()) - clock.sync_start_ns;
        const std::uint64_t wanted = since / 1'000'000 + 1;
        const std::uint64_t got = esc(slave).sync().pulses(0);
        return got > wanted ? got - wanted : wanted - got;
    }

    std::uint16_t slaves_;
    std::mt19937_64 random_;
    VirtualOsal osal_;
    sim::Segment segment_;
    SimulatedNic nic_;
    HostContext ctx_;
    std::vector<std::int32_t> drifts_;
    std::vector<std::uint32_t> place_of_;
    std::vector<std::byte> image_ = std::vector<std::byte>(4096);
    SlaveSetup setup_{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    double loss_ = 0;
    std::int64_t jitter_ns_;
    Time due_{};
    Time last_far_{};
};

void print_head() {
    std::printf("%6s %-5s %6s %5s %-6s %8s %9s %9s %12s %9s %9s %12s %12s %6s\n", "slaves", "shape", "jitter", "loss",
                "start", "in sync", "after ms", "first ns", "100 ns at ms", "max ns", "rms ns", "phase rms ns",
                "phase max ns", "edges");
}

// Prints one line of the table. Returns whether the line keeps the targets.
bool print_row(std::uint16_t slaves, Shape shape, std::int64_t jitter_ns, double loss, Way way, std::uint64_t seed,
               Duration duration) {
    Bench bench(slaves, shape, loss, seed, jitter_ns);
    const Row row = bench.run(way, duration);
    std::printf("%6d %-5s %3d us %4.0f%% %-6s %8s %9.0f %9.0f %12.0f %9.0f %9.1f %12.0f %12.0f %6llu\n", slaves,
                shape == Shape::line ? "line" : "tree", static_cast<int>(jitter_ns / 1000), loss * 100,
                way == Way::burst ? "burst" : "wait", row.ok ? "yes" : "NO", row.in_sync_ms, row.start_most_ns,
                row.close_ms, row.most_ns, row.rms_ns, row.phase_rms_ns, row.phase_most_ns,
                static_cast<unsigned long long>(row.edges_wrong));
    std::fflush(stdout);
    const double soon = slaves > 100 ? 2000 : 1000;
    return row.ok && row.edges_wrong == 0 && row.phase_rms_ns <= 1000 && row.close_ms <= soon && row.most_ns <= 100 &&
           row.rms_ns <= 20;
}

bool power_table(std::uint64_t seed, Duration duration) {
    bool kept = true;
    std::printf("%6s %-5s %5s %14s %6s\n", "slaves", "shape", "loss", "back after ms", "edges");
    for (const std::uint16_t slaves : std::array<std::uint16_t, 2>{10, 100})
        for (const Shape shape : {Shape::line, Shape::tree})
            for (const double loss : {0.0, 0.01}) {
                Bench bench(slaves, shape, loss, seed);
                if (!bench.run(Way::burst, duration).ok) return false;
                const auto back = bench.lose_power();
                std::printf("%6d %-5s %4.0f%% %14.0f %6llu\n", slaves, shape == Shape::line ? "line" : "tree",
                            loss * 100, back.back_ms, static_cast<unsigned long long>(back.edges_wrong));
                std::fflush(stdout);
                kept &= back.ok && back.back_ms <= 1000 && back.edges_wrong == 0;
            }
    std::printf("targets: back within 1 s, no wrong edge of the others: %s\n", kept ? "kept" : "NOT KEPT");
    return kept;
}

bool sweep(std::uint16_t slaves, std::uint64_t seed, Duration duration) {
    bool kept = true;
    for (const double loss : {0.0, 0.01})
        for (const std::int64_t jitter_ns : {0, 1'000, 5'000, 10'000, 20'000, 50'000}) {
            kept &= print_row(slaves, Shape::line, jitter_ns, loss, Way::burst, seed, duration);
            (void)print_row(slaves, Shape::line, jitter_ns, loss, Way::wait, seed, duration);
        }
    return kept;
}

bool table(std::uint64_t seed, Duration duration) {
    bool kept = true;
    for (const std::uint16_t slaves : std::array<std::uint16_t, 4>{1, 10, 100, 300}) {
        for (const Shape shape : {Shape::line, Shape::tree}) {
            for (const double loss : {0.0, 0.01}) {
                kept &= print_row(slaves, shape, 10'000, loss, Way::burst, seed, duration);
                (void)print_row(slaves, shape, 10'000, loss, Way::wait, seed, duration);
            }
        }
    }
    return kept;
}

}  // namespace

int main(int argc, char** argv) {
    const std::uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 0) : 1;
    const Duration duration = std::chrono::seconds(argc > 2 ? std::atoi(argv[2]) : 10);
    const bool sweeping = argc > 3 && std::string_view(argv[3]) == "sweep";
    const int slaves = argc > 4 ? std::atoi(argv[4]) : 100;
    if (argc > 3 && std::string_view(argv[3]) == "back") return power_table(seed, duration) ? 0 : 1;
    print_head();
    const bool kept = sweeping ? sweep(static_cast<std::uint16_t>(std::clamp(slaves, 1, 300)), seed, duration)
                               : table(seed, duration);
    std::printf(
        "targets: 100 ns within 1 s (300 slaves: 2 s), max 100 ns, rms 20 ns, phase 1000 ns rms, no wrong edge: %s\n",
        kept ? "kept" : "NOT KEPT");
    return kept ? 0 : 1;
}
