// A ring with two NICs, as the network sees it: where the ring is open, which end of the ring reaches each slave, and
// which clock the slaves behind a break follow.
#pragma once

#include "link/redundancy.hpp"
#include "network/network.hpp"

#include <margay/phase_controller.hpp>

namespace margay {

// The slave that the second NIC is connected to: one port of it is open and leads to no slave. nullptr: not seen.
[[nodiscard]] const Slave* last_slave(Network& network, std::uint8_t& port);

class RingWatch final : public RedundancyPart {
  public:
    explicit RingWatch(Redundancy& ring) : ring_(ring) {}
    void watch(Network& network) override;
    void note_change(Network& network) override;
    [[nodiscard]] Error check() const override;
    [[nodiscard]] RingParts parts() const override;
    [[nodiscard]] Task<Result<>> find_beginning(Network& network) override;
    [[nodiscard]] bool begins_right(Network& network) override;
    [[nodiscard]] bool is_breaking() const override { return ring_.refuses() && ring_.ring() == RingState::whole; }
    [[nodiscard]] bool may_restore() const override { return automatic_ || ring_.changes() == restored_; }
    void set_automatic(bool on) {
        automatic_ = on;
        restore();
    }
    void restore() { restored_ = ring_.changes(); }
    [[nodiscard]] std::uint32_t changes() const override { return ring_.changes(); }
    [[nodiscard]] Task<Result<>> read_ports_again(Network& network, std::uint32_t changes) override;
    [[nodiscard]] bool are_ports_old() const override { return ports_of_broken_ && parts().whole; }
    [[nodiscard]] Task<Result<>> read_ports(Network& network) override;
    // Whether the slave is behind the break of a broken ring: only the NIC at the end of the ring reaches it.
    [[nodiscard]] bool is_behind_break(Network& network, const Slave& slave) const { return is_behind(network, slave); }
    [[nodiscard]] const Redundancy& ring() const { return ring_; }

    // Clocks (ring_clocks.cpp)
    [[nodiscard]] Task<Result<>> open_ring(Network& network) override;
    [[nodiscard]] Task<Result<>> close_ring(Network& network) override;
    void forget_opening() override { ring_.end_opening(); }
    [[nodiscard]] Task<Result<>> begin_second_part(Network& network) override;
    // Clocks beside the ring, and constants (ring_ways.cpp)
    void note_ways(Network& network) override;
    [[nodiscard]] bool delays_are_guessed() const override { return guessed_; }
    [[nodiscard]] Task<Result<>> watch_clocks(Network& network) override;
    [[nodiscard]] Task<Result<>> follow_reference(Network& network) override;
    [[nodiscard]] std::uint16_t reference_of(Network& network, const Slave& slave) const override;
    [[nodiscard]] FollowedClock followed_clock(Network& network, const Slave& slave) const override;
    [[nodiscard]] bool has_clocks_beside() const override { return has_beside_; }
    [[nodiscard]] bool are_parted(Network& network, const Slave& one, const Slave& other) const override {
        return is_behind(network, one) != is_behind(network, other);
    }
    // The slave with the second reference clock (0: none), and how far that clock is ahead of the reference clock.
    [[nodiscard]] std::uint16_t second_reference() const { return second_; }
    [[nodiscard]] std::int64_t apart_ns() const { return second_ == 0 || !is_steered() ? 0 : ahead_ns_; }

  private:
    // The constants (see `constant_ns_`) of the last breaks. They are needed when the first clock behind a break comes
    // back after a loss of power, because that clock is not in step then. `ns` is the constant for a delay register of
    // 0, because the register changes with the ways.
    struct Constant {
        std::uint16_t slave = 0;  // with the first clock behind the break
        // The slaves before and behind the break. They are compared too: other slaves without a clock may be behind the
        // break, and a branch that is lost makes the way of its copy shorter.
        std::uint16_t front = 0;
        std::uint16_t behind = 0;
        std::uint16_t head = 0;  // the NIC at the beginning of the ring: the constant contains the times of both NICs
        std::int64_t ns = 0;
    };

