// Messages to slaves whose frames have not come back. The reply of a frame can be lost although the slave has taken its
// message: then the answer of the slave, or the next message, shows that the message was sent. A frame that another
// frame overtakes is regarded as lost until it comes.
#pragma once

#include "analyse/exchanges.hpp"

#include <deque>
#include <map>
#include <vector>

namespace margay::analyse {

struct SentMessage {
    Moment when{};
    std::uint16_t address = 0;  // in the memory of the slave
    std::vector<std::byte> data{};
};

class SentMail {
  public:
    // Call it for each datagram of a sent frame. The datagram is kept if it writes into the process data memory of one
    // slave.
    void note(const Exchanged& request);
    void came_back(const Exchanged& reply);
    // The messages to the slave of this datagram that were sent earlier, the oldest first. They are removed.
    [[nodiscard]] std::deque<SentMessage> take(const wire::DatagramHeader& header, Moment before);

  private:
    // The key of a slave: whether it is addressed by station address, and the station address or the position.
    using Key = std::pair<bool, std::uint16_t>;
    [[nodiscard]] static Key key_of(const wire::DatagramHeader& header);

    std::map<Key, std::deque<SentMessage>> messages_{};
};

}  // namespace margay::analyse
