// Finds the EtherCAT frame in a recorded packet: as it is, behind VLAN tags, or in UDP port 0x88A4 (ETG.1000.4,
// "Mapping into UDP").
#pragma once

#include "util/bytes.hpp"

#include <optional>
#include <vector>

namespace margay::analyse {

struct EthercatFrame {
    Bytes bytes{};  // from the destination address on, with EtherType 0x88A4 at octet 12
    bool vlan = false;
    bool udp = false;
};

class FrameFinder {
  public:
    // nullopt: the packet contains no EtherCAT frame. The result is valid until the next call, and as long as `packet`.
    [[nodiscard]] std::optional<EthercatFrame> find(Bytes packet);

  private:
    std::vector<std::byte> buffer_{};  // the frame without tags and other headers
};

// Whether the frame has the type of datagrams.
[[nodiscard]] bool is_of_datagrams(Bytes frame);
// Whether the frame has this type, and its datagrams can be read. Some masters announce more octets than their
// datagrams have; slaves accept this, and so does this function.
[[nodiscard]] bool has_datagrams(Bytes frame);
// Whether the first slave has marked the source address.
[[nodiscard]] bool is_marked(Bytes frame);
// Whether all working counters are 0.
[[nodiscard]] bool is_untouched(Bytes frame);

}  // namespace margay::analyse
