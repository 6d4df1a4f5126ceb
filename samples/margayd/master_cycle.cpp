// The cycle of a master.
#include "margayd/log.hpp"
#include "margayd/master.hpp"

#include <algorithm>
#include <chrono>

namespace margay::service {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLookAround = 1s;
constexpr auto kSettle = 2s;  // between the last news of added slaves and the scan
// A scan ends OP for the other slaves, and the next scan may find no more slaves.
constexpr Duration kLongestPause = 10min;
constexpr int kPauseGrows = 4;
constexpr auto kMeasureAgain = 5s;  // between two measurements of the clocks that fail
constexpr auto kHasHelped = 30s;    // if all slaves have places for this time after a scan, the next scan does not wait

}  // namespace

void Master::cycle() {
    samples::PaceOptions pace{.spin_us = configuration_.spin_us,
                              .priority = configuration_.priority,
                              .cpu = configuration_.cpu,
                              .histogram = {}};
    pace_.emplace(*source_, *ctx_, pace, plan_);
    pace_->start();
    lacks_since_.reset();
    right_since_.reset();
    const auto every = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(kLookAround / plan_.period));
    for (std::uint64_t number = 0; !stopping_ && !is_to_be_scanned(); ++number) {
        // Errors of a cycle are not reported here: the supervision finds their reason and reports it by events.
        (void)pace_->exchange(plan_.period / 2);
        if (number % every == 0) look_around(pace_->figures().overruns, number < 3 * every);
        (void)pace_->wait();
    }
    pace_.reset();
}

// Once a second, with a few system calls.
void Master::look_around(std::uint64_t overruns, bool settles) {
    const Error wrong = what_is_wrong(*ctx_);
    (void)source_->look_for_interfaces();
    const auto now = Clock::now();
    if (lacks_places(wrong)) {
        lacks_since_ = lacks_since_.value_or(now);
        right_since_.reset();
    } else {
        lacks_since_.reset();
        right_since_ = right_since_.value_or(now);
        if (now - *right_since_ >= kHasHelped) scanned_for_places_.reset();
    }
    const auto present =
        std::ranges::count_if(ctx_->slaves(), [](const Slave& s) { return s.al.state != AlState::none; });
    const auto elsewhere = std::ranges::count_if(ctx_->slaves(), [this](const Slave& s) {
        return s.al.state != AlState::none && s.al.state != configuration_.state;
    });
    if (late_clocks_) look_at_clocks();
    if (configuration_.eoe) open_late_eoe();
    companion_->tell({.wrong = wrong,
                      .slaves = static_cast<std::uint16_t>(present),
                      .elsewhere = static_cast<std::uint16_t>(elsewhere),
                      .target = configuration_.state,
                      .overruns = overruns,
                      .settles = settles,
                      .link = ctx_->statistics()});
}

// SYNC signals that are active show that the clocks are set: another measurement would switch the signals off.
void Master::look_at_clocks() {
    if (measure_clocks_.busy()) return;
    const bool done = is_measuring_ && (measure_clocks_.state() == RequestState::success ||
                                        measure_clocks_.error().code == Errc::not_in_sync);
    is_measuring_ = false;
    if (done || std::ranges::any_of(ctx_->slaves(),
                                    [this](const Slave& s) { return slave_clock(*ctx_, s.number).sync_active; })) {
        late_clocks_.reset();
        return;
    }
    const std::uint16_t reference = late_clocks_->reference;
    const bool is_there = reference == 0 || ctx_->slave(reference).al.state != AlState::none;
    const auto now = Clock::now();
    if (!is_there || now < next_measurement_) return;
    next_measurement_ = now + kMeasureAgain;
    measure_clocks_.settings = *late_clocks_;
    is_measuring_ = submit(*ctx_, measure_clocks_).ok();
}

bool Master::has_strangers() const {
    const auto since = companion_->strangers_since();
    return since != std::chrono::steady_clock::time_point{} && std::chrono::steady_clock::now() - since >= kSettle;
}

// A slave could not be read while the segment was brought up, or it has other PDOs since then: by a client, or because
// its modules were changed while it was off. PDOs that an application wants may have these errors for ever: here only
// an ENI wants any, and with an ENI the segment is not scanned again.
bool Master::lacks_places(const Error& wrong) const {
    if (configuration_.state < AlState::safeop) return false;
    const auto lacks = [](Errc code) {
        return code == Errc::no_place || code == Errc::remapping_needed || code == Errc::pdo_size;
    };
    return lacks(wrong.code) || std::ranges::any_of(ctx_->slaves(), [&](const Slave& s) {
               return s.al.state != AlState::none && lacks(s.error.code);
           });
}

// Without an ENI, all slaves that are there belong to the segment. A slave in BOOT may be getting its firmware.
bool Master::is_to_be_scanned() {
    if (eni_) return false;
    const auto now = Clock::now();
    const bool again = scanned_for_places_ && now - *scanned_for_places_ < 2 * kLongestPause;
    const Duration pause = again ? places_pause_ : Duration(kSettle);
    const bool lacks = lacks_since_ && now - *lacks_since_ >= pause;
    const bool strangers = has_strangers();
    if (!lacks && !strangers) return false;
    if (std::ranges::any_of(ctx_->slaves(), [](const Slave& s) { return s.al.state == AlState::boot; })) return false;
    why_scanned_ = strangers ? "slaves were added or exchanged"
                             : "slaves have no place in the process image, or other PDOs than when it was laid out";
    if (strangers) return true;
    places_pause_ = std::min<Duration>(kPauseGrows * pause, kLongestPause);
    scanned_for_places_ = now;
    return true;
}

}  // namespace margay::service
