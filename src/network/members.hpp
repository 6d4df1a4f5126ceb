// Which slaves take part in the cycle of their group, and which ones should. Two working counters follow from that.
// `accepted` is the sum over the slaves that take part; a datagram's inputs are only used when its working counter is
// exactly this value (or the full one). A slave that is known to be lost, or that is being configured, is left out, so
// that the inputs of the other slaves are still used. `expected` is the sum over the slaves that are wanted.
#pragma once

#include "network/network.hpp"

namespace margay {

// Call it when something has changed that decides whether the cycles of the group can be right.
void settle(ProcessGroup& group);

// The same for all groups.
void settle_groups(Network& network);

// Sets whether the slave takes part, from the next cycle on. No effect when nothing changes.
void set_takes_part(Network& network, Slave& slave, bool takes_part);

// Exists while the write that clears the FMMUs of a slave is under way. The slave leaves the exchange as soon as the
// reply to the write has arrived, because a cycle that was sent after the write may be judged before the sequence
// continues.
class LeavingExchange {
  public:
    LeavingExchange(Network& network, Slave& slave, const Datagram& write);
    LeavingExchange(const LeavingExchange&) = delete;
    LeavingExchange& operator=(const LeavingExchange&) = delete;
    ~LeavingExchange();

    // Removes the slaves whose FMMUs are known to be cleared from the exchange of the group.
    static void update(ProcessGroup& group);
    // Whether a slave still takes part in the exchange of the group that is leaving it.
    [[nodiscard]] static bool any(const ProcessGroup& group);

  private:
    Network& network_;
    Slave& slave_;
    const Datagram& write_;
    ProcessGroup* group_;
    LeavingExchange* next_ = nullptr;
};

// Call it when the slave was away and is known to be this slave again: the inputs of earlier cycles were not copied.
void join_again(Network& network, const Slave& slave);

// Call it when the state of the slave was read. The slave does not take part in cycles that were sent before it reached
// SAFEOP.
void note_reached(Network& network, const Slave& slave, AlState before);

// Adds the slave to the expected working counters, or removes it, according to what is wanted of the slave now.
void update_counted(Network& network, Slave& slave);

// Call it when a group was laid out and has its frames. A wanted slave whose sizes are not known yet (`unplaced`) is
// counted once in the first datagram: the cycle is not right without the slave.
void begin_counting(Network& network, ProcessGroup& group);

// Call it when the slave leaves its group: the group continues without it.
void leave_counters(Network& network, Slave& slave);

// Members of a hot connect group are counted while the first slave of the group is present, except while the group
// starts up after it was connected. await_slave(): the member has taken part, has failed to, or should have come with
// the first slave of its group.
[[nodiscard]] bool is_first_of_group(Network& network, const Slave& slave);
[[nodiscard]] bool first_of_group_is_there(const Network& network, std::uint8_t hot_connect);
void await_slave(Network& network, Slave& slave);

// Call it when a slave is lost, after slave.al is NONE: the slave does not take part, and mail to it ends. Without the
// first slave the whole hot connect group may be missing.
void leave_exchange(Network& network, Slave& lost);

// Call it when a slave that was `unplaced` has no process data.
void forget_unplaced(Network& network, Slave& slave);

}  // namespace margay
