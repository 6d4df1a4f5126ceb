// A function of the application that the library calls while it works on one slave. A hook has one of two forms.
//
// A plain function does its work at once and returns a Result. For example, it fills in the configuration of the slave.
// It must not wait: functions that wait return Errc::in_callback. (With another context they do wait, and stop the
// cycle.) It may return Errc::busy: then the library calls it again after a millisecond, for at most 10 seconds; after
// that, the hook has failed with Errc::timeout.
//
// A sequence is a coroutine that returns a Task. It may await all functions of HookedSlave: access to the mailbox and
// the registers of its slave. It does not stop the cycle or other slaves. (While a request for the whole segment waits
// for the end of the hook, the supervision helps other slaves only from time to time.) When the request that waits for
// a hook reaches its timeout, the hook ends: the error then has the step application_hook and names the slave. A hook
// that no request waits for (the supervision executes it, or it follows a state that writestate() has requested) may
// take any time while no request needs its slave, and 10 s otherwise; it ends when its slave is lost or leaves its
// state. When the library ends a hook, the hook does not continue after its current co_await; its local objects are
// destroyed.
//
//     margay::Result<> set_group(margay::HookedSlave slave, void*) { … }
//     margay::Task<> choose_mode(margay::HookedSlave slave, void*) {
//         auto written = co_await slave.sdo_write(0x6060, 0, std::int8_t{8});
//         if (!written) co_return written.error();
//         co_return {};  // success
//     }
//     ctx.slave(1).hooks.preop_to_safeop = choose_mode;
//
// A hook that adds SyncManagers to the configuration of its slave (SlaveConfiguration::add()) must first set
// SlaveConfiguration::sm_count to 0: when the slave comes back, the configuration still contains the SyncManagers that
// the hook added at the last start-up.
//
// poll() calls hooks of both forms, at the first start-up and when a slave comes back. An exception that leaves a hook
// ends the program.
#pragma once

#include <margay/result.hpp>
#include <margay/task.hpp>

#include <concepts>
#include <cstddef>

namespace margay {

class HookedSlave;

namespace detail {
// The code by which the library calls a hook. Only hooks refer to it, so a program without hooks does not contain this
// code.
struct HookKind;
extern const HookKind kPlainHook;
extern const HookKind kSequenceHook;
}  // namespace detail

template <class... Args>
class Hook {
  public:
    using Plain = Result<> (*)(HookedSlave slave, Args... args, void* user);
    using Sequence = Task<> (*)(HookedSlave slave, Args... args, void* user);

    constexpr Hook() = default;
    constexpr Hook(std::nullptr_t) {}
    template <class F>
    requires std::convertible_to<F, Plain>
    constexpr Hook(F function) : plain_(function), kind_(plain_ != nullptr ? &detail::kPlainHook : nullptr) {}
    template <class F>
    requires std::convertible_to<F, Sequence>
    constexpr Hook(F function) : sequence_(function), kind_(sequence_ != nullptr ? &detail::kSequenceHook : nullptr) {}

    [[nodiscard]] constexpr explicit operator bool() const { return kind_ != nullptr; }
    // nullptr: the hook has the other form, or there is none.
    [[nodiscard]] constexpr Plain plain() const { return kind_ == &detail::kPlainHook ? plain_ : nullptr; }
    [[nodiscard]] constexpr Sequence sequence() const { return kind_ == &detail::kSequenceHook ? sequence_ : nullptr; }
    // For the library. nullptr: there is no hook.
    [[nodiscard]] constexpr const detail::HookKind* kind() const { return kind_; }

  private:
    union {
        Plain plain_ = nullptr;
        Sequence sequence_;
    };
    const detail::HookKind* kind_ = nullptr;
};

}  // namespace margay
