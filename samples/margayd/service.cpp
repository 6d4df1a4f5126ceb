#include "margayd/service.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"
#include "margayd/log.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

namespace margay::service {
namespace {

using samples::MasterConfiguration;
namespace exit_code = samples::exit_code;

sigset_t service_signals() {
    sigset_t all;
    sigemptyset(&all);
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&all, signal);
    return all;
}

// The number of a master is in the names of its EoE interfaces only. The level of its messages changes while it runs.
bool is_same(MasterConfiguration running, const MasterConfiguration& wanted) {
    running.debug = wanted.debug;
    const auto has_number = [](const MasterConfiguration& m) {
        return m.eoe &&
               (m.eoe_named.empty() || std::ranges::any_of(m.eoe_named, [](const auto& e) { return e.name.empty(); }));
    };
    if (!has_number(wanted)) running.number = wanted.number;
    return running == wanted;
}

}  // namespace

bool is_usable(const samples::ServiceConfiguration& configuration, const std::string& folder, int& code) {
    for (const auto& warning : configuration.warnings) log(Priority::warning, "warning: " + warning);
    for (const auto& error : configuration.errors) log(Priority::error, error);
    code = configuration.unreadable ? exit_code::kSystem : exit_code::kUsage;
    if (!configuration.errors.empty()) return false;
    if (configuration.masters.empty()) {
        log(Priority::error, fmt::format("no master is described in {} (files *.toml)", folder));
        return false;
    }
    return true;
}

int Service::run() {
    // Threads inherit the mask: the signals are for this one, which waits for them.
    const sigset_t signals = service_signals();
    (void)::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    auto configuration =
        samples::read_service_configuration(options_.config, samples::ConfigurationCheck::whole, options_.sockets);
    int code = exit_code::kWell;
    if (!is_usable(configuration, options_.config, code)) return code;
    std::error_code error;
    std::filesystem::create_directories(options_.sockets, error);
    if (error) {
        log(Priority::error, fmt::format("{}: cannot be created: {}", options_.sockets, error.message()));
        return exit_code::kSystem;
    }
    if (!start(std::move(configuration.masters), false)) return exit_code::kSystem;
    notifier_.ready();
    log(Priority::notice,
        fmt::format("margayd {} runs {}", MARGAY_VERSION_TEXT, samples::counted(masters_.size(), "master")));
    code = serve();
    notifier_.stopping();
    stop_all();
    return code;
}

bool Service::start(std::vector<MasterConfiguration> configurations, bool all) {
    std::vector<std::unique_ptr<Master>> opened;
    bool well = true;
    for (auto& configuration : configurations) {
        const auto name = configuration.name;
        auto socket = samples::socket_path(configuration, options_.sockets);
        auto master = std::make_unique<Master>(configuration, std::move(socket));
        auto problem = master->open();
        if (problem.empty()) {
            opened.push_back(std::move(master));
            continue;
        }
        log(Priority::error, fmt::format("{}: does not start: {}", name, problem));
        absent_.push_back({std::move(configuration), std::move(problem)});
        well = false;
    }
    if (!well && !all) return false;
    for (auto& master : opened) {
        master->begin();
        masters_.push_back(std::move(master));
    }
    return well;
}

void Service::try_absent() {
    for (auto& [configuration, problem] : std::exchange(absent_, {})) {
        auto master = std::make_unique<Master>(configuration, samples::socket_path(configuration, options_.sockets));
        auto again = master->open();
        if (again.empty()) {
            log(Priority::notice, configuration.name + ": starts now");
            master->begin();
            masters_.push_back(std::move(master));
            continue;
        }
        if (again != problem) log(Priority::error, fmt::format("{}: does not start: {}", configuration.name, again));
        absent_.push_back({std::move(configuration), std::move(again)});
    }
}

int Service::serve() {
    constexpr unsigned kTryEach = 5;  // seconds
    const sigset_t signals = service_signals();
    for (unsigned seconds = 0;; ++seconds) {
        const timespec second{.tv_sec = 1, .tv_nsec = 0};
        const int signal = ::sigtimedwait(&signals, nullptr, &second);
        if (signal == SIGTERM || signal == SIGINT) return exit_code::kWell;
        if (signal == SIGHUP) reload();
        if (signal < 0 && errno != EAGAIN && errno != EINTR) {
            log(Priority::error, fmt::format("waiting for signals failed: {}", std::strerror(errno)));
            return exit_code::kSystem;
        }
        if (std::ranges::any_of(masters_, [](const auto& master) { return master->failed(); }))
            return exit_code::kSystem;
        if (seconds % kTryEach == kTryEach - 1) try_absent();
        notifier_.status(status());
    }
}

void Service::reload() {
    notifier_.reloading();
    auto configuration =
        samples::read_service_configuration(options_.config, samples::ConfigurationCheck::whole, options_.sockets);
    int code = exit_code::kWell;
    if (!is_usable(configuration, options_.config, code)) {
        log(Priority::error, "the new configuration is refused: the masters go on with the old one");
        return notifier_.ready();
    }
    auto& wanted = configuration.masters;
    std::vector<std::unique_ptr<Master>> ended;
    for (auto& master : masters_) {
        const auto same = std::ranges::find_if(
            wanted, [&](const MasterConfiguration& m) { return is_same(master->configuration(), m); });
        if (same == wanted.end()) {
            ended.push_back(std::move(master));
            continue;
        }
        if (same->debug != master->configuration().debug) master->set_debug_level(same->debug);
        wanted.erase(same);
    }
    std::erase(masters_, nullptr);
    absent_.clear();  // they are in `wanted`, or they were removed from the configuration
    for (const auto& master : ended)
        log(Priority::notice,
            fmt::format("{}: ends, its configuration has changed or is gone", master->configuration().name));
    for (const auto& master : ended) master->stop();
    const auto changed = wanted.size();
    ended.clear();  // waits for them: a new master may use the same interface
    const auto kept = masters_.size();
    const bool well = start(std::move(wanted), true);
    log(well ? Priority::notice : Priority::error,
        fmt::format("configuration reloaded: {}{} started, {} in all{}",
                    well ? "" : fmt::format("{} of ", masters_.size() - kept), samples::counted(changed, "master"),
                    masters_.size(), well ? "" : "; the others are tried again every 5 s"));
    notifier_.ready();
}

std::string Service::status() const {
    std::string text;
    for (const auto& master : masters_)
        text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", master->configuration().name, master->status());
    for (const auto& [configuration, problem] : absent_)
        text += fmt::format("{}{}: does not start: {}", text.empty() ? "" : "; ", configuration.name, problem);
    return text;
}

void Service::stop_all() {
    for (const auto& master : masters_) master->stop();
    masters_.clear();
    log(Priority::notice, "ends");
}

}  // namespace margay::service
