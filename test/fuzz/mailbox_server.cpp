// The mailbox engine with anything that a master can do: messages with any header, replies that are read or not read,
// repeat requests, state changes, SyncManagers that are disabled and enabled.
#include "mail_device.hpp"

using namespace margay;
using namespace margay::subdevice::fuzzing;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    const auto first = input.octet();
    MailDevice device(input.octet(), (first & 1) != 0);
    while (!input.done()) {
        const auto action = input.octet();
        switch (action & 7) {
            case 0:
            case 1:
            case 2: {
                const auto length = input.octet();
                (void)device.put(input.take(length));
                break;
            }
            case 3: (void)device.fetch(); break;
            case 4: device.esc.ecat_set<std::uint8_t>(0x080E, static_cast<std::uint8_t>(1 | (action >> 2 & 2))); break;
            case 5: device.esc.al_control(static_cast<std::uint16_t>(input.octet() & 0x3F)); break;
            case 6: device.esc.ecat_set<std::uint8_t>(0x0806, static_cast<std::uint8_t>(action >> 3 & 1)); break;
            case 7: device.esc.time += std::chrono::milliseconds(input.octet()); break;
        }
        device.step();
    }
    // If the mailbox is still enabled, it must work again after reading only. After a new start-up it must work in any
    // case.
    const auto status = device.esc.al_status();
    const bool on = device.esc.sync_manager(0).enabled() && device.esc.sync_manager(1).enabled();
    if (on && status.state != AlState::init) device.must_still_work();
    device.bring_up((first & 1) == 0);
    device.must_still_work();
    return 0;
}
