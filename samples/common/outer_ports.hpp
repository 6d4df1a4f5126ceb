// The Ethernet ports of simulated devices with EoE, each connected to a TAP device.
#pragma once

#include "common/segment_file.hpp"
#include "common/tap_nic.hpp"
#include "sim/ethernet_port.hpp"

#include <poll.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace margay::samples {

class OuterPorts {
  public:
    // Makes a TAP device for each slave with an Ethernet port, with the name `prefix` and the position of the slave,
    // the first is 0. `segment` outlives the object. Returns one sentence about an error; empty when there is none.
    [[nodiscard]] std::string open(SimulatedSegment& segment, const std::string& prefix);

    // Adds a file to wait for, for each device that can accept frames now.
    void add_files(std::vector<pollfd>& files) const;
    // Passes the frames of the TAP devices on to the devices.
    void serve(Time now);

    // One line for each port.
    [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
    // The number of frames that the kernel did not accept.
    [[nodiscard]] std::uint64_t dropped() const;

  private:
    struct Port final : sim::EthernetPeer {
        TapNic tap;
        sim::EthernetPort* device = nullptr;
        std::uint32_t slave = 0;
        std::uint64_t dropped = 0;
        void arrived(Bytes frame, Time now) override;
    };

    SimulatedSegment* segment_ = nullptr;
    std::vector<std::unique_ptr<Port>> ports_;
    std::vector<std::string> names_;
};

}  // namespace margay::samples
