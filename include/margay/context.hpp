// The context: everything that one master knows, in memory that the caller gave.
#pragma once

#include <margay/emergency.hpp>
#include <margay/error_log.hpp>
#include <margay/event.hpp>
#include <margay/group.hpp>
#include <margay/limits.hpp>
#include <margay/link_settings.hpp>
#include <margay/result.hpp>
#include <margay/slave.hpp>
#include <margay/statistics.hpp>

#include <cstddef>
#include <span>

namespace margay {

class Nic;
class Osal;
struct Master;

// Octets of memory that a context with these limits needs.
[[nodiscard]] constexpr std::size_t context_bytes(const Limits& limits) {
    constexpr std::size_t kFixedBytes =
        16384;                               // the engine, the queue of requests, errors and events, one frame buffer
    constexpr std::size_t kFrameBytes = 64;  // a frame in flight
    // The coroutine frames of one slave being worked on, and a mailbox of 1 KiB; half of it where pointers are half as
    // long.
    constexpr std::size_t kTaskBytes = 1024 * sizeof(void*);
    const std::size_t tasks = limits.tasks == 0 || limits.tasks > limits.slaves ? limits.slaves : limits.tasks;
    const std::size_t arena = (tasks + 4) * kTaskBytes;
    constexpr std::size_t kGroupBytes = 416;
    constexpr std::size_t kProcessFrameBytes = 2048;  // with its datagrams
    constexpr std::size_t kMailboxBytes = 768;        // the mailbox channel of a slave
    constexpr std::size_t kRingBytes = 32;            // a place in the ring; 16 of them for strangers
    constexpr std::size_t kMarksBytes = 8;            // what the library remembers of a slave
    const std::size_t slave =
        kRingBytes + kMarksBytes + sizeof(Slave) + kMailboxBytes + limits.emergencies * sizeof(Emergency);
    return kFixedBytes + limits.slaves * slave + limits.frames * kFrameBytes + limits.groups * kGroupBytes +
           limits.process_frames * kProcessFrameBytes + arena + arena / 64 + 16 * kRingBytes + 256;
}

// One master. Not copyable; one thread owns it and calls everything, unless a function says otherwise.
class Context {
  public:
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

    // The slaves of the last config_init(), in the order of their numbers (expected.hpp).
    [[nodiscard]] std::span<const Slave> slaves();
    // Slave number `position`, 1 the first. For a position where there is none, 0 included: a slave whose position is
    // 0, and whose image has no bits. Its image octets read as zero, and what is written to them is dropped.
    [[nodiscard]] const Slave& slave(std::size_t position);

    // A group of process data, from 0. For a number where there is none: one that is never mapped.
    [[nodiscard]] Group& group(std::size_t number);

    // Before init() these four are empty and all counters are zero: ask for them again afterwards. Only a callback of
    // events() that was set before init() stays.
    //
    // What has gone wrong, oldest first; the oldest 64 errors stay until they are taken. May be read by one other
    // thread.
    [[nodiscard]] ErrorLog& errors();
    // What is odd though nothing has failed (see is_warning()), in a ring of its own as large: warnings take no room of
    // errors. May be read by one other thread.
    [[nodiscard]] ErrorLog& warnings();
    // What the supervision has seen, oldest first. May be read by one other thread.
    [[nodiscard]] EventQueue& events();
    [[nodiscard]] const LinkStatistics& statistics() const;

    // Times and tries of the link. What is set before init() holds from init() on. For the thread that polls.
    [[nodiscard]] LinkSettings& link_settings();

    // Of the arena that running operations live in: most octets ever used, and how many there are. Zero before init().
    [[nodiscard]] std::size_t arena_peak_bytes() const;
    [[nodiscard]] std::size_t arena_bytes() const;

    [[nodiscard]] const Limits& limits() const { return limits_; }

  protected:
    Context(std::span<std::byte> memory, const Limits& limits) : memory_(memory), limits_(limits) {}
    ~Context() = default;
    // To be called by the destructor of whoever owns the memory. Busy requests end as canceled.
    void close();

  private:
    friend struct ContextAccess;
    std::span<std::byte> memory_;
    Limits limits_;
    Master* master_ = nullptr;  // in memory_, once init() was called
    Slave none_;
    // What there is before init().
    LinkSettings early_settings_;
    ErrorLog no_errors_;
    EventQueue no_events_;
    EmergencyRing no_emergencies_;
    Group no_group_;
};

// A context whose memory is part of it: put it in .bss on a system without a heap.
//
//     static margay::StaticContext<margay::Limits{.slaves = 16}> ctx;
template <Limits L>
class StaticContext : public Context {
  public:
    StaticContext() : Context(bytes_, L) {}
    ~StaticContext() { close(); }

  private:
    alignas(std::max_align_t) std::byte bytes_[context_bytes(L)];
};

}  // namespace margay
