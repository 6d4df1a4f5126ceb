// The facts of the slaves for the gateway. poll() copies them, a few slaves at a time. They are copied again when they
// are old.
#pragma once

#include <margay/address.hpp>
#include <margay/context.hpp>
#include <margay/slave.hpp>
#include <margay/visit.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <vector>

namespace margay::gateway {

using Moment = std::chrono::steady_clock::time_point;

// If the owner has not accepted a request for this time, it does not poll (the same time as in wait()).
inline constexpr std::chrono::seconds kOwnerSilent{3};

struct SlaveFacts {
    std::uint16_t number = 0;
    StationAddress station{};
    std::uint16_t ring_position = 0;
    bool configured = false;  // in the list of expect(), or there was no list
    bool detected = false;    // present, as far as is known
    // The identity in the list; for members that the list leaves open, the identity that was found.
    Identity wanted{};
    Identity identity{};
    std::uint16_t out_bytes = 0;  // of the mailboxes that the slave uses now
    std::uint16_t in_bytes = 0;
    friend bool operator==(const SlaveFacts&, const SlaveFacts&) = default;
};

class SlaveTable {
  public:
    explicit SlaveTable(Context& ctx);
    // While the request is busy, destroy this object only in the thread of the owner, or while the owner polls.
    ~SlaveTable() = default;

    // Begins to read the facts, unless a reading is under way.
    void refresh(Moment now);
    // Continues to read. True: the facts are new, or could not be read: see slaves() and polled().
    bool step(Moment now);
    [[nodiscard]] bool busy() const { return reading_; }
    [[nodiscard]] bool is_fresh(Moment now) const;
    [[nodiscard]] bool is_usable(Moment now) const;  // accepts slightly older facts
    // Call it after an answer that contradicts the facts.
    void forget() { known_ = false; }
    // False: the owner of the context did not poll during the last reading.
    [[nodiscard]] bool polled() const { return polled_; }

    [[nodiscard]] const std::vector<SlaveFacts>& slaves() const { return slaves_; }
    [[nodiscard]] const SlaveFacts* find(std::uint16_t station) const;

  private:
    static constexpr std::size_t kOnce = 64;
    static void copy(Context& ctx, void* user);
    void end(bool polled);

    Context& ctx_;
    std::vector<SlaveFacts> slaves_{};
    std::vector<SlaveFacts> coming_{};
    bool known_ = false;
    bool reading_ = false;
    bool polled_ = true;
    Moment at_{};
    Moment asked_{};
    // The data of the request: the first wanted slave, and the facts that the owner has copied.
    std::array<SlaveFacts, kOnce> some_{};
    std::size_t first_ = 0;
    std::size_t copied_ = 0;
    std::size_t all_ = 0;
    VisitRequest request_{};
};

}  // namespace margay::gateway
