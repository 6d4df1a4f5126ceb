#include "sim/library/motor.hpp"

#include <algorithm>
#include <cmath>

namespace margay::sim {

namespace {
constexpr double kSpeedGain = 1000;    // 1/s: the speed loop settles within a few milliseconds
constexpr double kSpeedReset = 0.02;   // s, integral part
constexpr double kPositionGain = 150;  // 1/s
constexpr double kStandstill = Motor::kCountsPerTurn / 1e6;
}  // namespace

void Motor::integrate(double torque) {
    torque_ = torque;
    if (jammed_) {
        speed_ = 0;
        return;
    }
    const double net = torque - load_ - kFriction * speed_;
    const double before = speed_;
    speed_ += net / 1000 * kAccelerationAtRated * kStepSeconds;
    // Static friction of the bearings stops a motor without torque.
    if (torque == 0 && load_ == 0 && std::abs(speed_) < kStandstill) speed_ = 0;
    position_ += (before + speed_) / 2 * kStepSeconds;
}

void Motor::step_torque(double torque, const MotorLimits& limits) {
    double wanted = std::clamp(torque, -limits.torque, limits.torque);
    limited_ = wanted != torque;
    // At the speed limit, torque is only allowed to decelerate.
    if (limits.speed > 0 && std::abs(speed_) >= limits.speed && wanted * speed_ > 0) {
        wanted = std::clamp(load_ + kFriction * speed_, -limits.torque, limits.torque);
        limited_ = true;
    }
    integrate(wanted);
}

void Motor::step_speed(double target, double feed_forward_acceleration, const MotorLimits& limits) {
    const double held = limits.speed > 0 ? std::clamp(target, -limits.speed, limits.speed) : target;
    const double error = held - speed_;
    const double per_mille = 1000 / kAccelerationAtRated;
    const double wanted = (kSpeedGain * error + feed_forward_acceleration) * per_mille + integral_;
    const double torque = std::clamp(wanted, -limits.torque, limits.torque);
    limited_ = held != target || torque != wanted;
    // The integral part does not change at the torque limit, because it would take long to decrease again.
    if (torque == wanted) integral_ += kSpeedGain * error * per_mille * kStepSeconds / kSpeedReset;
    integrate(torque);
}

void Motor::step_position(double target, double target_speed, const MotorLimits& limits) {
    step_speed(target_speed + kPositionGain * (target - position_), 0, limits);
}

void Motor::step_unpowered() {
    limited_ = false;
    integrate(0);
    torque_ = 0;
}

}  // namespace margay::sim
