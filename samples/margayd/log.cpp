#include "margayd/log.hpp"

#include "common/program.hpp"

#include <fmt/format.h>

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

namespace margay::service {
namespace {

bool to_journal = false;
thread_local std::string about;

// systemd names the file of the stream: JOURNAL_STREAM=DEVICE:INODE.
bool is_journal() {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat found {};
    if (stream == nullptr || ::fstat(STDERR_FILENO, &found) != 0) return false;
    return fmt::format("{}:{}", static_cast<unsigned long long>(found.st_dev),
                       static_cast<unsigned long long>(found.st_ino)) == stream;
}

}  // namespace

void begin_log() {
    to_journal = is_journal();
    samples::write_messages_by([](std::string_view text) { log(Priority::warning, text); });
}

void log(Priority priority, std::string_view text) {
    auto line =
        fmt::format("{}{}{}{}", to_journal ? fmt::format("<{}>", static_cast<int>(priority)) : "margayd: ", about,
                    about.empty() ? "" : ": ", text);
    // Texts of slaves may contain anything. One message is one line.
    std::ranges::replace_if(
        line, [](char c) { return (c >= 0 && c < ' ') || c == 0x7F; }, ' ');
    line += '\n';
    for (std::size_t at = 0; at < line.size();) {
        const auto written = ::write(STDERR_FILENO, line.data() + at, line.size() - at);
        if (written <= 0) return;
        at += static_cast<std::size_t>(written);
    }
}

void log_about(std::string master) { about = std::move(master); }

}  // namespace margay::service
