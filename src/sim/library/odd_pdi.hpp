// The ESC as a firmware with manners sees it: what it reads and writes behind the PDI is spoiled on the way.
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

    // When a message that it turned a blind eye on is to be seen.
    [[nodiscard]] Time next() const;

  private:
    void hide_mail(MutableBytes status);
    // The master asks for a repetition, and has no acknowledge yet.
    [[nodiscard]] bool repeats();

    subdevice::EscAccess* esc_ = nullptr;
    Quirks quirks_;
    Time full_since_ = kNever;
};

}  // namespace margay::sim
