// The router's view of a client: its waiting messages, and the function that sends its replies.
#pragma once

#include "gateway/frame.hpp"
#include "gateway/slave_table.hpp"

#include <deque>

namespace margay::gateway {

class Client {
  public:
    struct Waiting {
        Mail mail;
        Moment since{};
        bool again = false;
    };

    Client() = default;
    virtual ~Client() = default;
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    // False: the reply is lost.
    virtual bool send(Octets frame, Moment now) = 0;
    // False: too many replies wait for the client, which must read them first.
    [[nodiscard]] virtual bool takes_replies() const = 0;

    std::deque<Waiting> waiting{};
    std::size_t running = 0;
};

}  // namespace margay::gateway
