// init_redundant(): places the objects that merge two cables at the beginning of the memory of the context; init() uses
// the rest.
#include "api/init.hpp"
#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/ring_watch.hpp"

#include <margay/margay.hpp>
#include <margay/redundancy.hpp>

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <type_traits>

namespace margay {
namespace {

// The objects at the beginning of the memory of the context.
struct TwoCables {
    TwoCables(Nic& first, Nic& second, std::span<FramePair> own, std::span<FramePair> overlapped)
        : ring(first, second, own, overlapped), watch(ring) {}
    Redundancy ring;
    RingWatch watch;
};
static_assert(std::is_trivially_destructible_v<FramePair>);
constexpr std::size_t kCables = sizeof(void*) == 8 ? 1248 : 1200;
constexpr std::size_t kPair = 3088;
constexpr bool kExact = alignof(std::uint64_t) == 8;
// Rounded up, so that the pairs and the context begin at an aligned address. Some processors with pointers of 32 bits
// align to 16 octets.
constexpr std::size_t kRounded = (sizeof(TwoCables) + 15) / 16 * 16;
static_assert(kExact ? kRounded == kCables : kRounded <= kCables, "context_bytes(): kCablesBytes");
static_assert(kExact ? sizeof(FramePair) == kPair : sizeof(FramePair) <= kPair, "context_bytes(): kPairBytes");
static_assert(kCables % alignof(std::max_align_t) == 0 && kPair % alignof(std::max_align_t) == 0);

}  // namespace

Result<> init_redundant(Context& ctx, Nic& nic, Nic& second, Osal& osal, const Features& features) {
    if (&nic == &second) return invalid(Argument::second_nic, Step::open_nic);
    if (master_of(ctx) != nullptr) return Error{.code = Errc::wrong_state, .step = Step::open_nic};
    const Limits& limits = ctx.limits();
    const std::size_t own = std::size_t{limits.frames} + limits.process_frames;
    const std::size_t pairs = own + limits.process_frames + 1U;  // the receiving thread may hold one of the last ones
    if (!limits.redundancy) return Error{.code = Errc::capacity, .step = Step::open_nic, .detail = Error::kRedundancy};
    const auto memory = memory_of(ctx);
    if (!memory) return memory.error();
    std::byte* const at = memory->data();
    FramePair* first = nullptr;
    for (std::size_t n = pairs; n-- > 0;)
        first = ::new (static_cast<void*>(at + kCables + n * sizeof *first)) FramePair;
    auto* const cables = ::new (static_cast<void*>(at))
        TwoCables(nic, second, std::span(first, own), std::span(first + own, pairs - own));
    const auto done = init_in(ctx, memory->subspan(kCables + pairs * kPair), cables->ring, osal, features);
    if (!done) return done;
    Network& network = master_of(ctx)->network;
    network.engine.link().use(cables->ring);
    network.redundancy = &cables->watch;
    return done;
}

RedundancyStatus redundancy(Context& ctx) {
    Master* master = master_of(ctx);
    if (master == nullptr || master->network.redundancy == nullptr) return {};
    const auto* const watch = static_cast<const RingWatch*>(master->network.redundancy);
    RedundancyStatus status = watch->ring().status();
    status.second_reference = watch->second_reference();
    status.second_ahead_ns = watch->apart_ns();
    status.restoring_waits = !watch->may_restore();
    return status;
}

void set_automatic_restoring(Context& ctx, bool on) {
    Master* master = master_of(ctx);
    if (master == nullptr || master->network.redundancy == nullptr) return;
    static_cast<RingWatch*>(master->network.redundancy)->set_automatic(on);
}

void restore_ring(Context& ctx) {
    Master* master = master_of(ctx);
    if (master == nullptr || master->network.redundancy == nullptr) return;
    static_cast<RingWatch*>(master->network.redundancy)->restore();
}

}  // namespace margay
