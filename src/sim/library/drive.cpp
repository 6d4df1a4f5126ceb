#include "sim/library/drive.hpp"

#include "sim/library/drive_objects.hpp"

#include <algorithm>
#include <cmath>

namespace margay::sim {

namespace {

using drive::Values;
namespace cw = control_word;
namespace sw = status_word;

constexpr double kTravel = 20.25 * Motor::kCountsPerTurn;  // distance from the middle position to each limit switch
constexpr double kStartAt = 3.3 * Motor::kCountsPerTurn;
constexpr double kOverspeed = 125 * Motor::kCountsPerTurn;
constexpr double kStopped = Motor::kCountsPerTurn / 100;
constexpr double kOverloadSeconds = 2;  // at twice the rated heat; 0.25 s at three times the rated torque

// Error codes of IEC 61800-7-201.
constexpr std::uint16_t kOverload = 0x2350;
constexpr std::uint16_t kOvervoltage = 0x3210;
constexpr std::uint16_t kUndervoltage = 0x3220;
constexpr std::uint16_t kCommunication = 0x7500;
constexpr std::uint16_t kSpeedError = 0x8400;
constexpr std::uint16_t kFollowing = 0x8611;

// The bits of the error register (0x1001) for an error code.
std::uint8_t register_bits(std::uint16_t code) {
    switch (code >> 12) {
        case 0x2: return 0x03;
        case 0x3: return 0x05;
        case 0x4: return 0x09;
        case 0x7: return 0x11;
        default: return 0x21;
    }
}
// After overcurrent and feedback errors the motor cannot be controlled any more.
bool controllable(std::uint16_t code) { return (code & 0xFF00) != 0x2300 && (code & 0xFF00) != 0x7300; }

std::int32_t rounded(double value) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(std::llround(value)));
}

}  // namespace

const subdevice::DeviceDescription& Drive::description() const { return drive::kDevice; }

void Drive::start(const Surroundings& around, Time now) {
    image_ = around.dictionary->image();
    motor_ = Motor();
    motor_.place(kStartAt);
    previous_ = kStartAt;
    zero_ = 0;
    states_.start();
    states_.command(0, true);
    mode_ = Mode::none;
    homing_.reset();
    time_ = now;
    overload_s_ = 0;
    last_control_ = 0;
    behind_ = {};
    following_error_ = acknowledged_ = buffered_ = error_requested_ = limited_ = false;
    show();
}

MotorLimits Drive::limits() const {
    return {static_cast<double>(Values::max_torque::load(image_)),
            static_cast<double>(Values::max_speed::load(image_))};
}

Profile::Shape Drive::shape() const {
    const auto most = Values::max_speed::load(image_);
    const auto wanted = Values::profile_speed::load(image_);
    return {static_cast<double>(most != 0 ? std::min(wanted, most) : wanted),
            static_cast<double>(Values::acceleration::load(image_)),
            static_cast<double>(Values::deceleration::load(image_))};
}

Duration Drive::interpolation_period() const {
    auto period = Duration{Values::interpolation_value::load(image_)} * 1'000'000'000;
    for (int n = Values::interpolation_index::load(image_); n < 0; ++n) period /= 10;
    return period;
}

double Drive::within_limits(double user) {
    const auto low = Values::limit_low::load(image_);
    const auto high = Values::limit_high::load(image_);
    if (low >= high) return user;  // limits are switched off
    const auto held = std::clamp(user, static_cast<double>(low), static_cast<double>(high));
    if (held != user) limited_ = true;
    return held;
}

// ------------------------------------------------------------------ motor simulation

Time Drive::advance(Time now) {
    apply_environment();
    // A motor without power that does not move needs no simulation steps for the past.
    if (!states_.powered() && motor_.at_rest()) {
        time_ = now;
        overload_s_ = 0;
    }
    for (; time_ + Motor::kStep <= now; time_ += Motor::kStep) {
        const double before = motor_.position();
        one_step();
        previous_ = before;
        watch(time_);
    }
    show();
    return kNever;
}

void Drive::apply_environment() {
    const auto outside = load_le<std::int16_t>(measured_);
    motor_.set_load(static_cast<double>(Values::load::load(image_)) + outside);
    motor_.set_jammed(Values::jammed::load(image_) != 0);
    Values::voltage::store(image_, Values::supply::load(image_));
}

void Drive::one_step() {
    if (states_.state() == DriveState::operation_enabled) return operate();
    if (states_.powered()) return ramp_down();
    motor_.step_unpowered();
}

