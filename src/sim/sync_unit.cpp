#include "sim/sync_unit.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

namespace reg = wire::reg;
namespace activation = wire::sync_activation;

bool meets(std::uint32_t address, std::size_t length, wire::Register r) {
    return address < r.end() && r.address < address + length;
}

// Latch control: bit 0 (positive edge) and bit 1 (negative edge) select single shot, that is only the first edge is
// latched.
constexpr std::uint16_t kLatchControl[] = {reg::kLatch0Control.address, reg::kLatch1Control.address};
constexpr std::uint16_t kLatchStatus[] = {reg::kLatch0Status.address, reg::kLatch1Status.address};
constexpr wire::Register kEdges[2][2] = {{reg::kLatch0PositiveEdge, reg::kLatch0NegativeEdge},
                                         {reg::kLatch1PositiveEdge, reg::kLatch1NegativeEdge}};

// Pulses with a cycle below 10 µs, which no program could handle, are processed in groups of about that duration.
// Otherwise a cycle time of 1 ns would stop the simulation.
std::uint32_t bundle_of(std::uint32_t cycle_ns) {
    constexpr std::uint32_t kLeast = 10'000;
    return cycle_ns == 0 || cycle_ns >= kLeast ? 1 : (kLeast + cycle_ns - 1) / cycle_ns;
}

}  // namespace

void SyncUnit::power_up(RegisterFile& registers, const DcClock& clock, Features features) {
    registers_ = &registers;
    clock_ = &clock;
    features_ = features;
    next_ = {kNever, kNever};
    on_ = {};
    pulses_ = {};
    active_ = false;
}

std::uint32_t SyncUnit::written(std::uint32_t address, std::size_t length, Time at) {
    auto wanted = registers_->get<std::uint8_t>(reg::kSyncActivation.address);
    const bool pulse = features_.enhanced && (wanted & activation::kDebugPulse) != 0;
    wanted &= static_cast<std::uint8_t>(features_.enhanced ? ~activation::kDebugPulse : 0x07);
    if (meets(address, length, reg::kSyncStartTime)) {
        if ((wanted & activation::kExtendStartTime) != 0) extend_start_time(address, length, at);
        if ((wanted & activation::kAutoActivation) != 0) wanted |= activation::kCyclic;
    } else if (!meets(address, length, reg::kSyncActivation)) {
        return 0;
    }
    registers_->set(reg::kSyncActivation.address, wanted);
    const bool start = (wanted & activation::kCyclic) != 0;
    on_ = {(wanted & activation::kSync0) != 0, (wanted & activation::kSync1) != 0};
    if (start && !active_) activate(at);
    if (!start) {
        active_ = false;
        next_ = {kNever, kNever};
        registers_->set<std::uint8_t>(reg::kActivationStatus.address, 0);
    }
    return pulse ? debug_pulse() : 0;
}

// "Extension of start time": a master that writes only the low half means the next time with these low 32 bits.
void SyncUnit::extend_start_time(std::uint32_t address, std::size_t length, Time at) {
    if (address + length > reg::kSyncStartTime.address + 4u || !features_.wide) return;
    const auto now = clock_->copy(at);
    const auto low = registers_->get<std::uint32_t>(reg::kSyncStartTime.address);
    const auto ahead = static_cast<std::uint32_t>(low - static_cast<std::uint32_t>(now));
    registers_->set(reg::kSyncStartTime.address, now + ahead);
}

// "Start time plausibility check": whether the start time is in the near future.
bool SyncUnit::plausible(std::uint64_t start, Time at) const {
    const auto wanted = registers_->get<std::uint8_t>(reg::kSyncActivation.address);
    if ((wanted & activation::kPlausibility) == 0) return true;
    const auto ahead = clock_->ahead(start, at);
    if (ahead < 0) return false;
    return (wanted & activation::kNearFuture) == 0 || ahead <= std::int64_t{1} << 31;
}

std::uint32_t SyncUnit::debug_pulse() {
    std::uint32_t events = 0;
    for (unsigned signal = 0; signal < 2; ++signal) {
        if (!on_[signal]) continue;
        ++pulses_[signal];
        show_pulse(signal);
        events |= signal == 0 ? wire::al_event::kDcSync0 : wire::al_event::kDcSync1;
    }
    return events;
}

// In acknowledge mode the signal stays active until it is acknowledged.
void SyncUnit::show_pulse(unsigned signal) {
    if (registers_->get<std::uint16_t>(reg::kSyncPulseLength.address) == 0)
        registers_->set<std::uint8_t>(signal == 0 ? reg::kSync0Status.address : reg::kSync1Status.address, 1);
}

void SyncUnit::activate(Time at) {
    cycle0_ = registers_->get<std::uint32_t>(reg::kSync0CycleTime.address);
    cycle1_ = registers_->get<std::uint32_t>(reg::kSync1CycleTime.address);
    due_ = {registers_->get<std::uint64_t>(reg::kSyncStartTime.address), 0};
    if (!plausible(due_[0], at)) due_[0] = clock_->copy(at) + 1;
    countdown1_ = 0;
    active_ = true;
    next_ = {kNever, kNever};
    next_[0] = clock_->start_moment(due_[0], at);
    registers_->set<std::uint8_t>(reg::kActivationStatus.address, 0x03);  // waiting for the start time
}

