// Process data at fixed times, beside all other accesses of the bench: a frame waits neither for the reply to the frame
// before nor for that to another access. Slaves that compare frames with SYNC0 need it, also with short cycles.
#pragma once

#include "wire/sync_manager.hpp"

#include <margay/context.hpp>
#include <margay/registers.hpp>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace margay::samples::conformance {

// A SyncManager of process data, as a master configures it in PREOP.
struct ProcessArea {
    std::uint8_t sync_manager = 0;
    bool outputs = false;
    wire::SyncManager setting{};
    // What one access carries. Larger areas are exchanged in part.
    [[nodiscard]] std::size_t bytes() const { return std::min<std::size_t>(setting.length_bytes, 1486); }
};

class Cycle {
  public:
    Cycle(Context& ctx, std::uint16_t slave) : ctx_(ctx), slave_(slave) {}

    // From the next multiple of `period` on, a frame with zeros for all outputs and with all inputs.
    void start(const std::vector<ProcessArea>& areas, Time now, Duration period);
    void stop() { next_ = kNever; }
    [[nodiscard]] bool running() const { return next_ != kNever; }
    [[nodiscard]] Duration period() const { return period_; }
    // Submits the frame that is due; the caller polls then. Returns the time of the next frame.
    Time step(Time now);

    // Since start(): frames that have come back, and frames in which the slave did not accept or provide all data.
    [[nodiscard]] unsigned frames() const { return frames_; }
    [[nodiscard]] unsigned missed() const { return missed_; }
    // By how much a frame came too late, at most, since forget_late(): the program was not executed in time.
    [[nodiscard]] Duration latest() const { return latest_; }
    void forget_late() { latest_ = {}; }
    // A frame was lost on the line; the next call returns nullopt.
    [[nodiscard]] std::optional<Error> line_fault() { return std::exchange(line_fault_, std::nullopt); }

  private:
    // The accesses to all areas. They are submitted together, so that they are in one frame where they fit.
    struct Frame {
        std::vector<std::unique_ptr<RegisterWriteRequest>> writes{};
        std::vector<std::unique_ptr<RegisterReadRequest>> reads{};
        std::vector<std::byte> zeros{};
        std::vector<std::byte> inputs{};
        bool on_wire = false;
        [[nodiscard]] bool busy() const;
    };
    std::unique_ptr<Frame> make_frame(const std::vector<ProcessArea>& areas) const;
    void send(Frame& frame);
    void judge(Frame& frame);

    Context& ctx_;
    std::uint16_t slave_;
    std::vector<std::unique_ptr<Frame>> pool_;
    Time next_ = kNever;
    Duration period_{};
    unsigned frames_ = 0;
    unsigned missed_ = 0;
    Duration latest_{};
    std::optional<Error> line_fault_;
};

// The cycle runs while this object exists; a cycle of the same period that runs already continues.
class CycleRun {
  public:
    CycleRun(Cycle& cycle, const std::vector<ProcessArea>& areas, Time now, Duration period)
        : cycle_(!cycle.running() || cycle.period() != period ? &cycle : nullptr) {
        if (cycle_ != nullptr) cycle_->start(areas, now, period);
    }
    ~CycleRun() {
        if (cycle_ != nullptr) cycle_->stop();
    }
    CycleRun(const CycleRun&) = delete;
    CycleRun& operator=(const CycleRun&) = delete;
    CycleRun(CycleRun&& other) noexcept : cycle_(std::exchange(other.cycle_, nullptr)) {}

  private:
    Cycle* cycle_;
};

}  // namespace margay::samples::conformance
