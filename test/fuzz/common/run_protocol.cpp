#include "run_protocol.hpp"

#include "fuzz/mail_device.hpp"

namespace margay::subdevice::fuzzing {

void run_protocol(wire::MailboxType type, std::span<const std::uint8_t> octets, bool boot) {
    Input input(octets.data(), octets.size());
    MailDevice device(input.octet(), boot);
    while (!input.done()) {
        const auto head = input.octet();
        if ((head & 0x80) != 0) (void)device.fetch();
        (void)device.send(type, input.take(head & 0x7F));
        device.step();
    }
    device.must_still_work();
}

}  // namespace margay::subdevice::fuzzing
