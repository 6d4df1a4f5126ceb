// For table.cmake: the code of the state machine, and its memory as the size of a constant.
#include "al_state_machine.hpp"

namespace margay {

void start(AlStateMachine& machine, Station station, AlState state, bool device_emulation, Duration timeout) {
    std::construct_at(&machine, station, state, device_emulation, timeout)->start();
}
void end(AlStateMachine& machine) { std::destroy_at(&machine); }

extern const char kAlStateMachineBytes[sizeof(AlStateMachine)];
const char kAlStateMachineBytes[sizeof(AlStateMachine)] = {};

}  // namespace margay
