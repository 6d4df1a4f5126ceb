#include "margayd/log.hpp"

#include "common/program.hpp"
#include "common/visible_text.hpp"

#include <fmt/format.h>

#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <mutex>

namespace margay::service {
namespace {

bool to_journal = false;
thread_local std::string about;

// systemd sets JOURNAL_STREAM=DEVICE:INODE to the file of the stream.
bool is_journal() {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat found {};
    if (stream == nullptr || ::fstat(STDERR_FILENO, &found) != 0) return false;
    return fmt::format("{}:{}", static_cast<unsigned long long>(found.st_dev),
                       static_cast<unsigned long long>(found.st_ino)) == stream;
}

// Standard error as a stream that waits for its reader for a bounded time. Other programs may use the same open file,
// so its flags stay as they are.
class Stream {
  public:
    void open() {
        struct stat found {};
        if (::fstat(STDERR_FILENO, &found) != 0) return;
        socket_ = S_ISSOCK(found.st_mode);
        if (!S_ISFIFO(found.st_mode) && !S_ISCHR(found.st_mode)) return;
        const int own = ::open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
        if (own >= 0) fd_ = own;  // never closed: messages are written until the process ends
    }

    // One line with its end. From any thread.
    void write(std::string_view line) {
        const std::lock_guard lock(mutex_);
        if (lost_ != 0) {
            const auto text = fmt::format("{}{}{} line{} of the log {} lost: nothing has read {} in time\n",
                                          cut_ ? "\n" : "", to_journal ? "<4>" : "margayd: ", lost_,
                                          lost_ == 1 ? "" : "s", lost_ == 1 ? "is" : "are", lost_ == 1 ? "it" : "them");
            if (!put(text)) {
                ++lost_;
                return;
            }
            lost_ = 0;
        }
        if (!put(line)) ++lost_;
    }

  private:
    bool put(std::string_view text) {
        const std::size_t whole = text.size();
        constexpr int kTries = 16;
        for (int tries = 0; !text.empty();) {
            // If poll() reports a pipe as ready, it has room for PIPE_BUF octets.
            const auto part = text.substr(0, PIPE_BUF);
            const ssize_t written = is_ready() ? write_part(part) : 0;
            if (written < 0 && (errno == EINTR || errno == EAGAIN) && ++tries < kTries) continue;
            if (written <= 0) {
                if (text.size() != whole) cut_ = true;
                return false;
            }
            text.remove_prefix(static_cast<std::size_t>(written));
        }
        cut_ = false;
        return true;
    }
    ssize_t write_part(std::string_view part) const {
        return socket_ ? ::send(fd_, part.data(), part.size(), MSG_DONTWAIT | MSG_NOSIGNAL)
                       : ::write(fd_, part.data(), part.size());
    }
    // After a wait without success, the next lines do not wait.
    bool is_ready() {
        constexpr int kWaitMs = 100;
        pollfd one{.fd = fd_, .events = POLLOUT, .revents = 0};
        stalled_ = ::poll(&one, 1, stalled_ ? 0 : kWaitMs) == 0;
        return !stalled_;
    }

    std::mutex mutex_;
    int fd_ = STDERR_FILENO;
    bool socket_ = false;
    bool stalled_ = false;
    bool cut_ = false;  // the last octets are not a complete line
    unsigned long lost_ = 0;
};

Stream& stream() {
    static Stream one;
    return one;
}

}  // namespace

void begin_log() {
    to_journal = is_journal();
    stream().open();
    samples::write_messages_by([](std::string_view text) { log(Priority::warning, text); });
}

void log(Priority priority, std::string_view text) {
    auto line =
        fmt::format("{}{}{}{}", to_journal ? fmt::format("<{}>", static_cast<int>(priority)) : "margayd: ", about,
                    about.empty() ? "" : ": ", samples::visible(text));
    // Texts of slaves may contain anything. One message is one line.
    std::ranges::replace_if(
        line, [](char c) { return (c >= 0 && c < ' ') || c == 0x7F; }, ' ');
    line += '\n';
    stream().write(line);
}

void log_about(std::string master) { about = std::move(master); }

}  // namespace margay::service
