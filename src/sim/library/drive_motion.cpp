#include "sim/library/drive_motion.hpp"

#include <algorithm>
#include <cmath>

namespace margay::sim {

namespace {

double sign(double value) { return value < 0 ? -1 : 1; }

// Finds the index pulse between two positions, if there is one.
bool index_between(double from, double to, double& where) {
    const double turn = Motor::kCountsPerTurn;
    const double low = std::min(from, to);
    const double high = std::max(from, to);
    where = std::floor(high / turn) * turn;
    return where > low;
}

}  // namespace

void Profile::halt(const Shape& shape) {
    if (shape.deceleration <= 0) {
        speed_ = 0;
        target_ = position_;
        return;
    }
    target_ = position_ + sign(speed_) * speed_ * speed_ / (2 * shape.deceleration);
}

void Profile::step(const Shape& shape) {
    const double dt = Motor::kStepSeconds;
    const double left = target_ - position_;
    // The next step would pass the target: the profile ends here.
    if (std::abs(left) <= std::abs(speed_) * dt + shape.deceleration * dt * dt &&
        std::abs(speed_) <= 2 * shape.deceleration * dt) {
        position_ = target_;
        speed_ = 0;
        return;
    }
    // The highest speed that still permits to stop at the target.
    const double stop = std::sqrt(2 * shape.deceleration * std::max(0.0, std::abs(left) - std::abs(speed_) * dt));
    const double wanted = sign(left) * std::min(shape.speed, stop);
    const bool faster = std::abs(wanted) > std::abs(speed_) && wanted * speed_ >= 0;
    const double change = (faster ? shape.acceleration : shape.deceleration) * dt;
    speed_ += std::clamp(wanted - speed_, -change, change);
    position_ += speed_ * dt;
}

bool Homing::supported(int method) {
    for (const int known : {1, 2, 17, 18, 33, 34, 35, 37})
        if (method == known) return true;
    return false;
}

void Homing::begin(const Setting& setting) {
    setting_ = setting;
    const bool by_switch = setting.method == 1 || setting.method == 2 || setting.method == 17 || setting.method == 18;
    phase_ = by_switch ? Phase::to_switch : Phase::to_index;
    state_ = supported(setting.method) && setting.fast > 0 && setting.slow > 0 ? State::moving : State::failed;
}

void Homing::stop() {
    if (state_ == State::moving) state_ = State::idle;
}

void Homing::attain(double where) {
    home_ = where;
    state_ = State::attained;
}

double Homing::step(const Inputs& in) {
    if (state_ != State::moving) return 0;
    if (setting_.method == 35 || setting_.method == 37) {
        attain(in.position);
        return 0;
    }
    const bool negative = setting_.method == 1 || setting_.method == 17 || setting_.method == 33;
    const double towards = negative ? -1 : 1;
    const bool at_switch = negative ? in.negative_limit : in.positive_limit;
    const bool by_switch = setting_.method != 33 && setting_.method != 34;
    double where = 0;
    switch (phase_) {
        case Phase::to_switch:
            if (!at_switch) return towards * setting_.fast;
            phase_ = Phase::off_switch;
            [[fallthrough]];
        case Phase::off_switch:
            if (at_switch) return -towards * setting_.slow;
            if (setting_.method == 17 || setting_.method == 18) {
                attain(in.position);
                return 0;
            }
            phase_ = Phase::to_index;
            [[fallthrough]];
        case Phase::to_index:
            // A limit switch is active during a search for the index pulse only: homing fails.
            if (!by_switch && (in.negative_limit || in.positive_limit)) {
                state_ = State::failed;
                return 0;
            }
            if (index_between(in.previous, in.position, where)) {
                attain(where);
                return 0;
            }
            return (by_switch ? -towards : towards) * setting_.slow;
    }
    return 0;
}

}  // namespace margay::sim
