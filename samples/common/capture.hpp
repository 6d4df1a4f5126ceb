// Recordings of real traffic, as requests and the answers that the hardware gave to them.
#pragma once

#include "wire/datagram.hpp"

#include <margay/time.hpp>

#include <string>
#include <vector>

namespace margay::samples {

struct Exchange {
    std::size_t frame = 0;  // number in the file, from 1
    Duration at{};          // since the first frame
    std::vector<std::byte> request;
    std::vector<std::byte> answer;  // empty: none in the recording
    std::size_t answer_frame = 0;
};

struct Capture {
    std::vector<Exchange> exchanges;
    std::string error;   // empty: all is well
    std::string remark;  // about a file that was cut off at its end: what is whole of it is here
};

// Reads a pcap or pcapng file and finds the answer to each request: the next frame back with the same
// datagrams.
[[nodiscard]] Capture load_capture(const std::string& path);

// One datagram of an exchange, both ways.
struct DatagramPair {
    std::size_t frame = 0;
    wire::DatagramHeader request;
    Bytes sent;
    wire::DatagramHeader reply;
    Bytes received;
    std::uint16_t wkc = 0;
};
// The datagrams of an exchange that was answered. The views are into `exchange`.
[[nodiscard]] std::vector<DatagramPair> pairs_of(const Exchange& exchange);

}  // namespace margay::samples
