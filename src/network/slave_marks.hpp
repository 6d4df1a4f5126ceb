// What the library remembers of a slave beside the facts that the application sees, and the token of a slave.
#pragma once

#include <margay/al_state.hpp>
#include <margay/startup.hpp>

#include <cstdint>

namespace margay {

struct SlaveMarks {
    // The check value of the commands of the transition IP when the slave left INIT last.
    std::uint32_t started_with = 0;
    // The check value of the PDOs and entries that were read from its dictionary last; 0: none were read.
    std::uint32_t pdo_content = 0;
    // The number of the last cycle that was sent before the slave took part. Only inputs of later cycles are fresh.
    // See `joining`.
    std::uint32_t joined_after = 0;
    // The transition that was requested and is not confirmed yet; its after-commands are pending.
    Transition requested = Transition::none;
    // The transition whose commands or hook after the new state have failed or were cut: the slave must be started
    // again.
    Transition unfinished = Transition::none;
    // The check value of the cause of the failed `attempts` that was reported last; 0: none was.
    std::uint16_t cause_reported = 0;
    // The state to which the supervision brought the slave last without an error.
    AlState settled : 4 = AlState::none;
    // The failed attempts of the supervision since the slave was last in its target state, as far as they are counted.
    std::uint8_t attempts : 3 = 0;
    static constexpr std::uint8_t kMostAttempts = 7;
    bool in_use : 1 = false;            // see SlaveToken
    bool pdos_compared : 1 = false;     // differences between the sources of its PDOs have been reported
    bool missing_reported : 1 = false;  // reported as missing while its hot connect group is present
    bool awaited : 1 = false;    // member of a hot connect group whose start-up should have ended: see members.hpp
    bool counted : 1 = false;    // the expected working counters of its group include its share
    bool following : 1 = false;  // the commands or the hook after a transition are executing
    bool in_hook : 1 = false;    // a hook of the application is executing
    bool repeating : 1 = false;  // the supervision repeats an attempt whose failure was reported
    // In BOOT: the application has set another target for this slave since. Without it the supervision leaves the slave
    // in BOOT.
    bool leave_boot : 1 = false;
    bool finding : 1 = false;       // the slave comes back, and its process data is being found
    bool pdos_refused : 1 = false;  // the slave refused to report its PDOs when they were read last
    bool pdos_written : 1 = false;  // the application has written PDOs by SDO since the mapping
    // The slave did not answer for a while, or its answers were not looked at: another slave may have its station
    // address now. Its identity is compared before the next change of its state, and before the commands and hooks that
    // follow a change.
    bool unproved : 1 = false;
    bool was_away : 1 = false;       // unproved because it did not answer: mail and writing to it are refused
    bool joining : 1 = false;        // no cycle behind joined_after was received yet
    bool from_boot : 1 = false;      // it was in BOOT, and may have other firmware: compared again in PREOP
    bool pdos_in_doubt : 1 = false;  // it has started again, or was in BOOT, since its PDOs were read from it
    // It was in BOOT since then: its identity may change when the new firmware has started.
    bool new_firmware : 1 = false;
    bool held_back : 1 = false;  // brought to PREOP while it was held: its start-up commands were left out
    // While it takes part: a state below SAFEOP was requested, and its AL status was not read since. While it does not:
    // its FMMUs are being written or read. So the working counters may include its share or not.
    bool uncertain : 1 = false;
    bool boot_read : 1 = false;   // its AL status was read since it was away, and is still BOOT
    bool unanswered : 1 = false;  // see is_first_silence()
    // Where the slave was seen last in a ring that could be read: below this port of the slave `home` (0: the first
    // NIC), and at the second NIC. See places.hpp.
    bool at_second_nic : 1 = false;
    std::uint8_t home_port : 2 = 0;
    std::uint16_t home = kNoHome;
    static constexpr std::uint16_t kNoHome = UINT16_MAX;

    // Another slave may answer at the address. `away`: this slave did not answer for a while.
    void doubt(bool away) {
        unproved = true;
        was_away |= away;
        boot_read &= !away;
    }
    // Call it when the comparison has shown that this slave answers.
    void trust() { unproved = was_away = unanswered = false; }
};

// The token of a slave: one request, or the supervision, changes the slave at a time. The token is taken on
// construction and returned on destruction, thus also when the sequence that holds it is destroyed.
class SlaveToken {
  public:
    explicit SlaveToken(SlaveMarks& marks) : marks_(marks) { marks_.in_use = true; }
    SlaveToken(const SlaveToken&) = delete;
    SlaveToken& operator=(const SlaveToken&) = delete;
    ~SlaveToken() { marks_.in_use = false; }

  private:
    SlaveMarks& marks_;
};

}  // namespace margay
