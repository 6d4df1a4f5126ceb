// "drive": a CiA 402 servo drive with a motor.
#pragma once

#include "sim/library/drive_motion.hpp"
#include "sim/library/drive_states.hpp"
#include "sim/library/model.hpp"

namespace margay::sim {

class Drive final : public Model {
  public:
    [[nodiscard]] const subdevice::DeviceDescription& description() const override;
    void start(const Surroundings& around, Time now) override;
    Time advance(Time now) override;
    void cycle(Time now, bool outputs_valid) override;
    void safe_outputs(Time now) override;
    // Two values of 16 bits: the load torque in thousandths of the rated torque, and an error code to raise.
    [[nodiscard]] MutableBytes measured() override { return measured_; }

    [[nodiscard]] const Motor& motor() const { return motor_; }

  private:
    enum class Mode : std::int8_t { none = 0, pp = 1, hm = 6, csp = 8, csv = 9, cst = 10 };

    void apply_environment();
    void one_step();
    void operate();
    void ramp_to(double speed, double change);
    void ramp_down();
    void watch(Time now);
    void fault(std::uint16_t code, bool controlled, Time now);
    void execute_control_word(Time now);
    void enter_operation();
    void apply_mode();
    void accept_set_point(unsigned control, unsigned edges);
    void profile_command(unsigned control, unsigned edges);
    void homing_command(unsigned control, unsigned edges);
    void show();
    [[nodiscard]] unsigned mode_bits() const;
    [[nodiscard]] double within_limits(double user);
    [[nodiscard]] Profile::Shape shape() const;
    [[nodiscard]] MotorLimits limits() const;
    [[nodiscard]] Duration interpolation_period() const;
    [[nodiscard]] double user_position() const { return motor_.position() - zero_; }

    MutableBytes image_;
    std::array<std::byte, 4> measured_{};
    Motor motor_;
    DriveStates states_;
    Profile profile_;
    Interpolation interpolation_;
    Homing homing_;
    Mode mode_ = Mode::none;
    Time time_{};            // time of the motor simulation
    double zero_ = 0;        // motor position of user position zero
    double ramp_ = 0;        // target speed while a ramp is active
    double previous_ = 0;    // position of the motor one step before
    double overload_s_ = 0;  // load of the motor's heat model
    Duration behind_{};      // time since the following error is too large
    unsigned last_control_ = 0;
    bool following_error_ = false;
    bool limited_ = false;
    bool acknowledged_ = false;  // pp: a set point was accepted
    bool buffered_ = false;      // pp: a second set point is waiting
    double next_target_ = 0;
    bool error_requested_ = false;
};

}  // namespace margay::sim
