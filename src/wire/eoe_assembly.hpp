// Puts the fragments of one Ethernet frame together (ETG.1000.6 "EoE fragment"). Each fragment is checked: its number,
// its offset, and its size. A frame of which a fragment is missing or wrong is dropped as a whole.
#pragma once

#include "wire/eoe.hpp"

namespace margay::wire::eoe {

class Assembly {
  public:
    enum class Took : std::uint8_t {
        more,          // the frame is not complete yet
        whole,         // frame() is complete
        out_of_order,  // a fragment before this one is missing; the frame is dropped
        malformed,     // sizes that contradict each other; the frame is dropped
        too_long,      // the frame is longer than the memory; the frame is dropped
    };

    // The longest frame is as long as the memory.
    void use(MutableBytes memory) { memory_ = memory; }

    // A frame has begun and is not complete.
    [[nodiscard]] bool busy() const { return next_ != 0; }
    // The fragment belongs to the frame that has begun.
    [[nodiscard]] bool is_part(const Header& header) const {
        return busy() && header.port == port_ && header.frame_number == frame_number_;
    }
    void drop() { next_ = 0; }
    // Of the frame that has begun.
    [[nodiscard]] std::uint8_t frame_number() const { return frame_number_; }
    [[nodiscard]] std::uint8_t port() const { return port_; }

    // Takes a fragment; `data` is behind its header. Fragment 0 begins a frame, whatever has begun before.
    [[nodiscard]] Took add(const Header& header, Bytes data);
    // After `whole`, until the next add().
    [[nodiscard]] Bytes frame() const { return memory_.first(bytes_); }
    [[nodiscard]] const std::optional<std::uint32_t>& time_stamp() const { return time_stamp_; }

  private:
    [[nodiscard]] Took check(const Header& header, std::size_t bytes);

    MutableBytes memory_;
    std::size_t bytes_ = 0;
    std::optional<std::uint32_t> time_stamp_;
    std::uint8_t next_ = 0;    // number of the next fragment; 0: no frame has begun
    std::uint8_t blocks_ = 0;  // announced size of the frame
    std::uint8_t port_ = 0;
    std::uint8_t frame_number_ = 0;
};

}  // namespace margay::wire::eoe
