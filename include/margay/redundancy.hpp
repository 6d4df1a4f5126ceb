// A ring with two NICs: the first NIC is connected to the first slave, the second NIC to the last one.
//
//     margay::HostContext ctx({.redundancy = true});
//     margay::init_redundant(ctx, nic, second, osal);
//
// Everything else is as with one NIC. Each frame is sent by both NICs. While the ring is whole, each frame comes back
// at the other NIC, and every slave processes one of the two. When a cable breaks, each NIC gets its own frame back
// from the slaves at its end; the two replies are merged datagram by datagram, and their working counters are added. So
// no cycle lacks fresh inputs, except cycles whose frames were on the broken cable. While a slave is missing or
// exchanges no process data (its target is below SAFEOP, or BOOT), a break or a repair may cost up to five cycles, more
// with overlapping cycles: working counters that are equal by coincidence are not believed (margay.hpp). It costs up to
// 20 cycles while the library compares the identities of slaves that come back together, and one of them does not
// answer. A whole ring needs the frame of the NIC at the beginning: if this NIC does not accept it for once (busy), no
// slave processes the frame of the other NIC, and the cycle is lost as with one NIC.
//
// Frames pass the ports of a slave in the order 0, 3, 1, 2. A branch at a port that frames pass before the port of the
// next ring slave is numbered as without redundancy. Other branches are numbered after all ring slaves. While the ring
// is broken, config_init() numbers such branches of the first NIC's part after the slaves of this part, and such
// branches behind the break before the slaves there. Hot connect groups may appear at any port of either part.
//
// Distributed clocks: configdc() measures the delays while the ring is whole. For some milliseconds it closes the
// port of the last slave to the second NIC (ESC register 0x0101, temporary), because the frames must return by the
// way they came; all frames are sent by one NIC meanwhile. If a cable breaks in this time, configdc() ends with an
// error, and the slaves behind the break answer no frame for about a second, until the timer of the chip opens the
// port: a config_init() in this second finds fewer slaves, which only expect() shows. In a ring that is broken
// between slaves, each part is measured by the frames of its own NIC, and the clocks behind the break follow a
// second reference from the start. Both parts then differ by the difference of the times that the two NICs need
// until a frame is on the cable: microseconds on a PC. When the ring is whole again, the SuperviseRequest measures
// the delays again, and all clocks approach the reference clock without a step. Delays that were measured in the
// whole ring are not measured again while it is broken.
//
// When a cable breaks, the clocks behind the break follow the first clock there (EventKind::second_reference). A
// SuperviseRequest compares this clock with the reference clock by the two copies of each frame, and steers its
// offset, so that both parts keep in step; see SlaveClock::in_sync. When the ring is whole again, all clocks
// follow the reference clock. Group::dc_time always has the time of the reference clock; its `slaves` counts only the
// slaves on the same side of the break as the reference clock.
//
// If the slave with the second reference clock was away before the break (it had no power, or was between two breaks),
// both parts were not in step when the comparison began. Then the library measures the ways of both copies, and "in
// sync" leaves out the times that both NICs need, as in a ring that is broken from the start.
//
// In a ring without the branches of the next paragraph, a clock behind the break that had no power learns the rate of
// the reference clock before it becomes the second reference clock. Until then, for 200 watch_intervals at most, the
// present second reference clock is kept. If there is none, the master writes the time to the clock, up to four times
// for 0.3 s; meanwhile no clock behind the break is in sync. If the interval of the cycles varies too much (measured: 5
// µs are no obstacle, 20 µs often are), the clock keeps its own rate. If its oscillator then differs much (by more than
// 40 ppm with the default settings), one correction in each watch_interval is not enough for the limit: the clocks of
// its part are not in sync until the ring is whole.
//
// Some branches are reached only by the frames of the second NIC while the ring is whole: branches at a port that
// frames pass after the port of the next ring slave. The clocks at these branches follow a second reference clock too,
// the first of these clocks. So `second_reference` is never 0 in the whole ring then.
//
// The delays of these clocks change with each break and each repair. Until the SuperviseRequest has written the new
// delays (some rounds of its clock supervision), the frames bring no clock a time (Group::dc_time has 1 slave). The
// frames that were on the wire at the break (one, or with overlapping cycles several) still bring the time with the
// delays of the old way; after these frames, clocks may differ from the reference clock by up to some microseconds for
// some tenths of a second. So these clocks are not in sync from the next poll() on until they were compared again.
// Until the library knows where the ring is broken, only the reference clock is in sync.
//
// In a ring with such branches, the library does not measure the ways of both copies, and teaches no rate behind a
// break. If the second reference clock behind a break had no power, or was disturbed by a time that the master has
// sent, the clocks behind the break are not in sync until the ring is whole, unless the library knows the difference of
// both copies from an earlier break of the same cable. A reference clock behind a break stays the reference until the
// ring is whole, although a clock before it is back; the clocks at the other side of the break are not in sync
// meanwhile. For a break beside a slave without receive times, the library uses the delays of the nearest slave with
// receive times. They may be wrong by the propagation delay between both slaves. If configdc() is called while the ring
// is broken between slaves, the clocks at these branches follow the second reference clock as soon as the ring is
// whole.
//
// When the first of these slaves returns from a loss of power, the library closes the port of the last slave again, for
// up to two seconds in all, until the clocks at these branches have learned the rate. After a repair it does so if the
// difference of these clocks is not known, or if they need corrections of more than limit_ns in each watch_interval;
// and once more, some seconds later, if a clock was too far away to learn the rate. A break in this time cuts off the
// slaves behind the break for about a second, until the timer of the chip opens the port again. No NIC can open the
// port earlier, because the frames of the second NIC end at it. The library compares no clock in this time: it reports
// a clock that leaves the limit when the port is open again (measured: 1.1 s late with cycles of 1 ms).
//
// Either NIC may be at the beginning of the ring, and the cables of both NICs may be swapped while the machine runs
// (RedundancyStatus::swapped, EventKind::cables_swapped). If some branches are reached only by frames from the end of
// the ring, the frames do not show which NIC is at the beginning. Then config_init() and each search for lost slaves
// find it out by the ports of the slaves (DL status).
//
// Datagrams with addresses by position (auto increment) reach the slave of that position in either part; if the ring
// has changed meanwhile, they are sent again. If a break has moved to another cable, or a slave was inserted, since the
// last frame that counts slaves, a write may reach a wrong slave: then its reply has working counter 0, which is an
// error. A slave that gets the temporary address of a search in this way is started again.
//
// When another segment is behind the second NIC (CablingFault::second_segment, EventKind::second_segment), its slaves
// get no commands. If the second NIC is plugged into another segment while the master runs, the library knows this
// after eight frames: the slaves of the other segment process these frames, and slaves of the own segment with the same
// addresses may be regarded as lost. With each 64th frame the second NIC sends a frame without commands (NOP); when
// this frame comes back as in a ring, the cable is right again.
//
// When a frame of one NIC is lost and the frame of the other NIC comes back, the NIC of the lost frame sends six frames
// with a NOP behind its next frame. If none of these frames comes back, the cable of this NIC is broken, although the
// NIC may report a link. Then the library waits for no frame of this NIC until a frame of this NIC has come back. So a
// single lost frame costs only its own cycle (more while a slave is missing or exchanges no process data, see
// receive_processdata()), and the library regards no slave as lost because of it.
//
// If the second NIC of a whole ring sends, and receives nothing although its link is up, all inputs stay old: they are
// in the frames of the first NIC, which end at the second NIC. The event "no frame comes back from the segment" does
// not name the NIC. RedundancyStatus::cables does: `received` of the second NIC and `lost` of the first NIC show it.
#pragma once

