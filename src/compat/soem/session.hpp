// One master behind the functions of a SOEM interface: the source (interface or simulated segment), the context, and
// the lock for programs that call the functions from several threads. Without the types of a version of the interface.
#pragma once

#include "compat/soem/priority_lock.hpp"

#include "source/source.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace margay::soem {

class Inbox;

// Prints a sentence to standard error.
void say(const std::string& text);
// Prints each sentence only once.
void say_once(const std::string& text);

class Session {
  public:
    // nullptr: the session was not opened, and the reason was printed.
    static std::unique_ptr<Session> open(const std::string& source, const Limits& limits);
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // The lock of the context. The thread that has it is the owner of the context; no thread keeps it while it
    // waits, except for the frames of a cycle.
    class Guard {
      public:
        explicit Guard(Session& session) : session_(session) {
            session.lock_->lock();
            session.be_owner();
        }
        ~Guard() { session_.lock_->unlock(); }
        Guard(const Guard&) = delete;
        Guard& operator=(const Guard&) = delete;

      private:
        Session& session_;
    };

    // For a thread that has the lock.
    void be_owner() {
        if (owner_ != calling_thread()) [[unlikely]]
            change_owner();
    }
    [[nodiscard]] Context& context() { return context_; }
    [[nodiscard]] const Slave& slave(std::size_t number) { return context_.slave(number); }

    [[nodiscard]] Time now() { return source_->osal().now(); }
    [[nodiscard]] bool virtual_time() const { return source_->virtual_time(); }
    // Another thread closes the master: no frame is sent any more, and all calls end.
    [[nodiscard]] bool closing() const { return closing_.load(std::memory_order_relaxed); }
    [[nodiscard]] bool redundant() const { return source_->second() != nullptr; }

    // Work of the calling thread between two polls of a request, without the lock.
    class Between {
      public:
        virtual void run() = 0;

      protected:
        ~Between() = default;
    };
    // Submits a request and polls until it is over. Other threads continue meanwhile. If the request is not complete
    // after `limit`, it is cancelled. Replies that have arrived by then count, even if this thread runs late. Zero: no
    // limit.
    Result<> run(Request& request, Between* between = nullptr, Duration limit = Duration{0});
    // A frame that the program has built: its datagrams, on the wire together.
    struct Flight {
        std::vector<std::byte> octets;  // the datagrams with their headers
        std::deque<DatagramRequest> datagrams;
        [[nodiscard]] bool over() const {
            return std::ranges::none_of(datagrams, [](const DatagramRequest& one) { return one.busy(); });
        }
    };
    // A call that sends the frame, or waits for it. When two threads of the program use the same index at the same
    // time, the call of one of them is refused.
    class FlightUse {
      public:
        FlightUse(Session& session, std::size_t index)
            : flag_(session.flights_used_[index % kFlights]), alone_(!flag_.test_and_set(std::memory_order_acquire)) {}
        ~FlightUse() {
            if (alone_) flag_.clear(std::memory_order_release);
        }
        FlightUse(const FlightUse&) = delete;
        FlightUse& operator=(const FlightUse&) = delete;
        [[nodiscard]] bool alone() const { return alone_; }

      private:
        std::atomic_flag& flag_;
        bool alone_;
    };
    // Waits for a point of time, or until the flight is over. All requests go on meanwhile.
    void pause_until(Time until, const Flight* flight = nullptr);
    void pause(Duration duration) { pause_until(now() + duration); }
    // Executes the work that is due, and does not wait.
    void poll_now();
    // Must be called after a cycle without inputs, because it is not known which slave is missing. Starts to read the
    // states of all slaves and does not wait; the reading continues in the next calls. After it, the inputs of the
    // other slaves are fresh.
    void find_missing(const Error& of_cycle);

    // One datagram. Returns the working counter, or -1 when no frame came back within `timeout`.
    int exchange(DatagramCommand command, std::uint32_t address, std::span<std::byte> data, Duration timeout,
                 bool again = true);

