#include "sim/library/soe_axis.hpp"

#include <algorithm>
#include <cmath>

namespace margay::sim {

using namespace subdevice;
namespace idn = wire::soe::idn;

namespace {

constexpr std::int32_t kTurn = static_cast<std::int32_t>(Motor::kCountsPerTurn);
constexpr double kTravel = 20.25 * Motor::kCountsPerTurn;  // distance from the middle position to each limit switch
constexpr double kStopped = Motor::kCountsPerTurn / 10000;

// Bits of S-0-0134 and S-0-0135.
constexpr unsigned kDriveOn = 0x8000;
constexpr unsigned kDriveEnable = 0x4000;
constexpr unsigned kDriveRun = 0x2000;  // 0: halt
constexpr unsigned kLogicReady = 0x4000;
constexpr unsigned kPowerReady = 0x8000;
constexpr unsigned kTorqueOn = 0xC000;
constexpr unsigned kShutDown = 0x2000;  // an error of class 1
constexpr unsigned kFollows = 0x0008;   // the drive follows the command values

// Bits of S-0-0011, class 1 diagnostic.
constexpr std::uint16_t kFollowingError = 0x0800;
constexpr std::uint16_t kCommunication = 0x1000;

struct Values {
    using cycle_us = Field<std::uint16_t, 0>;
    using diagnosis = Field<std::uint16_t, cycle_us::end>;
    using telegram = Field<std::uint16_t, diagnosis::end>;
    using mode = Field<std::uint16_t, telegram::end>;
    using velocity_command = Field<std::int32_t, mode::end>;
    using velocity = Field<std::int32_t, velocity_command::end>;
    using position_command = Field<std::int32_t, velocity::end>;
    using position = Field<std::int32_t, position_command::end>;
    using torque_command = Field<std::int16_t, position::end>;
    using torque = Field<std::int16_t, torque_command::end>;
    using velocity_limit = Field<std::uint32_t, torque::end>;
    using torque_limit = Field<std::uint16_t, velocity_limit::end>;
    using control = Field<std::uint16_t, torque_limit::end>;
    using status = Field<std::uint16_t, control::end>;
    using window = Field<std::uint32_t, status::end>;
    using homing_speed = Field<std::uint32_t, window::end>;
    using load = Field<std::int16_t, homing_speed::end>;
    static constexpr std::size_t at_list = load::end;
    static constexpr std::size_t mdt_list = at_list + soe_list_bytes(8);
    static constexpr std::size_t message = mdt_list + soe_list_bytes(8);
    static constexpr std::size_t reset = message + soe_list_bytes(60);
    static constexpr std::size_t homing = reset + kSoeCommandBytes;
    static constexpr std::size_t bytes = homing + kSoeCommandBytes;
};
static_assert(Values::bytes <= SoeAxis::kImageBytes);

constexpr Idn kTorqueFeedback = Idn::standard(84);
constexpr Idn kReset = Idn::standard(99);
constexpr Idn kHoming = Idn::standard(148);
constexpr Idn kAtDefault[] = {idn::kPositionFeedback, idn::kVelocityFeedback};
constexpr Idn kMdtDefault[] = {idn::kPositionCommand};
constexpr Idn kAtChoice[] = {Idn::standard(11), idn::kVelocityFeedback, idn::kPositionFeedback, kTorqueFeedback,
                             idn::kStatusWord};
constexpr Idn kMdtChoice[] = {idn::kVelocityCommand, idn::kPositionCommand, idn::kTorqueCommand, idn::kControlWord};

constexpr SoeParameter kParameters[] = {
    soe_value<Values::cycle_us>(Idn::standard(1), "Control unit cycle time (TNcyc)", "us")
        .within(250, 20000)
        .starts_with(1000)
        .protect(false, true, true),
    soe_value<Values::diagnosis>(Idn::standard(11), "Class 1 diagnostic").read_only(),
    soe_value<Values::telegram>(idn::kTelegramType, "Telegram type")
        .within(0, 7)
        .starts_with(7)
        .protect(false, true, true),
    soe_idn_list(idn::kAtList, "Configuration list of AT", Values::at_list, 8, kAtDefault).protect(false, true, true),
    soe_all(Idn::standard(17), "IDN-list of all operation data", SoeStorage::all_idns),
    soe_idn_list(idn::kMdtList, "Configuration list of MDT", Values::mdt_list, 8, kMdtDefault)
        .protect(false, true, true),
    soe_all(Idn::standard(25), "IDN-list of all procedure commands", SoeStorage::all_commands),
    soe_text(Idn::standard(30), "Manufacturer version", "Margay SoE drive 1.0"),
    soe_value<Values::mode>(Idn::standard(32), "Primary operation mode").within(1, 3).starts_with(3),
    soe_value<Values::velocity_command>(idn::kVelocityCommand, "Velocity command value", "inc/s"),
    soe_value<Values::velocity>(idn::kVelocityFeedback, "Velocity feedback value 1", "inc/s").read_only(),
    soe_value<Values::position_command>(idn::kPositionCommand, "Position command value", "inc"),
    soe_value<Values::position>(idn::kPositionFeedback, "Position feedback value 1", "inc").read_only(),
    soe_value<Values::torque_command>(idn::kTorqueCommand, "Torque command value", "%", 1).within(-3000, 3000),
    soe_value<Values::torque>(kTorqueFeedback, "Torque feedback value", "%", 1).read_only(),
    soe_value<Values::velocity_limit>(Idn::standard(91), "Bipolar velocity limit value", "inc/s")
        .starts_with(100 * kTurn),
    soe_value<Values::torque_limit>(Idn::standard(92), "Bipolar torque limit value", "%", 1)
        .within(0, 3000)
        .starts_with(3000),
    soe_list(Idn::standard(95), "Diagnostic message", Values::message, 60, 1, SoeType::text).read_only(),
    soe_procedure(kReset, "Reset class 1 diagnostic", Values::reset),
    soe_value<Values::control>(idn::kControlWord, "Master control word").read_only(),
    soe_value<Values::status>(idn::kStatusWord, "Drive status word").read_only(),
    soe_procedure(kHoming, "Drive controlled homing procedure", Values::homing),
    soe_value<Values::window>(Idn::standard(159), "Monitoring window", "inc").starts_with(kTurn / 4),
    soe_fixed_idns(Idn::standard(187), "IDN-list of configurable data in the AT", kAtChoice),
    soe_fixed_idns(Idn::standard(188), "IDN-list of configurable data in the MDT", kMdtChoice),
    // Parameters of the simulation.
    soe_value<Values::homing_speed>(Idn::product(1), "Homing speed", "inc/s").within(1, 20 * kTurn).starts_with(kTurn),
    soe_value<Values::load>(Idn::product(2), "Load torque", "%", 1),
};
static_assert(well_formed(kParameters, Values::bytes));

std::int32_t rounded(double value) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(std::llround(value)));
}

}  // namespace

