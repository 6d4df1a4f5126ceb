// Who is next among those that wait in turn: the highest priority first, among equals the oldest. One that was passed
// over often goes first all the same, so that no priority starves another.
#pragma once

#include "util/list.hpp"

#include <cstdint>
#include <type_traits>

namespace margay {

// The base of what waits in turn, in a List of turns: the oldest in front.
struct Turn : ListNode {
    static constexpr std::uint8_t kMostPassed = 8;
    std::uint8_t priority = 0;  // 0 is the lowest
    std::uint8_t passed = 0;    // how often a later one of a higher priority went first
};

// The next of those that are allowed now, or nullptr. T derives from Turn.
template <class T, class Allowed>
[[nodiscard]] T* next_turn(List<T>& waiting, Allowed allowed) {
    T* best = nullptr;
    for (T* turn = waiting.front(); turn != nullptr; turn = waiting.after(*turn)) {
        if (!allowed(*turn)) continue;
        if (turn->passed >= Turn::kMostPassed) return turn;
        if (best == nullptr || turn->priority > best->priority) best = turn;
    }
    return best;
}

// Takes it out of the list; older ones that are allowed have been passed over.
template <class T, class Allowed>
void take_turn(List<T>& waiting, std::type_identity_t<T>& taken, Allowed allowed) {
    for (T* turn = waiting.front(); turn != &taken; turn = waiting.after(*turn))
        if (allowed(*turn)) ++turn->passed;
    taken.unlink();
}

}  // namespace margay
