// The RUN and ERR indicators (ETG.1300).
#include "subdevice/indicators.hpp"

#include "bench_device.hpp"

namespace margay::subdevice::testing {
namespace {

// The lamp over time, in steps of 50 ms: '#' is lit.
std::string picture(Flashing flashing, Duration length) {
    std::string text;
    for (Duration t{}; t < length; t += 50ms) text += lamp(flashing, t).lit ? '#' : '.';
    return text;
}

// The figures of the table "Indicator states and flash rates".
TEST(Indicators, FlashAsTheTableSays) {
    EXPECT_EQ(picture(Flashing::off, 1s), "....................");
    EXPECT_EQ(picture(Flashing::on, 1s), "####################");
    EXPECT_EQ(picture(Flashing::flickering, 500ms), "#.#.#.#.#.");
    EXPECT_EQ(picture(Flashing::blinking, 1s), "####....####....####");
    EXPECT_EQ(picture(Flashing::single, 1400ms), "####....................####");
    EXPECT_EQ(picture(Flashing::twice, 1800ms), "####....####....................####");
    EXPECT_EQ(picture(static_cast<Flashing>(3), 2s), "####....####....####....................");
}

// The lamp changes after `lasts`, and not earlier.
TEST(Indicators, EachCallSaysWhenTheNextIsDue) {
    for (unsigned code = 1; code <= 14; ++code) {
        const auto flashing = static_cast<Flashing>(code);
        Duration at{};
        for (int n = 0; n < 100; ++n) {
            const Lamp now = lamp(flashing, at);
            ASSERT_GT(now.lasts, Duration{0});
            EXPECT_EQ(lamp(flashing, at + now.lasts - 1ns).lit, now.lit) << code << " at " << at.count();
            EXPECT_NE(lamp(flashing, at + now.lasts).lit, now.lit) << code << " at " << at.count();
            at += now.lasts;
        }
    }
    EXPECT_EQ(lamp(Flashing::on, 1h).lasts, Duration::max());
}

// The pattern is the same as in the first period, also after years.
TEST(Indicators, FlashOnTheSameWayForEver) {
    for (unsigned code = 1; code <= 14; ++code) {
        const auto flashing = static_cast<Flashing>(code);
        const auto flashes = code <= 12 ? (2 * code - 1) * 200ms + 1000ms : Duration{code == 13 ? 400ms : 100ms};
        for (const std::int64_t periods : {std::int64_t{1}, std::int64_t{7}, std::int64_t{1} << 30})
            for (Duration at{}; at < flashes; at += 25ms) {
                const auto later = lamp(flashing, at + periods * flashes);
                EXPECT_EQ(later.lit, lamp(flashing, at).lit) << code << " at " << at.count();
                EXPECT_EQ(later.lasts, lamp(flashing, at).lasts) << code << " at " << at.count();
            }
    }
}

class IndicatorsOfADevice : public ::testing::Test {
  protected:
    Bench bench;
    Indicators indicators{bench.esc};
    Time at{};

