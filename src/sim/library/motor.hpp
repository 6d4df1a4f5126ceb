// A servo motor and its controllers: inertia, friction, load and limits, simulated in steps of fixed length.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay::sim {

// Positions in counts of the encoder, speeds in counts per second, torques in thousandths of the rated torque.
struct MotorLimits {
    double torque = 3000;
    double speed = 0;  // counts per second; 0: no limit
};

class Motor {
  public:
    static constexpr double kCountsPerTurn = 1 << 20;
    static constexpr Duration kStep = std::chrono::nanoseconds(62'500);
    static constexpr double kStepSeconds = 62.5e-6;
    // Acceleration at rated torque: 2.4 Nm with 0.0005 kg m² are 4800 rad/s².
    static constexpr double kAccelerationAtRated = 4800 / (2 * 3.14159265358979323846) * kCountsPerTurn;
    // Friction is proportional to speed: one tenth of the rated torque at 100 turns per second.
    static constexpr double kFriction = 100 / (100 * kCountsPerTurn);

    // Executes one step with the torque of the drive, minus load and friction.
    void step_torque(double torque, const MotorLimits& limits);
    // The cascade: a speed controller with integral part, and a position controller with speed feed-forward.
    void step_speed(double target, double feed_forward_acceleration, const MotorLimits& limits);
    void step_position(double target, double target_speed, const MotorLimits& limits);
    void step_unpowered();
    // Resets the controllers.
    void release() { integral_ = 0; }

    void place(double position) { position_ = position; }
    void set_load(double permille) { load_ = permille; }
    void set_jammed(bool jammed) { jammed_ = jammed; }

    [[nodiscard]] double position() const { return position_; }
    [[nodiscard]] double speed() const { return speed_; }
    [[nodiscard]] double torque() const { return torque_; }
    [[nodiscard]] bool limited() const { return limited_; }
    [[nodiscard]] bool at_rest() const { return speed_ == 0 && load_ == 0; }

  private:
    void integrate(double torque);

    double position_ = 0;
    double speed_ = 0;
    double torque_ = 0;  // torque of the motor
    double load_ = 0;    // acts against the positive direction
    double integral_ = 0;
    bool limited_ = false;
    bool jammed_ = false;
};

}  // namespace margay::sim
