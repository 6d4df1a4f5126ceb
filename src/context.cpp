// The context: lays the parts of a master into the caller's memory, and drives requests.
#include "context_access.hpp"
#include "network/groups.hpp"
#include "network/network.hpp"
#include "network/scan.hpp"
#include "network/states.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

#include <margay/margay.hpp>

#include <algorithm>
#include <memory>
#include <new>

namespace margay {

static_assert(sizeof(Network) <= 8192, "context_bytes(): kFixedBytes");
static_assert(sizeof(FrameSlot) <= 64, "context_bytes(): kFrameBytes");
static_assert(sizeof(ProcessGroup) <= 256, "context_bytes(): kGroupBytes");
static_assert(sizeof(PreparedFrame) + ProcessTables::datagrams_for(1) *
                  (sizeof(PreparedDatagram) + sizeof(DatagramStatus) + 2 * sizeof(DatagramPlan)) <= 2048,
              "context_bytes(): kProcessFrameBytes");

struct RequestAccess {
    static void begin(Request& r, void* coroutine) {
        r.coroutine_ = coroutine;
        r.state_ = RequestState::busy;
        r.error_ = {};
    }
    static void end(Request& r, const Error& error) {
        r.coroutine_ = nullptr;
        r.state_ = error.code == Errc::none ? RequestState::success : RequestState::error;
        r.error_ = error;
    }
};

namespace {

// Hands out pieces of the context's memory, front to back.
class Carver {
  public:
    explicit Carver(std::span<std::byte> memory) : left_(memory) {}
    template <class T>
    std::span<T> take(std::size_t count) {
        void* at = left_.data();
        std::size_t space = left_.size();
        if (std::align(alignof(T), count * sizeof(T), at, space) == nullptr) return {};
        left_ = left_.subspan(left_.size() - space + count * sizeof(T));
        T* first = static_cast<T*>(at);
        for (std::size_t i = 0; i < count; ++i) ::new (static_cast<void*>(first + i)) T();
        return {first, count};
    }
    void* raw(std::size_t bytes, std::size_t alignment) {
        void* at = left_.data();
        std::size_t space = left_.size();
        if (std::align(alignment, bytes, at, space) == nullptr) return nullptr;
        left_ = left_.subspan(left_.size() - space + bytes);
        return at;
    }
    std::span<std::byte> rest() const { return left_; }

  private:
    std::span<std::byte> left_;
};

// Ends the request when its sequence is done, or when the context goes away under it.
class RequestGuard {
  public:
    explicit RequestGuard(Request& request) : request_(request) {}
    RequestGuard(const RequestGuard&) = delete;
    RequestGuard& operator=(const RequestGuard&) = delete;
    ~RequestGuard() { RequestAccess::end(request_, error_); }
    void done(const Error& error) { error_ = error; }

