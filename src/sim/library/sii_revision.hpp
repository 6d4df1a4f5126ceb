// Keeps the revision in the SII equal to the revision of the executing firmware: the firmware writes it through the PDI
// side of the SII interface, as real devices do after an update.
#pragma once

#include "subdevice/esc_access.hpp"

namespace margay::sim {

class SiiRevision {
  public:
    // The firmware starts. `esc` is valid until the next start. `known`: the revision in the SII.
    void start(subdevice::EscAccess& esc, std::uint32_t known, std::uint32_t wanted);
    // Executes the next access if it is due. Returns the time of the next call; kNever: the SII has the revision.
    Time advance(Time now);
    // The revision in the SII.
    [[nodiscard]] std::uint32_t stored() const { return stored_; }

  private:
    [[nodiscard]] bool take_access();
    void release_access();
    void write_word();

    subdevice::EscAccess* esc_ = nullptr;
    std::uint32_t stored_ = 0;
    std::uint32_t wanted_ = 0;
    unsigned word_ = 0;     // the next word, 0 or 1
    bool writing_ = false;  // the SII interface executes a command of this class
};

}  // namespace margay::sim
