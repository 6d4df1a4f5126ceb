// The context: places the parts of a master in the caller's memory.
#include "api/init.hpp"
#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/expectation.hpp"

#include <margay/margay.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>

namespace margay {

// Compares a constant of context_bytes() with the real size for this size of pointers. The constant is exact, unless
// integers of 64 bits are aligned to less than 8 octets; then it may be larger.
constexpr bool is_size(std::size_t actual, std::size_t wide, std::size_t narrow) {
    const std::size_t constant = sizeof(void*) == 8 ? wide : narrow;
    return alignof(std::uint64_t) == 8 ? actual == constant : actual <= constant;
}
static_assert(is_size(sizeof(Master), 6656, 4720), "context_bytes(): kFixedBytes");
static_assert(is_size(sizeof(MailboxChannel), 448, 376), "context_bytes(): kMailboxBytes");
static_assert(is_size(sizeof(FrameSlot), 40, 32), "context_bytes(): kFrameBytes");
static_assert(is_size(sizeof(ClockEntry), 176, 176), "context_bytes(): kClockBytes");
static_assert(is_size(sizeof(DelayNode), 40, 40), "context_bytes(): kDelayBytes");
static_assert(is_size(sizeof(RingPlace), 28, 28), "context_bytes(): kRingBytes");
static_assert(is_size(sizeof(SlaveMarks), 24, 24), "context_bytes(): kMarksBytes");
static_assert(is_size(sizeof(ProcessGroup), 432, 328), "context_bytes(): kGroupBytes");
static_assert(is_size(sizeof(PreparedFrame) +
                          ProcessTables::datagrams_for(1) *
                              (sizeof(PreparedDatagram) + sizeof(DatagramStatus) + 2 * sizeof(DatagramPlan)),
                      1982, 1882),
              "context_bytes(): kProcessFrameBytes");
static_assert(Arena::kBlockBytes == 64 && Arena::memory_for(1) == 65, "context_bytes(): kBlockBytes");

namespace {

// Divides the context's memory into arrays, from front to back. Nothing lies between arrays that are taken in the order
// of their alignment, and memory_of() has compared the size with all of them.
class Carver {
  public:
    explicit Carver(std::span<std::byte> memory) : left_(memory) {}
    template <class T>
    std::span<T> take(std::size_t count) {
        static constexpr Element kElement{sizeof(T), alignof(T), [](void* at) { ::new (at) T(); }};
        return {static_cast<T*>(array(count, kElement)), count};
    }
    std::byte* raw(std::size_t bytes, std::size_t alignment) {
        const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(left_.data())) % alignment;
        std::byte* const at = left_.data() + skip;
        left_ = left_.subspan(skip + bytes);
        return at;
    }
    std::span<std::byte> rest() const { return left_; }

  private:
    struct Element {
        std::size_t bytes;
        std::size_t alignment;
        void (*construct)(void* at);
    };
    // One function for all types.
    [[gnu::noinline]] void* array(std::size_t count, const Element& element) {
        std::byte* const first = raw(count * element.bytes, element.alignment);
        for (std::size_t i = 0; i < count; ++i) element.construct(first + i * element.bytes);
        return first;
    }