SoeDrive SoeAxis::drive() { return {kParameters, image_, this}; }

void SoeAxis::start(Time now) {
    drive().restore_defaults();
    motor_ = Motor();
    motor_.place((3.3 + number_) * Motor::kCountsPerTurn);
    previous_ = motor_.position();
    zero_ = 0;
    homing_.reset();
    power_ = Power::off;
    time_ = now;
    operational_ = halted_ = was_on_ = false;
    set_diagnostic_message("ready");
    show();
}

// ------------------------------------------------------------------ cyclic data

// The IDNs of one direction: the configured list of the drive, or the IDNs of the standard telegram in `fixed`.
Bytes SoeAxis::cyclic(bool mdt, std::array<std::byte, 4>& fixed) const {
    const auto type = Values::telegram::load(image_) & 7U;
    if (type == wire::soe::kConfigurable) {
        const auto whole = Bytes(image_).subspan(mdt ? Values::mdt_list : Values::at_list, 12);
        return whole.subspan(4, std::min<std::size_t>(wire::soe::ListLayout::current_bytes::load(whole), 8));
    }
    const auto standard = wire::soe::telegram(type, mdt);
    std::size_t bytes = 0;
    for (const Idn one : standard)
        if (one != Idn{}) store_le(fixed, 2 * bytes++, one.value);
    return Bytes(fixed).first(2 * bytes);
}

const SoeParameter* SoeAxis::cyclic_parameter(Bytes idns, std::size_t n) const {
    const Idn one{load_le<std::uint16_t>(idns, 2 * n)};
    // The telegram already contains these words.
    if (one == idn::kControlWord || one == idn::kStatusWord) return nullptr;
    const auto at = std::ranges::find(kParameters, one, &SoeParameter::idn);
    return at != std::end(kParameters) ? &*at : nullptr;
}

