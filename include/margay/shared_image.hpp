// A process image for another thread of the application. That thread always reads and writes complete cycles.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace margay {

// A value that one thread writes and another thread reads as a whole. No thread ever waits, and the reader gets the
// newest value.
class TripleBuffer {
  public:
    TripleBuffer() = default;
    // `memory` must have three times `octets`.
    void attach(std::span<std::byte> memory, std::size_t octets) {
        for (std::size_t n = 0; n < 3; ++n) parts_[n] = memory.subspan(n * octets, octets);
        back_ = 0;
        front_ = 1;
        middle_.store(2, std::memory_order_release);
    }

    // For the writer. back(): the octets to write; they have the content of an older publication.
    // publish() gives them to the reader.
    [[nodiscard]] std::span<std::byte> back() const { return parts_[back_]; }
    void publish() {
        back_ = middle_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel) & kIndex;
    }

    // For the reader: fetches the newest value; false if there is none since the last call.
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

// The image of a group for one other thread than the thread of the cycle. Set GroupConfiguration::shared before
// config_map(); after that each send_processdata() sends the outputs that were published last, and each
// receive_processdata() that receives all inputs (except inputs of slaves that are known to be lost) publishes them.
//
//     // Sizes: at least the sizes that config_map() will need.
//     std::vector<std::byte> memory(SharedImage::memory_bytes(outputs, inputs));
//     SharedImage shared(memory);
//     ctx.group(0).config.shared = &shared;
//     // In the other thread, except while config_map() executes, because it divides the memory again:
//     if (shared.refresh_inputs()) { … shared.inputs() … }
//     … shared.outputs() …
//     shared.publish_outputs();
class SharedImage {
  public:
    explicit SharedImage(std::span<std::byte> memory) : memory_(memory) {}
    SharedImage(const SharedImage&) = delete;
    SharedImage& operator=(const SharedImage&) = delete;

    [[nodiscard]] static constexpr std::size_t memory_bytes(std::size_t output_bytes, std::size_t input_bytes) {
        return 3 * (output_bytes + input_bytes);
    }
    // How much memory the image has.
    [[nodiscard]] std::size_t memory_size() const { return memory_.size(); }

    // --- The other thread, after config_map() ---
    // The outputs to write, with the offsets of the image. After a publication this buffer has older values again:
    // write all outputs each time, or keep a copy.
    [[nodiscard]] std::span<std::byte> outputs() { return outputs_.back(); }
    void publish_outputs() { outputs_.publish(); }
    // Fetches the newest inputs; false if no cycle has brought inputs since the last call. inputs() begins with the
    // first input octet of the image.
    bool refresh_inputs() { return inputs_.refresh(); }
    [[nodiscard]] std::span<const std::byte> inputs() const { return inputs_.front(); }

  private:
    friend struct SharedImageAccess;
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

    std::span<std::byte> memory_;
    TripleBuffer outputs_;
    TripleBuffer inputs_;
};

}  // namespace margay
