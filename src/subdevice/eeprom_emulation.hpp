// EEPROM emulation: the processor of the slave executes the SII commands of an ESC that has no EEPROM (ESC register
// tables, "SII EEPROM interface", emulation).
#pragma once

#include "subdevice/esc_access.hpp"

namespace margay::subdevice {

class EepromEmulation {
  public:
    // `contents` is the SII image. The master may write to it.
    EepromEmulation(EscAccess& esc, MutableBytes contents) : esc_(esc), contents_(contents) {}

    // Executes the pending SII command if there is one. `events` is the AL event request.
    void step(std::uint32_t events);

    [[nodiscard]] bool written() const { return written_; }  // the master has changed the image
    void saved() { written_ = false; }                       // call it when the image is saved

  private:
    EscAccess& esc_;
    MutableBytes contents_;
    bool written_ = false;
};

}  // namespace margay::subdevice