    // The number of slaves that a frame passes; -1: no frame returns within EC_TIMEOUTRET3, the timeout of the
    // interface. The library would wait longer.
    [[nodiscard]] int answers(Duration timeout = std::chrono::milliseconds(6));
    [[nodiscard]] bool is_answered(Duration timeout = std::chrono::milliseconds(6)) { return answers(timeout) >= 0; }

    // Slaves that ecx_recover_slave() searches. When such a slave is present again, the library may have cleared its
    // FMMUs, because another device may have been at its place. In SAFEOP or OP the slave then has no process data.
    // settle_lost() takes such a slave to INIT, from where the program configures it again; `asked`: one slave, or 0
    // for all. False: one of these slaves has not reached INIT yet.
    void note_lost(const std::vector<std::uint16_t>& slaves);
    bool settle_lost(std::uint16_t asked);
    // Removes the slave from the list of lost slaves, because it is configured again; 0: removes all, because a scan
    // begins.
    void forget_lost(std::uint16_t asked);

    static constexpr std::size_t kFlights = 16;
    // The flight of a frame index of the program.
    [[nodiscard]] Flight& flight_of(std::size_t index) { return flights_[index % kFlights]; }
    // Sends the datagrams at once, and does not wait. False: there is no room for them.
    bool launch(Flight& flight);
    // Cancels the datagrams that are still on the wire.
    void land(Flight& flight);
    // Waits until all datagrams have returned or are lost, or until `until`.
    void await(const Flight& flight, Time until) { pause_until(until, &flight); }

    // Whether no frame can be sent.
    [[nodiscard]] bool link_is_down();

    // Data of the facade about a group, and about the SyncManagers that it has shown to the program. A cycle reads only
    // these data, so that it must save only one register of the processor across a call of the library.
    static constexpr RegisterReading kNoTime{};
    static constexpr DatagramStatus kNothingWritten{};
    static constexpr std::uint8_t kNotBlocked = 0;
    static constexpr std::uint8_t kEmpty = 1;  // block_lrw of an empty group, so that a cycle needs no other check
    struct alignas(64) GroupFacts {
        Context* context = nullptr;
        const RegisterReading* time = &kNoTime;        // time of the reference clock; kNoTime until the first mapping
        std::int64_t* shown_time = nullptr;            // where the program reads it; set by the first mapping
        const std::uint8_t* block_lrw = &kNotBlocked;  // where the program writes it; set by the first mapping
        Session* session = nullptr;
        PriorityLock* lock = nullptr;  // of the session
        // The first datagrams of a cycle that write: their working counter counts twice. If there is at most one, the
        // usual cycle need not read their number.
        const DatagramStatus* written = &kNothingWritten;
        int timeout_us = 0;  // timeout of the call that receives
        std::uint8_t group = 0;
        std::uint8_t blocked = 0;       // the value that the frames are planned for
        bool empty = false;             // mapped without process data
        std::uint8_t more_written = 0;  // number of datagrams behind `written`

        void set_written(std::span<const DatagramStatus> datagrams) {
            constexpr std::size_t kMost = 255;
            written = datagrams.empty() ? &kNothingWritten : datagrams.data();
            more_written = datagrams.empty() ? 0 : static_cast<std::uint8_t>(std::min(datagrams.size() - 1, kMost));
        }
    };
    static_assert(sizeof(GroupFacts) == 64);  // a line of the cache, and a shift finds the one of a group
    using ShownSyncManagers = std::array<std::byte, 64>;
    // The data of any group, also of a group that is not mapped.
    [[nodiscard]] GroupFacts& facts(std::uint8_t group) { return facts_[group]; }
    [[nodiscard]] bool known_group(std::uint8_t group) const { return facts_[group].time != &kNoTime; }
    [[nodiscard]] ShownSyncManagers& shown(std::size_t slave) { return shown_[slave < shown_.size() ? slave : 0]; }

