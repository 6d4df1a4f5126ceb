#include "storm/run.hpp"

#include "storm/device_bits.hpp"
#include "storm/world.hpp"

#include <execinfo.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace margay::storm {
namespace {

void write_all(int to, const std::string& text) {
    for (std::size_t at = 0; at < text.size();) {
        const auto written = ::write(to, text.data() + at, text.size() - at);
        if (written <= 0) return;
        at += static_cast<std::size_t>(written);
    }
}

[[maybe_unused]] void on_crash(int number) {
    std::array<void*, 40> frames{};
    const int count = backtrace(frames.data(), static_cast<int>(frames.size()));
    backtrace_symbols_fd(frames.data(), count, STDERR_FILENO);
    std::signal(number, SIG_DFL);
    std::raise(number);
}

// The child process. It writes seconds, rule and detail to `out`, one per line.
[[noreturn]] void child(const Plan& plan, int out, unsigned cpu_seconds) {
    ::dup2(out, STDERR_FILENO);
    const rlimit cpu{cpu_seconds, cpu_seconds + 1};
    (void)::setrlimit(RLIMIT_CPU, &cpu);
    const rlimit none{0, 0};
    (void)::setrlimit(RLIMIT_CORE, &none);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they report crashes themselves
    for (const int number : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGXCPU}) std::signal(number, on_crash);
#endif
    World* running = nullptr;
    const auto report = [&](const Failure& failure) {
        write_all(out, "\nverdict " + std::to_string(running != nullptr ? running->simulated_seconds() : 0) + "\n" +
                           failure.rule + "\n" + failure.detail + "\n");
        ::_exit(0);
    };
    {
        World world(plan, report);
        running = &world;
        world.run();
        write_all(out, "\nverdict " + std::to_string(world.simulated_seconds()) + "\n\n\n");
    }
    ::_exit(0);
}

std::string read_all(int from) {
    std::string all;
    std::array<char, 4096> part{};
    for (ssize_t got = 0; (got = ::read(from, part.data(), part.size())) > 0;)
        if (all.size() < 100'000) all.append(part.data(), static_cast<std::size_t>(got));
    return all;
}

// Functions and lines of the stack frames of a crash, from src/ only. Uses addr2line if it is installed.
std::string in_words(const std::string& output) {
    std::array<char, 512> self{};
    if (::readlink("/proc/self/exe", self.data(), self.size() - 1) <= 0) return "";
    std::string command = std::string("addr2line -Cfpe '") + self.data() + "'";
    bool any = false;
    for (std::size_t at = 0; (at = output.find("(+0x", at)) != std::string::npos; ++at) {
        const auto line = output.rfind('\n', at);
        if (output.find(".so", line) < at) continue;
        command += " " + output.substr(at + 2, output.find(')', at) - at - 2);
        any = true;
    }
    FILE* const pipe = any ? ::popen((command + " 2>/dev/null").c_str(), "r") : nullptr;
    if (pipe == nullptr) return "";
    std::string text;
    std::array<char, 2048> line{};
    while (std::fgets(line.data(), line.size(), pipe) != nullptr)
        if (const char* const place = std::strstr(line.data(), "/src/"); place != nullptr) text += place + 1;
    (void)::pclose(pipe);
    return text;
}

// The first message of a crash: an assertion, or the headline of a sanitizer.
std::string headline(const std::string& output) {
    for (const char* const mark : {"Assertion", "ERROR: AddressSanitizer:", "runtime error:", "ERROR: LeakSanitizer"}) {
        const auto at = output.find(mark);
        if (at == std::string::npos) continue;
        auto line = output.substr(at, output.find('\n', at) - at);
        if (const auto address = line.find(" on address"); address != std::string::npos) line.resize(address);
        return line;
    }
    return "";
}

}  // namespace

