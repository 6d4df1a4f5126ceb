// A working counter is a sum. Where a slave is missing, the sum can be the accepted one by coincidence: another slave
// leaves, and the missing slave, or a slave that is being configured, answers. The functions here decide when the sum
// is believed.
#pragma once

#include "network/network.hpp"

namespace margay {

// Call it when the slave takes part from the next sent cycle on.
void note_joining(ProcessGroup& group, const Slave& slave);
// Call it when a slave has left the exchange.
void note_leaving(ProcessGroup& group);

// Whether exactly the slaves that take part have answered a datagram that not all slaves have answered. Before that,
// removes the slaves from the exchange whose FMMUs are known to be cleared, because their sequences have not continued
// yet. `changed`: the cycle before had another working counter, or was lost.
[[nodiscard]] bool is_sure(ProcessGroup& group, const DatagramStatus& status, bool changed);
// Call it at the end of a cycle that has not passed the fast check. `fresh`: the cycle has brought the inputs of all
// slaves that take part.
void note_cycle(ProcessGroup& group, bool fresh);
// Call it when the NIC has refused a frame of a cycle: it is lost, and the application may not receive it.
void note_refusal(ProcessGroup& group);

// After a cycle that fell short or was lost, slaves may have changed places. The accepted working counter is believed
// again when all slaves that take part have answered in SAFEOP or OP since it changed last. This function starts the
// reading of their states unless something else prevents that. For poll(), for a group with `sums_doubted`.
void confirm_sums(Network& network, ProcessGroup& group);

// The same for sequences that read the states of all slaves anyway.
class SumConfirmation {
  public:
    // Create it before the first state is read. `only`: the states of this group alone are read.
    explicit SumConfirmation(Network& network, const ProcessGroup* only = nullptr)
        : network_(network), only_(only), doubts_(count_doubts()) {}
    [[nodiscard]] bool concerns(const Slave& slave) const {
        return slave.takes_part && (only_ == nullptr || slave.image.group == only_->number);
    }
    void note(const Slave& slave, const Result<AlStatus>& seen);
    // Call it after the last state was read.
    void end() const;

  private:
    [[nodiscard]] std::uint32_t count_doubts() const;

    Network& network_;
    const ProcessGroup* only_;
    std::uint32_t doubts_;
    std::size_t shown_ = 0;  // slaves that take part and have answered in SAFEOP or OP
};

}  // namespace margay