void SyncUnit::clock_changed(Time now) {
    if (!active_) return;
    const bool waiting = (registers_->get<std::uint8_t>(reg::kActivationStatus.address) & 1) != 0;
    // The start time may come while a frame is on its way to the slave: then the pulse is due, and a change of the
    // clock by that frame does not cancel it.
    if (waiting && next_[0] > now)
        next_[0] = clock_->start_moment(due_[0], now);
    else if (!waiting)
        for (unsigned s = 0; s < 2; ++s)
            if (next_[s] != kNever) next_[s] = std::max(now, clock_->moment_of(due_[s], now));
}

// When the clock was set ahead while SYNC is active, the pulses in between are lost, and the time grid is kept. To
// generate all lost pulses would take too long after a jump of years.
void SyncUnit::skip_missed(Time at) {
    const auto ahead = clock_->ahead(due_[0], at);
    if (cycle0_ == 0 || ahead > 0) return;
    const std::uint64_t period = std::uint64_t{cycle0_} * bundle_of(cycle0_);
    due_[0] += (static_cast<std::uint64_t>(-(ahead + 1)) / period + 1) * period;
}

std::uint32_t SyncUnit::settle(Time now) {
    std::uint32_t events = 0;
    while (next() <= now) {
        const unsigned signal = next_[1] < next_[0] ? 1 : 0;
        const Time at = next_[signal];
        const std::uint32_t bundle = bundle_of(cycle0_);
        if (on_[signal]) {
            pulses_[signal] += signal == 0 ? bundle : 1;
            events |= signal == 0 ? wire::al_event::kDcSync0 : wire::al_event::kDcSync1;
            show_pulse(signal);
        }
        if (signal == 1) {
            next_[1] = kNever;
            continue;
        }
        registers_->set<std::uint8_t>(reg::kActivationStatus.address, 0);
        if (countdown1_ == 0) {  // this SYNC0 is followed by a SYNC1
            due_[1] = due_[0] + cycle1_;
            next_[1] = cycle1_ == 0 ? at : clock_->moment_of(due_[1], at);
            countdown1_ = cycle0_ == 0 ? 0 : cycle1_ / cycle0_;
        } else {
            --countdown1_;
        }
        due_[0] += std::uint64_t{cycle0_} * bundle;
        skip_missed(at);
        next_[0] = cycle0_ == 0 ? kNever : std::max(at + Duration(1), clock_->moment_of(due_[0], at));
    }
    return events;
}

// While SYNC is active, the start time registers contain the times of the next pulses.
void SyncUnit::refresh() {
    if (!active_) return;
    if (next_[0] != kNever) registers_->set(reg::kSyncStartTime.address, due_[0]);
    if (next_[1] != kNever)
        registers_->set(reg::kNextSync1Pulse.address, due_[1]);
    else if (next_[0] != kNever)  // SYNC1 follows one of the next SYNC0; with a cycle time of 0 it comes with SYNC0
        registers_->set(reg::kNextSync1Pulse.address,
                        due_[0] + std::uint64_t{countdown1_} * cycle0_ * bundle_of(cycle0_) + cycle1_);
}

SyncUnit::Events SyncUnit::latch(unsigned input, bool rising, Time at) {
    const unsigned edge = rising ? 0 : 1;
    constexpr unsigned kPinState = 0x04;
    const auto control = registers_->get<std::uint8_t>(kLatchControl[input]);
    const auto status = static_cast<std::uint8_t>((registers_->get<std::uint8_t>(kLatchStatus[input]) & ~kPinState) |
                                                  (rising ? kPinState : 0u));
    registers_->set(kLatchStatus[input], status);
    const bool single = ((control >> edge) & 1) != 0;
    const auto bit = static_cast<std::uint8_t>(1u << edge);
    if (single && (status & bit) != 0) return {};
    registers_->set(kEdges[input][edge].address, clock_->copy(at));
    if (!single) return {};
    registers_->set(kLatchStatus[input], static_cast<std::uint8_t>(status | bit));
    // The event belongs to the side that controls the latch input.
    return latch_is_pdis(input) ? Events{wire::al_event::kDcLatch, false} : Events{0, true};
}

bool SyncUnit::latch_is_pdis(unsigned input) const {
    const auto bit = input == 0 ? wire::cyclic_unit::kLatch0IsPdis : wire::cyclic_unit::kLatch1IsPdis;
    return (registers_->get<std::uint8_t>(reg::kCyclicUnitControl.address) & bit) != 0;
}

SyncUnit::Events SyncUnit::was_read(std::uint32_t address, std::size_t length, bool by_pdi) {
    Events cleared;
    unsigned waiting = 0;  // events of the inputs that this side controls
    for (unsigned input = 0; input < 2; ++input) {
        if (latch_is_pdis(input) != by_pdi) continue;
        for (unsigned edge = 0; edge < 2; ++edge)
            if (meets(address, length, kEdges[input][edge])) {
                const auto status = registers_->get<std::uint8_t>(kLatchStatus[input]);
                registers_->set(kLatchStatus[input], static_cast<std::uint8_t>(status & ~(1u << edge)));
            }
        waiting |= registers_->get<std::uint8_t>(kLatchStatus[input]) & 0x03u;
    }
    if (waiting == 0 && by_pdi) cleared.al |= wire::al_event::kDcLatch;
    cleared.ecat_latch = waiting == 0 && !by_pdi;
    if (!by_pdi) return cleared;
    if (meets(address, length, reg::kSync0Status)) {
        registers_->set<std::uint8_t>(reg::kSync0Status.address, 0);
        cleared.al |= wire::al_event::kDcSync0;
    }
    if (meets(address, length, reg::kSync1Status)) {
        registers_->set<std::uint8_t>(reg::kSync1Status.address, 0);
        cleared.al |= wire::al_event::kDcSync1;
    }
    return cleared;
}

}  // namespace margay::sim
