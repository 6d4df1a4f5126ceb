// Executes an operation repeatedly, each time with another frame spoilt.
#pragma once

#include "mailbox/mailbox_bus.hpp"

namespace margay {

// Calls `operation(bus)` on a bus with this device of the library: once with all frames, which are fewer than `most`,
// and then with each of these frames lost on its way out, lost on its way back, or sent twice. The operation itself
// checks its success.
template <class Operation>
void with_each_frame_spoilt(const char* device, std::uint64_t most, Operation operation) {
    enum class Fault { none, lost_out, lost_in, twice };
    const auto run = [&](Fault fault, std::uint64_t at) {
        MailboxBus bus;
        bus.add_device(sim::make_device(device).value());
        bus.start();
        bus.idle(20ms);
        const auto before = bus.nic->sent;
        if (fault == Fault::lost_out) bus.nic->lose_out.insert(before + at);
        if (fault == Fault::lost_in) bus.nic->lose_in.insert(before + at);
        if (fault == Fault::twice) bus.nic->twice.insert(before + at);
        operation(bus);
        return bus.nic->sent - before;
    };
    const auto frames = run(Fault::none, 0);
    ASSERT_GT(frames, 0U);
    ASSERT_LT(frames, most);
    for (const Fault fault : {Fault::lost_out, Fault::lost_in, Fault::twice})
        for (std::uint64_t at = 0; at < frames; ++at) {
            SCOPED_TRACE(testing::Message()
                         << "fault " << static_cast<int>(fault) << " at frame " << at << " of " << frames);
            (void)run(fault, at);
        }
}

}  // namespace margay
