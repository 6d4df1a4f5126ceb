// What the link counts. Plain numbers that only grow; read them from the thread that polls.
#pragma once

#include <cstdint>

namespace margay {

struct LinkStatistics {
    std::uint64_t frames_sent = 0;
    std::uint64_t frames_received = 0;  // replies that were matched
    std::uint64_t datagrams_sent = 0;
    std::uint64_t bursts = 0;         // polls that sent at least one frame: round trips waited for
    std::uint64_t bytes_on_wire = 0;  // sent frames with padding, preamble, FCS and gap
    std::uint64_t lost = 0;           // frames that did not come back in time
    std::uint64_t retried = 0;        // datagrams sent again because of it
    std::uint64_t echoes = 0;         // own frames that no slave has touched
    std::uint64_t unmarked = 0;       // dropped: counted up by slaves, but without the mark of the first ESC
    std::uint64_t foreign = 0;        // other protocols, other EtherCAT frame types
    std::uint64_t malformed = 0;      // cut short or contradicting themselves
    std::uint64_t unexpected = 0;     // late, duplicated, or not asked for: no such frame is in flight
    std::uint64_t mismatched = 0;     // in flight, but the datagrams are not those that were sent
    std::uint64_t send_refused = 0;   // the NIC did not take a frame
};

// What the mailbox of one slave counts.
struct MailboxStatistics {
    std::uint32_t sent = 0;
    std::uint32_t received = 0;    // all that is fetched, also what is counted again below
    std::uint32_t resent = 0;      // messages that had not arrived
    std::uint32_t repeats = 0;     // replies asked for again
    std::uint32_t duplicates = 0;  // replies that came twice
    std::uint32_t unexpected = 0;  // mail that nobody waits for, and that is of no kind that is kept
    std::uint32_t malformed = 0;
    std::uint32_t errors = 0;  // mailbox error replies
    std::uint32_t routed = 0;  // for another slave, handed on
    std::uint32_t undeliverable = 0;
};

}  // namespace margay
