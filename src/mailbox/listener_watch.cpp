// The regular looks for mail on behalf of listeners and of requests that wait for mail.
#include "mailbox/mailboxes.hpp"

#include <algorithm>

namespace margay {

bool Mailboxes::watch_for_listeners() {
    const TaskReference task = look_for_listeners();
    if (!task) return false;  // the task for the other listeners continues
    listening_.end();
    listening_.take(task);
    return tasks_.start(task);
}

Task<Result<>> Mailboxes::look_for_listeners() {
    struct Guard {
        TaskHandle& handle;
        explicit Guard(TaskHandle& of) : handle(of) {}
        Guard(const Guard&) = delete;
        Guard& operator=(const Guard&) = delete;
        ~Guard() { handle.release(); }
    };
    Guard guard(listening_);
    Time next = Time::min();
    while (next != kNever) {
        co_await engine_.sleep_until(next);
        const Time now = engine_.now();
        next = kNever;
        listeners_.take_back(new_listeners_);
        for (MailListener* one = listeners_.front(); one != nullptr; one = listeners_.after(*one)) {
            if (one->look_every <= Duration{0}) continue;
            if (one->look_at_ <= now) {
                look_for(*one);
                one->look_at_ = later(now, one->look_every);
            }
            next = std::min(next, one->look_at_);
        }
    }
    co_return Nothing{};
}

void Mailboxes::look_for(const MailListener& listener) {
    if (listener.only_slave > channels_.size()) return;  // it was changed after listen()
    const std::size_t first = listener.only_slave == 0 ? 0 : listener.only_slave - 1U;
    const std::size_t count = listener.only_slave == 0 ? channels_.size() : 1;
    for (MailboxChannel& channel : channels_.subspan(first, count)) channel.look_once();
}

void MailboxChannel::look_once() {
    if (!is_reachable() || (pump_ && expecting())) return;
    if (bit_is_trusted() && !bit_is_set()) return;
    glance();
    silent_looks_ = kMostSilentLooks - 1;
}

}  // namespace margay
