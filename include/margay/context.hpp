// The context: the whole state of one master, in memory that the caller provides.
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
#include <cstdint>
#include <span>

namespace margay {

class Nic;
class Osal;
struct Master;

// How many octets of memory a context with these limits needs; SIZE_MAX if they are more than the processor can
// address. The number is exact for memory with the alignment of std::max_align_t (StaticContext and HostContext have
// such memory): with one octet less, init() fails with Errc::capacity. Other memory also needs the octets before its
// first aligned octet. On processors with pointers of 32 bits that align integers of 64 bits to 4 octets (i386), less
// may suffice.
[[nodiscard]] constexpr std::size_t context_bytes(const Limits& limits) {
    // Sizes of the parts of the library for both sizes of pointers. context.cpp compares these constants with the real
    // sizes.
    constexpr bool kWide = sizeof(void*) == 8;
    constexpr std::size_t kFixedBytes = kWide ? 6656 : 4720;  // the engine, the queue of requests, one frame buffer
    constexpr std::size_t kFrameBytes = kWide ? 40 : 32;      // a frame on the wire
    // The share of one slave in the memory of the running sequences, with a mailbox of 1 KiB. On a processor with
    // pointers of 32 bits the deepest sequence needs more than one share: see Limits::arena_bytes.
    constexpr std::size_t kTaskBytes = 1024 * sizeof(void*);
    constexpr std::size_t kGroupBytes = kWide ? 432 : 328;
    constexpr std::size_t kProcessFrameBytes = kWide ? 1982 : 1882;  // a prepared frame with its datagrams
    constexpr std::size_t kMailboxBytes = kWide ? 448 : 376;         // the mailbox channel of a slave
    constexpr std::size_t kRingBytes = 28;                           // a place in the ring
    constexpr std::size_t kMarksBytes = 24;                          // the marks of a slave
    constexpr std::size_t kClockBytes = 176;
    constexpr std::size_t kDelayBytes = 40;                    // a place in the topology
    constexpr std::size_t kCablesBytes = kWide ? 1248 : 1200;  // the merging of two cables
    constexpr std::size_t kPairBytes = 3088;                   // a frame on both cables
    constexpr std::size_t kBlockBytes = 64;                    // of the arena; one more octet manages it
    const std::uint64_t pairs = limits.redundancy ? limits.frames + 2U * limits.process_frames + 1U : 0;
    const std::uint64_t cables = limits.redundancy ? kCablesBytes + pairs * kPairBytes : 0;
    const std::uint64_t tasks = limits.tasks == 0 || limits.tasks > limits.slaves ? limits.slaves : limits.tasks;
    const std::uint64_t place = kRingBytes + (limits.clocks ? kDelayBytes : 0);
    const std::uint64_t slave = place + (limits.clocks ? kClockBytes : 0) + kMarksBytes + sizeof(Slave) +
                                kMailboxBytes + std::uint64_t{limits.emergencies} * sizeof(Emergency);
    const std::uint64_t tables = cables + kFixedBytes + limits.slaves * slave + limits.guests * place +
                                 limits.frames * kFrameBytes + limits.groups * kGroupBytes +
                                 std::uint64_t{limits.process_frames} * kProcessFrameBytes +
                                 2U * limits.errors * sizeof(Error) + limits.events * sizeof(Event);
    constexpr std::size_t kAlignment = alignof(std::max_align_t);
    const std::uint64_t arena = limits.arena_bytes != 0 ? limits.arena_bytes : (tasks + 4) * kTaskBytes;
    const std::uint64_t blocks = (arena + kBlockBytes - 1) / kBlockBytes;
    const std::uint64_t all = (tables + kAlignment - 1) / kAlignment * kAlignment + blocks * (kBlockBytes + 1);
    return all > SIZE_MAX ? SIZE_MAX : static_cast<std::size_t>(all);
}

// One master. Not copyable. One thread owns a context and makes all calls, unless a function says otherwise.
class Context {
  public:
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

    // The slaves of the last config_init(), in the order of their numbers (expected.hpp). Valid until the next
    // config_init().
    [[nodiscard]] std::span<const Slave> slaves();
    // The slave with this number; the first slave is 1. For a number without a slave (0 included) returns a
    // slave whose `number` is 0 and whose image has no bits: its octets read as zero, and a write to them has no
    // effect.
    [[nodiscard]] const Slave& slave(std::size_t number);

    // The group of process data `number`; the first group is 0. For a number without a group, and before init(),
    // returns a group that is never mapped: a configuration that is set there is lost (configuration_lost).
    [[nodiscard]] const Group& group(std::size_t number);

    // Before init(), the next four return empty objects with zero counters: call them again after init(). Only a
    // callback in events() that was set before init() is kept.
    //
    // The errors so far, oldest first. The log keeps the oldest Limits::errors errors until they are read; later ones
    // are dropped. One other thread may read it.
    [[nodiscard]] ErrorLog& errors();
    // Conditions that are unusual but no failure (see is_warning()), in a ring of their own of the same size: warnings
    // use no space of errors(). One other thread may read it.
    [[nodiscard]] ErrorLog& warnings();
    // The events that the supervision has reported, oldest first. One other thread may read it.
    [[nodiscard]] EventQueue& events();
    // The counters of the link. For the thread that polls.
    [[nodiscard]] const LinkStatistics& statistics() const;

    // Timeouts and repetitions of the link. Values that are set before init() apply from init() on. For the thread that
    // polls.
    [[nodiscard]] LinkSettings& link_settings();

    // The arena is the memory of running operations: the most octets ever in use, and its size. Zero before init().
    [[nodiscard]] std::size_t arena_peak_bytes() const;
    [[nodiscard]] std::size_t arena_bytes() const;

    [[nodiscard]] const Limits& limits() const { return limits_; }

  protected:
    // `memory`: context_bytes(limits) octets or more; the arena gets the rest. The memory outlives the context.
    Context(std::span<std::byte> memory, const Limits& limits)
        : memory_(memory), limits_(limits), needed_bytes_(context_bytes(limits)) {}
    ~Context() = default;
    // To be called by the destructor of the class that owns the memory. Busy requests end as canceled.
    void close();

  private:
    friend struct ContextAccess;
    std::span<std::byte> memory_;
    Limits limits_;
    Master* master_ = nullptr;  // in memory_, after init()
    Slave none_;
    // Returned before init().
    LinkSettings early_settings_;
    ErrorLog no_errors_;
    EventQueue no_events_;
    EmergencyRing no_emergencies_;
    Group no_group_;
    std::size_t needed_bytes_;  // context_bytes(): a constant where the limits are, so that no code computes it
};

// A context that contains its memory: for a static variable (.bss) on a system without a heap.
//
//     static margay::StaticContext<margay::Limits{.slaves = 16}> ctx;
template <Limits L>
class StaticContext : public Context {
  public:
    StaticContext() : Context(bytes_, L) {}
    ~StaticContext() { close(); }

  private:
    static_assert(context_bytes(L) <= PTRDIFF_MAX, "the limits need more memory than the processor can address");
    alignas(std::max_align_t) std::byte bytes_[context_bytes(L)];
};

}  // namespace margay
