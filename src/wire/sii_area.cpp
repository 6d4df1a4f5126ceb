#include "wire/sii_area.hpp"

#include <algorithm>

namespace margay::wire::sii {
namespace {

using Area = std::array<std::byte, kConfigurationBytes>;

std::uint16_t word_of(Bytes area, std::size_t word) { return load_le<std::uint16_t>(area, word * kWordBytes); }

// The checksums of the area while words 0–6 change from old to new, one word at a time: at most eight checksums.
class Mixtures {
  public:
    Mixtures(const Area& old, Bytes wanted) {
        Area area = old;
        add(area);
        for (std::size_t word = 0; word < word::kChecksum; ++word) {
            if (word_of(area, word) == word_of(wanted, word)) continue;
            store_le(MutableBytes(area), word * kWordBytes, word_of(wanted, word));
            add(area);
        }
    }
    // Whether one of the mixtures has this checksum. The old words and the new words are not mixtures.
    [[nodiscard]] bool any(std::uint8_t stored) const {
        const auto all = std::span(checksums_).first(count_);
        return count_ > 2 && std::ranges::count(all.subspan(1, count_ - 2), stored) != 0;
    }
    // A checksum that differs from the checksums of all mixtures, of the old words and of the new words.
    [[nodiscard]] std::uint8_t none_of_them() const {
        const auto all = std::span(checksums_).first(count_);
        std::uint8_t value = 0;
        while (std::ranges::count(all, value) != 0) ++value;
        return value;
    }
    [[nodiscard]] std::size_t changed_words() const { return count_ - 1; }
    [[nodiscard]] std::uint8_t of_new() const { return checksums_[count_ - 1]; }

  private:
    void add(const Area& area) { checksums_[count_++] = checksum(area); }

    std::array<std::uint8_t, 8> checksums_{};
    std::size_t count_ = 0;
};

}  // namespace

AreaPlan plan_area(Bytes old, Bytes wanted) {
    Area area{};
    std::copy_n(old.begin(), area.size(), area.begin());
    const auto mixtures = Mixtures(area, wanted);
    const auto last = word_of(wanted, word::kChecksum);
    AreaPlan plan;
    const auto change = [&](std::size_t word, std::uint16_t to) {
        const auto before = word_of(area, word);
        if (before == to) return;
        plan.add({static_cast<std::uint8_t>(word), before, to});
        store_le(MutableBytes(area), word * kWordBytes, to);
    };
    const auto stored = static_cast<std::uint8_t>(word_of(area, word::kChecksum));
    // When both octets of word 7 change, the new words with the old checksum are a mixture too.
    const bool high_differs = (word_of(area, word::kChecksum) ^ last) > 0xFF;
    const bool vouched =
        mixtures.any(stored) || (high_differs && mixtures.changed_words() != 0 && stored == mixtures.of_new());
    if (vouched && checksum_right(wanted))
        change(word::kChecksum, static_cast<std::uint16_t>((last & 0xFF00) | mixtures.none_of_them()));
    for (std::size_t word = 0; word < word::kChecksum; ++word) change(word, word_of(wanted, word));
    change(word::kChecksum, last);
    return plan;
}

}  // namespace margay::wire::sii
