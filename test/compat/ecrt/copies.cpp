// The copies between the memory of a domain and the image of a group have the same result as plain copies: any sizes
// and distances, equal and different, in any order.
#include "compat/ecrt/copies.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <random>
#include <vector>

using margay::compat::ecrt::Copies;
using margay::compat::ecrt::Copy;

namespace {

constexpr unsigned kRoom = 4096;
using Memory = std::array<std::uint8_t, kRoom>;

bool round_is_right(std::mt19937& engine) {
    const auto random = [&engine] { return static_cast<unsigned>(engine()); };
    Memory from{};
    Memory to{};
    for (auto& octet : from) octet = static_cast<std::uint8_t>(random());
    for (auto& octet : to) octet = static_cast<std::uint8_t>(random());
    Memory wanted = to;
    const bool same_size = random() % 4 != 0;
    const unsigned size = random() % 70;
    const unsigned gap_to = random() % 5;
    const unsigned gap_from = random() % 5;
    std::vector<Copy> plan;
    unsigned at_to = 0;
    unsigned at_from = 0;
    for (unsigned left = random() % 20; left != 0; --left) {
        const unsigned bytes = same_size ? size : random() % 70;
        plan.push_back({&to[at_to], &from[at_from], bytes});
        std::memcpy(&wanted[at_to], &from[at_from], bytes);
        at_to += bytes + (same_size ? gap_to : random() % 4);
        at_from += bytes + (same_size ? gap_from : random() % 4);
    }
    if (random() % 2 != 0) std::shuffle(plan.begin(), plan.end(), engine);
    Copies copies;
    copies.set(plan);
    copies.execute();
    return to == wanted;
}

}  // namespace

int main() {
    std::mt19937 random(1);
    for (int n = 0; n < 20000; ++n)
        if (!round_is_right(random)) {
            std::printf("round %d: other octets than those of plain copies\n", n);
            return 1;
        }
    return 0;
}