    // What is known of the constant.
    enum class Comparison : std::uint8_t {
        unknown,  // nothing yet: the next differences show the constant, or the ways show it
        taught,   // nothing yet, but teach() has brought all clocks beside the ring in step: the next differences show
                  // the constant
        unsure,   // a constant is used, but the clocks were perhaps not in step when it was measured
        known,
    };

    void report_break(Network& network);
    void report_fault(Network& network, CablingFault fault);
    [[nodiscard]] std::uint16_t first_behind(Network& network, bool only_settled) const;
    [[nodiscard]] std::uint16_t choose_second(Network& network) const;
    [[nodiscard]] Task<Result<>> teach_rate(Network& network, Slave& second);
    [[nodiscard]] bool lacks_rate(Network& network, std::uint16_t wanted) const;
    [[nodiscard]] bool has_present_second(Network& network) const {
        return second_ != 0 && network.slave(second_).al.state != AlState::none;
    }
    [[nodiscard]] Task<Result<>> teach_in_cycles(Network& network, const Slave& slave) const;
    [[nodiscard]] Task<Result<bool>> runs_alike(Network& network, Slave& slave, Slave& present,
                                                std::int64_t most_ns) const;
    [[nodiscard]] Task<Result<bool>> prepare_second(Network& network, Slave& slave);
    [[nodiscard]] Task<Result<bool>> is_second_late(Network& network, std::uint16_t wanted);
    [[nodiscard]] Task<Result<>> set_second_part(Network& network, Slave& second);
    [[nodiscard]] Task<Result<>> change_second(Network& network, std::uint16_t second);
    [[nodiscard]] Task<Result<>> open_ring_with(Network& network, bool times);
    [[nodiscard]] Task<Result<std::uint32_t>> teach_once(Network& network);
    [[nodiscard]] bool needs_lesson(const Network& network) const;
    [[nodiscard]] bool may_teach(Network& network);
    [[nodiscard]] Task<Result<>> teach(Network& network);
    [[nodiscard]] Task<Result<>> teach_beside(Network& network);
    [[nodiscard]] bool find_sides(Network& network);
    [[nodiscard]] bool is_misled(Network& network, const Slave& slave) const;
    void judge_change(Network& network);
    void find_first_behind(Network& network, std::size_t front, std::size_t behind);
    [[nodiscard]] bool is_behind_front(Network& network, const Slave& slave) const;
    [[nodiscard]] Event find_break(Network& network, std::size_t front, std::size_t behind) const;
    [[nodiscard]] bool are_places_new(Network& network) const;
    [[nodiscard]] bool is_behind(Network& network, const Slave& slave) const;
    [[nodiscard]] std::int64_t passes_at_ns(Network& network, const Slave& slave) const;
    [[nodiscard]] std::int64_t lost_way_ns(Network& network, const Slave& slave) const;
    [[nodiscard]] Task<Result<>> write_delay(Network& network, Slave& slave, std::int64_t earliest_ns);
    [[nodiscard]] Task<Result<>> arrange(Network& network);
    [[nodiscard]] Task<Result<>> steer(Network& network);
    [[nodiscard]] Task<Result<>> find_constant(Network& network);
    void begin_to_steer(Network& network);
    bool end_constant(Network& network);
    void use_known_constant(Network& network);
    void lose_behind(Network& network) const;
    void lose_own_rate(Network& network) const;
    void distrust_second_part(Network& network);
    [[nodiscard]] Constant present_constant() const;
    [[nodiscard]] const Constant* known_constant() const;
    [[nodiscard]] std::int64_t carried_ns(std::uint32_t now_us) const;
    [[nodiscard]] bool is_in_step(const Network& network) const;
    [[nodiscard]] bool is_steered() const { return comparison_ >= Comparison::unsure; }
    static std::uint32_t us_of(Time time) {
        return static_cast<std::uint32_t>(time.time_since_epoch() / std::chrono::microseconds(1));
    }
    void forget_differences() {
        first_ = {};
        (void)ring_.take_difference();
    }

