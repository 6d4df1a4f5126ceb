// The controller of the phase between the master's cycle and the reference clock.
#include <margay/master_clock.hpp>
#include <margay/phase_controller.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A cycle with a drift. The controller corrects its phase.
struct SteeredCycle {
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
    SteeredCycle plant;
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

// The target of the manual: with 10 µs of jitter the phase stays within 1 µs (root mean square).
TEST(PhaseControl, AveragesTheJitterOfTheReadings) {
    SteeredCycle plant;
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

double rms_of(SteeredCycle& plant, int cycles) {
    double squares = 0;
    for (int n = 0; n < cycles; ++n) {
        (void)plant.step();
        squares += plant.phase_ns * plant.phase_ns;
    }
    return std::sqrt(squares / cycles);
}

// The jitter moves the phase by about the amount that the settings want, whatever the jitter is, until the gain is at
// its bounds.
TEST(PhaseControl, TheGainFollowsTheMeasuredJitter) {
    std::uint16_t last = 1000;
    for (const double jitter : {300.0, 1'000.0, 3'000.0, 10'000.0}) {
        SteeredCycle plant;
        plant.drift_ns = 30;
        plant.jitter_ns = jitter;
        plant.settings.outlier_ns = 100'000;
        plant.settings.automatic_gain = true;
        plant.settings.noise_ns = 200;
        plant.start();
        plant.run(5000);
        const auto& controller = plant.controller;
        const double expected = jitter / std::sqrt(3);  // of an even distribution
        EXPECT_NEAR(controller.jitter_ns(), expected, expected / 5) << jitter;
        EXPECT_LT(controller.gain_ppt(), last) << jitter;
        last = controller.gain_ppt();
        const double rms = rms_of(plant, 20'000);
        EXPECT_LE(rms, 300) << jitter << " with a gain of " << last;
        EXPECT_GE(rms, last == 250 ? 30 : 100) << jitter << " with a gain of " << last;
    }
    EXPECT_LE(last, 3);
}

// A small jitter gives a high gain. This gain follows a drift that changes much faster than the gain of the settings
// could follow.
TEST(PhaseControl, LittleJitterFollowsAChangingDriftFaster) {
    std::array<double, 2> rms{};
    for (const bool automatic : {false, true}) {
        SteeredCycle plant;
        plant.jitter_ns = 20;
        plant.settings.automatic_gain = automatic;
        plant.start();
        plant.run(5000);
        double squares = 0;
        for (int n = 0; n < 20'000; ++n) {
            plant.drift_ns = 5 * std::sin(n / 300.0);
            (void)plant.step();
            squares += plant.phase_ns * plant.phase_ns;
        }
        rms[automatic ? 1 : 0] = std::sqrt(squares / 20'000);
    }
    EXPECT_LT(rms[1], 30);
    EXPECT_GT(rms[0], 10 * rms[1]);
}

// A gap in the readings and outliers do not count as jitter.
TEST(PhaseControl, GapsAndOutliersAreNoJitter) {
    SteeredCycle plant;
    plant.drift_ns = 100;
    plant.jitter_ns = 100;
    plant.settings.automatic_gain = true;
    plant.start();
    plant.run(3000);
    const auto before = plant.controller.jitter_ns();
    for (int n = 0; n < 300; ++n) {
        (void)plant.step(n % 3 == 0 ? 60'000 : 0);
        if (n % 5 == 0) (void)plant.controller.coast(plant.now);
        plant.phase_ns += n % 5 == 0 ? plant.drift_ns - 100 : 0;
    }
    EXPECT_NEAR(plant.controller.jitter_ns(), before, before / 4.0 + 5);
}

// The drift gain is critically damped at 1; with a gain of 1 ppt the drift is still learned.
TEST(PhaseControl, TheLowestGainLearnsTheDrift) {
    SteeredCycle plant;
    plant.settings.gain_ppt = 1;
    plant.settings.drift_gain = 1;
    plant.start();
    plant.run(3000);
    plant.drift_ns = 1;
    plant.run(60'000);
    EXPECT_LT(std::abs(plant.phase_ns), 3);
    EXPECT_NEAR(plant.controller.drift_ppb(), 1000, 20);
}

TEST(PhaseControl, OfACorrectionThatComesOneCycleLate) {
    SteeredCycle plant;
    plant.settings.cycles_late = 1;
    plant.settings.most_step_ns = 600;
    plant.phase_ns = 5'000;
    plant.drift_ns = 80;
    plant.start();
    plant.run(2000);
    EXPECT_LT(std::abs(plant.phase_ns), 5);
    EXPECT_NEAR(plant.controller.drift_ppb(), 80'000, 2'000);
}

// The controller has learned the drift of an earlier clock. This drift moves the phase back by more than the greatest
// step.
TEST(PhaseControl, ADriftOfAnotherClockIsForgotten) {
    for (const int sign : {-1, 1}) {
        SteeredCycle plant;
        plant.settings = for_bus_shift({.cycle = 5ms});
        plant.drift_ns = sign * 2970;  // 594 ppm
        plant.start();
        plant.run(2000);
        EXPECT_NEAR(plant.controller.drift_ppb(), sign * 594'000, 1'000);
        plant.drift_ns = sign * -100;  // 20 ppm
        plant.run(2000);
        EXPECT_EQ(plant.controller.state(), PhaseState::in_sync) << plant.phase_ns;
        EXPECT_NEAR(plant.controller.drift_ppb(), sign * -20'000, 1'000);
    }
}

TEST(PhaseControl, OneWrongReadingCorrectsNothing) {
    SteeredCycle plant;
    plant.drift_ns = 20;
    plant.start();
    plant.run(1000);
    const double before = plant.phase_ns;
    EXPECT_NEAR(static_cast<double>(plant.step(50'000)), 20, 1) << "the drift only";
    EXPECT_NEAR(plant.phase_ns, before, 2);
    EXPECT_EQ(plant.controller.error_ns(), 50'000 + std::llround(before)) << "but it is told";
}

// A real step, for example a new reference: after eight readings the controller accepts the step.
TEST(PhaseControl, AStepIsBelievedAfterSomeCycles) {
    SteeredCycle plant;
    plant.start();
    plant.run(1000);
    plant.phase_ns += 200'000;
    plant.run(PhaseController::kMostOutliers - 1);
    EXPECT_GT(plant.phase_ns, 199'000);
    plant.run(3);
    EXPECT_LT(std::abs(plant.phase_ns), 10);
}

// The default gate is below this jitter. The controller starts again repeatedly, and its state contains the reason.
TEST(PhaseControl, AJitterAboveTheGateIsSaid) {
    SteeredCycle plant;
    plant.jitter_ns = 40'000;
    plant.start();
    plant.run(2000);
    EXPECT_EQ(plant.controller.state(), PhaseState::error_too_large);
    EXPECT_NE(to_text(plant.controller.state()).find("jitter"), std::string_view::npos);
    plant.jitter_ns = 1000;
    plant.run(2000);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
}

TEST(PhaseControl, CyclesWithoutAReadingKeepTheDrift) {
    SteeredCycle plant;
    plant.drift_ns = 50;
    plant.start();
    plant.run(1000);
    for (int n = 0; n < 100; ++n) {
        plant.now += plant.settings.cycle;
        plant.phase_ns += plant.drift_ns - static_cast<double>(plant.controller.coast(plant.now));
    }
    EXPECT_LT(std::abs(plant.phase_ns), 10) << "100 cycles of 50 ns without it: 5000";
}

// Without readings, the phase moves by each change of the drift.
TEST(PhaseControl, IsNotInSyncAfterASecondWithoutAReading) {
    SteeredCycle plant;
    plant.start();
    plant.run(2000);
    const auto coast = [&plant](int cycles) {
        for (int n = 0; n < cycles; ++n, plant.now += plant.settings.cycle) (void)plant.controller.coast(plant.now);
    };
    coast(1000);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
    coast(1);
    EXPECT_EQ(plant.controller.state(), PhaseState::busy);
    (void)plant.step();
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync) << "the reading is within the limit";
    coast(1100);
    (void)plant.step(5000);
    EXPECT_EQ(plant.controller.state(), PhaseState::error_too_large);
    coast(5000);
    (void)plant.step();
    EXPECT_EQ(plant.controller.state(), PhaseState::error_too_large) << "a silence does not count as settled";
    // A cycle that is longer than a second has a reading in each cycle.
    plant.settings.cycle = 4s;
    plant.start();
    plant.run(10);
    EXPECT_EQ(plant.controller.state(), PhaseState::in_sync);
    coast(3);
    EXPECT_EQ(plant.controller.state(), PhaseState::busy);
}

TEST(PhaseControl, TellsWhenItIsInSync) {
    SteeredCycle plant;
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

// A cycle of a minute, and errors and settings of any size: each correction is limited, and nothing overflows.
TEST(PhaseControl, GreatErrorsAreLimited) {
    PhaseController controller;
    controller.start({.cycle = 60s, .outlier_ns = 0});
    EXPECT_EQ(controller.update(-29'000'000'000, Time{}), -4'000'000'000);
    EXPECT_EQ(controller.error_ns(), -29'000'000'000);
    controller.start({.cycle = 9'000'000'000s});
    EXPECT_EQ(controller.update(100, Time{}), 100);
    EXPECT_LE(std::abs(controller.update(200, Time{} + 1s)), 10'000);
    constexpr std::array<std::int64_t, 8> kExtreme{INT64_MIN, INT64_MIN + 1, -1,       0, 1,
                                                   62'500,    INT64_MAX / 2, INT64_MAX};
    for (const std::int64_t cycle : kExtreme)
        for (const std::uint32_t ppm : {0U, 600U, UINT32_MAX})
            for (const bool automatic : {false, true}) {
                PhaseSettings settings{.cycle = Duration(cycle), .automatic_gain = automatic, .most_drift_ppm = ppm};
                if (automatic) settings = for_bus_shift(settings);
                controller.start(settings);
                for (int n = 0; n < 64; ++n) {
                    const std::int64_t error = kExtreme[static_cast<std::size_t>(n * 5) % kExtreme.size()];
                    EXPECT_LE(std::abs(controller.update(error, Time{})), 9'000'000'000);
                    EXPECT_LE(std::abs(controller.coast(Time{})), 9'000'000'000);
                    controller.observe(error, Time{});
                    EXPECT_NE(controller.drift_ppb(), INT32_MIN);
                }
            }
}

// Bus shift: no step is greater than the other clocks can follow, so the phase never arrives.
TEST(PhaseControl, TellsADriftThatIsGreaterThanTheGreatestStep) {
    for (const double drift_ns : {650.0, -650.0, 1500.0, 500.0, -500.0}) {
        SCOPED_TRACE(drift_ns);
        SteeredCycle plant;
        plant.settings = for_bus_shift({});
        plant.drift_ns = drift_ns;
        plant.jitter_ns = 20'000;
        plant.phase_ns = 400'000;
        plant.start();
        int said = 0;
        for (int n = 0; n < 8000; ++n) {
            (void)plant.step();
            if (plant.phase_ns > 500'000) plant.phase_ns -= 1'000'000;
            if (plant.phase_ns < -500'000) plant.phase_ns += 1'000'000;
            said += plant.controller.state() == PhaseState::drift_too_high ? 1 : 0;
        }
        if (std::abs(drift_ns) > 600)
            EXPECT_GE(said, 5000);
        else
            EXPECT_EQ(said, 0);
    }
}

TEST(PhaseControl, TellsADriftThatNoChipCanFollow) {
    SteeredCycle plant;
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
