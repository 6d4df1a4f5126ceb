// Hooks of the program in PREOP. A hook may wait, but the library must not call a function that waits. Therefore the
// sequence of the slave is suspended until the thread that waits for the request has called the hook.
#include "compat/soem/facade.hpp"

namespace margay::soem {

HookCaller::~HookCaller() { rest(); }

bool HookCaller::is_refused(const Session& session, const char* function) {
    if (!session.in_hook()) return false;
    say_once(std::string(function) + "() is not possible in a hook: call it when the call that configures is over");
    return true;
}

void HookCaller::attach(std::uint16_t number) {
    const Session::Guard guard(session_);
    Call& call = calls_.emplace_back();
    call.caller = this;
    call.number = number;
    const Slave& slave = session_.slave(number);
    slave.hooks.preop_to_safeop = wait_for_call;
    slave.hooks.user = &call;
}

void HookCaller::rest() {
    const Session::Guard guard(session_);
    for (Call& call : calls_) session_.slave(call.number).hooks.preop_to_safeop = nullptr;
}

Task<> HookCaller::wait_for_call(HookedSlave slave, void* user) {
    Call& call = *static_cast<Call*>(user);
    call.done = false;
    call.wanted = true;
    while (!call.done) co_await completion(slave.sleep(std::chrono::milliseconds(1)));
    co_return Result<>();
}

void HookCaller::run() {
    for (Call& call : calls_) {
        if (!call.wanted.exchange(false)) continue;
        ec_slavet& slave = slaves_of(context_)[call.number];
        {
            const Session::Guard guard(session_);
            copy_state(context_, session_, call.number);
        }
        eeproms_.unlock();
        session_.begin_hook();
        before_hooks(context_, call.number);
        call_hooks(context_, call.number, with_context_);
        session_.end_hook();
        eeproms_.lock();
        bool changed = false;  // changed by the program; values that ecx_readPDOmap() has written do not count
        {
            const Session::Guard guard(session_);
            changed = std::memcmp(session_.shown(call.number).data(), slave.SM, sizeof(slave.SM)) != 0;
        }
        if (changed) take_sync_managers(context_, session_, call.number);
        call.done = true;
    }
}

}  // namespace margay::soem
