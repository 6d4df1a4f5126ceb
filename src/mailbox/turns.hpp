// Who is next: fair among equals, and no priority starves another.
#pragma once

#include "mailbox/exchange.hpp"

namespace margay {

// The next of those that are allowed now, or nullptr.
template <class Allowed>
[[nodiscard]] MailTurn* next_turn(List<MailTurn>& waiting, Allowed allowed) {
    MailTurn* best = nullptr;
    for (MailTurn* turn = waiting.front(); turn != nullptr; turn = waiting.after(*turn)) {
        if (!allowed(*turn)) continue;
        if (turn->passed >= MailTurn::kMostPassed) return turn;
        if (best == nullptr || turn->priority > best->priority) best = turn;
    }
    return best;
}

// Takes it out of the list; older ones that are allowed have been passed over.
template <class Allowed>
void take_turn(List<MailTurn>& waiting, MailTurn& taken, Allowed allowed) {
    for (MailTurn* turn = waiting.front(); turn != &taken; turn = waiting.after(*turn))
        if (allowed(*turn)) ++turn->passed;
    taken.unlink();
}

}  // namespace margay
