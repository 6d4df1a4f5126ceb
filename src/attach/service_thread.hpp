// The thread of a part that serves other programs: without the signals and the real-time priority of the application.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

namespace margay::attach {

class ServiceThread {
  public:
    ServiceThread() = default;
    // If the thread uses members that are destroyed before this object, call stop() first.
    ~ServiceThread() { stop(); }
    ServiceThread(const ServiceThread&) = delete;
    ServiceThread& operator=(const ServiceThread&) = delete;

    // `name` has at most 15 characters. Returns a sentence if the thread cannot be created; empty: the thread runs.
    [[nodiscard]] std::string start(const char* name, std::function<void()> run);
    // Wakes the thread and waits for its end.
    void stop();

    // For `run`: readable when the thread is to end.
    [[nodiscard]] int wake_fd() const { return wake_; }
    [[nodiscard]] bool stopping() const { return stopping_; }

  private:
    int wake_ = -1;
    std::atomic<bool> stopping_{false};
    std::thread thread_{};
};

}  // namespace margay::attach
