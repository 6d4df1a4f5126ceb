// The messages of the service: one line each on standard error, with the priority in front ("<4>") where standard error
// is the journal of systemd. The journal adds the time.
#pragma once

#include <string>
#include <string_view>

namespace margay::service {

// The values are those of <syslog.h>.
enum class Priority : int { error = 3, warning = 4, notice = 5, info = 6, debug = 7 };

// Call it once, before the first message. From then on, the messages of samples::fail() and warn() are written in the
// same way.
void begin_log();

// From any thread. A line that cannot be written is lost: a full disk, a closed pipe, or a reader that does not read
// stops nothing. The next line that can be written has a line before it with the number of lost ones. Writing waits for
// a reader for 100 ms at most, so the thread of a cycle does not call it while the cycle runs.
void log(Priority priority, std::string_view text);

// The master that the messages of this thread are about; empty: the service.
void log_about(std::string master);

}  // namespace margay::service
