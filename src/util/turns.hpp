// Selects the next of several waiting requests: the highest priority first, and the oldest of equal priority. A request
// that was passed over kMostPassed times is next in any case, so that no priority blocks another one forever.
#pragma once

#include <margay/detail/list.hpp>

#include <cstdint>
#include <type_traits>

namespace margay {

// The rule itself: offer() all waiting requests, the oldest first, then read next().
template <class T>
class NextTurn {
  public:
    void offer(T& request, std::uint8_t priority, std::uint8_t passed) {
        constexpr std::uint8_t kMostPassed = 8;
        if (overdue_ || (next_ != nullptr && priority <= priority_ && passed < kMostPassed)) return;
        next_ = &request;
        priority_ = priority;
        overdue_ = passed >= kMostPassed;
    }
    // nullptr when no request was offered.
    [[nodiscard]] T* next() const { return next_; }

  private:
    T* next_ = nullptr;
    std::uint8_t priority_ = 0;
    bool overdue_ = false;
};

// Base class of waiting requests in a List; the oldest request is at the front.
struct Turn : ListNode {
    std::uint8_t priority = 0;  // 0 is the lowest
    std::uint8_t passed = 0;    // number of times that a later request with a higher priority was selected first
};

// Returns the next request for which `allowed` is true, or nullptr. T derives from Turn.
template <class T, class Allowed>
[[nodiscard]] T* next_turn(List<T>& waiting, Allowed allowed) {
    NextTurn<T> rule;
    for (T* turn = waiting.front(); turn != nullptr; turn = waiting.after(*turn))
        if (allowed(*turn)) rule.offer(*turn, turn->priority, turn->passed);
    return rule.next();
}

// Removes the request from the list. Older requests that are allowed count as passed over.
template <class T, class Allowed>
void take_turn(List<T>& waiting, std::type_identity_t<T>& taken, Allowed allowed) {
    for (T* turn = waiting.front(); turn != &taken; turn = waiting.after(*turn))
        if (allowed(*turn)) ++turn->passed;
    taken.unlink();
}

}  // namespace margay