#include <margay/context.hpp>
#include <margay/error.hpp>
#include <margay/features.hpp>
#include <margay/result.hpp>

#include <array>
#include <cstdint>

namespace margay {

class Nic;
class Osal;
enum class LinkState : std::uint8_t;

// init() for a ring with two NICs. `nic`, `second` and `osal` must outlive the context. A NIC without a link is no
// error: an event reports it. Further errors: invalid_argument (Argument::second_nic: both are the same object),
// capacity (Limits::redundancy is false).
Result<> init_redundant(Context& ctx, Nic& nic, Nic& second, Osal& osal, const Features& features = kAllFeatures);

// The state of one NIC and its cable. The counters only grow.
struct CableStatus {
    LinkState link{};          // of the NIC, at the time of the call
    std::uint16_t slaves = 0;  // slaves that have processed the last frame with an address by position or broadcast
    std::uint32_t sent = 0;
    std::uint32_t refused = 0;   // frames that the NIC did not accept
    std::uint32_t received = 0;  // frames of both NICs that came back at this NIC
    std::uint32_t lost = 0;      // frames of this NIC that did not come back in time
    std::uint32_t late = 0;      // frames that came back at this NIC too late
};

enum class RingState : std::uint8_t { unknown, whole, broken };

struct RedundancyStatus {
    bool redundant = false;  // init_redundant() was called
    RingState ring = RingState::unknown;
    CablingFault fault = CablingFault::none;
    bool swapped = false;      // the first NIC is at the end of the ring: positions count from the second NIC
    std::uint32_t breaks = 0;  // how often the ring was broken, and closed
    std::uint32_t heals = 0;
    std::uint32_t merged = 0;  // replies that consist of two frames
    // Frames with addresses by position that were sent again, because the ring changed while they were on the wire.
    std::uint32_t repeated = 0;
    std::array<CableStatus, 2> cables{};
    bool restoring_waits = false;  // for restore_ring(), see set_automatic_restoring()
    // The slave whose clock the clocks behind a break, or at branches that only the second NIC reaches, follow (0:
    // none), and how far this clock was ahead of the reference clock at the last comparison.
    std::uint16_t second_reference = 0;
    std::int64_t second_ahead_ns = 0;
};

// What the library does without a call of the application when a cable breaks and is repaired, while a SuperviseRequest
// is busy:
//
// - Slaves that were lost between two breaks, or have left their state meanwhile, are started again.
// - Delays that were measured while the ring was broken are measured again when it is whole (the last slave's port is
//   closed for some milliseconds, see above).
//
// Switched off (`on` false), both wait after each break and each repair until restore_ring() is called
// (RedundancyStatus::restoring_waits): events report lost and found slaves, and no slave is started, for any reason.
// Work that needs no start continues: process data is exchanged by both NICs, slaves that are in their state again
// take part, and clocks keep their reference and the delays of the way that the frames take now. Default: on. Switching
// on restores the ring at once if a restoring waits. For the thread that owns the context; callable from the cycle; no
// effect with one NIC.
void set_automatic_restoring(Context& ctx, bool on);

// Does the restoring that waits, once; without effect if none waits. For the thread that owns the context; callable
// from the cycle.
void restore_ring(Context& ctx);

// The state of the ring. For the thread that owns the context. Do not call it in every cycle: it reads the link state
// of both NICs, which needs two system calls on Linux.
[[nodiscard]] RedundancyStatus redundancy(Context& ctx);

}  // namespace margay
