// Doubts slaves: after a silence, a pause or a cycle that fell short, another machine may be there (src/README.md,
// "doubt").
#pragma once

#include "network/network.hpp"

namespace margay {

// SlaveMarks::doubt() for all slaves that are known.
void doubt_all(Network& network, bool away);

// A single lost frame of a cycle or of a reading of all states is not reported. Where every tenth frame is lost, this
// many consecutive losses occur by chance once in ten thousand million readings.
inline constexpr std::uint32_t kSilentFrames = 10;

// Without a supervision: doubt_all() if another machine may be there, because kSilentFrames frames or more did not come
// back since the last call. Call it before anything is written to a slave. Returns whether it has doubted the slaves.
bool doubt_after_silence(Network& network);
// Without a supervision: doubts all slaves when the machine may have been exchanged without a silence: nothing was sent
// for long, or a cycle that had been right fell short and is right again. While other cycles go on, doubts only the
// slaves that no cycle reads. Returns whether it has doubted any slave.
bool doubt_unseen(Network& network);
// With a supervision, before the reply of an overlapped cycle is evaluated: doubts all slaves when a silence has ended
// that the supervision has not noted yet. Ends no sequence: the supervision does that with its next roll. Cheap.
void doubt_reply(Network& network);
// The same as doubt_after_silence(), but the slaves are doubted in the next poll(): for calls within hooks and
// callbacks, since doubt_all() ends sequences, perhaps the one that is executing. Returns whether such a silence was
// noted.
bool note_silence(Network& network);

// Whether another device may have the station address of the slave, so that nothing is sent to it. A slave that was in
// BOOT is not refused once a reading has shown that it still is: its firmware may be incomplete, and a device that was
// exchanged is mostly not in BOOT.
[[nodiscard]] bool is_identity_unread(const Network& network, const Slave& slave);

}  // namespace margay