    std::span<std::byte> left_;
};

constexpr std::uint32_t kMostGroups = 256;

// The tables in the memory of the context before the arena, in the order of decreasing alignment.
struct Tables {
    void* master;
    std::span<MailboxChannel> mailboxes;
    std::span<FrameSlot> frames;
    std::span<Emergency> emergencies;
    std::span<ClockEntry> clocks;
    std::span<DelayNode> delays;
    std::span<Event> events;
    SlaveTable slaves;
    std::span<Error> errors;
    std::span<Error> warnings;
    std::span<RingPlace> ring;
    ProcessTables process;
    std::span<std::byte> arena;
};

// The default logical addresses give each group 16 MiB; the application may change GroupConfiguration::start.
void number_groups(std::span<ProcessGroup> groups) {
    for (std::uint32_t n = 0; n < groups.size(); ++n) {
        groups[n].config.start.value = n * GroupConfiguration::kSpacing;
        groups[n].number = static_cast<std::uint8_t>(n);
    }
}

Tables carve(std::span<std::byte> memory, const Limits& limits) {
    Carver carver(memory);
    Tables tables;
    const std::size_t slaves = limits.slaves;
    const std::size_t places = slaves + limits.guests;
    const std::size_t datagrams = ProcessTables::datagrams_for(limits.process_frames);
    tables.master = carver.raw(sizeof(Master), alignof(Master));
    tables.mailboxes = carver.take<MailboxChannel>(slaves);
    tables.frames = carver.take<FrameSlot>(limits.frames);
    tables.emergencies = carver.take<Emergency>(slaves * limits.emergencies);
    tables.clocks = carver.take<ClockEntry>(limits.clocks ? slaves : 0);
    tables.delays = carver.take<DelayNode>(limits.clocks ? places : 0);
    tables.events = carver.take<Event>(limits.events);
    tables.process.groups = carver.take<ProcessGroup>(limits.groups);
    tables.process.frames = carver.take<PreparedFrame>(limits.process_frames);
    tables.slaves.slaves = carver.take<Slave>(slaves);
    tables.process.datagrams = carver.take<PreparedDatagram>(datagrams);
    tables.slaves.marks = carver.take<SlaveMarks>(slaves);
    tables.errors = carver.take<Error>(limits.errors);
    tables.warnings = carver.take<Error>(limits.errors);
    tables.process.plans = carver.take<DatagramPlan>(datagrams);
    tables.process.scratch = carver.take<DatagramPlan>(datagrams);
    tables.ring = carver.take<RingPlace>(places);
    tables.process.statuses = carver.take<DatagramStatus>(datagrams);
    tables.arena = carver.rest();
    number_groups(tables.process.groups);
    return tables;
}

Error check_limits(const Limits& limits) {
    struct Range {
        Argument argument;
        std::uint16_t Limits::*limit;
        std::uint16_t most;  // the least value is 1
    };
    static constexpr Range kRanges[] = {
        {Argument::limit_slaves, &Limits::slaves, UINT16_MAX},
        {Argument::limit_frames, &Limits::frames, FrameTable::kMostSlots},
        {Argument::limit_groups, &Limits::groups, kMostGroups},
        {Argument::limit_process_frames, &Limits::process_frames, UINT16_MAX},
    };
    for (const Range& range : kRanges) {
        const std::uint16_t value = limits.*range.limit;
        if (value >= 1 && value <= range.most) continue;
        Error error = invalid(range.argument, Step::open_nic);
        error.expected = range.most;
        error.actual = value;
        return error;
    }
    return {};
}

Error check_link_settings(const LinkSettings& settings) {
    constexpr Step step = Step::open_nic;
    if (settings.frame_timeout <= Duration{0}) return invalid(Argument::link_frame_timeout, step);
    if (settings.queue_timeout <= Duration{0}) return invalid(Argument::link_queue_timeout, step);
    if (settings.sendings == 0) return invalid(Argument::link_sendings, step);
    return {};
}

// How many slaves one operation processes at the same time: as many as leave each of their sequences enough memory.
std::size_t tasks_at_once(const Limits& limits) {
    constexpr std::size_t kShareBytes = 1024 * sizeof(void*);  // the same as in context_bytes()
    const std::size_t wanted = limits.tasks == 0 ? limits.slaves : limits.tasks;
    if (limits.arena_bytes == 0) return wanted;
    return std::clamp<std::size_t>(limits.arena_bytes / kShareBytes, 1, wanted);
}

}  // namespace

std::span<const Slave> Context::slaves() {
    return master_ == nullptr ? std::span<const Slave>() : master_->network.slaves();
}

const Slave& Context::slave(std::size_t number) {
    if (master_ == nullptr || number < 1 || number > master_->network.count) return none_;
    return master_->network.slave(number);
}

const Group& Context::group(std::size_t number) {
    if (master_ == nullptr || number >= master_->network.process.groups.size()) return no_group_;
    return master_->network.process.groups[number];
}

ErrorLog& Context::errors() { return master_ == nullptr ? no_errors_ : master_->network.errors; }
ErrorLog& Context::warnings() { return master_ == nullptr ? no_errors_ : master_->network.warnings; }
EventQueue& Context::events() { return master_ == nullptr ? no_events_ : master_->network.events; }