std::size_t SoeAxis::bytes(bool mdt) const {
    std::array<std::byte, 4> fixed{};
    const Bytes idns = cyclic(mdt, fixed);
    std::size_t bytes = 2;
    for (std::size_t n = 0; n < idns.size() / 2; ++n)
        if (const auto* const p = cyclic_parameter(idns, n); p != nullptr) bytes += p->attribute.bytes;
    return bytes;
}

void SoeAxis::take(Bytes mdt) {
    std::array<std::byte, 4> fixed{};
    const Bytes idns = cyclic(true, fixed);
    std::size_t at = 2;
    for (std::size_t n = 0; n < idns.size() / 2; ++n) {
        const auto* const p = cyclic_parameter(idns, n);
        if (p == nullptr) continue;
        std::ranges::copy(mdt.subspan(at, p->attribute.bytes), image_.begin() + p->offset);
        at += p->attribute.bytes;
    }
    execute_control_word(load_le<std::uint16_t>(mdt));
}

void SoeAxis::give(MutableBytes to) {
    show();
    std::array<std::byte, 4> fixed{};
    const Bytes idns = cyclic(false, fixed);
    store_le(to, 0, Values::status::load(image_));
    std::size_t at = 2;
    for (std::size_t n = 0; n < idns.size() / 2; ++n) {
        const auto* const p = cyclic_parameter(idns, n);
        if (p == nullptr) continue;
        std::ranges::copy(Bytes(image_).subspan(p->offset, p->attribute.bytes),
                          to.begin() + static_cast<std::ptrdiff_t>(at));
        at += p->attribute.bytes;
    }
}

// ------------------------------------------------------------------ parameters

SoeError SoeAxis::before_read(const SoeAccess& access) {
    advance(access.now);
    return SoeError::none;
}

SoeError SoeAxis::before_write(const SoeAccess& access, Bytes value) {
    const Idn one = access.parameter.idn;
    if (one == idn::kAtList || one == idn::kMdtList) {
        const auto choice = one == idn::kAtList ? std::span<const Idn>(kAtChoice) : std::span<const Idn>(kMdtChoice);
        for (std::size_t at = 4; at + 2 <= value.size(); at += 2)
            if (std::ranges::find(choice, Idn{load_le<std::uint16_t>(value, at)}) == choice.end())
                return SoeError::value_invalid;
        return SoeError::none;
    }
    if (access.state != AlState::op) return SoeError::none;
    std::array<std::byte, 4> fixed{};
    const Bytes idns = cyclic(true, fixed);
    for (std::size_t n = 0; n < idns.size() / 2; ++n)
        if (load_le<std::uint16_t>(idns, 2 * n) == one.value) return SoeError::value_cyclic;
    return one == Idn::standard(32) && power_ != Power::off ? SoeError::value_settings : SoeError::none;
}

SoeError SoeAxis::start_command(const SoeAccess& access) {
    if (access.parameter.idn == kReset) {
        Values::diagnosis::store(image_, 0);
        set_diagnostic_message("ready");
        server_.finish_command(number_, kReset, true);
        return SoeError::none;
    }
    if (power_ != Power::on) return SoeError::command_not_now;
    const auto speed = static_cast<double>(Values::homing_speed::load(image_));
    homing_.begin({.method = 34, .fast = speed, .slow = speed});
    motor_.release();
    set_diagnostic_message("homing");
    return SoeError::none;
}

void SoeAxis::stop_command(const SoeAccess& access) {
    if (access.parameter.idn != kHoming) return;
    homing_.stop();
    interpolation_.begin(motor_.position());
    set_diagnostic_message("homing interrupted");
}

// ------------------------------------------------------------------ the motor

void SoeAxis::execute_control_word(unsigned control) {
    Values::control::store(image_, static_cast<std::uint16_t>(control));
    const bool on = (control & kDriveOn) != 0 && (control & kDriveEnable) != 0;
    const bool healthy = Values::diagnosis::load(image_) == 0;
    if (on && !was_on_ && healthy && power_ == Power::off) {
        power_ = Power::on;
        motor_.release();
        interpolation_.begin(motor_.position());
        set_diagnostic_message("torque on");
    }
    if (!on && power_ == Power::on) power_ = (control & kDriveEnable) != 0 ? Power::stopping : Power::off;
    was_on_ = on;
    halted_ = (control & kDriveRun) == 0;
    // The axis does not move until homing is cancelled, because the master must first read the new position.
    const bool homing = load_le<std::uint16_t>(image_, Values::homing + 2) != 0;
    if (power_ == Power::on && !halted_ && !homing)
        interpolation_.set(zero_ + Values::position_command::load(image_),
                           std::chrono::microseconds(Values::cycle_us::load(image_)));
}

