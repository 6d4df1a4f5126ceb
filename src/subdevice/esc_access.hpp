// The ESC as the slave stack needs it: memory behind the PDI. On hardware an SPI or bus driver, in the simulation the
// PDI side of a simulated ESC.
//
// To port: derive and implement the three functions. Reads and writes happen in order, are never split and never wait
// for the master. Addresses are ESC addresses (registers below 0x1000, process memory from there).
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

namespace margay::subdevice {

class EscAccess {
  public:
    virtual void read(std::uint16_t address, MutableBytes into) noexcept = 0;
    virtual void write(std::uint16_t address, Bytes data) noexcept = 0;

    // A monotonic clock; how fine it is decides how fine the stack's own timeouts are.
    [[nodiscard]] virtual Time now() noexcept = 0;

  protected:
    ~EscAccess() = default;
};

}  // namespace margay::subdevice
