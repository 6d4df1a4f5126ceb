// The program of a device that is known only by its SII image: the state machine of the slave stack, process data that
// other programs set and read, and a mailbox for the objects that follow from the image. With device emulation the chip
// mirrors AL control to AL status: then the program has no state machine and refuses nothing, but follows AL control.
#pragma once

#include "sim/process_data.hpp"
#include "sim/sii_mailbox.hpp"
#include "sim/sii_model.hpp"
#include "subdevice/esm.hpp"

#include <optional>

namespace margay::sim {

class SiiFirmware final : public ProcessDataFirmware, private subdevice::EsmClient {
  public:
    // The image is not needed after construction.
    SiiFirmware(Bytes sii, const SiiModel& model);

    void start(subdevice::EscAccess& esc, Time now) override;
    Time step(Time now) override;
    [[nodiscard]] bool polls() const override { return true; }
    // Value of the ID switch of the device (ETG.1020); 0: the device has none.
    void set_device_id(std::uint16_t id) { device_.device_id = id; }

  private:
    [[nodiscard]] std::uint16_t device_id() override { return device_.device_id; }
    [[nodiscard]] subdevice::ProcessDataSizes process_data_sizes() override;
    [[nodiscard]] subdevice::Verdict before(subdevice::Transition transition, Time now) override;
    void dropped(subdevice::Transition) override {}
    void perform(subdevice::Transition transition, Time now) override;
    void after(subdevice::Transition transition, Time now) override;
    [[nodiscard]] bool outputs_missing();
    Time serve_mail(Time now, std::uint32_t events);
    // With device emulation: the program follows AL control.
    [[nodiscard]] AlState state() const;
    void follow(std::uint32_t events);
    Time step_emulated(Time now, std::uint32_t events);
    [[nodiscard]] bool outputs_stopped();

    subdevice::DeviceDescription device_;
    bool emulation_;
    std::vector<SiiModel::Area> areas_;
    subdevice::EscAccess* esc_ = nullptr;
    std::optional<subdevice::Esm> esm_;
    std::optional<SiiMailbox> mail_;  // empty if the device has no mailbox
    AlState followed_ = AlState::init;
    Time wait_until_ = kNever;
};

}  // namespace margay::sim
