// The reference clock after it was away, and the time of the cycles while another slave becomes the reference.
#pragma once

#include "util/task.hpp"

#include <margay/error.hpp>

namespace margay {

struct Network;

// Checks whether the reference clock was reset, and restores its time in this case. From now on the cycles carry its
// time.
[[nodiscard]] Task<Result<>> restore_reference(Network& network);

// Exists while the cycles carry no time because a slave becomes the reference. If the sequence is destroyed meanwhile,
// because the slave or all slaves are lost, the cycles carry the time of the reference again: at once, or after a
// silence when the watch has checked the reference.
class TimePause {
  public:
    explicit TimePause(Network& network) : network_(network) {}
    TimePause(const TimePause&) = delete;
    TimePause& operator=(const TimePause&) = delete;
    ~TimePause();
    void end() { ended_ = true; }

  private:
    Network& network_;
    bool ended_ = false;
};

}  // namespace margay
