#include "common/frame_times.hpp"

#include "common/counted.hpp"

#include <margay/cycle_stamps.hpp>

#include <fmt/format.h>

namespace margay::samples {

void add_frame_time_options(Arguments& arguments, FrameTimeOptions& options) {
    arguments.option(
        "--send-at", options.send_at_us,
        "the frames leave this long, in µs, after the cycle has begun: the system or the NIC holds them, so "
        "that they leave without the jitter of the wake-up (nic_check says whether the interface can); "
        "longer than this jitter, shorter than --period; 0: at once",
        Bounds{0, 1'000'000});
    arguments.choice("--stamps", options.stamps,
                     "measure cycles by the times that the NIC notes for its frames: hardware, or software (by the "
                     "driver and the kernel), or none, the default",
                     {{"hardware", WantedTimes::Stamps::hardware},
                      {"software", WantedTimes::Stamps::software},
                      {"none", WantedTimes::Stamps::off}});
}

WantedTimes wanted_times(const FrameTimeOptions& options) {
    return {.stamps = options.stamps.value_or(WantedTimes::Stamps::off), .send_at = options.send_at_us != 0};
}

std::string refusal(const FrameTimeOptions& options, unsigned period_us) {
    if (options.send_at_us < period_us) return {};
    return fmt::format("--send-at {}: the frames must leave within the period of {} µs", options.send_at_us, period_us);
}

std::string missed_text(std::uint64_t frames) {
    return counted(frames, "frame did not leave at its time (--send-at): it was given to the NIC too late",
                   "frames did not leave at their time (--send-at): they were given to the NIC too late");
}

void WireWatch::count(Context& ctx, const FrameTiming& nic, WireFigures& into) {
    if (nic.sent == nullptr || nic.received == nullptr) return;
    const CycleStamps stamps = cycle_stamps(ctx, nic);
    if (stamps.sent_ns && last_sent_ns_)
        into.period.record(Duration(static_cast<Duration::rep>(*stamps.sent_ns - *last_sent_ns_)));
    last_sent_ns_ = stamps.sent_ns;
    if (const auto trip = stamps.round_trip())
        into.round_trip.record(*trip);
    else
        ++into.unstamped;
}

}  // namespace margay::samples