  private:
    Request& request_;
    Error error_{.code = Errc::canceled};
};

Task<Result<>> run(Network& network, ScanRequest& request) {
    auto count = co_await scan(network);
    request.slaves = count ? *count : std::uint16_t{0};
    co_return count ? Result<>() : Result<>(count.error());
}

Task<Result<>> run(Network& network, SiiReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    SiiReader reader(station);
    co_return co_await reader.read(request.word, request.data);
}

Task<Result<>> run(Network& network, SiiWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    co_return co_await sii_write(station, request.word, request.data);
}

Task<Result<>> run(Network& network, StateRequest& request) {
    Slave& slave = network.slave(request.slave);
    const Station station = network.station(slave);
    const Duration timeout = request.timeout == Duration{0} ? default_al_timeout(request.state) : request.timeout;
    auto changed = co_await change_al_state(station, request.state, slave.device_emulation, timeout);
    auto seen = co_await read_al_status(station);
    slave.al = seen ? *seen : AlStatus{};
    co_return changed ? Result<>() : Result<>(changed.error());
}

Task<Result<>> run(Network& network, ReadStateRequest& request) {
    auto read = co_await read_states(network);
    request.lowest = *read;
    co_return read ? Result<>() : Result<>(read.error());
}

Task<Result<>> run(Network& network, WriteStateRequest& request) {
    co_return co_await write_states(network, request.slave, request.wanted);
}

Task<Result<>> run(Network& network, StateCheckRequest& request) {
    auto reached = co_await wait_for_state(network, request.slave, request.wanted, request.timeout);
    request.reached = *reached;
    co_return reached ? Result<>() : Result<>(reached.error());
}

Task<Result<>> run(Network& network, MapRequest& request) {
    auto mapped = co_await map_group(network, request.group, request.image);
    request.bytes = mapped ? *mapped : std::size_t{0};
    co_return mapped ? Result<>() : Result<>(mapped.error());
}

template <class R>
Task<Result<>> drive(Network& network, R& request) {
    RequestGuard guard(request);
    co_await network.engine.next_poll();
    auto result = co_await run(network, request);
    guard.done(result.error());
    co_return Result<>();
}

Error check_slave(Network& network, std::uint16_t slave, Step step) {
    if (slave >= 1 && slave <= network.count) return {};
    return {.code = Errc::unknown_slave, .step = step, .slave = slave, .expected = network.count};
}

// Slave 0 is all of them.
Error check_slave_or_all(Network& network, std::uint16_t slave, Step step) {
    return slave == 0 ? Error{} : check_slave(network, slave, step);
}

Error check_words(std::size_t octets, std::uint16_t slave, Step step) {
    if (octets % 2 == 0) return {};
    return {.code = Errc::invalid_argument, .step = step, .slave = slave};
}

template <class R>
Result<> start(Context& ctx, R& request, const Error& refused) {
    if (refused.code != Errc::none) return refused;
    if (request.busy()) return Error{.code = Errc::busy};
    Task<Result<>> task = drive(*ContextAccess::network(ctx), request);
    if (!task) return Error{.code = Errc::capacity};
    RequestAccess::begin(request, task.address());
    (void)ContextAccess::network(ctx)->requests.start(std::move(task));
    return Result<>();
}

constexpr std::uint32_t kMostGroups = 256;

// Each group's image has 16 MiB of logical address space, unless the application wants it elsewhere.
ProcessTables carve_process_tables(Carver& carver, const Limits& limits) {
    constexpr std::uint32_t kGroupSpacing = 0x0100'0000;
    const std::size_t datagrams = ProcessTables::datagrams_for(limits.process_frames);
    ProcessTables tables;
    tables.groups = carver.take<ProcessGroup>(limits.groups);
    tables.frames = carver.take<PreparedFrame>(limits.process_frames);
    tables.datagrams = carver.take<PreparedDatagram>(datagrams);
    tables.statuses = carver.take<DatagramStatus>(datagrams);
    tables.plans = carver.take<DatagramPlan>(datagrams);
    tables.scratch = carver.take<DatagramPlan>(datagrams);
    for (std::uint32_t n = 0; n < tables.groups.size(); ++n) tables.groups[n].config.start.value = n * kGroupSpacing;
    return tables;
}

Error check_init(Context& ctx) {
    return ContextAccess::network(ctx) != nullptr ? Error{} : Error{.code = Errc::wrong_state};
}

}  // namespace

std::span<Slave> Context::slaves() { return network_ == nullptr ? std::span<Slave>() : network_->slaves(); }

Slave& Context::slave(std::size_t position) {
    if (network_ == nullptr || position < 1 || position > network_->count) return none_;
    return network_->slave(position);
}

Group& Context::group(std::size_t number) {
    if (network_ == nullptr || number >= network_->process.groups.size()) return no_group_;
    return network_->process.groups[number];
}

ErrorLog& Context::errors() { return network_->errors; }
const LinkStatistics& Context::statistics() const { return network_->engine.link().statistics(); }
std::size_t Context::arena_peak_bytes() const { return network_->engine.arena().peak_bytes(); }
std::size_t Context::arena_bytes() const { return network_->engine.arena().capacity_bytes(); }

void Context::close() {
    if (network_ != nullptr) std::destroy_at(network_);
    network_ = nullptr;
}

void Request::cancel() {
    if (coroutine_ != nullptr) std::coroutine_handle<>::from_address(coroutine_).destroy();
}

Result<> init(Context& ctx, Nic& nic, Osal& osal) {
    const Limits& limits = ctx.limits();
    if (limits.slaves == 0 || limits.frames == 0 || limits.frames > FrameTable::kMostSlots || limits.groups > kMostGroups)
        return Error{.code = Errc::invalid_argument, .step = Step::open_nic};
    if (ContextAccess::network(ctx) != nullptr) return Error{.code = Errc::wrong_state, .step = Step::open_nic};
    Carver carver(ContextAccess::memory(ctx));
    void* place = carver.raw(sizeof(Network), alignof(Network));
    const auto slaves = carver.take<Slave>(limits.slaves);
    const auto frames = carver.take<FrameSlot>(limits.frames);
    if (place == nullptr || slaves.empty() || frames.empty()) return Error{.code = Errc::capacity, .step = Step::open_nic};
    const ProcessTables process = carve_process_tables(carver, limits);
    const std::size_t tasks = limits.tasks == 0 ? limits.slaves : limits.tasks;
    ContextAccess::network(ctx) = ::new (place) Network(nic, slaves, frames, carver.rest(), tasks);
    ContextAccess::network(ctx)->process = process;
    ContextAccess::osal(ctx) = &osal;
    return Result<>();
}

Time poll(Context& ctx, Time now) {
    Network* network = ContextAccess::network(ctx);
    return network == nullptr ? kNever : network->engine.poll(now);
}

Result<> submit(Context& ctx, ScanRequest& request) { return start(ctx, request, check_init(ctx)); }

Result<> submit(Context& ctx, SiiReadRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::read_sii);
    if (refused.code == Errc::none) refused = check_words(request.data.size(), request.slave, Step::read_sii);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, SiiWriteRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::write_sii);
    if (refused.code == Errc::none) refused = check_words(request.data.size(), request.slave, Step::write_sii);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, StateRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave(*ContextAccess::network(ctx), request.slave, Step::request_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, ReadStateRequest& request) { return start(ctx, request, check_init(ctx)); }

Result<> submit(Context& ctx, WriteStateRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave_or_all(*ContextAccess::network(ctx), request.slave, Step::request_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, StateCheckRequest& request) {
    Error refused = check_init(ctx);
    if (refused.code == Errc::none) refused = check_slave_or_all(*ContextAccess::network(ctx), request.slave, Step::read_state);
    return start(ctx, request, refused);
}

Result<> submit(Context& ctx, MapRequest& request) { return start(ctx, request, check_init(ctx)); }

}  // namespace margay
