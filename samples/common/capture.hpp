// Reads recordings of real traffic: the requests of the master, each with the answer of the hardware.
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
    std::vector<std::byte> answer;  // empty: the recording has no answer
    std::size_t answer_frame = 0;
};

struct Capture {
    std::vector<Exchange> exchanges;
    std::string error;   // empty: no error
    std::string remark;  // set when the file is cut off at its end; the exchanges then come from the whole packets
};

// Reads a pcap or pcapng file and finds the answer to each request. The answer is the next returning frame with the
// same datagrams.
[[nodiscard]] Capture load_capture(const std::string& path);

// One datagram of an exchange: as sent and as received.
struct DatagramPair {
    std::size_t frame = 0;
    wire::DatagramHeader request;
    Bytes sent;
    wire::DatagramHeader reply;
    Bytes received;
    std::uint16_t wkc = 0;
};
// The datagrams of an exchange that has an answer. The views point into `exchange`.
[[nodiscard]] std::vector<DatagramPair> pairs_of(const Exchange& exchange);

}  // namespace margay::samples
