// EEPROM emulation: the slave's processor answers the SII commands of an ESC that has no EEPROM (ESC register
// tables, "SII EEPROM interface", emulation).
#pragma once

#include "subdevice/esc_access.hpp"

namespace margay::subdevice {

class EepromEmulation {
  public:
    // `contents` is the SII image, which the master may write.
    EepromEmulation(EscAccess& esc, MutableBytes contents) : esc_(esc), contents_(contents) {}

    // Serves the command that waits, if one does.
    void step(std::uint32_t events);

    [[nodiscard]] bool written() const { return written_; }  // the master has changed the image
    void saved() { written_ = false; }                       // the author has put it away

  private:
    EscAccess& esc_;
    MutableBytes contents_;
    bool written_ = false;
};

}  // namespace margay::subdevice
