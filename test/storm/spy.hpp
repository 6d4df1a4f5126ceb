// Watches the program of a device: records the inputs that it writes to its input SyncManager, and the outputs that it
// applies in OP.
#pragma once

#include "sim/process_data.hpp"

#include <deque>
#include <memory>
#include <set>
#include <utility>
#include <vector>

namespace margay::storm {

using Value = std::vector<std::byte>;

class Spy final : public sim::Firmware, private subdevice::EscAccess {
  public:
    explicit Spy(std::unique_ptr<sim::Firmware> inner) : inner_(std::move(inner)) {}

    void start(subdevice::EscAccess& esc, Time now) override;
    Time step(Time now) override { return inner_->step(now); }
    [[nodiscard]] bool polls() const override { return inner_->polls(); }
    [[nodiscard]] bool feeds_pdi_watchdog() const override { return inner_->feeds_pdi_watchdog(); }
    bool add_quirk(sim::Quirk quirk, std::vector<std::byte>& sii) override { return inner_->add_quirk(quirk, sii); }
    [[nodiscard]] sim::ProcessDataFirmware* process_data() override { return inner_->process_data(); }

    // Inputs that the program showed; the latest with their time. Each entry is a complete value.
    struct Shown {
        Time at{};
        Value value;
    };
    // Returns whether the first `bits` bits of the inputs were equal to `value` at some time since `from`, or at any
    // time.
    [[nodiscard]] bool has_shown(const Value& value, std::uint32_t bits, Time from) const;
    [[nodiscard]] bool has_ever_shown(const Value& value, std::uint32_t bits) const;
    [[nodiscard]] const std::deque<Shown>& shown() const { return shown_; }
    // Outputs that the program applied in OP since the last call.
    [[nodiscard]] std::vector<Value> take_applied() { return std::exchange(applied_, {}); }

  private:
    void read(std::uint16_t address, MutableBytes into) noexcept override;
    void write(std::uint16_t address, Bytes data) noexcept override;
    [[nodiscard]] Time now() noexcept override { return esc_->now(); }
    [[nodiscard]] bool starts_sm(std::uint16_t address, std::size_t length, bool outputs);

    static constexpr std::size_t kMostShown = 4096;  // more than the cycles that are on their way at any time
    std::unique_ptr<sim::Firmware> inner_;
    subdevice::EscAccess* esc_ = nullptr;
    std::deque<Shown> shown_;
    std::set<Value> ever_;
    std::vector<Value> applied_;
    Value last_applied_;
};

// The first `bits` bits of a value.
[[nodiscard]] Value first_bits(const Value& value, std::uint32_t bits);

}  // namespace margay::storm
