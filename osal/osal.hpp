// The operating system as Margay needs it: a clock and a way to wait. Only the blocking wrappers and
// applications use it; nothing in src/ below them reads a clock.
//
// To port: derive from Osal and implement the two functions. now() must never go backwards and must count at a
// steady rate (not wall-clock time). wait() returns when `until` has come, or earlier when the NIC behind
// `nic_handle` has a frame, or earlier for no reason at all: the caller always looks again. A port that cannot wait on
// a NIC may cap the wait at its tick.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

class Osal {
  public:
    // The time now. Callable from any thread.
    [[nodiscard]] virtual Time now() noexcept = 0;

    // Waits until `until`, a frame at the NIC, or a wake(); `nic_handle` is what Nic::wait_handle() returned.
    virtual void wait(Time until, int nic_handle) noexcept = 0;

    // Ends a wait() of another thread. A port with one thread leaves it empty.
    virtual void wake() noexcept {}

    // Tells threads apart: the same number for the same thread, never 0 for one of several. A port with one thread
    // leaves it.
    [[nodiscard]] virtual std::uintptr_t calling_thread() noexcept { return 0; }

  protected:
    ~Osal() = default;
};

}  // namespace margay
