// All masters of the service. They are started together, changed by a reload, and ended together.
#pragma once

#include "margayd/master.hpp"
#include "margayd/notify.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace margay::service {

struct ServiceOptions {
    std::string config = samples::kConfigurationFolder;
    std::string sockets = samples::kSocketFolder;
};

// Reads the configuration, writes its errors and warnings into the log, and returns whether it can be used. `code`: the
// exit code if not.
[[nodiscard]] bool is_usable(const samples::ServiceConfiguration& configuration, const std::string& folder, int& code);

class Service {
  public:
    explicit Service(ServiceOptions options) : options_(std::move(options)) {}
    // Until SIGTERM or SIGINT; SIGHUP reloads. Returns the exit code.
    int run();

  private:
    // Starts these masters. False: one of them cannot start; `all` says whether the others begin nevertheless.
    bool start(std::vector<samples::MasterConfiguration> configurations, bool all);
    void reload();
    int serve();
    // Tries to start the masters that could not start at a reload.
    void try_absent();
    [[nodiscard]] std::string status() const;
    void stop_all();

    ServiceOptions options_;
    Notifier notifier_{};
    std::vector<std::unique_ptr<Master>> masters_{};
    // A resource of a master, for example its port, may be in use for a short time. Therefore the service tries to
    // start the master again.
    struct Absent {
        samples::MasterConfiguration configuration{};
        std::string problem{};
    };
    std::vector<Absent> absent_{};
};

}  // namespace margay::service
