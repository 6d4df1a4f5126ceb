// A line of devices, and a context for it that several real threads use.
#pragma once

#include "segment/bench.hpp"

#include <atomic>
#include <memory>

namespace margay {

inline void plug_line(sim::Segment& segment, std::uint32_t devices) {
    for (std::uint32_t n = 0; n < devices; ++n) {
        (void)segment.add(sim::make_device("odd_device").value().assemble());
        ASSERT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
    }
}

// Two devices in real time, and an initialised context. A thread sets `stop` to end the polling of the owner.
template <class System>
class RealLine : public testing::Test {
  protected:
    System osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    std::unique_ptr<HostContext> own = std::make_unique<HostContext>(Limits{.slaves = 8});
    HostContext& ctx = *own;
    std::array<std::byte, 256> image{};
    std::atomic<bool> stop{false};

    void SetUp() override {
        plug_line(segment, 2);
        segment.power_up(osal.now());
        ASSERT_TRUE(init(ctx, wire, osal));
    }
    // Polls at the times that poll() returns, or after `longest`, until `stop` is set.
    void poll_until_stopped(Duration longest) {
        while (!stop.load()) osal.wait(std::min(poll(ctx, osal.now()), osal.now() + longest), wire.wait_handle());
    }
    void stop_owner() {
        stop.store(true);
        osal.wake();
    }
};

}  // namespace margay