void Drive::operate() {
    limited_ = false;
    switch (mode_) {
        case Mode::csp:
            interpolation_.step();
            motor_.step_position(interpolation_.position(), interpolation_.speed(), limits());
            break;
        case Mode::csv: motor_.step_speed(Values::target_speed::load(image_), 0, limits()); break;
        case Mode::cst: motor_.step_torque(Values::target_torque::load(image_), limits()); break;
        case Mode::hm:
            if (homing_.state() == Homing::State::moving) {
                const double wanted = homing_.step(
                    {motor_.position(), previous_, motor_.position() <= -kTravel, motor_.position() >= kTravel});
                const double change = Values::homing_acceleration::load(image_) * Motor::kStepSeconds;
                ramp_to(wanted, change);
                if (homing_.state() == Homing::State::attained)
                    zero_ = homing_.home() - Values::home_offset::load(image_);
                if (homing_.state() != Homing::State::moving) {
                    profile_.begin(motor_.position(), motor_.speed());
                    profile_.halt(shape());
                }
                break;
            }
            [[fallthrough]];
        case Mode::pp:
        case Mode::none:
            if (profile_.there() && buffered_) {
                buffered_ = false;
                profile_.go_to(next_target_);
            }
            profile_.step(shape());
            motor_.step_position(profile_.position(), profile_.speed(), limits());
            break;
    }
    limited_ = limited_ || motor_.limited();
}

void Drive::ramp_to(double speed, double change) {
    const double step = std::clamp(speed - ramp_, -change, change);
    ramp_ += step;
    motor_.step_speed(ramp_, step / Motor::kStepSeconds, limits());
}

// The quick stop, and the fault reaction.
void Drive::ramp_down() {
    const bool fault = states_.state() == DriveState::fault_reaction_active;
    const int option = fault ? Values::fault_option::load(image_) : Values::quick_stop_option::load(image_);
    if (option == 0) {
        motor_.step_unpowered();
        return states_.stopped(false);
    }
    const bool slow = option == 1 || option == 5;
    const double change = (slow ? Values::deceleration::load(image_) : Values::quick_stop_deceleration::load(image_)) *
                          Motor::kStepSeconds;
    ramp_to(0, change);
    if (ramp_ == 0 && std::abs(motor_.speed()) < kStopped) states_.stopped(!fault && option >= 5);
}

void Drive::watch(Time now) {
    const double heat = motor_.torque() / 1000;
    overload_s_ = std::max(0.0, overload_s_ + (heat * heat - 1) * Motor::kStepSeconds);
    if (overload_s_ > kOverloadSeconds) fault(kOverload, false, now);
    if (std::abs(motor_.speed()) > kOverspeed) fault(kSpeedError, true, now);

    const bool positioned = mode_ == Mode::csp || mode_ == Mode::pp;
    const auto window = Values::following_window::load(image_);
    const double demand = mode_ == Mode::csp ? interpolation_.position() : profile_.position();
    const bool behind = states_.state() == DriveState::operation_enabled && positioned && window != UINT32_MAX &&
                        std::abs(demand - motor_.position()) > window;
    behind_ = behind ? behind_ + Motor::kStep : Duration{};
    if (behind_ > std::chrono::milliseconds(Values::following_timeout::load(image_))) {
        following_error_ = true;
        fault(kFollowing, true, now);
    }
}

void Drive::fault(std::uint16_t code, bool controlled, Time now) {
    const auto before = states_.state();
    if (before == DriveState::fault || before == DriveState::fault_reaction_active) return;
    states_.fail(controlled);
    ramp_ = motor_.speed();
    Values::error_code::store(image_, code);
    Values::error_register::store(image_, register_bits(code));
    report(code, register_bits(code), now);
}

// ------------------------------------------------------------------ commands of the master

void Drive::cycle(Time now, bool) {
    advance(now);
    execute_control_word(now);
    show();
}

// The device leaves OP or the master is lost: a motor with power must not continue to move.
void Drive::safe_outputs(Time now) {
    if (states_.powered()) fault(kCommunication, true, now);
    last_control_ = 0;
}

