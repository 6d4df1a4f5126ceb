// Counters of the link and of the mailboxes. They only grow; read them in the thread that polls.
#pragma once

#include <cstdint>

namespace margay {

struct LinkStatistics {
    std::uint64_t frames_sent = 0;
    std::uint64_t frames_received = 0;  // replies that belong to a sent frame
    std::uint64_t datagrams_sent = 0;
    std::uint64_t bursts = 0;         // calls of poll() that sent at least one frame: the number of round trips
    std::uint64_t bytes_on_wire = 0;  // octets of sent frames with padding, preamble, FCS and inter-frame gap
    std::uint64_t lost = 0;           // frames that did not come back in time
    std::uint64_t retried = 0;        // datagrams that were sent again because their frames were lost
    std::uint64_t echoes = 0;         // own frames that no slave has processed
    std::uint64_t unmarked = 0;      // dropped: slaves have processed the frame, but it lacks the mark of the first ESC
    std::uint64_t foreign = 0;       // other protocols, other EtherCAT frame types
    std::uint64_t malformed = 0;     // truncated or contradictory
    std::uint64_t unexpected = 0;    // late, duplicated or unknown: no such frame is on the wire
    std::uint64_t mismatched = 0;    // the index belongs to a frame on the wire, but the datagrams differ
    std::uint64_t send_refused = 0;  // frames that the NIC did not accept
};

// Counters of the mailbox of one slave.
struct MailboxStatistics {
    std::uint32_t sent = 0;
    std::uint32_t received = 0;    // all fetched messages, including the messages that the counters below count again
    std::uint32_t resent = 0;      // messages that were sent again because they had not arrived
    std::uint32_t repeats = 0;     // replies that were requested again
    std::uint32_t duplicates = 0;  // replies that arrived twice
    std::uint32_t unexpected = 0;  // messages that no request waits for and that the library does not store
    std::uint32_t malformed = 0;
    std::uint32_t errors = 0;  // mailbox error replies
    std::uint32_t routed = 0;  // messages for another slave that were forwarded
    std::uint32_t undeliverable = 0;
};

}  // namespace margay
