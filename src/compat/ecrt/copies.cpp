#include "compat/ecrt/copies.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace margay::compat::ecrt {

// What makes the copies of a run.
struct Copies::Makers {
    using Make = void (*)(const Run& run);

    static void nothing(const Run&) {}
    static void whole(const Run& run) { std::memcpy(run.to, run.from, run.bytes); }
    static void list_of_wholes(const Run& run) {
        for (const Copy* copy = run.list; copy != run.list + run.count; ++copy)
            std::memcpy(copy->to, copy->from, copy->bytes);
    }

    // Copies of `Part` octets.
    template <std::size_t Part>
    struct Exact {
        static void run(const Run& run) {
            std::uint8_t* to = run.to;
            const std::uint8_t* from = run.from;
            const std::ptrdiff_t t = run.step_to;
            const std::ptrdiff_t f = run.step_from;
            std::uint32_t left = run.count;
            for (; left >= 4; left -= 4) {
                std::memcpy(to, from, Part);
                std::memcpy(to + t, from + f, Part);
                std::memcpy(to + 2 * t, from + 2 * f, Part);
                std::memcpy(to + 3 * t, from + 3 * f, Part);
                to += 4 * t;
                from += 4 * f;
            }
            for (; left != 0; --left) {
                std::memcpy(to, from, Part);
                to += t;
                from += f;
            }
        }
        static void list(const Run& run) {
            for (const Copy* copy = run.list; copy != run.list + run.count; ++copy)
                std::memcpy(copy->to, copy->from, Part);
        }
    };

    // A first and a last part of `Part` octets, which overlap.
    template <std::size_t Part>
    struct Twice {
        static void run(const Run& run) {
            std::uint8_t* to = run.to;
            const std::uint8_t* from = run.from;
            const std::size_t tail = run.bytes - Part;
            for (std::uint32_t left = run.count; left != 0; --left) {
                std::memcpy(to, from, Part);
                std::memcpy(to + tail, from + tail, Part);
                to += run.step_to;
                from += run.step_from;
            }
        }
        static void list(const Run& run) {
            const std::size_t tail = run.bytes - Part;
            for (const Copy* copy = run.list; copy != run.list + run.count; ++copy) {
                std::memcpy(copy->to, copy->from, Part);
                std::memcpy(copy->to + tail, copy->from + tail, Part);
            }
        }
    };

    template <class Kind>
    static Make of(bool list) {
        return list ? &Kind::list : &Kind::run;
    }
    static Make choose(std::uint32_t bytes, bool list) {
        switch (bytes) {
            case 1: return of<Exact<1>>(list);
            case 2: return of<Exact<2>>(list);
            case 4: return of<Exact<4>>(list);
            case 8: return of<Exact<8>>(list);
            case 16: return of<Exact<16>>(list);
            default: break;
        }
        if (bytes < 4) return of<Twice<2>>(list);
        if (bytes < 8) return of<Twice<4>>(list);
        if (bytes < 16) return of<Twice<8>>(list);
        if (bytes <= 32) return of<Twice<16>>(list);
        return &list_of_wholes;
    }
};

// Copies of the same size, from `begin`.
void Copies::add_run(std::size_t begin, std::size_t count) {
    const Copy& first = copies_[begin];
    Run run{.count = static_cast<std::uint32_t>(count),
            .bytes = first.bytes,
            .to = first.to,
            .from = first.from,
            .list = &first};
    bool even = true;
    if (count > 1) {
        run.step_to = copies_[begin + 1].to - first.to;
        run.step_from = copies_[begin + 1].from - first.from;
    }
    for (std::size_t n = 1; n < count; ++n)
        even &= copies_[begin + n].to - copies_[begin + n - 1].to == run.step_to &&
                copies_[begin + n].from - copies_[begin + n - 1].from == run.step_from;
    constexpr std::uint32_t kMostWithoutCall = 32;
    run.make = count == 1 && first.bytes > kMostWithoutCall ? &Makers::whole : Makers::choose(first.bytes, !even);
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
    if (runs_.empty()) runs_.push_back({.make = &Makers::nothing});
    first_ = runs_.data();
    last_ = &runs_.back();
}

}  // namespace margay::compat::ecrt
