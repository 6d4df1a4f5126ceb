// A process image for applications whose other threads work on it: whole cycles, never half of one.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace margay {

// A value of some octets that one thread writes whole and another one reads whole: neither ever waits, the reader has
// the newest one.
class TripleBuffer {
  public:
    TripleBuffer() = default;
    // `memory` holds three times `octets`.
    void attach(std::span<std::byte> memory, std::size_t octets) {
        for (std::size_t n = 0; n < 3; ++n) parts_[n] = memory.subspan(n * octets, octets);
        back_ = 0;
        front_ = 1;
        middle_.store(2, std::memory_order_release);
    }

    // The writer's: what it writes into, as it left it two publications before, and its hand-over.
    [[nodiscard]] std::span<std::byte> back() const { return parts_[back_]; }
    void publish() {
        back_ = middle_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel) & kIndex;
    }

    // The reader's: takes over the newest value; false when there is none since the last time.
    bool refresh() {
        if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
        front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kIndex;
        return true;
    }
    [[nodiscard]] std::span<const std::byte> front() const { return parts_[front_]; }

  private:
    static constexpr std::uint8_t kFresh = 4;
    static constexpr std::uint8_t kIndex = 3;

    std::array<std::span<std::byte>, 3> parts_{};
    std::uint8_t back_ = 0;
    std::uint8_t front_ = 1;
    std::atomic<std::uint8_t> middle_{2};
};

// The image of a group for one other thread than that of the cycle. Name it in GroupConfiguration::shared before
// config_map(); from then on each send_processdata() sends the outputs published last, and each receive_processdata()
// that brings in a whole cycle, or one that is whole but for slaves known to be lost, publishes its inputs.
//
//     // Sizes as config_map() will have them, or more:
//     std::vector<std::byte> memory(SharedImage::memory_bytes(outputs, inputs));
//     SharedImage shared(memory);
//     ctx.group(0).config.shared = &shared;
//     … in the other thread, whenever it likes:
//     if (shared.refresh_inputs()) …shared.inputs()…;
//     …shared.outputs()…; shared.publish_outputs();
class SharedImage {
  public:
    explicit SharedImage(std::span<std::byte> memory) : memory_(memory) {}
    SharedImage(const SharedImage&) = delete;
    SharedImage& operator=(const SharedImage&) = delete;

    [[nodiscard]] static constexpr std::size_t memory_bytes(std::size_t output_bytes, std::size_t input_bytes) {
        return 3 * (output_bytes + input_bytes);
    }

    // --- The other thread, once config_map() is through ---
    // To be written; offsets as in the image. After publishing it holds an older value again: write all of it, or keep
    // a copy.
    [[nodiscard]] std::span<std::byte> outputs() { return outputs_.back(); }
    void publish_outputs() { outputs_.publish(); }
    // Takes over the newest inputs; false when no cycle has brought any since the last time. inputs() begins where the
    // image's inputs begin.
    bool refresh_inputs() { return inputs_.refresh(); }
    [[nodiscard]] std::span<const std::byte> inputs() const { return inputs_.front(); }

    // --- For the library ---
    [[nodiscard]] bool attach(std::size_t output_bytes, std::size_t input_bytes) {
        if (memory_.size() < memory_bytes(output_bytes, input_bytes)) return false;
        if (!memory_.empty()) std::memset(memory_.data(), 0, memory_.size());
        outputs_.attach(memory_.first(3 * output_bytes), output_bytes);
        inputs_.attach(memory_.subspan(3 * output_bytes), input_bytes);
        return true;
    }
    void take_outputs(std::span<std::byte> image) {
        if (outputs_.refresh() && !image.empty()) std::memcpy(image.data(), outputs_.front().data(), image.size());
    }
    void give_inputs(std::span<const std::byte> image) {
        if (!image.empty()) std::memcpy(inputs_.back().data(), image.data(), image.size());
        inputs_.publish();
    }

  private:
    std::span<std::byte> memory_;
    TripleBuffer outputs_;
    TripleBuffer inputs_;
};

}  // namespace margay
