// Reads a recording of EtherCAT traffic of any master from a file. If the file has frames of several masters, each
// master is analysed separately.
#pragma once

#include "analyse/analysis.hpp"

#include <string>

namespace margay::analyse {

// Reads a pcap or pcapng file. A file that ends in the middle of a packet is read up to this packet, and `remark`
// reports this. A file that cannot be read, or has no EtherCAT frame, has a `problem`. `path` may be a pipe, which is
// read up to its end. Packets of one master that are not in order of time are sorted, if they fit into kMostSorted
// octets.
//
// Masters are distinguished by their source addresses. Masters with the same address are distinguished by the
// interfaces of a pcapng file, if two interfaces show both requests and replies. The result is the master of the first
// frame, Analysis::others are the others in the order of their first frames. The two NICs of a ring are one master.
[[nodiscard]] Analysis analyse_file(const std::string& path);

inline constexpr std::size_t kMostMasters = 16;                     // frames of more masters are counted in a remark
inline constexpr std::size_t kMostSorted = std::size_t{512} << 20;  // octets of packets of one master

}  // namespace margay::analyse