void Drive::execute_control_word(Time now) {
    const auto code =
        static_cast<std::uint16_t>(Values::raise_error::load(image_) | load_le<std::uint16_t>(measured_, 2));
    if (code != 0 && !error_requested_) fault(code, controllable(code), now);
    error_requested_ = code != 0;
    const auto supply = Values::supply::load(image_);
    if (states_.powered() && supply < 200'000) fault(kUndervoltage, true, now);
    if (states_.powered() && supply > 400'000) fault(kOvervoltage, false, now);

    const unsigned control = Values::control::load(image_);
    const unsigned edges = control & ~last_control_;
    last_control_ = control;
    const auto before = states_.state();
    states_.command(static_cast<std::uint16_t>(control), std::abs(motor_.speed()) < kStopped);
    const auto after = states_.state();
    if (before == DriveState::fault && after != before) {
        following_error_ = false;
        Values::error_code::store(image_, 0);
        Values::error_register::store(image_, 0);
        report(0, 0, now);
    }
    if (after == DriveState::quick_stop_active && before != after) ramp_ = motor_.speed();
    apply_mode();
    if (after != DriveState::operation_enabled) return;
    if (before != after) enter_operation();
    accept_set_point(control, edges);
}

void Drive::apply_mode() {
    const auto wanted = static_cast<Mode>(Values::mode::load(image_));
    switch (wanted) {
        case Mode::pp:
        case Mode::hm:
        case Mode::csp:
        case Mode::csv:
        case Mode::cst: break;
        default: return;  // no mode, or an unsupported mode: the mode does not change
    }
    if (wanted == mode_) return;
    mode_ = wanted;
    if (states_.state() == DriveState::operation_enabled) enter_operation();
}

// After standstill or a change of the mode: starts from the present position of the motor.
void Drive::enter_operation() {
    motor_.release();
    profile_.begin(motor_.position(), motor_.speed());
    profile_.halt(shape());
    interpolation_.begin(motor_.position());
    homing_.reset();
    ramp_ = motor_.speed();
    acknowledged_ = buffered_ = false;
    behind_ = {};
}

void Drive::accept_set_point(unsigned control, unsigned edges) {
    switch (mode_) {
        case Mode::csp:
            interpolation_.set(zero_ + within_limits(Values::target_position::load(image_)), interpolation_period());
            break;
        case Mode::pp: profile_command(control, edges); break;
        case Mode::hm: homing_command(control, edges); break;
        default: break;
    }
}

// CiA 402 "Set point handshake": the rising edge of bit 4 gives a set point, and status bit 12 acknowledges it until
// bit 4 is cleared. While the drive moves to one target, a second target may wait.
void Drive::profile_command(unsigned control, unsigned edges) {
    if ((control & cw::kHalt) != 0) {
        if ((edges & cw::kHalt) != 0) profile_.halt(shape());
        return;
    }
    if ((control & cw::kNewSetPoint) == 0) {
        acknowledged_ = buffered_;
        return;
    }
    if ((edges & cw::kNewSetPoint) == 0 || buffered_) return;
    const double wanted = Values::target_position::load(image_);
    const bool at_once = (control & cw::kChangeAtOnce) != 0 || profile_.there();
    const double base = (control & cw::kRelative) != 0 ? profile_.target() - zero_ : 0;
    const double target = zero_ + within_limits(base + wanted);
    acknowledged_ = true;
    if (at_once) {
        profile_.go_to(target);
    } else {
        buffered_ = true;
        next_target_ = target;
    }
}

void Drive::homing_command(unsigned control, unsigned edges) {
    if ((edges & cw::kNewSetPoint) != 0 && (control & cw::kHalt) == 0) {
        ramp_ = motor_.speed();
        homing_.begin({Values::homing_method::load(image_), static_cast<double>(Values::homing_fast::load(image_)),
                       static_cast<double>(Values::homing_slow::load(image_))});
    }
    const bool stop = (control & cw::kNewSetPoint) == 0 || (control & cw::kHalt) != 0;
    if (stop && homing_.state() == Homing::State::moving) {
        homing_.stop();
        profile_.begin(motor_.position(), motor_.speed());
        profile_.halt(shape());
    }
}

// ------------------------------------------------------------------ status for the master

unsigned Drive::mode_bits() const {
    const bool enabled = states_.state() == DriveState::operation_enabled;
    switch (mode_) {
        case Mode::pp: {
            const bool there = enabled && profile_.there() && !buffered_ &&
                               std::abs(profile_.target() - motor_.position()) <= Values::position_window::load(image_);
            return (there ? sw::kTargetReached : 0) | (acknowledged_ ? sw::kSetPointAcknowledge : 0) |
                   (following_error_ ? sw::kFollowingError : 0);
        }
        case Mode::hm: {
            const auto state = homing_.state();
            return (state != Homing::State::moving && std::abs(motor_.speed()) < kStopped ? sw::kTargetReached : 0) |
                   (state == Homing::State::attained ? sw::kSetPointAcknowledge : 0) |
                   (state == Homing::State::failed ? sw::kFollowingError : 0);
        }
        case Mode::csp:
        case Mode::csv:
        case Mode::cst: return (enabled ? sw::kSetPointAcknowledge : 0) | (following_error_ ? sw::kFollowingError : 0);
        case Mode::none: break;
    }
    return 0;
}

void Drive::show() {
    unsigned status = states_.status_bits() | sw::kRemote | mode_bits();
    if (Values::supply::load(image_) >= 200'000) status |= sw::kVoltageEnabled;
    if (limited_) status |= sw::kInternalLimit;
    if (overload_s_ > kOverloadSeconds / 2) status |= sw::kWarning;
    const bool profile = mode_ != Mode::csp;
    const double demand = profile ? profile_.position() : interpolation_.position();
    Values::status::store(image_, static_cast<std::uint16_t>(status));
    Values::mode_display::store(image_, static_cast<std::int8_t>(mode_));
    Values::position::store(image_, rounded(user_position()));
    Values::position_demand::store(image_, rounded(demand - zero_));
    Values::following_error::store(image_, rounded(demand - motor_.position()));
    Values::speed::store(image_, rounded(motor_.speed()));
    Values::torque::store(image_, static_cast<std::int16_t>(std::lround(motor_.torque())));
    const bool negative = motor_.position() <= -kTravel;
    const bool positive = motor_.position() >= kTravel;
    Values::digital_inputs::store(image_, (negative ? 1u : 0u) | (positive ? 2u : 0u));
}

constexpr Blueprint kDrive = blueprint<Drive>("drive", drive::kDevice, drive::kObjects, Values::bytes,
                                              {.pdi_control = kSpiWithDc, .sync_pulse_length_10ns = kSyncPulse});

}  // namespace margay::sim
