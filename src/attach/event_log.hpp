// The events of a context for clients: the owner's thread adds them to a ring, the server's thread keeps the newest.
#pragma once

#include "attach/facts.hpp"
#include "attach/job.hpp"

#include <margay/context.hpp>
#include <margay/detail/writable_ring.hpp>

#include <array>
#include <deque>

namespace margay::attach {

class EventLog {
  public:
    // In the thread of the owner: observes the events, and also calls the callback that was set before.
    explicit EventLog(Context& ctx);
    ~EventLog();
    EventLog(const EventLog&) = delete;
    EventLog& operator=(const EventLog&) = delete;

    // In the thread of the server: empties the ring.
    void collect();
    // The events after `number`: the newest number, how many events were lost, how many events follow, and these
    // events.
    [[nodiscard]] Octets after(std::uint64_t number) const;

  private:
    static void tap(const Event& event, void* user);
    static constexpr std::size_t kKept = 1024;
    static constexpr std::size_t kOnce = 64;

    Context& ctx_;
    void (*before_)(const Event& event, void* user);
    void* before_user_;
    std::array<Event, 512> memory_{};
    WritableRing<Event> ring_{std::span<Event>(memory_)};
    std::deque<EventFacts> kept_{};
    std::uint64_t last_ = 0;
};

}  // namespace margay::attach
