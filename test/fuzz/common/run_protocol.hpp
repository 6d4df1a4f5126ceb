// A device with a mailbox receives any sequence of messages of one protocol. This function has its own source, because
// mail_device.hpp takes long to compile, and most harnesses need only this function.
#pragma once

#include "wire/mailbox.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay::subdevice::fuzzing {

// `input` is a sequence of messages. Each message follows an octet with its length. If bit 7 of this octet is set, a
// reply is read before the message is sent. After the last message the device must answer a correct request.
void run_protocol(wire::MailboxType type, std::span<const std::uint8_t> input, bool boot);

}  // namespace margay::subdevice::fuzzing
