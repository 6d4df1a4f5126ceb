// The start-up of the segment after activation, one request after the other, inside the cycle of the program: scan with
// the configured slaves, clocks, process data, and the supervision, which brings the slaves to OP and keeps them there.
#pragma once

#include <margay/clocks.hpp>
#include <margay/expected.hpp>
#include <margay/request.hpp>
#include <margay/supervision.hpp>

#include <ecrt.h>

#include <atomic>
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
    // Called now and then while running.
    void check(Time now);
    // The slaves have no numbers yet.
    [[nodiscard]] bool scanning() const { return stage_ <= Stage::scanning && !empty_; }
    [[nodiscard]] bool has_clock() const { return has_clock_; }
    // Ends all requests. For the owner.
    void cancel();

  private:
    enum class Stage : std::uint8_t { scan, scanning, clock, clocking, map, mapping, supervise, running };

    void plan_groups();
    void plan_slave(ec_slave_config& config);
    void add_expected(ec_slave_config& config);
    void add_by_alias(ec_slave_config& config);
    void end_scan(Time now);
    void begin_clock(Time now);
    void end_map(Time now);
    [[nodiscard]] bool wants_clock() const;
    [[nodiscard]] bool ctx_has_no_slaves() const;

    Bus& bus_;
    std::atomic<Stage> stage_{Stage::scan};  // transfers of other threads wait for the scan
    std::atomic<bool> empty_{false};         // no slave has answered
    Time retry_{};
    unsigned waited_ = 0;  // cycles without an application time
    bool has_clock_ = false;
    bool said_time_ = false;
    std::vector<ExpectedSlave> expected_;
    ScanRequest scan_;
    ClockRequest clock_;
    MapRequest map_;
    std::size_t map_next_ = 0;
    SuperviseRequest supervise_;
};

}  // namespace margay::compat::ecrt
