// A client as the router sees it: its messages that wait, and the way of the replies.
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
    // False: so many replies wait for the client that it must read them first.
    [[nodiscard]] virtual bool takes_replies() const = 0;

    std::deque<Waiting> waiting{};
    std::size_t running = 0;
};

}  // namespace margay::gateway
