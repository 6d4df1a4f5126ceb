// A device with a mailbox that gets any sequence of messages of one protocol. Its own file, because the device of
// mail_device.hpp takes long to compile, and most harnesses need no more of it.
#pragma once

#include "wire/mailbox.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay::subdevice::fuzzing {

// The input is messages, each after its length in an octet. Bit 7 of this octet: a reply is read before. After the last
// message the device must answer a correct request.
void run_protocol(wire::MailboxType type, std::span<const std::uint8_t> input, bool boot);

}  // namespace margay::subdevice::fuzzing
