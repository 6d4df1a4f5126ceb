// The start-up of the segment after activation, one request after the other, inside the cycle of the program: scan with
// the configured slaves, clocks, process data, and the supervision, which brings the slaves to OP and keeps them there.
#pragma once

#include <margay/clocks.hpp>
#include <margay/expected.hpp>
#include <margay/request.hpp>
#include <margay/supervision.hpp>

#include <ecrt.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <vector>

namespace margay::compat::ecrt {

class Bus;

class Operation {
  public:
    explicit Operation(Bus& bus) : bus_(bus) {}

    // Plans groups and slaves from the objects of the program. For the thread that activates.
    [[nodiscard]] int plan();

    // Called in each cycle after poll(), until running().
    void step(Time now);
    [[nodiscard]] bool running() const { return stage_ == Stage::running; }
    // Called from time to time while running.
    void check(Time now);
    // Slaves were added, removed or replaced.
    void note_change() {
        restarts_left_ = kMostRestarts;
        changed_ = true;
    }
    // The time at which check() must be called next; kNever: at any time.
    [[nodiscard]] Time look_at() const {
        return running() && (changed_ || watched_until_ != Time{} || starting()) ? Time{} : kNever;
    }
    // Whether slaves are still starting, in the first seconds after the frames were laid out.
    [[nodiscard]] bool starting() const { return starting_until_ != Time{}; }
    // The target of the slaves is PREOP from now on.
    void lower() { target_ = AlState::preop; }
    // The slaves have no numbers yet.
    [[nodiscard]] bool scanning() const { return stage_ <= Stage::scanning && !empty_; }
    [[nodiscard]] bool has_clock() const { return has_clock_; }
    // Ends all requests. For the owner.
    void cancel();

  private:
    static constexpr Duration kRetry = std::chrono::milliseconds(500);
    enum class Stage : std::uint8_t { scan, scanning, clock, clocking, map, mapping, supervise, running };

    void plan_groups();
    void plan_slave(ec_slave_config& config);
    // The list of expected slaves (expected.cpp).
    [[nodiscard]] int plan_expected();
    [[nodiscard]] int first_with(std::uint16_t alias) const;
    void add_expected(ec_slave_config& config);
    void add_by_alias(const ec_slave_config& config);
    [[nodiscard]] std::size_t line_end() const;
    void add_unconfigured();
    void find_expected();
    // Devices at other positions than planned (moves.cpp).
    [[nodiscard]] bool is_moved(const ec_slave_config& config) const;
    [[nodiscard]] bool may_attach(const ec_slave_config& config) const;
    [[nodiscard]] bool lacks_place(const ec_slave_config& config) const;
    [[nodiscard]] bool is_misplaced() const;
    void watch_places(Time now);
    void hold_moved();
    void start_again();
    void end_starting();
    void end_scan(Time now);
    [[nodiscard]] bool is_scanned_again(Time now);
    void forget_slaves();
    void begin_clock(Time now);
    void end_map(Time now);
    [[nodiscard]] bool wants_clock() const;
    [[nodiscard]] bool are_started() const;
    [[nodiscard]] bool ctx_has_no_slaves() const;

    Bus& bus_;
    std::atomic<Stage> stage_{Stage::scan};  // transfers of other threads wait for the scan
    std::atomic<bool> empty_{false};         // no slave has answered
    Time retry_{};
    bool first_clock_ = false;  // the clock of the chosen slave could not be the reference
    unsigned waited_ = 0;       // cycles without an application time
    bool has_clock_ = false;
    bool said_time_ = false;
    // The scan of a new start may find slaves with an alias whose place was not known before it.
    static constexpr unsigned kMostRestarts = 2;
    unsigned restarts_left_ = kMostRestarts;
    static constexpr unsigned kMostClockTries = 10;
    // Remaining attempts when frames are lost while the clocks are synchronised.
    unsigned clock_tries_ = kMostClockTries;
    bool again_ = false;    // the start-up is not the first one
    bool changed_ = false;  // slaves have come or gone since the last check()
    Time starting_until_{};
    Time watched_until_{};  // each cycle compares the positions until this time; Time{}: no comparison
    Time misplaced_since_{};
    Time look_at_{};  // time of the next decision whether the segment starts again
    AlState target_ = AlState::op;
    std::vector<ExpectedSlave> old_expected_;  // the slaves point to it until the scan of a new start has ended
    std::vector<ExpectedSlave> expected_;
    ScanRequest scan_;
    ClockRequest clock_;
    MapRequest map_;
    std::size_t map_next_ = 0;
    SuperviseRequest supervise_;
};

}  // namespace margay::compat::ecrt
