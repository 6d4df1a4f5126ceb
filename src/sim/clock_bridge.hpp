// Connects the two halves of a bridge device, which are slaves of two segments. Each half reads the clocks of both
// slaves at the same moment, and the outputs of the other half.
#pragma once

#include "sim/segment.hpp"

#include <cstdint>

namespace margay::sim {

// The clock of one slave, for the hardware of a bridge.
class ClockView {
  public:
    ClockView(Segment& segment, std::uint32_t slave) : segment_(segment), slave_(slave) {}
    [[nodiscard]] bool powered() const { return segment_.powered(slave_); }
    // The local copy of the system time.
    [[nodiscard]] std::uint64_t system_time_ns(Time at) const { return segment_.slave(slave_).clock().copy(at); }

  private:
    Segment& segment_;
    std::uint32_t slave_;
};

// One half of a bridge: implemented by its firmware.
class BridgeHalf {
  public:
    struct Links {
        const ClockView* own = nullptr;
        const ClockView* other_clock = nullptr;
        const BridgeHalf* other = nullptr;
    };
    // Nothing: the other half is not connected.
    virtual void connect(const Links& links) = 0;
    // The outputs that the master of this half has sent.
    [[nodiscard]] virtual std::uint32_t sent() const = 0;

  protected:
    ~BridgeHalf() = default;
};

// Both halves are connected while this object exists; it must not outlive the segments. `valid()` is false when one of
// the slaves is no half of a bridge.
class ClockBridge {
  public:
    ClockBridge(Segment& a, std::uint32_t slave_a, Segment& b, std::uint32_t slave_b)
        : clock_a_(a, slave_a), clock_b_(b, slave_b), a_(a.slave(slave_a).bridge()), b_(b.slave(slave_b).bridge()) {
        if (!valid()) return;
        a_->connect({&clock_a_, &clock_b_, b_});
        b_->connect({&clock_b_, &clock_a_, a_});
    }
    ClockBridge(const ClockBridge&) = delete;
    ClockBridge& operator=(const ClockBridge&) = delete;
    ~ClockBridge() {
        if (a_ != nullptr) a_->connect({});
        if (b_ != nullptr) b_->connect({});
    }
    [[nodiscard]] bool valid() const { return a_ != nullptr && b_ != nullptr; }

  private:
    ClockView clock_a_;
    ClockView clock_b_;
    BridgeHalf* a_;
    BridgeHalf* b_;
};

}  // namespace margay::sim
