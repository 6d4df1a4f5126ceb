// The program of a device of which nothing is known but its SII image: the state machine of the slave stack,
// and process data that others set and look at.
#pragma once

#include "sim/process_data.hpp"
#include "sim/sii_model.hpp"
#include "subdevice/esm.hpp"

#include <optional>

namespace margay::sim {

class SiiFirmware final : public ProcessDataFirmware, private subdevice::EsmClient {
  public:
    explicit SiiFirmware(const SiiModel& model)
        : device_(model.description()), emulation_(model.device_emulation()), areas_(model.areas) {}

    void start(subdevice::EscAccess& esc, Time now) override;
    Time step(Time now) override;

  private:
    [[nodiscard]] subdevice::ProcessDataSizes process_data_sizes() override;
    [[nodiscard]] subdevice::Verdict before(subdevice::Transition transition, Time now) override;
    void dropped(subdevice::Transition) override {}
    void perform(subdevice::Transition, Time) override {}
    void after(subdevice::Transition, Time) override;
    void discard_mail();

    subdevice::DeviceDescription device_;
    bool emulation_;
    std::vector<SiiModel::Area> areas_;
    subdevice::EscAccess* esc_ = nullptr;
    std::optional<subdevice::Esm> esm_;
    Time wait_until_ = kNever;
};

}  // namespace margay::sim
