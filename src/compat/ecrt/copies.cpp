#include "compat/ecrt/copies.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace margay::compat::ecrt {

// The function that makes the copies of a run.
struct Copies::Makers {
    using Make = int (*)(const Run* run);
    static constexpr std::size_t kMostWithoutCall = 32;
    using Table = std::array<Make, kMostWithoutCall + 1>;

    static int nothing(const Run*) { return 0; }
    static int next(const Run* run) {
        ++run;
        asm("" : "+r"(run));  // the compiler makes one addition instead of two, for the call and for the argument
        return run->make(run);
    }
    static int whole(const Run* run) {
        std::memcpy(run->to, run->from, run->bytes);
        return next(run);
    }
    // The last block overlaps the one before it.
    static constexpr std::uint32_t kBlock = 64;
    static constexpr std::uint32_t kMostInBlocks = 512;
    static int blocks(const Run* run) {
        std::uint8_t* to = run->to;
        const std::uint8_t* from = run->from;
        std::uint32_t left = run->bytes;
        const auto copy = [&](auto... block) {
            constexpr std::uint32_t kBytes = kBlock * sizeof...(block);
            (std::memcpy(to + block * kBlock, from + block * kBlock, kBlock), ...);
            to += kBytes;
            from += kBytes;
            left -= kBytes;
        };
        static_assert(kMostInBlocks <= 8 * kBlock);
        if (left >= 4 * kBlock) copy(0U, 1U, 2U, 3U);
        if (left >= 4 * kBlock) copy(0U, 1U, 2U, 3U);
        if (left >= 2 * kBlock) copy(0U, 1U);
        if (left > kBlock) std::memcpy(to, from, kBlock);
        std::memcpy(to + left - kBlock, from + left - kBlock, kBlock);
        return next(run);
    }
    static int list_of_wholes(const Run* run) {
        for (const Copy* copy = run->list; copy != run->list + run->count; ++copy)
            std::memcpy(copy->to, copy->from, copy->bytes);
        return next(run);
    }

    template <std::size_t Bytes>
    static int list(const Run* run) {
        for (const Copy* copy = run->list; copy != run->list + run->count; ++copy)
            std::memcpy(copy->to, copy->from, Bytes);
        return next(run);
    }
    // At constant distances. The number of octets is a constant, and so are the addresses in the image. The compiler
    // must not compute the other addresses in advance: it adds the distance once for each copy.
    template <std::size_t Bytes, bool ToImage>
    [[gnu::always_inline]] static inline int strided(const Run* run) {
        std::uint8_t* to = run->to;
        const std::uint8_t* from = run->from;
        const std::ptrdiff_t step = run->step;
        const auto copy = [&](std::size_t n) {
            if constexpr (ToImage) {
                std::memcpy(to + n * Bytes, from, Bytes);
                from += step;
                asm("" : "+r"(from));
            } else {
                std::memcpy(to, from + n * Bytes, Bytes);
                to += step;
                asm("" : "+r"(to));
            }
        };
        const auto advance_image = [&](std::size_t copies) {
            if constexpr (ToImage)
                to += copies * Bytes;
            else
                from += copies * Bytes;
        };
        std::uint32_t left = run->count;
        // [[likely]] makes the compiler place the copies behind this test without a jump.
        if ((left & 1U) != 0) [[likely]] {
            copy(0);
            advance_image(1);
        }
        if ((left & 2U) != 0) [[likely]] {
            copy(0);
            copy(1);
            advance_image(2);
        }
        for (left /= 4; left != 0; --left) {
            copy(0);
            copy(1);
            copy(2);
            copy(3);
            advance_image(4);
            asm("" : "+r"(left));
        }
        return next(run);
    }
    template <std::size_t Bytes>
    static int to_image(const Run* run) {
        return strided<Bytes, true>(run);
    }
    template <std::size_t Bytes>
    static int from_image(const Run* run) {
        return strided<Bytes, false>(run);
    }

    template <std::size_t... Bytes>
    static constexpr Table lists(std::index_sequence<Bytes...>) {
        return {&list<Bytes>...};
    }
    template <std::size_t... Bytes>
    static constexpr Table to_images(std::index_sequence<Bytes...>) {
        return {&to_image<Bytes>...};
    }
    template <std::size_t... Bytes>
    static constexpr Table from_images(std::index_sequence<Bytes...>) {
        return {&from_image<Bytes>...};
    }
};

// Copies of the same size, from `begin`.
void Copies::add_run(std::size_t begin, std::size_t count) {
    constexpr auto kSizes = std::make_index_sequence<Makers::kMostWithoutCall + 1>();
    static constexpr Makers::Table kLists = Makers::lists(kSizes);
    static constexpr Makers::Table kToImage = Makers::to_images(kSizes);
    static constexpr Makers::Table kFromImage = Makers::from_images(kSizes);
    const Copy& first = copies_[begin];
    Run run{.to = first.to,
            .from = first.from,
            .count = static_cast<std::uint32_t>(count),
            .bytes = first.bytes,
            .list = &first};
    std::ptrdiff_t step_to = first.bytes;
    std::ptrdiff_t step_from = first.bytes;
    if (count > 1) {
        step_to = copies_[begin + 1].to - first.to;
        step_from = copies_[begin + 1].from - first.from;
    }
    bool even = true;
    for (std::size_t n = 1; n < count; ++n)
        even &= copies_[begin + n].to - copies_[begin + n - 1].to == step_to &&
                copies_[begin + n].from - copies_[begin + n - 1].from == step_from;
    if (first.bytes > Makers::kMostWithoutCall) {
        const bool in_blocks = first.bytes >= Makers::kBlock && first.bytes <= Makers::kMostInBlocks;
        run.make = count != 1 ? &Makers::list_of_wholes : in_blocks ? &Makers::blocks : &Makers::whole;
    } else if (even && step_to == first.bytes) {
        run.make = kToImage[first.bytes];
        run.step = step_from;
    } else if (even && step_from == first.bytes) {
        run.make = kFromImage[first.bytes];
        run.step = step_to;
    } else {
        run.make = kLists[first.bytes];
    }
    runs_.push_back(run);
}

void Copies::set(std::vector<Copy> copies) {
    std::ranges::sort(copies, {}, &Copy::to);
    copies_.clear();
    for (const Copy& copy : copies) {
        if (copy.bytes == 0) continue;
        Copy* last = copies_.empty() ? nullptr : &copies_.back();
        if (last != nullptr && last->to + last->bytes == copy.to && last->from + last->bytes == copy.from)
            last->bytes += copy.bytes;
        else
            copies_.push_back(copy);
    }
    std::ranges::stable_sort(copies_, {}, &Copy::bytes);
    runs_.clear();
    for (std::size_t begin = 0; begin < copies_.size();) {
        std::size_t end = begin;
        while (end < copies_.size() && copies_[end].bytes == copies_[begin].bytes) ++end;
        add_run(begin, end - begin);
        begin = end;
    }
    runs_.push_back({.make = &Makers::nothing});
    first_ = runs_.data();
}

}  // namespace margay::compat::ecrt
