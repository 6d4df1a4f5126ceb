// The Ethernet port of a simulated device that carries frames by EoE: the side of the device that is not EtherCAT.
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

namespace margay::sim {

// What is connected to the port: a host, a network, or a test.
class EthernetPeer {
  public:
    // A frame leaves the device; its octets are valid during the call. It may call EthernetPort::put().
    virtual void arrived(Bytes frame, Time now) = 0;

  protected:
    ~EthernetPeer() = default;
};

class EthernetPort {
  public:
    // Connects a peer; nullptr: nothing is connected, and the frames of the device are dropped.
    virtual void connect(EthernetPeer* peer) = 0;
    // A frame of the peer arrives at the device. Call Segment::interrupt() after it, so that the device notices it.
    // False: the queue of the device is full, and the frame is dropped.
    virtual bool put(Bytes frame) = 0;
    // Whether put() would accept a frame.
    [[nodiscard]] virtual bool has_room() const = 0;

  protected:
    ~EthernetPort() = default;
};

}  // namespace margay::sim
