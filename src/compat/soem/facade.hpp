// The common declarations of both versions of the interface. The sources of this folder that include this header are
// compiled once for each version, with the header soem_version.hpp of that version.
#pragma once

#include <soem_version.hpp>
#include "compat/soem/session.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <deque>

namespace margay::soem {

using Pinned = Sessions::Pinned;

// The place of a port in Sessions. Another thread may open and close the port at the same time.
[[nodiscard]] inline std::atomic_ref<int> place_of(ecx_portt& port) {
    return std::atomic_ref<int>(port.margay_session);
}
// The status of a frame index. Threads reserve indexes at the same time, also those of a port that is not open.
[[nodiscard]] inline std::atomic_ref<int> status_of(ecx_portt& port, int index) {
    return std::atomic_ref<int>(port.rxbufstat[index]);
}
[[nodiscard]] inline Pinned session_of(ecx_portt& port) {
    return Pinned(place_of(port).load(std::memory_order_relaxed), &port);
}
[[nodiscard]] inline Pinned session_of(ecx_contextt& context) { return session_of(port_of(context)); }
[[nodiscard]] inline Pinned session_of(ecx_contextt* context) { return session_of(port_of(*context)); }

[[nodiscard]] inline Duration us(int timeout) { return std::chrono::microseconds(std::max(timeout, 0)); }
// The time for a whole mailbox service: the timeout of one reply plus the time to send the request.
[[nodiscard]] inline Duration mail_time(int timeout) { return us(timeout) + std::chrono::microseconds(EC_TIMEOUTTXM); }

// A hook of the program. One thread may set it while another thread calls it.
template <class Hook>
[[nodiscard]] std::atomic_ref<Hook> hook_at(Hook& hook) {
    return std::atomic_ref<Hook>(hook);
}

// A scan writes the number of slaves and what it has found of them with the lock of the EEPROMs. A thread that has this
// lock can read all of it. Most of these data are written with the lock of the session too, so a thread that has only
// this lock can read them, except Itype, eep_8byte and eep_pdi. These functions are for a thread without any of these
// locks.
[[nodiscard]] inline int slaves_found(ecx_contextt& context, Session& session) {
    const Session::Guard guard(session);
    return slave_count(context);
}
// The slave exists: a number from 1 to the number of slaves.
[[nodiscard]] inline bool is_slave(ecx_contextt& context, Session& session, int number) {
    return number >= 1 && number < most_slaves(context) && number <= slaves_found(context, session);
}
template <class Value>
[[nodiscard]] Value value_of(ecx_contextt& context, Session& session, std::uint16_t number, Value ec_slavet::*field) {
    const Session::Guard guard(session);
    return slaves_of(context)[number].*field;
}

[[nodiscard]] inline std::span<std::byte> octets_at(void* data, std::size_t size) {
    return {static_cast<std::byte*>(data), size};
}
[[nodiscard]] inline std::span<const std::byte> octets_at(const void* data, std::size_t size) {
    return {static_cast<const std::byte*>(data), size};
}

// Converts between the octet order of the wire and that of the host.
inline std::uint16_t word_at(const std::byte* from) {
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(from[0]) | std::to_integer<unsigned>(from[1]) << 8);
}
inline void put_word(std::byte* to, unsigned value) {
    to[0] = static_cast<std::byte>(value);
    to[1] = static_cast<std::byte>(value >> 8);
}

// The AL status in the format of the interface: the state, plus 0x10 for an error.
[[nodiscard]] inline std::uint16_t raw_state(const AlStatus& status) {
    return static_cast<std::uint16_t>(static_cast<unsigned>(status.state) | (status.error ? 0x10U : 0U));
}

// Registers of a slave by its station address; return the working counter, or -1.
int read_registers(Session& session, std::uint16_t station, std::uint16_t address, std::span<std::byte> data,
                   Duration timeout);
int write_registers(Session& session, std::uint16_t station, std::uint16_t address, std::span<const std::byte> data,
                    Duration timeout);

// Adds the error of a mailbox service to the list of the program, and what push_unasked() adds. Returns what the
// service returns.
int mail_result(ecx_contextt& context, std::uint16_t slave, const Error& error, std::uint16_t index,
                std::uint8_t subindex);
// Adds the emergencies of the slave, and its mailbox errors that belong to no request of the library.
void push_unasked(ecx_contextt& context, std::uint16_t slave);
// Adds an entry whose time is now.
void push(ecx_contextt& context, ec_errort& entry);

// Finds the slaves: the result of config_init().
int config_init(ecx_contextt& context);
// Maps a group: the result of config_map_group(). `bytes`: each slave begins on an octet.
int config_map(ecx_contextt& context, void* image, std::uint8_t group, bool overlapped, bool bytes);

// The datagrams of a group that only write. They are the first datagrams, and their working counters count twice.
struct Writing {
    std::span<const DatagramStatus> datagrams{};
    unsigned wkc = 0;  // if all slaves take part
};
Writing writing_datagrams(Session& session, std::uint8_t group);

// Copies the state of a slave from the library.
void copy_state(ecx_contextt& context, Session& session, std::uint16_t number);

// Uses the mailboxes that the program has written as the mailboxes of this state, PREOP or BOOT.
void take_mailboxes(ecx_contextt& context, Session& session, std::uint16_t number, AlState state);
// Uses the SyncManagers that the program has changed as the configuration of the slave.
void take_sync_managers(ecx_contextt& context, Session& session, std::uint16_t number);
// Fills the slave from its process data: sizes, pointers, SyncManagers, FMMUs.
void fill_process_data(ecx_contextt& context, Session& session, std::uint16_t number, std::uint8_t group,
                       std::uint8_t* image);

// Calls the hooks of slaves between two polls of a request, because a hook waits.
class HookCaller final : public Session::Between {
  public:
    HookCaller(ecx_contextt& context, Session& session, bool with_context)
        : configuring_(session.lock_configuring()),
          eeproms_(session.lock_eeproms()),
          context_(context),
          session_(session),
          with_context_(with_context) {}
    ~HookCaller();
    // For a function that waits until no slave is being configured. In a hook of this thread the function would wait
    // for itself: is_refused() then prints a message and returns true.
    static bool is_refused(const Session& session, const char* function);
    // Makes the library wait in PREOP until the hooks of the slave have been called.
    void attach(std::uint16_t number);
    // The hooks have been called: from now on the library does not wait in PREOP.
    void rest();
    void run() override;

  private:
    struct Call {
        HookCaller* caller = nullptr;
        std::uint16_t number = 0;
        std::atomic<bool> wanted{false};
        std::atomic<bool> done{false};
    };
    static Task<> wait_for_call(HookedSlave slave, void* user);

    Session::LongLock configuring_;  // the hook of a slave belongs to one caller
    Session::LongLock eeproms_;
    ecx_contextt& context_;
    Session& session_;
    bool with_context_;
    std::deque<Call> calls_;
};

}  // namespace margay::soem
