#include "common/program.hpp"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>

namespace margay::samples {
namespace {

std::string program_name = "margay";
MessageWriter message_writer = nullptr;
int output_error = 0;  // errno of the first write to standard output that failed
volatile std::sig_atomic_t signal_seen = 0;

void note_lost_output() {
    if (output_error == 0) output_error = errno != 0 ? errno : EIO;
}

}  // namespace

void write_out(std::string_view text) {
    if (output_lost()) return;
    errno = 0;
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) note_lost_output();
}

void flush_out() {
    errno = 0;
    if (!output_lost() && std::fflush(stdout) != 0) note_lost_output();
}

bool output_lost() { return output_error != 0; }

int fail(std::string_view text, int code) {
    if (message_writer != nullptr) {
        message_writer(text);
        return code;
    }
    const auto line = program_name + ": " + std::string(text) + "\n";
    (void)std::fwrite(line.data(), 1, line.size(), stderr);
    return code;
}

void warn(std::string_view text) { (void)fail(text); }

void write_messages_by(MessageWriter writer) { message_writer = writer; }

void stop_at_signals() {
    struct sigaction action {};
    action.sa_handler = [](int) { signal_seen = 1; };
    (void)::sigaction(SIGINT, &action, nullptr);
    (void)::sigaction(SIGTERM, &action, nullptr);
}

bool stop_asked() { return signal_seen != 0 || output_lost(); }

int run_program(std::string_view name, const std::function<int()>& body) {
    program_name = name;
    (void)std::signal(SIGPIPE, SIG_IGN);
    int code = exit_code::kSystem;
    try {
        code = body();
    } catch (const std::exception& exception) {
        (void)fail(exception.what());
    }
    flush_out();
    if (!output_lost()) return code;
    return fail(std::string("standard output cannot be written: ") + std::strerror(output_error), exit_code::kSystem);
}

}  // namespace margay::samples
