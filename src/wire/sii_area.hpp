// The configuration area of an SII (words 0x00–0x07), changed word by word: which words, and in which order.
//
// The ESC loads the area at power-up if its checksum (low octet of word 7) is right. An EEPROM takes one word at a
// time, so that the area is a mixture of old and new words for a while. A checksum of 8 bits vouches for one mixture in
// 256 by chance; plan_area() makes sure that it vouches for none.
#pragma once

#include "wire/sii.hpp"

#include <array>
#include <span>

namespace margay::wire::sii {

// One word of the area that is to be written.
struct AreaWrite {
    std::uint8_t word = 0;
    std::uint16_t before = 0;  // what stands there when its turn comes: writing it back undoes the step
    std::uint16_t after = 0;
    friend constexpr bool operator==(const AreaWrite&, const AreaWrite&) = default;
};

class AreaPlan {
  public:
    static constexpr std::size_t kMost = kConfigurationBytes / kWordBytes + 1;  // each word, and word 7 twice

    constexpr void add(AreaWrite write) { writes_[count_++] = write; }
    [[nodiscard]] constexpr std::span<const AreaWrite> writes() const { return std::span(writes_).first(count_); }

  private:
    std::array<AreaWrite, kMost> writes_{};
    std::size_t count_ = 0;
};

// The writes that make `old` into `wanted`, both kConfigurationBytes: the words that differ, in rising order, the
// checksum last. Where a mixture on the way would have a right checksum by chance, word 7 is first made wrong for all
// of them. After any number of writes the area is `old`, `wanted`, or has a wrong checksum. Not so where `wanted`
// itself has a wrong checksum: it is written as it is.
[[nodiscard]] AreaPlan plan_area(Bytes old, Bytes wanted);

}  // namespace margay::wire::sii
