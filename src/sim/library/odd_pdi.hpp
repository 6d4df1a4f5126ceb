// An EscAccess with quirks: it changes the data that the firmware reads and writes through the PDI.
#pragma once

#include "sim/library/quirk.hpp"
#include "subdevice/esc_access.hpp"

namespace margay::sim {

class OddPdi final : public subdevice::EscAccess {
  public:
    void attach(subdevice::EscAccess& esc, Quirks quirks) {
        esc_ = &esc;
        quirks_ = quirks;
        full_since_ = kNever;
    }
    void read(std::uint16_t address, MutableBytes into) noexcept override;
    void write(std::uint16_t address, Bytes data) noexcept override;
    [[nodiscard]] Time now() noexcept override { return esc_->now(); }

    // Time at which a hidden message becomes visible.
    [[nodiscard]] Time next() const;

  private:
    void hide_mail(MutableBytes status);
    // The master requests a repeat that is not acknowledged yet.
    [[nodiscard]] bool repeats();

    subdevice::EscAccess* esc_ = nullptr;
    Quirks quirks_;
    Time full_since_ = kNever;
};

}  // namespace margay::sim