    // A recursive lock, because hooks make calls that need the lock again.
    using LongLock = std::unique_lock<RecursivePriorityLock>;
    // Locked while a call uses the EEPROM of a slave or the data from it, and while a call configures slaves. It is not
    // locked while hooks run, because a hook may wait for another thread that uses an EEPROM.
    [[nodiscard]] LongLock lock_eeproms() { return LongLock(eeprom_lock_); }
    // Locked while a call searches or configures slaves or their clocks, also while hooks run. A thread locks it before
    // the lock of the EEPROMs.
    [[nodiscard]] LongLock lock_configuring() { return LongLock(configuring_lock_); }
    // The thread that executes hooks of the program. Only one thread at a time does, because it has the lock above.
    void begin_hook() { hook_thread_.store(PriorityLock::thread(), std::memory_order_relaxed); }
    void end_hook() { hook_thread_.store(0, std::memory_order_relaxed); }
    [[nodiscard]] bool in_hook() const {
        return hook_thread_.load(std::memory_order_relaxed) == PriorityLock::thread();
    }
    // The words that a thread reads in two calls, by the address of the slave. Use it with the lock.
    using Half = std::pair<std::thread::id, std::uint16_t>;
    [[nodiscard]] std::map<Half, std::uint16_t>& half_readings() { return half_readings_; }

    // Mail that no request waits for. The library looks for it while a call waits for it (begin_watch() to
    // end_watch()), and always once the program handles mail by ecx_mbxhandler().
    [[nodiscard]] Inbox& inbox() { return *inbox_; }
    void begin_watch();
    void end_watch();
    void watch_always();

  private:
    friend class Sessions;
    Session(std::unique_ptr<hosted::Source> source, const Limits& limits);
    // A value that identifies the calling thread.
    static std::uintptr_t calling_thread() {
#if defined(__x86_64__) || defined(__aarch64__)
        return reinterpret_cast<std::uintptr_t>(__builtin_thread_pointer());
#else
        return PriorityLock::thread();
#endif
    }
    void change_owner();
    Result<> run_once(Request& request, Between* between, Duration limit);
    Time poll_once(Request* request, Time until, bool& over);
    std::vector<std::uint16_t> back_of_lost(std::uint16_t asked);
    std::optional<bool> is_mapped(std::uint16_t number);
    void watch(unsigned watchers);

    // One sending of the datagram of exchange(). Each sending has its own data, because two replies may arrive in one
    // poll, and the second may come from no slave.
    struct Sending {
        std::vector<std::byte> data;
        DatagramRequest request;
    };
    static constexpr std::size_t kMostSendings = 10;  // whose replies are awaited at the same time
    bool begin(Sending& sending, DatagramCommand command, std::uint32_t address, std::span<const std::byte> data,
               bool again);
    const Sending* await_one(std::span<const Sending> sendings, Time until);
    void wait_for_work(Time until);

    PriorityLock* lock_ = nullptr;      // of the place in Sessions
    std::atomic<bool> closing_{false};  // requests end, because a thread closes the session
    std::uintptr_t owner_ = 0;          // the thread that owns the context; 0: not known
    std::unique_ptr<hosted::Source> source_;
    std::array<Flight, kFlights> flights_;
    ReadStateRequest states_;  // of find_missing()
    Time states_at_{};         // earliest time of the next reading
    HostContext context_;
    std::unique_ptr<Inbox> inbox_;
    std::set<std::uint16_t> lost_;  // with the lock of the session
    unsigned watchers_ = 0;         // with the lock of the session: the calls that wait for mail, and the handler
    bool handles_mail_ = false;
    RecursivePriorityLock eeprom_lock_;
    RecursivePriorityLock configuring_lock_;
    std::atomic<std::uint32_t> hook_thread_{0};
    std::map<Half, std::uint16_t> half_readings_;
    std::array<GroupFacts, 256> facts_;
    std::vector<ShownSyncManagers> shown_;
    std::array<std::atomic_flag, kFlights> flights_used_{};  // set by a call, see FlightUse
};

// ADP and ADO as one address of Session::exchange().
[[nodiscard]] constexpr std::uint32_t address_of(std::uint16_t adp, std::uint16_t ado) {
    return std::uint32_t{ado} << 16 | adp;
}

// The open sessions. A port of the application remembers its place here; a port that was never opened has any number in
// its memory, therefore the owner is compared. A thread may close a session while other threads are in a call: the
// requests of these calls are cancelled, and the session ends when the last of them has returned. The places have no
// destructor: threads may run while the process ends.
class Sessions {
    struct Place;

