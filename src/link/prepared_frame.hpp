// Prepared frames: the frames of the cycle, which are built once and sent again and again with new data and a new
// index. No coroutine waits for them; the sender reads the result afterwards. The link sends queued datagrams
// ("riders") in the space behind the datagrams of a prepared frame.
#pragma once

#include "link/frame_table.hpp"

#include <margay/group.hpp>

#include <array>
#include <span>

namespace margay {

// One datagram with process data that is always in its frame.
struct PreparedDatagram {
    Bytes output;        // outputs of the application, copied to the first octets of the data
    MutableBytes input;  // destination of the inputs, copied from octet input_at of the data on; only when the working
                         // counter is as expected
    std::uint16_t input_at = 0;
    std::uint16_t offset = 0;  // of the header in the frame
    std::uint16_t bytes = 0;   // of the data
    DatagramStatus* status = nullptr;
};

// A datagram that reads a register. It is placed behind the PreparedDatagrams of its frame.
struct PreparedReading {
    // Only the mapping writes `offset` and `bytes`: a thread that sends overlapped cycles reads them while the owner
    // writes the other members.
    std::uint16_t offset : 12 = 0;  // of the header in the frame
    std::uint16_t bytes : 4 = 0;    // of the data, at most 8
    std::uint8_t full = 0;  // how many slaves the last frame with its time has passed, modulo 256; 0: not known
    // For the time of the reference clock, in a frame that cannot be changed now. `changes`: the next frame is sent
    // with the time of the standby, or without a time. `by_position`: the address of the standby is a position.
    bool changes : 1 = false;
    bool by_position : 1 = false;
    bool held : 1 = false;  // overlapped frames only: the reference clock is read, and its time reaches no other clock
    // For the time of the reference clock: the station address of the slave whose time is sent when the reference clock
    // is lost; 0: none.
    std::uint16_t standby = 0;
    std::uint16_t times = 0;  // frames that brought the time of the reference clock to the others; wraps
    RegisterReading* into = nullptr;
};

// The result of one frame of a cycle, or of all its frames.
enum class CycleEnd : std::uint8_t {
    missing,   // not back
    odd,       // back, but some slave did not take part in one of its datagrams
    unjudged,  // back, a plain frame: not every slave took part, and commit_short() was not called yet
    right,     // back, and every slave took part
};

struct PreparedFrame;

// The functions that the frame calls in the part of the library that owns it; `group` is PreparedFrame::group.
struct FrameOwner {
    // Copies the inputs of the slaves that take part, and of no other slave; n is the index in `datagrams`. Called
    // for a degraded frame that is `apart`, or that was regrouped in flight.
    void (*copy_inputs)(void* group, const PreparedFrame& frame, std::size_t n, Bytes inputs);
    // Called when a working counter is not that of all slaves: whether exactly the slaves that take part have answered.
    // A working counter is the accepted one by coincidence if one slave has left and another one has come. `changed`:
    // the previous cycle had another working counter, or its working counter is not known.
    bool (*is_sure)(void* group, const DatagramStatus& status, bool changed);
};

struct PreparedFrame {
    std::span<PreparedDatagram> datagrams;
    std::span<PreparedReading> readings;
    FrameSlot* slot = nullptr;  // while it is in flight (not used for overlapped cycles): `own`, or a slot of the link
                                // when datagrams ride along
    CycleEnd end = CycleEnd::missing;
    bool plain = false;  // one datagram in which every slave takes part, no reading, and no parked reply
    // Some slave does not take part. Inputs are then sent as they are in the image, so that the octets that no slave
    // writes come back unchanged.
    bool degraded = false;
    bool doubted = false;    // another device may answer in the place of a slave that takes part
    bool regrouped = false;  // the slaves that take part have changed since the frame was filled
    bool apart = false;  // inputs are never sent: they overlap outputs in the image, or another thread sends the frame
    bool overlapped = false;  // of a cycle that one thread may send and another receive, see link/overlap.cpp
    bool refused = false;     // overlapped frames only: the NIC has not accepted it
    bool parked = false;      // the reply is in `bytes`
    bool no_time = false;     // the parked reply has the time that was sent, so the reference clock has not answered
    // Whether the reply is parked: never, always, or (any other value) unless the group with this value is being
    // received.
    static constexpr std::uint16_t kNever = 0;
    static constexpr std::uint16_t kAlways = 1;
    std::uint16_t park = kNever;
    std::uint16_t size = wire::kFramePrefixBytes;  // octets without riders
    std::uint16_t last = 0;                        // offset of the last datagram, riders not counted
    std::uint16_t datagram_count = 0;              // readings included, riders not
    std::uint16_t wire_bytes = 0;                  // octets on the wire without riders, with padding and all overhead
    const FrameOwner* owner = nullptr;
    void* group = nullptr;
    FrameSlot own;
    std::array<std::byte, wire::kMaxFrameBytes> bytes{};  // the frame as it was sent last

    // Call it when `overlapped` is known; `hold`: replies are parked while the group with this number is not received.
    void set_park(bool hold, std::uint8_t number) {
        park = overlapped ? kAlways : hold ? static_cast<std::uint16_t>(kAlways + 1U + number) : kNever;
    }
    // A reply is parked until the group is received.
    [[nodiscard]] bool is_held() const { return parked && !overlapped; }
    // Call it when the accepted working counters of its datagrams have changed.
    void settle() {
        degraded = doubted;
        regrouped = true;
        for (const PreparedDatagram& d : datagrams) degraded |= d.status->accepted != d.status->full;
        settle_form();
    }
    // Call it when `degraded` or `parked` has changed.
    void settle_form() { plain = datagrams.size() == 1 && readings.empty() && !degraded && !parked; }
};

// PreparedReading::changes of a frame that is neither on the wire nor parked.
void change_time(PreparedFrame& frame, PreparedReading& reading);

}  // namespace margay