void SoeAxis::stop() {
    if (power_ == Power::on) fault(kCommunication, "communication lost");
    was_on_ = false;
    Values::control::store(image_, 0);
}

void SoeAxis::advance(Time now) {
    motor_.set_load(Values::load::load(image_) + load_);
    if (power_ == Power::off && motor_.at_rest()) time_ = now;
    for (; time_ + Motor::kStep <= now; time_ += Motor::kStep) {
        const double before = motor_.position();
        one_step();
        previous_ = before;
        watch();
    }
    show();
}

void SoeAxis::one_step() {
    const MotorLimits limits{static_cast<double>(Values::torque_limit::load(image_)),
                             static_cast<double>(Values::velocity_limit::load(image_))};
    if (power_ == Power::off) return motor_.step_unpowered();
    if (power_ == Power::stopping || halted_) {
        motor_.step_speed(0, 0, limits);
        interpolation_.begin(motor_.position());
        if (power_ == Power::stopping && std::abs(motor_.speed()) < kStopped) power_ = Power::off;
        return;
    }
    if (homing_.state() == Homing::State::moving) return home();
    switch (static_cast<Mode>(Values::mode::load(image_))) {
        case Mode::torque: return motor_.step_torque(Values::torque_command::load(image_), limits);
        case Mode::velocity: return motor_.step_speed(Values::velocity_command::load(image_), 0, limits);
        case Mode::position:
            interpolation_.step();
            return motor_.step_position(interpolation_.position(), interpolation_.speed(), limits);
    }
}

// Moves to the next index pulse, which becomes the zero position.
void SoeAxis::home() {
    const double wanted =
        homing_.step({motor_.position(), previous_, motor_.position() <= -kTravel, motor_.position() >= kTravel});
    motor_.step_speed(wanted, 0, {});
    if (homing_.state() == Homing::State::moving) return;
    const bool attained = homing_.state() == Homing::State::attained;
    if (attained) zero_ = homing_.home();
    homing_.reset();
    interpolation_.begin(motor_.position());
    set_diagnostic_message(attained ? "homed" : "homing failed");
    server_.finish_command(number_, kHoming, attained);
}

void SoeAxis::watch() {
    if (power_ != Power::on || halted_ || homing_.state() == Homing::State::moving) return;
    if (static_cast<Mode>(Values::mode::load(image_)) != Mode::position) return;
    if (std::abs(interpolation_.position() - motor_.position()) > Values::window::load(image_))
        fault(kFollowingError, "excessive position deviation");
}

void SoeAxis::fault(std::uint16_t diagnosis, std::string_view text) {
    Values::diagnosis::store(image_, static_cast<std::uint16_t>(Values::diagnosis::load(image_) | diagnosis));
    power_ = power_ == Power::off ? Power::off : Power::stopping;
    if (homing_.state() == Homing::State::moving) {
        homing_.reset();
        server_.finish_command(number_, kHoming, false);
    }
    set_diagnostic_message(text);
    std::array<std::byte, 2> code{};
    store_le(code, 0, diagnosis);
    (void)server_.report(number_, code);  // a lost report has no effect: the class 1 diagnostic contains the same error
}

void SoeAxis::set_diagnostic_message(std::string_view text) {
    const auto list = MutableBytes(image_).subspan(Values::message, 64);
    wire::soe::ListLayout::current_bytes::store(list, static_cast<std::uint16_t>(text.size()));
    std::ranges::transform(text, list.begin() + 4, [](char c) { return static_cast<std::byte>(c); });
}

void SoeAxis::show() {
    const bool healthy = Values::diagnosis::load(image_) == 0;
    unsigned status = operational_ && healthy ? kPowerReady : kLogicReady;
    if (power_ == Power::on) status = kTorqueOn | (halted_ ? 0U : kFollows);
    if (!healthy) status |= kShutDown;
    Values::status::store(image_, static_cast<std::uint16_t>(status));
    Values::position::store(image_, rounded(motor_.position() - zero_));
    Values::velocity::store(image_, rounded(motor_.speed()));
    Values::torque::store(image_, static_cast<std::int16_t>(std::lround(motor_.torque())));
}

}  // namespace margay::sim
