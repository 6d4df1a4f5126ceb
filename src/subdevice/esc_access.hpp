// The interface between the slave stack and the ESC: the memory that the PDI shows. On hardware an SPI or bus driver
// implements it, in the simulation the PDI side of a simulated ESC.
//
// To port: derive a class and implement the three functions. Reads and writes must execute in order, must not be split,
// and must not wait for the master. Addresses are ESC addresses (registers below 0x1000, process memory from 0x1000).
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

namespace margay::subdevice {

class EscAccess {
  public:
    virtual void read(std::uint16_t address, MutableBytes into) noexcept = 0;
    virtual void write(std::uint16_t address, Bytes data) noexcept = 0;

    // A monotonic clock. Its resolution limits the resolution of the stack's timeouts.
    [[nodiscard]] virtual Time now() noexcept = 0;

  protected:
    ~EscAccess() = default;
};

}  // namespace margay::subdevice
