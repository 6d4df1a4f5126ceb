// A line of library devices with a master in virtual time. All calls are requests with a time limit, so that no test
// waits for ever.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "storm/chaos_nic.hpp"
#include "storm/roomy_context.hpp"

#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

namespace margay::storm {

struct Rig {
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    ChaosNic nic{wire, osal, 1};
    std::optional<RoomyContext> ctx;
    std::vector<std::byte> image = std::vector<std::byte>(1024);
    bool cycling = false;
    Time next_cycle{};

    void plug_line(std::initializer_list<std::string_view> names) {
        for (const auto name : names) {
            const auto n = segment.add(std::move(*sim::make_device(name)).assemble());
            EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
    }
    void start(const Limits& limits = {.slaves = 16}) {
        segment.power_up(osal.now());
        ctx.emplace(limits);
        ASSERT_TRUE(init(*ctx, nic, osal));
    }
    // Calls poll() at the times that poll() returns, with a cycle each millisecond while `cycling`, until `holds` is
    // true. Returns false when the time is over, or when poll() loops without letting time pass.
    template <class Holds>
    bool until(Holds holds, Duration most) {
        using namespace std::chrono_literals;
        const Time end = osal.now() + most;
        unsigned at_once = 0;
        while (!holds()) {
            if (cycling && osal.now() >= next_cycle) {
                next_cycle = osal.now() + 1ms;
                if (ctx->group(0).mapped && send_processdata(*ctx)) (void)receive_processdata(*ctx, 300us);
            }
            const Time before = osal.now();
            Time next = std::min(poll(*ctx, before), end);
            if (cycling) next = std::min(next, next_cycle);
            if (holds()) return true;
            if (next > before) osal.advance(next - before);
            at_once = osal.now() == before ? at_once + 1 : 0;
            if (at_once > 2000 || osal.now() >= end) return holds();
        }
        return true;
    }
    void run_for(Duration time) {
        (void)until([] { return false; }, time);
    }
    bool ends(Request& request, Duration most) {
        return until([&] { return !request.busy(); }, most);
    }
    // Submits a request and waits until it ends. Returns its error; Errc::busy when it did not end.
    template <class R>
    Error run(R& request, Duration most) {
        const auto taken = submit(*ctx, request);
        if (!taken) return taken.error();
        if (!ends(request, most)) return {.code = Errc::busy};
        return request.error();
    }
    Error scan(Duration most = std::chrono::seconds(120)) {
        ScanRequest request;
        return run(request, most);
    }
    Error map(Duration most = std::chrono::seconds(120)) {
        MapRequest request;
        request.image = image;
        return run(request, most);
    }
    bool all_in(AlState state) {
        return std::ranges::all_of(ctx->slaves(), [state](const Slave& s) {
            return s.al == AlStatus{state, false, 0};
        });
    }
};

inline std::string words(const Error& error) {
    std::array<char, 300> text{};
    return std::string(describe(error, text));
}

}  // namespace margay::storm
