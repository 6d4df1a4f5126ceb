// The order of writes to the words of the configuration area.
#include "wire/sii_area.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace margay::wire::sii {
namespace {

using Area = std::array<std::byte, kConfigurationBytes>;

Area with_checksum(Area area) {
    area[14] = static_cast<std::byte>(checksum(area));
    return area;
}

// After each write the area has the old words, the new words, or a wrong checksum.
void expect_safe(const Area& old, const Area& wanted) {
    Area area = old;
    const auto plan = plan_area(old, wanted);
    for (const auto& write : plan.writes()) {
        ASSERT_LT(write.word, 8);
        ASSERT_EQ(load_le<std::uint16_t>(area, write.word * 2U), write.before);
        ASSERT_NE(write.before, write.after);
        store_le(MutableBytes(area), write.word * 2U, write.after);
        const bool mixture = area != old && area != wanted;
        ASSERT_FALSE(mixture && checksum_right(area)) << unsigned{write.word};
    }
    EXPECT_EQ(area, wanted);
}

TEST(SiiArea, NoMixtureOfOldAndNewWordsHasARightChecksum) {
    std::mt19937 random(7);
    std::size_t twice = 0;
    for (int n = 0; n < 20000; ++n) {
        Area old{};
        for (auto& octet : old) octet = static_cast<std::byte>(random());
        Area wanted = old;
        for (auto& octet : wanted)
            if (random() % 2 == 0) octet = static_cast<std::byte>(random());
        wanted = with_checksum(wanted);
        if (n % 4 != 0) old = with_checksum(old);
        if (n % 3 == 0) wanted[15] = old[15];
        expect_safe(old, wanted);
        const auto plan = plan_area(old, wanted);
        twice += std::ranges::count(plan.writes(), 7, &AreaWrite::word) == 2;
    }
    EXPECT_GT(twice, 100U) << "word 7 is written twice where a mixture would be right by chance";
    EXPECT_LT(twice, 2000U);
}

TEST(SiiArea, WritesNothingWhereNothingDiffers) {
    const Area same = with_checksum({});
    EXPECT_TRUE(plan_area(same, same).writes().empty());
}

TEST(SiiArea, AWrongChecksumThatIsWantedIsWritten) {
    const Area old = with_checksum({});
    Area wanted = old;
    wanted[0] = std::byte{5};
    const auto plan = plan_area(old, wanted);
    ASSERT_EQ(plan.writes().size(), 1U);
    EXPECT_EQ(plan.writes()[0], (AreaWrite{0, 0, 5}));
}

}  // namespace
}  // namespace margay::wire::sii
