// One axis of "soe_drive": a motor and its controllers with the parameters of the servo drive profile (IEC
// 61800-7-204).
#pragma once

#include "sim/library/drive_motion.hpp"
#include "subdevice/soe_server.hpp"

#include <array>

namespace margay::sim {

class SoeAxis final : public subdevice::SoeApplication {
  public:
    static constexpr std::size_t kImageBytes = 256;
    // Maximum size of MDT or AT: the word and four numbers of four octets.
    static constexpr std::size_t kMostBytes = 18;

    SoeAxis(std::uint8_t number, subdevice::SoeServer& server) : number_(number), server_(server) {}

    [[nodiscard]] subdevice::SoeDrive drive();
    // Called when the firmware starts.
    void start(Time now);
    // Simulates the motor until `now`.
    void advance(Time now);
    // Load torque in thousandths of the rated torque, in addition to P-0-0002.
    void set_load(std::int16_t permille) { load_ = permille; }
    void state_changed(AlState state) { operational_ = state == AlState::op; }
    // The master no longer sends set points.
    void stop();

    // Size in octets of the axis in the process data; take() reads the MDT, give() writes the AT.
    [[nodiscard]] std::size_t bytes(bool mdt) const;
    void take(Bytes mdt);
    void give(MutableBytes at);

    [[nodiscard]] const Motor& motor() const { return motor_; }

    subdevice::SoeError before_read(const subdevice::SoeAccess& access) override;
    subdevice::SoeError before_write(const subdevice::SoeAccess& access, Bytes value) override;
    subdevice::SoeError start_command(const subdevice::SoeAccess& access) override;
    void stop_command(const subdevice::SoeAccess& access) override;

  private:
    enum class Power : std::uint8_t { off, on, stopping };
    enum class Mode : std::uint8_t { torque = 1, velocity = 2, position = 3 };

    [[nodiscard]] Bytes cyclic(bool mdt, std::array<std::byte, 4>& fixed) const;
    [[nodiscard]] const subdevice::SoeParameter* cyclic_parameter(Bytes idns, std::size_t n) const;
    void execute_control_word(unsigned control);
    void one_step();
    void run();
    void home();
    void watch();
    void fault(std::uint16_t diagnosis, std::string_view text);
    void set_diagnostic_message(std::string_view text);
    void show();

    std::uint8_t number_;
    subdevice::SoeServer& server_;
    std::array<std::byte, kImageBytes> image_{};
    Motor motor_;
    Interpolation interpolation_;
    Homing homing_;
    Power power_ = Power::off;
    std::int16_t load_ = 0;
    Time time_{};
    double zero_ = 0;
    double previous_ = 0;
    bool operational_ = false;
    bool halted_ = false;
    bool was_on_ = false;
};

}  // namespace margay::sim