const LinkStatistics& Context::statistics() const {
    static constexpr LinkStatistics kNothing;
    return master_ == nullptr ? kNothing : master_->network.engine.link().statistics();
}

LinkSettings& Context::link_settings() {
    return master_ == nullptr ? early_settings_ : master_->network.engine.link().settings;
}

std::size_t Context::arena_peak_bytes() const {
    return master_ == nullptr ? 0 : master_->network.engine.arena().peak_bytes();
}

std::size_t Context::arena_bytes() const {
    return master_ == nullptr ? 0 : master_->network.engine.arena().capacity_bytes();
}

void Context::close() {
    if (master_ == nullptr) return;
    master_->network.events.callback = nullptr;  // the data that the callback uses may no longer exist
    cancel_queued(*master_);
    std::destroy_at(master_);
    master_ = nullptr;
}

Result<> init(Context& ctx, Nic& nic, Osal& osal, const Features& features) {
    const auto memory = memory_of(ctx);
    return memory ? init_in(ctx, *memory, nic, osal, features) : Result<>(memory.error());
}

Result<std::span<std::byte>> memory_of(Context& ctx) {
    const auto memory = ContextAccess::memory(ctx);
    const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(memory.data())) % alignof(std::max_align_t);
    const std::size_t needed = ContextAccess::needed_bytes(ctx);
    if (memory.size() >= skip && memory.size() - skip >= needed) return memory.subspan(skip);
    Error error{.code = Errc::capacity, .step = Step::open_nic};
    if (needed <= UINT32_MAX - skip) {  // then the available size is in the range too
        error.expected = static_cast<std::uint32_t>(needed + skip);
        error.actual = static_cast<std::uint32_t>(memory.size());
    }
    return error;
}

Result<> init_in(Context& ctx, std::span<std::byte> memory, Nic& nic, Osal& osal, const Features& features) {
    const Limits& limits = ctx.limits();
    if (const Error wrong = check_limits(limits); wrong.code != Errc::none) return wrong;
    if (ContextAccess::master(ctx) != nullptr) return Error{.code = Errc::wrong_state, .step = Step::open_nic};
    const Error wrong = check_link_settings(ContextAccess::early_settings(ctx));
    if (wrong.code != Errc::none) return wrong;
    const Tables tables = carve(memory, limits);
    Master* master =
        ::new (tables.master) Master(osal, nic, tables.slaves, tables.frames, tables.arena, tasks_at_once(limits),
                                     tables.mailboxes, tables.emergencies, tables.ring);
    Network& network = master->network;
    network.process = tables.process;
    network.errors.use(tables.errors);
    network.warnings.use(tables.warnings);
    network.events.use(tables.events);
    network.coe = features.coe;
    network.mailboxes.soe = features.soe;
    network.mailboxes.routing = features.routing;
    network.overlap = features.overlap;
    network.boot = features.boot;
    network.clocks.entries = tables.clocks;
    network.clocks.nodes = tables.delays;
    network.engine.link().settings = ContextAccess::early_settings(ctx);
    network.events.callback = ContextAccess::no_events(ctx).callback;
    network.events.user = ContextAccess::no_events(ctx).user;
    ContextAccess::master(ctx) = master;
    return Result<>();
}

Result<> expect(Context& ctx, Borrowed<ExpectedSlave> slaves) {
    if (const Error refused = check_owner(ctx, Step::identify); refused.code != Errc::none) return refused;
    if (const auto right = check_expected(slaves); !right) return right;
    Network& network = ContextAccess::master(ctx)->network;
    network.expected_is_new = !slaves.empty() || !network.expected.empty();
    network.expected_next = slaves;
    network.expectation = &kExpectation;
    return Result<>();
}

Result<> clear_error(Context& ctx, std::uint16_t slave) {
    if (const Error refused = check_owner(ctx, Step::none); refused.code != Errc::none) return refused;
    Network& network = ContextAccess::master(ctx)->network;
    if (const Error refused = check_slave_or_all(network, slave, Step::none); refused.code != Errc::none)
        return refused;
    for (Slave& one : network.slaves())
        if (slave == 0 || one.number == slave) one.error = {};
    return Result<>();
}

}  // namespace margay
