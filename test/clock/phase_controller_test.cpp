// The controller of the phase between the master's cycle and the reference clock.
#include <margay/phase_controller.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A cycle that drifts by itself, whose phase the controller corrects.
struct Plant {
    PhaseController controller;
    PhaseSettings settings;
    double phase_ns = 0;
    double drift_ns = 0;   // in a cycle
    double jitter_ns = 0;  // of the reading, evenly distributed
    std::mt19937 random{1};
    std::int64_t on_its_way = 0;
    Time now{};

    std::int64_t step(std::int64_t disturbance_ns = 0) {
        std::uniform_real_distribution<double> jitter(-jitter_ns, jitter_ns + 1e-9);
        const auto seen = std::llround(phase_ns + jitter(random)) + disturbance_ns;
        const auto correction = controller.update(seen, now);
        std::int64_t effective = correction;
        if (settings.cycles_late != 0) std::swap(effective, on_its_way);
        phase_ns += drift_ns - static_cast<double>(effective);
        now += settings.cycle;
        return correction;
    }
    void start() { controller.start(settings); }
    void run(int cycles) {
        for (int n = 0; n < cycles; ++n) (void)step();
    }
};

TEST(PhaseError, IsTheShortestWay) {
    EXPECT_EQ(phase_error_ns(10'000'250, 1'000'000, 0), 250);
    EXPECT_EQ(phase_error_ns(10'999'750, 1'000'000, 0), -250);
    EXPECT_EQ(phase_error_ns(10'999'750, 1'000'000, 300), -550);
    EXPECT_EQ(phase_error_ns(10'000'100, 1'000'000, 900'000), 100'100);
    EXPECT_EQ(phase_error_ns(10'500'000, 1'000'000, 0), 500'000);
    EXPECT_EQ(phase_error_ns(5, 0, 0), 0);
}

TEST(PhaseControl, LearnsPhaseAndDriftFromAFewCycles) {
    Plant plant;
    plant.phase_ns = 300'000;
    plant.drift_ns = 100;  // 100 ppm
    plant.start();
    EXPECT_EQ(plant.step(), 300'000) << "the whole phase at once";
    EXPECT_EQ(plant.step(), 200) << "what the drift has brought, and what it will bring";
    plant.run(5);
    EXPECT_LT(std::abs(plant.phase_ns), 2);
    EXPECT_NEAR(plant.controller.drift_ppb(), 100'000, 2'000);
    plant.run(1000);
    EXPECT_LT(std::abs(plant.phase_ns), 2);
}

// The manual's target: at 10 µs of jitter the phase stays within 1 µs (root of the mean of the squares).
TEST(PhaseControl, AveragesTheJitterOfTheReadings) {
    Plant plant;
    plant.drift_ns = -40;
    plant.jitter_ns = 10'000;
    plant.settings.outlier_ns = 30'000;
    plant.start();
    plant.run(2000);
    double squares = 0;
    for (int n = 0; n < 20'000; ++n) {
        (void)plant.step();
        squares += plant.phase_ns * plant.phase_ns;
    }
    EXPECT_LT(std::sqrt(squares / 20'000), 1000);
    EXPECT_NEAR(plant.controller.drift_ppb(), -40'000, 20'000);
}

TEST(PhaseControl, OfACorrectionThatComesOneCycleLate) {
    Plant plant;
    plant.settings.cycles_late = 1;
    plant.settings.most_step_ns = 600;
    plant.phase_ns = 5'000;
    plant.drift_ns = 80;
    plant.start();
    plant.run(2000);
    EXPECT_LT(std::abs(plant.phase_ns), 5);
    EXPECT_NEAR(plant.controller.drift_ppb(), 80'000, 2'000);
}

TEST(PhaseControl, OneWrongReadingCorrectsNothing) {
    Plant plant;
    plant.drift_ns = 20;
    plant.start();
    plant.run(1000);
    const double before = plant.phase_ns;
    EXPECT_NEAR(static_cast<double>(plant.step(50'000)), 20, 1) << "the drift only";
    EXPECT_NEAR(plant.phase_ns, before, 2);
    EXPECT_EQ(plant.controller.error_ns(), 50'000 + std::llround(before)) << "but it is told";
}

// A real step, for example a new reference: after eight readings the controller believes it.
TEST(PhaseControl, AStepIsBelievedAfterSomeCycles) {
    Plant plant;
    plant.start();
    plant.run(1000);
    plant.phase_ns += 200'000;
    plant.run(PhaseController::kMostOutliers - 1);
    EXPECT_GT(plant.phase_ns, 199'000);
    plant.run(3);
    EXPECT_LT(std::abs(plant.phase_ns), 10);
}

TEST(PhaseControl, CyclesWithoutAReadingKeepTheDrift) {
    Plant plant;
    plant.drift_ns = 50;
    plant.start();
    plant.run(1000);
    for (int n = 0; n < 100; ++n) plant.phase_ns += plant.drift_ns - static_cast<double>(plant.controller.coast());
    EXPECT_LT(std::abs(plant.phase_ns), 10) << "100 cycles of 50 ns without it: 5000";
}

TEST(PhaseControl, TellsWhenItIsInSync) {
    Plant plant;
    EXPECT_EQ(plant.controller.state(), PhaseState::idle);
    plant.settings.settle = 100ms;
    plant.phase_ns = 10'000;
    plant.start();
    plant.run(50);
    EXPECT_EQ(plant.controller.state(), PhaseState::busy);
    plant.run(60);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
    (void)plant.step(4001);
    EXPECT_EQ(plant.controller.state(), PhaseState::error_too_large);
    plant.run(102);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
    EXPECT_GE(plant.controller.most_ns(), 10'000U);
    plant.controller.reset_statistics();
    plant.run(10);
    EXPECT_LE(plant.controller.most_ns(), 2U);
    EXPECT_LE(plant.controller.average_ns(), 2U);
}

TEST(PhaseControl, TellsADriftThatNoChipCanFollow) {
    Plant plant;
    plant.drift_ns = 700;  // 700 ppm
    plant.start();
    plant.run(200);
    EXPECT_EQ(plant.controller.state(), PhaseState::drift_too_high);
    EXPECT_EQ(plant.controller.drift_ppb(), 600'000);
    plant.drift_ns = 500;
    plant.run(4000);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
}

}  // namespace
}  // namespace margay