Verdict execute(const Plan& plan, unsigned cpu_seconds) {
    for (const auto& device : plan.devices) (void)bits_of_device(device.name);  // read before fork(), for all plans
    std::array<int, 2> pipe{};
    if (::pipe(pipe.data()) != 0) return {"no pipe", "", 0};
    std::fflush(nullptr);
    const pid_t pid = ::fork();
    if (pid == 0) {
        ::close(pipe[0]);
        child(plan, pipe[1], cpu_seconds);
    }
    ::close(pipe[1]);
    const std::string output = read_all(pipe[0]);
    ::close(pipe[0]);
    int status = 0;
    (void)::waitpid(pid, &status, 0);

    Verdict verdict;
    const auto at = output.rfind("\nverdict ");
    if (WIFSIGNALED(status) || WEXITSTATUS(status) != 0 || at == std::string::npos) {
        const int number = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
        const std::string where = in_words(output);
        verdict.rule = number == SIGXCPU || number == SIGKILL ? "hangs" : "crashes: " + headline(output);
        if (where.empty() && number == SIGSEGV) verdict.rule += "a call of nothing";
        if (!where.empty()) verdict.rule += " at " + where.substr(0, where.find_first_of(" \n"));
        verdict.detail = where + output;
        return verdict;
    }
    const auto line = output.find('\n', at + 1);
    verdict.simulated_seconds = std::strtod(output.c_str() + at + std::strlen("\nverdict "), nullptr);
    const auto rule_end = output.find('\n', line + 1);
    verdict.rule = output.substr(line + 1, rule_end - line - 1);
    verdict.detail = output.substr(rule_end + 1);
    while (!verdict.detail.empty() && verdict.detail.back() == '\n') verdict.detail.pop_back();
    return verdict;
}

// ------------------------------------------------------------------ reducing a plan

namespace {

class Shrinker {
  public:
    Shrinker(Plan plan, std::string rule, unsigned most)
        : plan_(std::move(plan)), rule_(std::move(rule)), left_(most) {}

    Plan run() {
        for (bool smaller = true; smaller && left_ > 0;) {
            smaller = steps();
            smaller = devices() || smaller;
            smaller = quirks() || smaller;
            smaller = settings() || smaller;
        }
        return plan_;
    }

  private:
    bool try_plan(const Plan& candidate) {
        if (left_ == 0) return false;
        --left_;
        if (execute(candidate, 20).rule != rule_) return false;
        plan_ = candidate;
        return true;
    }

    bool steps() {
        bool any = false;
        for (std::size_t part = std::max<std::size_t>(plan_.steps.size() / 2, 1); part > 0; part /= 2) {
            for (std::size_t at = 0; at < plan_.steps.size();) {
                Plan candidate = plan_;
                const auto end = std::min(at + part, candidate.steps.size());
                const auto first = candidate.steps.begin() + static_cast<std::ptrdiff_t>(at);
                const auto last = candidate.steps.begin() + static_cast<std::ptrdiff_t>(end);
                std::uint32_t after = 0;  // keeps the time of the next step
                for (auto step = first; step != last; ++step) after += step->after_us;
                if (end < candidate.steps.size()) last->after_us += after;
                candidate.steps.erase(first, last);
                if (try_plan(candidate))
                    any = true;
                else
                    at += part;
            }
        }
        return any;
    }

    bool devices() {
        bool any = false;
        for (std::size_t n = plan_.devices.size(); n-- > 0 && plan_.devices.size() > 1;)
            if (n < plan_.devices.size()) any = try_plan(without_device(plan_, n)) || any;
        return any;
    }

    bool quirks() {
        bool any = false;
        for (std::size_t n = 0; n < plan_.devices.size(); ++n)
            for (std::size_t q = plan_.devices[n].quirks.size(); q-- > 0;) {
                Plan candidate = plan_;
                candidate.devices[n].quirks.erase(candidate.devices[n].quirks.begin() + static_cast<std::ptrdiff_t>(q));
                any = try_plan(candidate) || any;
            }
        return any;
    }

    bool settings() {
        bool any = false;
        const Settings usual;
        for (const auto& one : setting_infos()) {
            if (one.name == "calm" || plan_.settings.*one.value == usual.*one.value) continue;
            Plan candidate = plan_;
            candidate.settings.*one.value = usual.*one.value;
            any = try_plan(candidate) || any;
        }
        return any;
    }

    Plan plan_;
    std::string rule_;
    unsigned left_;
};

}  // namespace

Plan shrink(const Plan& plan, const std::string& rule, unsigned most) { return Shrinker(plan, rule, most).run(); }

}  // namespace margay::storm
