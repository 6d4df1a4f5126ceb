#include "common/program.hpp"

#include "common/visible_text.hpp"

#include <fcntl.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
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

// A socket or a file must not get the number of a standard stream that the caller has closed: it would receive the
// output or the messages. Reading and writing fails as with a closed stream.
void hold_standard_streams() {
    for (int fd = 0; fd < 3; ++fd)
        if (::fcntl(fd, F_GETFD) < 0) (void)::open("/dev/null", fd == 0 ? O_WRONLY : O_RDONLY);
}

// An exception cannot pass through a part of the library that is compiled without exceptions, for example through the
// simulated segment: std::terminate() is called. If memory is exhausted, this is an error of the system, and the
// program ends with the exit code of such an error. fail() is not used, because it allocates.
std::terminate_handler handler_before = nullptr;
[[noreturn]] void end_without_memory() {
    if (const auto exception = std::current_exception()) {
        try {
            std::rethrow_exception(exception);
        } catch (const std::bad_alloc&) {
            (void)std::fputs(program_name.c_str(), stderr);
            (void)std::fputs(": out of memory\n", stderr);
            std::_Exit(exit_code::kSystem);
        } catch (...) {  // a fault of the program
        }
    }
    handler_before();
    std::abort();
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

void print_text(std::string_view text) { write_out(visible(text)); }

int fail(std::string_view message, int code) {
    const auto text = visible(message);
    if (message_writer != nullptr) {
        message_writer(text);
        return code;
    }
    const auto line = program_name + ": " + text + "\n";
    flush_out();  // if both go to one file, the message follows the earlier output
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
    hold_standard_streams();
    (void)std::signal(SIGPIPE, SIG_IGN);
    const std::terminate_handler before = std::set_terminate(end_without_memory);
    if (before != end_without_memory) handler_before = before;
    int code = exit_code::kSystem;
    try {
        code = body();
    } catch (const std::bad_alloc&) {
        (void)fail("out of memory");
    } catch (const std::exception& exception) {
        (void)fail(exception.what());
    }
    flush_out();
    if (!output_lost()) return code;
    return fail(std::string("standard output cannot be written: ") + std::strerror(output_error), exit_code::kSystem);
}

}  // namespace margay::samples
