// The receive times of one slave (ESC registers 0x0900–0x090F and 0x0918), averaged over several measurements.
#pragma once

#include <array>
#include <cstdint>

namespace margay {

// The times that one measurement has latched, in the local time of the slave. A port without a neighbour keeps an old
// value.
struct ReceiveTimes {
    std::array<std::uint32_t, 4> port_ns{};
    // The low half of register 0x0918: when the frame passed the processing unit.
    std::uint32_t processing_ns = 0;
    bool has_processing = false;  // the slave has this register
};

// Times since the frame arrived at the entry port. Local times have 32 bits and wrap every 4.29 s; a frame needs less
// than half of that, so the differences modulo 2^32 are right.
class PortTimes {
  public:
    void clear() { *this = PortTimes{}; }
    void add(const ReceiveTimes& times, std::uint8_t entry_port) {
        const std::uint32_t entry = times.port_ns[entry_port & 3];
        for (unsigned p = 0; p < 4; ++p) add_one(p, times.port_ns[p] - entry);
        has_processing_ = times.has_processing;
        add_one(kProcessing, times.processing_ns - entry);
        ++count_;
    }
    // Sets the port at which the frame has arrived first.
    void begin_at(std::uint8_t entry_port) {
        const auto first = static_cast<std::uint32_t>(first_[entry_port & 3]);
        const std::int64_t sum = sum_[entry_port & 3];
        for (std::int32_t& time : first_) time = static_cast<std::int32_t>(static_cast<std::uint32_t>(time) - first);
        for (std::int64_t& changes : sum_) changes -= sum;
    }
    [[nodiscard]] std::uint8_t count() const { return count_; }
    // Whether the measurements differ by more than the jitter of a frame. Then some of them have an old time, because
    // no frame arrived at the port.
    [[nodiscard]] bool differ(std::uint8_t port) const { return (differ_ >> (port & 3) & 1) != 0; }
    [[nodiscard]] bool full() const { return count_ == kMost; }
    // The means, in picoseconds: sums of many rounded nanoseconds would deviate.
    [[nodiscard]] std::int64_t port_ps(std::uint8_t port) const { return mean_ps(port & 3); }
    [[nodiscard]] bool has_processing() const { return has_processing_; }
    [[nodiscard]] std::int64_t processing_ps() const { return mean_ps(kProcessing); }

    static constexpr std::uint8_t kMost = 255;

  private:
    static constexpr unsigned kProcessing = 4;
    static constexpr std::int64_t kMostChange_ns = 2000;

    void add_one(unsigned which, std::uint32_t since_entry) {
        const auto time = static_cast<std::int32_t>(since_entry);
        if (count_ == 0) first_[which] = time;
        const std::int64_t change = std::int64_t{time} - first_[which];
        sum_[which] += change;
        if (change > kMostChange_ns || change < -kMostChange_ns) differ_ |= static_cast<std::uint8_t>(1U << which);
    }
    [[nodiscard]] std::int64_t mean_ps(unsigned which) const {
        return count_ == 0 ? 0 : std::int64_t{first_[which]} * 1000 + sum_[which] * 1000 / count_;
    }

    std::array<std::int32_t, 5> first_{};
    std::array<std::int64_t, 5> sum_{};  // sums of the differences to `first_`
    std::uint8_t count_ = 0;
    bool has_processing_ = false;
    std::uint8_t differ_ = 0;  // bit p: see differ()
};

}  // namespace margay
