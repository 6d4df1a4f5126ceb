// Figures that the documents repeat are the same everywhere, and equal the values that the headers compute.
#include <margay/context.hpp>

#include <places.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace margay::layers {
namespace {

// The number after `mark` in a file of the project; a negative number when the file does not contain `mark`.
double figure_after(const std::string& file, const std::string& mark) {
    std::ifstream in(MARGAY_SOURCE_DIR "/" + file, std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    const auto at = text.find(mark);
    return at == std::string::npos ? -1 : std::strtod(text.c_str() + at + mark.size(), nullptr);
}

// The memory of one more slave, without the memory of its sequences. The size of the tables of all slaves is a multiple
// of the greatest alignment, which is at most 16 octets. So a difference of 16 slaves has no remainder.
constexpr std::size_t bytes_of_a_slave(bool clocks) {
    Limits one{.slaves = 1, .tasks = 1, .clocks = clocks};
    Limits more = one;
    more.slaves = 17;
    return (context_bytes(more) - context_bytes(one)) / 16;
}

TEST(Figures, TheMemoryOfASlaveIsThatOfTheTable) {
    if (sizeof(void*) != 8) GTEST_SKIP() << "the first column is for pointers of 64 bits";
    EXPECT_EQ(figure_after("test/embedded/README.md", "| all | "), static_cast<double>(bytes_of_a_slave(true)));
}

TEST(Figures, TheMemoryOfAClockIsThatOfTheLimit) {
    EXPECT_EQ(figure_after("include/margay/limits.hpp", "no memory for distributed clocks ("),
              static_cast<double>(bytes_of_a_slave(true) - bytes_of_a_slave(false)));
}

// embedded/sizes prints the figures of the table. The comparison with SOEM repeats one row of the table.
TEST(Figures, TheCodeSizeOfTheComparisonIsThatOfTheTable) {
    const double row = figure_after("README.md", "| … and SDO reading | ");
    EXPECT_GT(row, 0);
    EXPECT_EQ(figure_after("README.md", "| code size on a Cortex-M4 | **larger**: "), std::round(row));
}

}  // namespace
}  // namespace margay::layers
