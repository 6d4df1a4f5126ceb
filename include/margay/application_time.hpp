// The reference clock in the time of the application, for programs that drive the clocks themselves with each cycle:
// the application states its time, writes it to the reference clock, sends the time of the reference clock to all other
// clocks, and reads the differences between the clocks. A new program needs none of this: MasterClock does the same
// with a controller, and the cycle carries the time of the reference clock (Group::dc_time). This header is for
// programs that were written for another master and call these functions themselves.
//
//     ApplicationTime time(ctx);
//     time.set(my_time_ns, osal.now());
//     configdc(ctx, {.system_time_at_zero = time.at_zero()});   // offsets and start times in the application's time
//     …
//     for (;;) {                                                // each cycle
//         receive_processdata(ctx, timeout);
//         poll(ctx, osal.now());                                // the results of the last cycle
//         time.set(my_time_ns, osal.now());
//         time.sync_reference_clock();
//         time.sync_slave_clocks();
//         time.queue_sync_monitor();
//         poll(ctx, osal.now());                                // the datagrams wait for the cycle now,
//         send_processdata(ctx);                                // and travel with it
//     }
#pragma once

#include <margay/context.hpp>
#include <margay/request.hpp>

#include <cstdint>

namespace margay {

// One datagram for the clocks. ApplicationTime uses it; a program may also submit it itself. It is sent once: when its
// frame is lost, the request ends with no_frame. Errors: no_clock (configdc() was not called, or has found no clock),
// missing_slave (the reference clock does not answer), no_frame, busy (see below).
//
// While a supervision runs, write_reference and distribute are not sent, and end with missing_slave, from the moment at
// which the slave with the reference clock is known to be lost until its clock is set again, or another slave has
// become the reference clock: distribute would bring all clocks a time that the master has predicted. distribute ends
// with missing_slave also when the last cycle has not brought the time of the reference clock. It is not sent either,
// and ends with busy, while the clock of a slave learns the rate in order to become the reference clock, and with
// no_frame while no frame comes back from the segment. A program repeats it with the next cycle.
struct ClockDatagramRequest : Request {
    enum class Action : std::uint8_t {
        write_reference,   // writes `time_ns` to the reference clock, which compares it with its own time (0x0910)
        distribute,        // reads the time of the reference clock, and writes it to all clocks behind
        read_differences,  // reads an upper estimate of the differences of all clocks (0x092C)
    };
    ClockDatagramRequest();
    Action action = Action::distribute;
    // write_reference: the time to write, valid at `at`; the library adds the time between `at` and the queueing of the
    // datagram. distribute: result, the time of the reference clock when the frame passed it, all 64 bits.
    std::uint64_t time_ns = 0;
    Time at = kNever;                 // in the time of the osal; kNever: nothing is added
    std::uint16_t slaves = 0;         // result of distribute: the reference clock, and the slaves that took its time
    std::uint32_t difference_ns = 0;  // result of read_differences
};

// For the thread that owns the context, which must outlive this object. All functions are callable from the cycle and
// never wait: their datagrams are sent from the next poll() on. Call poll() before send_processdata(), so that the
// datagrams travel with the cycle, and after receive_processdata(), so that they are over before the next ones. Do it
// always at the same point of the cycle: the time between set() and the passage of the frame is an error of the
// reference clock.
class ApplicationTime {
  public:
    explicit ApplicationTime(Context& ctx) : ctx_(ctx) {}

    // The time of the application, in ns since an origin of its choice, at `now` in the time of the osal.
    void set(std::uint64_t time_ns, Time now);
    // The time of the application minus the time of the osal, for ClockSettings::system_time_at_zero.
    [[nodiscard]] Duration at_zero() const { return at_zero_; }

    // The reference clock follows the time of the last set(): its time is written to register 0x0910 of the reference
    // clock, and the control loop of the chip follows. Errors: wrong_state (no set() yet), busy (the last datagram of
    // this kind is not back yet; it keeps its time), and the errors of submit().
    Result<> sync_reference_clock();
    // The same, with a time that is right when the datagram passes the reference clock.
    Result<> sync_reference_clock_to(std::uint64_t time_ns);
    // Sends the time of the reference clock to all clocks behind it. Not needed where a cycle carries the time.
    Result<> sync_slave_clocks();

    // The system time of the reference clock when the last sync_slave_clocks() passed it: its low 32 bits, or all 64
    // (continued by the library where the clock has 32). Errors: no_clock, and no_frame or wrong_state when the
    // datagram has not come back (yet).
    [[nodiscard]] Result<std::uint32_t> reference_clock_time() const;
    [[nodiscard]] Result<std::uint64_t> reference_clock_time64() const;

    // Reads an upper estimate of the differences between the reference clock and all other clocks, by one broadcast.
    Result<> queue_sync_monitor();
    // The result of queue_sync_monitor() in ns: less than twice the greatest difference. Errors: as
    // reference_clock_time().
    [[nodiscard]] Result<std::uint32_t> process_sync_monitor() const;

  private:
    Result<> send(ClockDatagramRequest& request, ClockDatagramRequest::Action action);

    Context& ctx_;
    Duration at_zero_{0};
    std::uint64_t time_ns_ = 0;
    Time set_at_ = kNever;
    ClockDatagramRequest write_;
    ClockDatagramRequest distribute_;
    ClockDatagramRequest monitor_;
};

}  // namespace margay
