// AL state changes with everything that belongs to them: the start-up commands of the slave and the application's hook,
// before and after.
#pragma once

#include "network/network.hpp"

namespace margay {

// Executes the commands, then calls the hook. On the way down failures do not stop the transition; they are noted in
// the slave's error. Errors: that of the command or hook.
[[nodiscard]] Task<Result<>> around_transition(Network& network, Slave& slave, Transition which, Moment moment);

// The error of a request that skips a state, and with it the commands and hooks of that state, for a slave that enters
// any requested state. Other slaves refuse such a request themselves. Code none otherwise.
[[nodiscard]] Error left_out_state(const Slave& slave, AlState from, AlState to);

// Requests `state` and waits for it. slave.al is the start and is updated. Errors: above_highest, the errors of
// around_transition() and of change_al_state(). A failure after the state was reached is an error too; slave.al then
// contains the reached state. The change of the state itself is given up at `until`; kNever: after al_timeout().
[[nodiscard]] Task<Result<AlStatus>> bring_to_state(Network& network, Slave& slave, AlState state, Time until = kNever);

// Call it before a state is requested: until the commands and the hook after the transition have succeeded, the slave
// is unfinished in the new state, also when the request is cut meanwhile.
void mark_unfinished(Network& network, Slave& slave, Transition which);
// Whether the slave is in a state whose commands or hook after the transition have not succeeded.
[[nodiscard]] bool is_unfinished(const Network& network, const Slave& slave);

// The same for a request of the application. Additional errors: the errors of refusal().
[[nodiscard]] Task<Result<AlStatus>> change_state(Network& network, Slave& slave, AlState state, Time until);

// Completes a state that was requested without waiting, if the slave has reached it: starts the commands and the hook
// that follow the transition. They belong to no request (Network::settling), so that no timeout cuts them. Without
// memory the next reading starts them.
void settle_request(Network& network, Slave& slave);

// Whether commands or hooks after a transition of the slave are executing, or a reading is still to start them.
[[nodiscard]] bool is_settling(const Network& network, const Slave& slave);

// The error of a slave in its state while is_settling() or is_unfinished(): start_up_unfinished, or that of its
// start-up.
[[nodiscard]] Error unfinished_error(const Network& network, const Slave& slave);

// Executes what follows a state that was requested without waiting, and that the slave has reached since. Call it
// before a transition from this state. If `next` leads to a lower state, the commands and the hook are not executed any
// more.
[[nodiscard]] Task<Result<>> finish_requested(Network& network, Slave& slave, Transition next);

// The work on the slave that no request waits for; nullptr: there is none.
[[nodiscard]] SlaveWork* find_work(Network& network, const Slave& slave);

// Ends the work, which has taken too long, and reports the hook or the commands that have not ended by themselves.
void end_work(Network& network, SlaveWork& work);

// While commands or a hook of the application execute: the time of the work that executes them is limited, if it is not
// limited already.
class WorkLimit {
  public:
    WorkLimit(Network& network, std::uint16_t slave);
    WorkLimit(const WorkLimit&) = delete;
    WorkLimit& operator=(const WorkLimit&) = delete;
    ~WorkLimit() {
        if (work_ != nullptr) work_->since = kNever;
    }

  private:
    SlaveWork* work_;  // outlives this object: both are parts of one sequence
};

// The state of the slave when it has reached the state that was requested last; slave.al has just been read.
[[nodiscard]] AlState awaited_state(const SlaveMarks& marks, const Slave& slave);
[[nodiscard]] inline AlState awaited_state(const Network& network, const Slave& slave) {
    return awaited_state(network.marks(slave), slave);
}

// Whether writestate() has requested this state, and it is not confirmed yet.
[[nodiscard]] bool is_requested(const Network& network, const Slave& slave, AlState state);

// Call it when commands and a hook have ended that began at `begun`: doubts the slave if another one may have taken its
// place meanwhile. Returns whether prove_before_request() is due.
[[nodiscard]] bool doubt_after_hook(Network& network, Slave& slave, Time begun);

// Ends the work on the slave, if there is any: the slave has left the state in which the work executes a hook.
void drop_work(Network& network, const Slave& slave);

// How long the slave may take from its current state.
[[nodiscard]] Duration al_timeout(const Slave& slave, AlState state);

// `wanted`, but at most the highest state of the slave's configuration.
[[nodiscard]] AlState limited(const Slave& slave, AlState wanted);

// The error when a state above the slave's highest state is requested.
[[nodiscard]] Error above_highest(const Slave& slave, AlState state);

}  // namespace margay
