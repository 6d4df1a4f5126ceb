// Clients of an application, each in its own thread, beside the cycle in the thread of the test, in virtual time.
#pragma once

#include "segment/bench.hpp"

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <vector>

namespace margay {

class ClientsTest : public SegmentTest {
  protected:
    int cycles = 0;  // of the last run()

    // Executes the cycle in this thread until all `clients` have ended. Returns the number of cycles with an error.
    int run(const std::vector<std::function<void()>>& clients) {
        std::atomic<std::size_t> left = clients.size();
        std::vector<std::thread> threads;
        for (const auto& client : clients)
            threads.emplace_back([&left, &client] {
                client();
                --left;
            });
        int wrong = 0;
        cycles = 0;
        while (left != 0 || cycles < 100) {
            wrong += cycle() ? 0 : 1;
            ++cycles;
        }
        for (auto& thread : threads) thread.join();
        return wrong;
    }
    // Executes one cycle of 1 ms. Returns whether it was without an error.
    virtual bool cycle() {
        using namespace std::chrono_literals;
        const bool right = send_processdata(ctx) && receive_processdata(ctx, 500us);
        const Time end = osal.now() + 1ms;
        while (osal.now() < end) osal.wait(std::min(poll(ctx, osal.now()), end), wire.wait_handle());
        return right;
    }
};

}  // namespace margay
