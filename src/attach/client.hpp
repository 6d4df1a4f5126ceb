// The other end of an AttachServer: a connection that sends one request at a time and waits for the answer.
#pragma once

#include "attach/facts.hpp"
#include "attach/message.hpp"

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace margay::attach {

// The answer of a server; `text`: a sentence (refused), or the words of the slave (failed).
struct Reply {
    Status status = Status::done;
    std::vector<std::byte> payload{};
    Error error{};
    std::string text{};
    bool broken = false;  // `refused` by the client itself: the connection has ended, or makes no sense
    [[nodiscard]] bool ok() const { return status == Status::done; }
};

class Client {
  public:
    Client() = default;
    ~Client();
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    // A sentence when the server does not answer, or speaks another version; empty: connected.
    [[nodiscard]] std::string connect(const std::string& path);

    // Called at least each second in which the application sends and takes nothing, or takes no connection, while it is
    // waited for, with the time since it last did, also after a signal. `false` ends the connection: this call and all
    // later ones are refused. Before connect().
    using Silence = std::function<bool(std::chrono::seconds)>;
    void when_silent(Silence silence) { silence_ = std::move(silence); }

    using Progress = std::function<void(std::size_t done, std::size_t total)>;
    // Waits for the answer as long as the connection lasts.
    [[nodiscard]] Reply call(Operation operation, const Arguments& arguments, const Progress& progress = {});

    // As the server has said.
    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] const std::string& version() const { return version_; }
    [[nodiscard]] bool read_only() const { return read_only_; }
    [[nodiscard]] std::size_t transfer_bytes() const { return transfer_bytes_; }

  private:
    [[nodiscard]] Reply exchange(Operation operation, Bytes payload, const Progress& progress);
    [[nodiscard]] std::string send_all(Bytes octets);
    [[nodiscard]] std::string receive_all(MutableBytes into);
    using Clock = std::chrono::steady_clock;
    [[nodiscard]] bool wait_for(short events);
    // False: the caller does not want to wait any more, and the connection is closed.
    [[nodiscard]] bool goes_on(Clock::time_point since);

    int fd_ = -1;
    bool given_up_ = false;  // by silence_
    Silence silence_{};
    std::string path_{};
    std::uint32_t number_ = 0;
    std::string name_{};
    std::string version_{};
    bool read_only_ = false;
    std::uint32_t transfer_bytes_ = 0;
};

}  // namespace margay::attach
