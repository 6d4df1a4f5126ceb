// A progress line on standard error, written again at each step. It is shown on a terminal only.
#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <string_view>

#include <unistd.h>

namespace margay::samples {

class ProgressLine {
  public:
    ProgressLine() : terminal_(::isatty(STDERR_FILENO) != 0) {}
    ~ProgressLine() { clear(); }
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    void show(std::string_view text) {
        if (!terminal_) return;
        fmt::print(stderr, "\r\033[K{}", text);
        (void)std::fflush(stderr);
        shown_ = true;
    }
    void clear() {
        if (shown_) fmt::print(stderr, "\r\033[K");
        shown_ = false;
    }

  private:
    bool terminal_;
    bool shown_ = false;
};

}  // namespace margay::samples
