// Frames that leave at a given time, for NICs that can hold a frame until then. The frames of a cycle then leave
// without the jitter of the wake-up, so that the phase of the outputs against SYNC0 does not depend on it: the cycle
// wakes up earlier than the frames leave, by more than its jitter (CycleSettings::send_lead).
//
//     PacketNic nic;
//     nic.open("eth1");
//     if (!nic.allow_send_at()) …;                    // nic.problem(): what the kernel or the qdisc lacks
//     run_cycle(ctx, {.period = 1ms, .send_at = &nic, .send_lead = 200us}, work);
//
// A program with its own loop calls send_processdata_at(). A NIC with this ability derives from Nic and from TimedSend,
// and returns its TimedSend by Nic::timing().
#pragma once

#include <margay/context.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstdint>

namespace margay {

class TimedSend {
  public:
    static constexpr Time kAtOnce = Time::min();

    // From now on, the first octet of each frame given to Nic::send() leaves at `at`, in the time of the Osal; further
    // frames with the same time follow at once. kAtOnce: the frames leave at once again. A frame with a time is "sent"
    // as soon as the NIC has accepted it. A frame whose time has passed already leaves at once, and is counted by
    // missed(). Frames that leave at once may overtake frames that wait. Never waits. For the thread that calls send().
    virtual void set_send_time(Time at) noexcept = 0;

    // How many frames did not leave at their time since the NIC was opened: they were given to the NIC too late and
    // left at once, or the system has dropped them because it was late itself. Never waits. For the thread that owns
    // the context.
    [[nodiscard]] virtual std::uint64_t missed() noexcept = 0;

  protected:
    ~TimedSend() = default;
};

// Both NICs of a ring (init_redundant()).
class TimedPair final : public TimedSend {
  public:
    // Both must outlive this object.
    TimedPair(TimedSend& first, TimedSend& second) noexcept : first_(first), second_(second) {}
    void set_send_time(Time at) noexcept override {
        first_.set_send_time(at);
        second_.set_send_time(at);
    }
    [[nodiscard]] std::uint64_t missed() noexcept override { return first_.missed() + second_.missed(); }

  private:
    TimedSend& first_;
    TimedSend& second_;
};

// As send_processdata(ctx, at, group), but the frames leave at `at`. `nic`: of the NIC, or of the filter, that the
// context sends by. Acyclic datagrams in frames of the cycle leave with them. The timeouts of receive_processdata() and
// of the datagrams count from `at`. If `at` has passed, the frames leave at once, and nic.missed() counts them.
// Callable from the cycle; never waits. For the thread that owns the context. Errors: as send_processdata(), and
// not_owner also where another thread may send the group (GroupConfiguration::cycles_in_flight).
Result<> send_processdata_at(Context& ctx, TimedSend& nic, Time at, std::uint8_t group = 0);

}  // namespace margay
