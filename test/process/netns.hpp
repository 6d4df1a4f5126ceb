// Two network namespaces connected by a veth pair. The test creates and removes them and changes nothing else in the
// system. Also starts child processes inside them.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace margay::process {

// Executes a command through the shell. Returns true when it succeeded, and appends its output to `said`.
bool run(const std::string& command, std::string* said = nullptr);

class Cable {
  public:
    // The ends of the cable. The names of the namespaces contain the process id of the test, the interface names are
    // fixed.
    static constexpr const char* kMaster = "ecat-m";
    static constexpr const char* kSegment = "ecat-s";

    Cable();
    ~Cable();
    Cable(const Cable&) = delete;
    Cable& operator=(const Cable&) = delete;

    // The reason why there is no cable (no permission, no ip, no veth), for skipping the test; empty when there is a
    // cable.
    [[nodiscard]] const std::string& missing() const { return missing_; }

    [[nodiscard]] const std::string& master_namespace() const { return master_; }
    [[nodiscard]] const std::string& segment_namespace() const { return segment_; }

    // Executes `ip ARGUMENTS` in one of the namespaces.
    bool ip(const std::string& name_space, const std::string& arguments) const;

    // Calls `what` with this thread in the namespace. Sockets that it opens stay in the namespace.
    static void inside(const std::string& name_space, const std::function<void()>& what);

  private:
    std::string master_;
    std::string segment_;
    std::string missing_;
};

// A program in a namespace, with its output recorded. The destructor ends the program by its process id.
class Child {
  public:
    Child(const std::string& name_space, const std::vector<std::string>& arguments);
    ~Child();
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    // Waits for the end and returns the exit code; −1 when the program was killed after `limit` or ended by a signal.
    int wait(std::chrono::seconds limit);
    // Waits until standard output contains `text`. Returns false after `limit`, or when the program ended before.
    bool says(const std::string& text, std::chrono::seconds limit);
    // Whether the program has ended, without waiting.
    bool ended();
    void terminate();
    void send(int signal) const;

    [[nodiscard]] std::string output() const;
    [[nodiscard]] std::string errors() const;

  private:
    pid_t id_ = -1;
    int exit_code_ = -1;
    std::string folder_;
};

}  // namespace margay::process
