// The explicit device id of one slave (ETG.1020, "Explicit device identification"): the value of a switch on the
// device.
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/slave.hpp>

namespace margay {

// Reads the device id in the way that the SII defines. Either by AL control bit 5: the slave answers with AL status bit
// 5 and the id in the AL status code. Or by reading the word of the ESC's memory that the SII names. The AL state does
// not change, and the AL status code has its usual meaning again afterwards. The SII interface must be assigned to the
// master. Errors: unsupported (the slave does not answer the request, or has no processor that could), and register
// errors.
[[nodiscard]] Task<Result<std::uint16_t>> read_device_id(Station station, const Slave& slave);

}  // namespace margay
