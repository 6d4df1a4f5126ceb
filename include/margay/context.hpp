// The context: everything that one master knows, in memory that the caller gave.
#pragma once

#include <margay/emergency.hpp>
#include <margay/error_log.hpp>
#include <margay/event.hpp>
#include <margay/group.hpp>
#include <margay/limits.hpp>
#include <margay/result.hpp>
#include <margay/slave.hpp>
#include <margay/statistics.hpp>

#include <cstddef>
#include <span>

namespace margay {

class Nic;
class Osal;
struct Network;

// Octets of memory that a context with these limits needs.
[[nodiscard]] constexpr std::size_t context_bytes(const Limits& limits) {
    constexpr std::size_t kFixedBytes = 16384;  // the engine, errors and events, one frame buffer
    constexpr std::size_t kFrameBytes = 64;     // a frame in flight
    // The coroutine frames of one slave being worked on, and a mailbox of 1 KiB; half of it where pointers are half as
    // long.
    constexpr std::size_t kTaskBytes = 1024 * sizeof(void*);
    const std::size_t tasks = limits.tasks == 0 || limits.tasks > limits.slaves ? limits.slaves : limits.tasks;
    const std::size_t arena = (tasks + 4) * kTaskBytes;
    constexpr std::size_t kGroupBytes = 416;
    constexpr std::size_t kProcessFrameBytes = 2048;  // with its datagrams
    constexpr std::size_t kMailboxBytes = 768;        // the mailbox channel of a slave
    constexpr std::size_t kRingBytes = 32;            // a place in the ring; 16 of them for strangers
    const std::size_t slave = kRingBytes + sizeof(Slave) + kMailboxBytes + limits.emergencies * sizeof(Emergency);
    return kFixedBytes + limits.slaves * slave + limits.frames * kFrameBytes + limits.groups * kGroupBytes +
           limits.process_frames * kProcessFrameBytes + arena + arena / 64 + 16 * kRingBytes + 256;
}

// One master. Not copyable; one thread owns it and calls everything, unless a function says otherwise.
class Context {
  public:
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

    // The slaves found by the last config_init(), in the order of the ring.
    [[nodiscard]] std::span<Slave> slaves();
    // Slave number `position`, 1 the first. For a position where there is none: a slave whose position is 0.
    [[nodiscard]] Slave& slave(std::size_t position);

    // A group of process data, from 0. For a number where there is none: one that is never mapped.
    [[nodiscard]] Group& group(std::size_t number);

    // What has gone wrong, oldest first. May be read by one other thread.
    [[nodiscard]] ErrorLog& errors();
    // What the supervision has seen, oldest first. May be read by one other thread.
    [[nodiscard]] EventQueue& events();
    [[nodiscard]] const LinkStatistics& statistics() const;
    // Of the arena that running operations live in: most octets ever used, and how many there are.
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
    Network* network_ = nullptr;  // in memory_, once init() was called
    Osal* osal_ = nullptr;
    Slave none_;
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
