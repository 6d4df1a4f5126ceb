// Load on the machine beside a measurement: processes that compute, copy memory, and send frames.
#pragma once

#include <sys/types.h>
#include <string>
#include <string_view>
#include <vector>

namespace margay::bench {

class Load {
  public:
    Load() = default;
    ~Load() { stop(); }
    Load(const Load&) = delete;
    Load& operator=(const Load&) = delete;

    // Starts processes of one kind: "cpu" and "memory", one for each processor; "network", one pair that sends frames
    // by the loopback interface. Returns false and the reason in `why` when the kind does not exist or cannot be
    // started.
    [[nodiscard]] bool start(std::string_view kind, std::string& why);
    // Ends all these processes. The end of this process ends them too.
    void stop();

  private:
    [[nodiscard]] bool start_one(void (*work)(), std::string& why);

    std::vector<pid_t> processes_;
};

}  // namespace margay::bench
