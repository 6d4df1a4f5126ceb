// Recordings of both NICs of a ring. Such a master sends each frame at both ends. The slaves process the first copy or
// the second copy; in a broken ring they process a part of both. This class merges the copies to one request and one
// reply, as for the master.
#pragma once

#include "analyse/exchanges.hpp"
#include "analyse/ring_signs.hpp"
#include "oshw/pcap/pcapng.hpp"

#include <array>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

namespace margay::analyse {

// Frames are passed on in the order of the recording: a request waits for its reply, and the frames after it wait, too.
// A part of a reply waits for the other part until its index is used again.
class RingCopies {
  public:
    using Emit = std::function<void(Moment when, Bytes packet, std::size_t length_on_wire)>;
    explicit RingCopies(Emit emit) : emit_(std::move(emit)) {}
    // For a recording without directions; `signs` has examined it before. The packets are in order of time.
    RingCopies(Emit emit, const RingSigns& signs)
        : emit_(std::move(emit)), macs_(signs.addresses()), has_directions_(false), whole_(signs.whole()) {}

    // Whether the packets have exactly two interfaces, and were sent at both.
    [[nodiscard]] static bool is_ring(const std::vector<PacketOrigin>& origins);

    void packet(const PacketOrigin& origin, Moment when, Bytes packet, std::size_t length_on_wire);
    // Passes on all waiting frames.
    void finish();
    // Packets that were not passed on: second copies, copies that no slave has processed, parts of merged replies.
    [[nodiscard]] std::uint64_t merged() const { return merged_; }
    // Without directions and interfaces: copies that were seen again long after the reply. They may be other frames
    // with the same index.
    [[nodiscard]] std::uint64_t seen_late() const { return seen_late_; }
    // Without directions: packets that an interface has recorded twice in a short time. Then the interface shows
    // several places of the ring, or the master sends the same frame with the same index again.
    [[nodiscard]] std::uint64_t seen_twice() const { return seen_twice_; }

  private:
    struct Held {
        Moment when{};
        std::vector<std::byte> bytes{};
        [[nodiscard]] bool there() const { return !bytes.empty(); }
        void keep(Moment at, Bytes packet) {
            when = at;
            bytes.assign(packet.begin(), packet.end());
        }
    };
    // A frame on the wire. The index of each array is the NIC that has sent the copy.
    struct Flight {
        std::uint64_t number = 0;
        std::array<Held, 2> sent{};
        std::array<Held, 2> came{};              // copies that slaves have processed
        std::array<std::uint64_t, 2> seen_at{};  // interfaces that have seen the copy before slaves have processed it
        std::array<bool, 2> crossed{};           // of these copies: the copy has passed the whole ring
        std::array<bool, 2> untouched{};         // the copy came back, and no slave has processed it
        std::uint64_t request = 0;               // its place in the queue
        std::uint64_t reply = 0;                 // 0: there is none
        bool alone = false;                      // the NIC has sent its next frame, so the other copy will not be sent
        bool over = false;                       // the frame was passed on: later copies are left out
    };
    // A frame in the queue: it is passed on after all frames before it.
    struct Place {
        Moment when{};
        std::vector<std::byte> bytes{};  // empty: nothing is passed on
        std::size_t length_on_wire = 0;
        bool waits = false;
    };
    // Flights with the same index, because a master repeats a frame that does not come back.
    using Flights = std::vector<Flight>;
    void sent(std::size_t copy, Moment when, Bytes packet);
    // Without directions: a frame that no slave has processed is a new request, or a request that is seen again.
    void sent_or_seen_again(std::size_t copy, std::uint32_t interface, Moment when, Bytes packet);
    void received(std::size_t copy, bool crossed, Moment when, Bytes packet);
    void note_next(std::size_t copy);
    // The flight of which only the other copy was sent, a short time ago.
    [[nodiscard]] Flight* other_copy(Flights& flights, std::size_t copy, Moment when, Bytes packet) const;
    Flight& open(Flights& flights, Moment when);
    // Passes the frame on if nothing more is expected to come back.
    void settle_if_complete(Flight& flight);
    // Whether the same copy was seen before, and more slaves have processed it since.
    bool take_farther(Flights& flights, std::size_t copy, Moment when, Bytes packet);
    void settle(Flight& flight);
    void note_head(const Flight& flight);
    // The copy that is the whole reply although the other copy came back, too; 2: both copies are parts.
    [[nodiscard]] std::size_t whole_of(const Flight& flight) const;
    [[nodiscard]] std::vector<std::byte> request_of(const Flight& flight) const;
    [[nodiscard]] std::uint64_t enqueue(Place next);
    [[nodiscard]] Place& place(std::uint64_t number) { return queue_[number - first_]; }
    void flush();
    void make_room();

    static constexpr std::size_t kMostWaiting = 16384;
    static constexpr std::size_t kMostRepeated = 8;  // flights with the same index
    // Flights; an older flight with the same index is another frame.
    static constexpr std::uint64_t kRepeatedWithin = 128;

    Emit emit_;
    std::array<Flights, 256> flights_{};                 // by the index of the first datagram, the youngest one last
    std::array<std::optional<std::uint8_t>, 2> last_{};  // the index that the NIC has sent last
    std::array<RingSigns::Address, 2> macs_{};
    bool has_directions_ = true;
    RingSigns::Counters whole_{};  // without directions
    std::array<bool, 2> idle_{};   // in the whole ring, no slave processes the copy
    std::size_t head_ = 0;         // the NIC at the beginning of the ring
    std::deque<Place> queue_{};
    std::uint64_t first_ = 1;   // the number of the first place of the queue
    std::uint64_t opened_ = 0;  // flights
    std::uint64_t merged_ = 0;
    std::uint64_t interfaces_ = 0;  // that were seen
    std::uint64_t seen_late_ = 0;   // see seen_late()
    std::uint64_t seen_twice_ = 0;  // see seen_twice()
};

}  // namespace margay::analyse
