// How long the AF_XDP NIC waits for its queue, in virtual time.
#include <margay/parts/oshw/xdp/once_free.hpp>

#include <gtest/gtest.h>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct Virtual {
    std::chrono::milliseconds* passed;
    [[nodiscard]] std::chrono::milliseconds now() const { return *passed; }
    void wait(std::chrono::milliseconds time) const { *passed += time; }
};

// Returns the milliseconds until the end, if an attempt takes `attempt` and the resource is free from `free` on.
std::chrono::milliseconds waited(std::chrono::milliseconds attempt, std::chrono::milliseconds free, int& error) {
    std::chrono::milliseconds passed{};
    error = once_free(Virtual{&passed}, [&] {
        passed += attempt;
        return passed < free ? -EBUSY : 0;
    });
    return passed;
}

TEST(OnceFree, WaitsASecondByTheClockHoweverLongAnAttemptTakes) {
    int error = 0;
    EXPECT_EQ(waited(0ms, 10h, error), 1000ms);
    EXPECT_EQ(error, -EBUSY);
    EXPECT_EQ(waited(95ms, 10h, error), 1095ms) << "95 ms, and ten times 5 + 95 ms";
    EXPECT_EQ(error, -EBUSY);
    EXPECT_EQ(waited(95ms, 500ms, error), 595ms);
    EXPECT_EQ(error, 0);
}

TEST(OnceFree, TriesOnceWhereTheErrorIsAnother) {
    std::chrono::milliseconds passed{};
    int attempts = 0;
    const auto refused = [&] { return ++attempts, -EPERM; };
    EXPECT_EQ(once_free(Virtual{&passed}, refused), -EPERM);
    EXPECT_EQ(attempts, 1);
    EXPECT_EQ(passed, 0ms);
}

}  // namespace
}  // namespace margay
