// One client of a server: its socket, the message that it is sending, its request, and the answer that it is reading.
#pragma once

#include "attach/job.hpp"
#include "attach/message.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace margay::attach {

using Moment = std::chrono::steady_clock::time_point;

class Connection {
  public:
    Connection(int fd, std::size_t most, Moment now) : most_(most), moved_(now), fd_(fd) {}
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    static constexpr std::chrono::seconds kIdle{5};
    static constexpr std::chrono::seconds kSlow{10};

    enum class Came : std::uint8_t { nothing, message, wrong, gone };

    [[nodiscard]] int fd() const { return fd_; }
    [[nodiscard]] bool closed() const { return fd_ < 0; }
    void close();

    // A message is read only when the previous one was answered, so that a client that floods the server only delays
    // itself.
    [[nodiscard]] bool listens() const { return !closed() && job == nullptr && out_.empty() && !complete(); }
    [[nodiscard]] bool has_output() const { return !out_.empty(); }
    // A message of either direction is incomplete.
    [[nodiscard]] bool in_message() const { return !in_.empty() || !out_.empty(); }
    [[nodiscard]] Moment moved() const { return moved_; }
    // Whether the client may lose its place to a new client: it has sent no message for kIdle, or one message is
    // incomplete for kSlow. A client with a busy request keeps its place.
    [[nodiscard]] bool gives_way(Moment now) const;

    // Reads the available octets, up to a limit. `wrong`: the message is not allowed.
    [[nodiscard]] Came receive(Moment now);
    // False: the client has closed the connection.
    [[nodiscard]] bool send(Moment now);

    // The received message, after Came::message.
    [[nodiscard]] Operation operation() const { return static_cast<Operation>(header_.what); }
    [[nodiscard]] Bytes payload() const { return Bytes(in_).subspan(Header::kBytes); }
    void forget_message() { Octets().swap(in_); }

    void answer(Status status, Octets payload, Moment now);

    std::unique_ptr<Job> job{};
    Moment begun{};     // when the job began
    Moment reported{};  // when its last progress was reported
    std::size_t reported_octets = 0;
    bool unpolled = false;  // the job was withdrawn because the owner does not poll
    bool greeted = false;

  private:
    [[nodiscard]] bool complete() const { return in_.size() >= Header::kBytes && in_.size() == wanted(); }
    [[nodiscard]] std::size_t wanted() const {
        return in_.size() < Header::kBytes ? Header::kBytes : Header::kBytes + header_.bytes;
    }
    [[nodiscard]] bool header_allowed() const;

    std::size_t most_;
    Header header_{};
    Octets in_{};
    Octets out_{};
    std::size_t sent_ = 0;
    Moment moved_;    // when octets moved last
    Moment began_{};  // when the incomplete message began
    int fd_;
};

// The client that gives its place to a new one: among the clients that may lose their place, the client whose octets
// have not moved for the longest time. If no client may, the number of clients.
[[nodiscard]] std::size_t who_gives_way(std::span<const std::unique_ptr<Connection>> clients, Moment now);

}  // namespace margay::attach
