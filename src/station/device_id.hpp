// The explicit device id of one slave (ETG.1020 "Explicit device identification"): what a switch on the device is set
// to.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Asks for it the way the SII says: by AL control bit 5, answered by AL status bit 5 with the id in the AL status code;
// or by reading the word of the ESC's memory that the SII names. The AL state stays as it is, and AL status code is
// itself again afterwards. The SII's interface must be the master's. Errors: unsupported (the slave does not answer the
// request, or has no processor that could), and those of the registers.
[[nodiscard]] Task<Result<std::uint16_t>> read_device_id(Station station, const Slave& slave);

}  // namespace margay
