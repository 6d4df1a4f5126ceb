// Set point generators of a drive: profiles from point to point, interpolation between cyclic set points, and homing.
#pragma once

#include "sim/library/motor.hpp"

namespace margay::sim {

// Generates positions in counts with a trapezoidal speed profile.
class Profile {
  public:
    struct Shape {
        double speed = 0;
        double acceleration = 0;
        double deceleration = 0;
    };
    void begin(double position, double speed) {
        position_ = target_ = position;
        speed_ = speed;
    }
    void go_to(double target) { target_ = target; }
    // Decelerates, and stays at the position where the motor stops.
    void halt(const Shape& shape);
    void step(const Shape& shape);
    [[nodiscard]] double position() const { return position_; }
    [[nodiscard]] double speed() const { return speed_; }
    [[nodiscard]] double target() const { return target_; }
    [[nodiscard]] bool there() const { return position_ == target_ && speed_ == 0; }

  private:
    double position_ = 0;
    double speed_ = 0;
    double target_ = 0;
};

// Linear interpolation between cyclic set points.
class Interpolation {
  public:
    void begin(double position) { from_ = to_ = position; }
    void set(double target, Duration period) {
        from_ = position();
        to_ = target;
        steps_ = period / Motor::kStep > 0 ? static_cast<double>(period / Motor::kStep) : 1;
        done_ = 0;
    }
    void step() {
        if (done_ < steps_) done_ += 1;
    }
    [[nodiscard]] double position() const { return steps_ > 0 ? from_ + (to_ - from_) * done_ / steps_ : to_; }
    [[nodiscard]] double speed() const { return done_ < steps_ ? (to_ - from_) / (steps_ * Motor::kStepSeconds) : 0; }

  private:
    double from_ = 0;
    double to_ = 0;
    double steps_ = 0;
    double done_ = 0;
};

// Homing (CiA 402 "Homing mode"), methods 1 and 2 (limit switch, then index pulse), 17 and 18 (limit switch), 33 and 34
// (index pulse), 35 and 37 (current position).
class Homing {
  public:
    enum class State : std::uint8_t { idle, moving, attained, failed };
    struct Setting {
        int method = 0;
        double fast = 0;  // speed to the limit switch
        double slow = 0;  // speed to the edge or the index pulse
    };
    struct Inputs {
        double position = 0;  // position of the motor
        double previous = 0;  // position one step before
        bool negative_limit = false;
        bool positive_limit = false;
    };
    [[nodiscard]] static bool supported(int method);

    void begin(const Setting& setting);
    void stop();  // stops before the end: homing is not attained
    // Returns the next target speed.
    double step(const Inputs& inputs);
    [[nodiscard]] State state() const { return state_; }
    void reset() { state_ = State::idle; }
    // Motor position of the home position; valid when attained.
    [[nodiscard]] double home() const { return home_; }

  private:
    enum class Phase : std::uint8_t { to_switch, off_switch, to_index };
    void attain(double where);

    Setting setting_;
    State state_ = State::idle;
    Phase phase_ = Phase::to_switch;
    double home_ = 0;
};

}  // namespace margay::sim