  public:
    static constexpr int kMost = 64;
    static int add(std::unique_ptr<Session> session, const void* owner);
    static void remove(int place, const void* owner);

    // A session that exists as long as this object.
    class Pinned {
      public:
        Pinned(int place, const void* owner);
        ~Pinned() {
            if (session_ != nullptr) leave(*place_);
        }
        Pinned(const Pinned&) = delete;
        Pinned& operator=(const Pinned&) = delete;
        [[nodiscard]] explicit operator bool() const { return session_ != nullptr; }
        [[nodiscard]] bool operator==(std::nullptr_t) const { return session_ == nullptr; }
        [[nodiscard]] Session* operator->() const { return session_; }
        [[nodiscard]] Session& operator*() const { return *session_; }

      private:
        Place* place_ = nullptr;
        Session* session_ = nullptr;
    };

    // Calls Work::run() for a group of the session, under its lock: the lock keeps the session. The calling thread may
    // not be the owner of the context. Returns Work::kNone when there is no session. Neither the library nor
    // Work::run() throws.
    template <class Work, class... Arguments>
    [[gnu::always_inline]] static int with_lock(int place, const void* owner, std::size_t group,
                                                Arguments... arguments) {
        if (!__builtin_constant_p(group)) asm("" : "+r"(group));  // a register has it as 64 bits, once
        // Any number in a port that was never opened leads to some place, whose owner is another one.
        Place& found = places_[static_cast<unsigned>(place) / sizeof(Place) % kMost];
        const std::uint32_t me = PriorityLock::known_thread();
        if (!found.lock.try_lock(me)) [[unlikely]]
            return in_any_case<Work, Arguments...>(group, arguments..., found, false, owner);
        if (found.owner.load(std::memory_order_relaxed) != owner) [[unlikely]]
            return in_any_case<Work, Arguments...>(group, arguments..., found, true, owner);
        Session::GroupFacts* facts = found.facts + group;
        asm("" : "+r"(facts));  // one register holds it, instead of three of which the compiler makes it again
        const int result = Work::run(*facts, arguments...);
        PriorityLock& lock = *facts->lock;  // that of the place: no register has to keep it
        if (!lock.try_unlock(me)) [[unlikely]]
            return pass_on(lock, result);
        return result;
    }

    // Sleeps in the time of the open sessions: simulated segments in virtual time get it, otherwise the system.
    static int sleep(std::uint32_t microseconds);

  private:
    // The number of a place is its distance from the first one, in octets: a cycle finds it without a shift.
    struct alignas(64) Place {
        PriorityLock lock;
        std::atomic<const void*> owner{nullptr};  // changed under the lock
        Session::GroupFacts* facts = nullptr;     // of the session: the first group
        Session* session = nullptr;               // stays when the owner is gone and calls have pinned it
        std::atomic<unsigned> users{0};           // calls that have pinned the session
    };
    static std::size_t index_of(int number) { return static_cast<unsigned>(number) / sizeof(Place); }
    static int number_of(const Place& place) {
        return static_cast<int>(static_cast<std::size_t>(&place - places_.data()) * sizeof(Place));
    }
    static void end(Place& place);
    static void leave(Place& place);
    // What with_lock() does when there is more to do than two instructions that compare and exchange. A function of its
    // own, so that the usual way saves few registers.
    template <class Work, class... Arguments>
    [[gnu::noinline, gnu::cold]] static int in_any_case(std::size_t group, Arguments... arguments, Place& found,
                                                        bool locked, const void* owner) {
        if (!locked) found.lock.lock();
        int result = Work::kNone;
        if (found.owner.load(std::memory_order_relaxed) == owner) result = Work::run(found.facts[group], arguments...);
        found.lock.unlock();
        return result;
    }
    [[gnu::noinline, gnu::cold]] static int pass_on(PriorityLock& lock, int result) {
        lock.pass_on();
        return result;
    }
    static std::array<Place, kMost> places_;
};

}  // namespace margay::soem
