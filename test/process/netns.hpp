// Two network namespaces joined by a cable (a veth pair), made by the test and removed with it; nothing
// outside of them is touched. And child processes that run inside them.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace margay::process {

// Runs a command through the shell; true when it succeeded. Its output is added to `said`.
bool run(const std::string& command, std::string* said = nullptr);

class Cable {
  public:
    // Ends of the cable: namespaces by the name of the test's process, interfaces by fixed names.
    static constexpr const char* kMaster = "ecat-m";
    static constexpr const char* kSegment = "ecat-s";

    Cable();
    ~Cable();
    Cable(const Cable&) = delete;
    Cable& operator=(const Cable&) = delete;

    // Why there is no cable (no permission, no ip, no veth), empty when there is one: reason to skip.
    [[nodiscard]] const std::string& missing() const { return missing_; }

    [[nodiscard]] const std::string& master_namespace() const { return master_; }
    [[nodiscard]] const std::string& segment_namespace() const { return segment_; }

    // `ip ARGUMENTS` in one of the namespaces.
    bool ip(const std::string& name_space, const std::string& arguments) const;

    // Calls `what` with this thread in the namespace. Sockets opened meanwhile stay in it.
    static void inside(const std::string& name_space, const std::function<void()>& what);

  private:
    std::string master_;
    std::string segment_;
    std::string missing_;
};

// A program running in a namespace, its output caught. Ended, by its id, at the latest by the destructor.
class Child {
  public:
    Child(const std::string& name_space, const std::vector<std::string>& arguments);
    ~Child();
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    // Waits for the end and returns the exit code; −1 when it had to be killed after `limit` or died of a
    // signal.
    int wait(std::chrono::seconds limit);
    // Waits until standard output has held `text`; false when it has not within `limit` or the program has
    // ended before.
    bool says(const std::string& text, std::chrono::seconds limit);
    void terminate();

    [[nodiscard]] std::string output() const;
    [[nodiscard]] std::string errors() const;

  private:
    bool ended();

    pid_t id_ = -1;
    int exit_code_ = -1;
    std::string folder_;
};

}  // namespace margay::process
