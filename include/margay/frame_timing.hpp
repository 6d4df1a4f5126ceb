// What a NIC can do with the times of frames, in words of the NIC interface "sent at", "received at" and "send at".
// Each of the three is an interface of its own; Nic::timing() says which of them a NIC has. Nothing in the cycle asks
// for them, so that a NIC without them, and a program that does not use them, have no cost.
#pragma once

namespace margay {

class SendClock;     // send_clock.hpp: when a frame has left
class ReceiveClock;  // receive_clock.hpp: when a frame has arrived
class TimedSend;     // timed_send.hpp: a frame leaves at a given time

// nullptr: the NIC does not have it, or it was not asked for (PacketNic::stamp_frames(), PacketNic::allow_send_at()).
// The objects belong to the NIC.
struct FrameTiming {
    SendClock* sent = nullptr;
    ReceiveClock* received = nullptr;  // the times come from the same clock as the times of `sent`
    TimedSend* send_at = nullptr;
};

}  // namespace margay
