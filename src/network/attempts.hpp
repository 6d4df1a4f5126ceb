// Attempts of the supervision to bring a slave back. A failure is reported when it begins, when its cause changes, and
// when it ends. An attempt that repeats a reported failure reports only what it has changed in the end.
#pragma once

#include "network/network.hpp"

namespace margay {

// Exists while the supervision brings the slave back. The destructor reports what a repeated attempt has changed, also
// when the sequence is destroyed.
class Attempt {
  public:
    Attempt(Network& network, Slave& slave);
    Attempt(const Attempt&) = delete;
    Attempt& operator=(const Attempt&) = delete;
    ~Attempt();

  private:
    Network& network_;
    Slave& slave_;
    AlStatus before_;
};

// Whether the slave is as the supervision has left it, or starts for the first time. The end of such an attempt is not
// reported as a recovery.
[[nodiscard]] bool is_well(const Network& network, const Slave& slave);

// The attempt has failed, and the slave is in state `now`: `cause` becomes the error of the slave. It is reported
// unless the attempt before has failed for the same cause.
void report_failure(Network& network, Slave& slave, const AlStatus& now, const Error& cause);

}  // namespace margay
