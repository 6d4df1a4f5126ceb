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
    bool broken = false;  // `refused` by the client itself: the connection has ended, or an answer is invalid
    [[nodiscard]] bool ok() const { return status == Status::done; }
};

class Client {
  public:
    Client() = default;
    ~Client();
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    // Returns a sentence if the server does not answer, or uses another version of the protocol; empty: connected.
    [[nodiscard]] std::string connect(const std::string& path);

    // Called at least once a second while the client waits and the application does not send, receive or accept
    // anything, and after each signal. The argument is the time of this silence. `false` ends the connection: the
    // present call and all later calls are refused. Set the function before connect().
    using Silence = std::function<bool(std::chrono::seconds)>;
    void when_silent(Silence silence) { silence_ = std::move(silence); }

    using Progress = std::function<void(std::size_t done, std::size_t total)>;
    // Waits for the answer as long as the connection lasts.
    [[nodiscard]] Reply call(Operation operation, const Arguments& arguments, const Progress& progress = {});

    // The values that the server has sent with its answer to `hello`.
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
    // False: the Silence function has ended the waiting, and the connection is closed.
    [[nodiscard]] bool goes_on(Clock::time_point since);

    int fd_ = -1;
    bool given_up_ = false;  // silence_ has ended the waiting
    Silence silence_{};
    std::string path_{};
    std::uint32_t number_ = 0;
    std::string name_{};
    std::string version_{};
    bool read_only_ = false;
    std::uint32_t transfer_bytes_ = 0;
};

}  // namespace margay::attach
