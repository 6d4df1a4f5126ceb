// Three abilities of a NIC that concern the times of frames: the NIC notes when a frame was sent, notes when a frame
// was received, or holds a frame until a given time. Each ability is an interface of its own; Nic::timing() returns the
// interfaces that a NIC has. The library uses them only where the program asks for it, so a NIC without them, and a
// program that does not use them, have no cost.
#pragma once

namespace margay {

class SendClock;     // send_clock.hpp: when a frame has left
class ReceiveClock;  // receive_clock.hpp: when a frame has arrived
class TimedSend;     // timed_send.hpp: a frame leaves at a given time

// nullptr: the NIC does not have the ability, or the program has not switched it on (PacketNic::stamp_frames(),
// PacketNic::allow_send_at()). The objects belong to the NIC.
struct FrameTiming {
    SendClock* sent = nullptr;
    ReceiveClock* received = nullptr;  // the times come from the same clock as the times of `sent`
    TimedSend* send_at = nullptr;
};

}  // namespace margay
