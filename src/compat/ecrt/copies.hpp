// Copies of process data between the memory of a domain and the image of a group, planned once and made in each cycle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace margay::compat::ecrt {

struct Copy {
    std::uint8_t* to = nullptr;
    const std::uint8_t* from = nullptr;
    std::uint32_t bytes = 0;
};

// Slaves of the same kind make copies of the same size, which follow each other without a gap in the image and at
// constant distances in the domain: such a run needs no list. All others are in lists, by size. Copies of up to 32
// octets are made without a call.
class Copies {
  public:
    Copies() { set({}); }
    Copies(const Copies&) = delete;
    Copies& operator=(const Copies&) = delete;
    // Octets that are contiguous on both sides become one copy.
    void set(std::vector<Copy> copies);
    // Returns 0, so that a function of the interface can return this result.
    int execute() const { return first_->make(first_); }

  private:
    // Each run calls the next run at its end. The last run copies nothing.
    struct Run {
        int (*make)(const Run* run) = nullptr;
        std::uint8_t* to = nullptr;
        const std::uint8_t* from = nullptr;
        std::ptrdiff_t step = 0;  // distance on the side with gaps
        std::uint32_t count = 0;
        std::uint32_t bytes = 0;
        const Copy* list = nullptr;
    };
    struct Makers;

    void add_run(std::size_t begin, std::size_t count);

    std::vector<Copy> copies_;
    std::vector<Run> runs_;
    const Run* first_ = nullptr;
};

}  // namespace margay::compat::ecrt