    // Both lamps over time, in steps of 50 ms; the calls follow the returned times.
    std::pair<std::string, std::string> look(Duration length) {
        std::pair<std::string, std::string> both;
        const Time end = at + length;
        Time next = at;
        while (at < end) {
            if (at >= next) next = indicators.step(at, bench.device->al_status());
            both.first += indicators.run_lit() ? '#' : '.';
            both.second += indicators.error_lit() ? '#' : '.';
            at += 50ms;
        }
        return both;
    }
};

struct CountedPins final : IndicatorPins {
    void show(bool run_lit, bool error_lit) override {
        ++calls;
        run = run_lit;
        error = error_lit;
    }
    unsigned calls = 0;
    bool run = false;
    bool error = false;
};

// After each step the pins have the values of the functions, and the pins are written only when they change.
TEST_F(IndicatorsOfADevice, SwitchThePinsWhenALampChanges) {
    CountedPins pins;
    Indicators with_pins(bench.esc, &pins);
    (void)with_pins.step(at, {.state = AlState::init});
    EXPECT_EQ(pins.calls, 1u);  // both lamps are off: the pins of a board may be in another state after a reset
    unsigned changes = 1;
    bool run = false;
    bool error = false;
    for (unsigned n = 0; n < 60; ++n, at += 50ms) {
        const bool refused = n >= 30;
        (void)with_pins.step(at,
                             {.state = AlState::preop, .error = refused, .code = std::uint16_t(refused ? 0x1D : 0)});
        changes += run != with_pins.run_lit() || error != with_pins.error_lit() ? 1 : 0;
        run = with_pins.run_lit();
        error = with_pins.error_lit();
        ASSERT_EQ(pins.run, run) << n;
        ASSERT_EQ(pins.error, error) << n;
        ASSERT_EQ(pins.calls, changes) << n;
    }
    EXPECT_GE(changes, 15u);  // both lamps blink with 2.5 Hz, RUN for 3 s
}

TEST_F(IndicatorsOfADevice, ShowTheState) {
    EXPECT_EQ(look(800ms), std::pair(std::string("####....####...."), std::string("................")));
    bench.request(4);
    EXPECT_EQ(look(1200ms).first, "####....................");
    bench.request(1);
    EXPECT_EQ(look(200ms).first, "....");
}

TEST_F(IndicatorsOfADevice, ShowTheError) {
    (void)look(50ms);
    bench.request(8);  // from PREOP: refused
    ASSERT_TRUE(bench.device->al_status().error);
    EXPECT_EQ(look(800ms), std::pair(std::string("###....####....#"), std::string("####....####....")))
        << "the RUN indicator begins anew only when the state changes";
}

TEST_F(IndicatorsOfADevice, AnErrorOfTheDeviceItselfIsASingleFlash) {
    bench.request(4);
    (void)look(50ms);
    bench.device->fall_back(AlState::preop, AlStatusCode::unspecified, bench.esc.time);
    EXPECT_EQ(look(1400ms).second, "####....................####");
    bench.request(0x12);  // acknowledged
    EXPECT_EQ(look(400ms).second, "........");
}

TEST(IndicatorCodes, OfErrors) {
    const AlStatus op{AlState::op, false, 0};
    EXPECT_EQ(error_flashing(op, {AlState::safeop, true, 0x001B}), Flashing::twice);
    EXPECT_EQ(error_flashing(op, {AlState::safeop, true, 0x001A}), Flashing::single);
    EXPECT_EQ(error_flashing({AlState::preop, false, 0}, {AlState::preop, true, 0x001E}), Flashing::blinking);
    EXPECT_EQ(error_flashing({}, {AlState::init, true, 0x0014}), Flashing::flickering);
    EXPECT_EQ(error_flashing(op, op), Flashing::off);
}

// The master sets a lamp by the override registers, until the state changes.
TEST_F(IndicatorsOfADevice, TheMasterOverrides) {
    (void)look(400ms);
    bench.esc.ecat_set<std::uint8_t>(0x0138, 0x1F);
    bench.esc.ecat_set<std::uint8_t>(0x0139, 0x1D);
    EXPECT_EQ(look(400ms), std::pair(std::string("########"), std::string("####....")));
    bench.request(4);
    EXPECT_EQ(look(400ms).first, "####....");
    EXPECT_EQ(bench.esc.get<std::uint8_t>(0x0138), 0);
    EXPECT_EQ(bench.esc.get<std::uint8_t>(0x0139), 0x1D) << "no new error";
    bench.esc.ecat_set<std::uint8_t>(0x0139, 0);
    EXPECT_EQ(look(100ms).second, "..");
}

TEST_F(IndicatorsOfADevice, AFailedControllerIsAlwaysLit) {
    (void)look(50ms);
    indicators.controller_failed();
    (void)look(50ms);
    EXPECT_EQ(look(400ms).second, "########");
    bench.request(4);
    EXPECT_EQ(look(200ms).second, "....");
}

}  // namespace
}  // namespace margay::subdevice::testing
