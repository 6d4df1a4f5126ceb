// The second thread of a master. It writes events into the log, and passes Ethernet frames between slaves with EoE and
// the kernel, so that the thread of the cycle never waits for a log or a socket.
#pragma once

#include "common/eoe_lines.hpp"
#include "margayd/log.hpp"

#include <margay/context.hpp>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace margay::service {

// The levels of messages about a segment: the key `debug` of the configuration, and `ethercat debug`.
namespace debug_level {
inline constexpr unsigned kNone = 0;  // only messages about the service itself
inline constexpr unsigned kUsual = 1;
inline constexpr unsigned kAll = 2;  // also repetitions, and the counters of frames once a second
}  // namespace debug_level

// The state of the segment, reported by the owner of the context.
struct Standing {
    Error wrong{.code = Errc::wrong_state};  // the result of what_is_wrong(); code none: no error
    std::uint16_t slaves = 0;                // that answer
    std::uint16_t elsewhere = 0;             // of these, in another state than `target`
    AlState target = AlState::op;
    std::uint64_t overruns = 0;  // cycles that were left out
    bool settles = false;        // the cycle has just begun, so errors are not reported yet
    LinkStatistics link{};
};

class Companion {
  public:
    // `name`: of the master, for messages. `level`: selects the messages (debug_level); another thread may change it.
    // Both references outlive the object.
    Companion(Context& ctx, std::string name, const std::atomic<unsigned>& level);
    ~Companion();
    Companion(const Companion&) = delete;
    Companion& operator=(const Companion&) = delete;

    // For the owner, callable from the cycle: never waits.
    void tell(const Standing& standing);
    // The segment has slaves that are not used, since this time; 0: no.
    [[nodiscard]] std::chrono::steady_clock::time_point strangers_since() const { return strangers_.load(); }

    // For the owner, callable from the cycle: never waits for the other thread. Adds a line. The result is written into
    // the log. False: not possible now.
    [[nodiscard]] bool open_line(Context& ctx, const Slave& slave, const std::string& name);

    // For the owner, while no cycle runs.
    void take_lines(std::unique_ptr<samples::EoeLines> lines);
    // Returns the lines, which are not used any more.
    [[nodiscard]] std::unique_ptr<samples::EoeLines> give_lines();
    // Sets the reason why there is no segment at present. The text is logged when it has changed.
    void wait_for(const std::string& reason);
    void forget_strangers() { strangers_ = std::chrono::steady_clock::time_point{}; }

    // Writes the remaining messages and ends the thread.
    void end();

    // One sentence about the master. From any thread.
    [[nodiscard]] std::string status() const;

  private:
    void run();
    void look(bool all);
    void report_events();
    void report_errors();
    // Logs the text at most `most` times a minute; forget_repeated() logs the number of suppressed repetitions.
    void say(Priority priority, const std::string& text, unsigned most);
    void forget_repeated();
    void report_standing(const Standing& now);
    void report_frames(const Standing& now);
    bool pass_frames(std::vector<pollfd>& files);

    Context& ctx_;
    std::string name_;
    const std::atomic<unsigned>& level_;
    std::atomic<bool> stopping_{false};
    std::atomic<std::chrono::steady_clock::time_point> strangers_{};

    mutable std::mutex mutex_{};
    Standing told_{};
    bool is_told_ = false;
    std::string waiting_{};
    std::string status_ = "starts";
    std::unique_ptr<samples::EoeLines> lines_{};
    struct Note {
        Priority priority{};
        std::string text{};
    };
    std::vector<Note> notes_{};  // of open_line(), for the log

    // Used only by the thread.
    Error last_wrong_{};
    std::string right_{};  // the last text of "all is right"
    bool was_right_ = false;
    std::uint64_t overruns_ = 0;
    std::chrono::steady_clock::time_point overruns_reported_{};
    LinkStatistics frames_{};  // as reported last
    struct Said {
        std::chrono::steady_clock::time_point since{};
        Priority priority = Priority::info;
        unsigned times = 0;
        unsigned silent = 0;  // of these
    };
    std::map<std::string, Said> said_{};
    std::thread thread_{};
};

}  // namespace margay::service