    Redundancy& ring_;
    RingState reported_ = RingState::unknown;
    CablingFault reported_fault_ = CablingFault::none;
    bool reported_swapped_ = false;
    bool automatic_ = true;
    std::uint32_t restored_ = 0;    // RedundancyPart::changes() when restoring was requested last
    bool ports_of_broken_ = false;  // the topology is that of the broken ring
    std::uint16_t before_ = 0;      // the slaves at both sides of the last break
    std::uint16_t behind_ = 0;
    std::uint16_t first_behind_ = 0;    // the first place behind the break; 0: not known
    std::uint16_t front_of_break_ = 0;  // how many places are before the break
    std::uint16_t behind_break_ = 0;    // how many places are behind the break
    std::uint32_t places_of_break_ = 0;

    // The slave with the second reference clock. If this clock is in step at the moment of the break, the first
    // differences show the difference between the ways of both copies (`constant_ns_`). If the slave was away before,
    // the ways are measured.
    std::uint16_t second_ = 0;
    bool second_is_first_ = false;
    Comparison comparison_ = Comparison::unknown;
    std::uint16_t compared_behind_ = 0;  // how many slaves were behind the break when the constant was measured
    std::uint32_t taught_ways_ = 0;      // Redundancy::ways() before teach() began
    std::uint8_t lesson_rounds_ = 0;     // rounds until teach() runs again
    bool carried_ = false;  // the constant has ended; the second reference still has its difference and its rate
    bool learns_ = false;   // a lesson has ended, and the second reference is not in step yet
    std::uint8_t rounds_unsettled_ = 0;  // rounds in which frames have passed slaves that are not brought back yet
    std::int64_t ahead_ns_ = 0;          // mean of the differences of the last round, without the constant
    std::int64_t change_ns_ = 0;         // how far `ahead_ns_` is from its value of the round before
    std::int64_t jitter_ns_ = 0;         // how much the differences of a round differ among each other
    std::int64_t moved_ns_ = 0;          // the correction of the round before; the differences contain it
    std::uint8_t rounds_deaf_ = 0;       // rounds without a difference
    bool guessed_ = false;               // the delays behind a break, see delays_are_guessed()
    std::uint32_t steered_us_ = 0;       // when `ahead_ns_` was measured
    std::int64_t constant_ns_ = 0;
    static constexpr std::uint8_t kDeaf = 100;
    // The first element is the constant of the whole ring. It keeps the value that was measured after a lesson. A new
    // measurement after each repair would include the present error of the clock, and these errors would add up.
    std::array<Constant, 4> constants_{};
    std::size_t next_constant_ = 0;
    std::uint16_t wanted_second_ = 0;  // the slave that was the best second reference in `rounds_seen_` rounds
    std::uint8_t rounds_seen_ = 0;
    std::uint32_t first_us_ = 0;  // when `first_` began
    PartDifference first_;
    PhaseController phase_;
    // Clocks beside the ring. Ring slaves are counted from 1 at the head.
    bool has_beside_ = false;
    bool ways_known_ = false;
    bool arranged_ = false;            // the delays in the slaves fit the present ways
    bool measured_whole_ = false;      // the last measurement of delays was in the whole ring
    std::uint16_t measured_last_ = 0;  // position of the last ring slave in this measurement
    std::uint16_t ring_slaves_ = 0;
    std::uint16_t front_end_ = 0;     // the last ring slave that the head reaches; in the whole ring the last of all
    std::uint16_t behind_begin_ = 0;  // the first ring slave that only the other NIC reaches
    std::uint8_t rounds_unclear_ = 0;
    bool judges_ = false;        // note_change() has marked clocks, and where the ring is broken is not known yet
    std::uint8_t end_port_ = 0;  // the port of slave `end_` to the second NIC
    // State of open_ring(), which closes a port of the last slave. When the port was closed.
    Time opened_{};
    std::uint16_t last_ = 0;          // the last slave
    std::uint16_t last_control_ = 0;  // the DL control register of the last slave before the port was closed
    std::uint16_t end_ = 0;           // the slave that the second NIC was connected to before the break
    std::uint16_t noted_ways_ = 0;    // Redundancy::ways() of the last note_change()
};

}  // namespace margay
