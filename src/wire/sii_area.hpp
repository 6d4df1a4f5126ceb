// The order of word writes that change the configuration area of an SII (words 0x00–0x07).
//
// The ESC loads the area at power-up if its checksum (low octet of word 7) is correct. An EEPROM is written one word at
// a time, so during a change the area is a mixture of old and new words. A checksum of 8 bits is correct by chance for
// one mixture in 256; plan_area() prevents this for all mixtures.
#pragma once

#include "wire/sii.hpp"

#include <array>
#include <span>

namespace margay::wire::sii {

// One word of the area to write.
struct AreaWrite {
    std::uint8_t word = 0;
    std::uint16_t before = 0;  // the value before this write; write it back to undo the step
    std::uint16_t after = 0;
    friend constexpr bool operator==(const AreaWrite&, const AreaWrite&) = default;
};

class AreaPlan {
  public:
    static constexpr std::size_t kMost = kConfigurationBytes / kWordBytes + 1;  // each word once, and word 7 twice

    constexpr void add(AreaWrite write) { writes_[count_++] = write; }
    [[nodiscard]] constexpr std::span<const AreaWrite> writes() const { return std::span(writes_).first(count_); }

  private:
    std::array<AreaWrite, kMost> writes_{};
    std::size_t count_ = 0;
};

// The writes that change `old` into `wanted`; both must have kConfigurationBytes octets. The words that differ are
// written in ascending order, the checksum last. If a mixture on the way would have a correct checksum by chance, word
// 7 is first set to a checksum that is wrong for all mixtures. Then, after any number of writes, the area is `old`,
// `wanted`, or has a wrong checksum. Exception: if `wanted` itself has a wrong checksum, it is written without this
// protection.
[[nodiscard]] AreaPlan plan_area(Bytes old, Bytes wanted);

}  // namespace margay::wire::sii
