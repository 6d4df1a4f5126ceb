#include "subdevice_check/cycle.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

constexpr std::size_t kMostOnWire = 8;  // frames; the time until a frame comes back may be several periods

bool any_busy(const auto& requests) {
    return std::ranges::any_of(requests, [](const auto& request) { return request->busy(); });
}

}  // namespace

bool Cycle::Frame::busy() const { return any_busy(writes) || any_busy(reads); }

std::unique_ptr<Cycle::Frame> Cycle::make_frame(const std::vector<ProcessArea>& areas) const {
    auto frame = std::make_unique<Frame>();
    std::size_t most = 0;
    for (const auto& area : areas) most = std::max(most, area.bytes());
    frame->zeros.resize(most);
    frame->inputs.resize(most);
    const auto prepare = [&](auto& list, auto request, const ProcessArea& area, auto data) {
        request->slave = slave_;
        request->address = area.setting.physical_start;
        request->data = data;
        list.push_back(std::move(request));
    };
    for (const auto& area : areas) {
        if (area.bytes() == 0) continue;
        if (area.outputs)
            prepare(frame->writes, std::make_unique<RegisterWriteRequest>(), area,
                    std::span<const std::byte>(frame->zeros).first(area.bytes()));
        else
            prepare(frame->reads, std::make_unique<RegisterReadRequest>(), area,
                    std::span(frame->inputs).first(area.bytes()));
    }
    return frame;
}

void Cycle::start(const std::vector<ProcessArea>& areas, Time now, Duration period) {
    pool_.clear();
    for (std::size_t n = 0; n < kMostOnWire; ++n) pool_.push_back(make_frame(areas));
    period_ = period;
    next_ = now + (period - now.time_since_epoch() % period);
    frames_ = missed_ = 0;
    line_fault_.reset();
}

void Cycle::send(Frame& frame) {
    frame.on_wire = true;
    const auto submit_all = [&](auto& requests) {
        for (auto& request : requests)
            if (const auto submitted = submit(ctx_, *request); !submitted) line_fault_ = submitted.error();
    };
    submit_all(frame.writes);
    submit_all(frame.reads);
}

void Cycle::judge(Frame& frame) {
    frame.on_wire = false;
    bool whole = true;
    const auto look = [&](const auto& requests) {
        for (const auto& request : requests) {
            whole = whole && request->state() == RequestState::success;
            const auto code = request->state() == RequestState::error ? request->error().code : Errc::none;
            if (code != Errc::none && code != Errc::working_counter) line_fault_ = request->error();
        }
    };
    look(frame.writes);
    look(frame.reads);
    ++frames_;
    if (!whole) ++missed_;
}

Time Cycle::step(Time now) {
    if (!running()) return kNever;
    for (auto& frame : pool_)
        if (frame->on_wire && !frame->busy()) judge(*frame);
    if (now < next_) return next_;
    const auto free = std::ranges::find_if(pool_, [](const auto& frame) { return !frame->on_wire; });
    if (free != pool_.end()) send(**free);
    latest_ = std::max(latest_, now - next_);
    // The program may have been suspended for some time. The frames nevertheless keep their times.
    next_ += ((now - next_) / period_ + 1) * period_;
    return next_;
}

}  // namespace margay::samples::conformance
