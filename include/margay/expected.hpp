// Which slaves shall be there, and what each of them shall be configured with: known before anybody has been asked.
#pragma once

#include <margay/configuration.hpp>

#include <cstdint>
#include <optional>

namespace margay {

// One slave that is expected. What is not set is not looked at.
//
// Where it is: at a place of the line (`position`), or anywhere, known by what is set on the device (`alias`,
// `device_id`, position 0), or behind the head of its hot connect group.
//
// How slaves are numbered: config_init() gives slave(n) the number n, which stays until the next config_init(), whoever
// comes and goes:
//   1. slave(n) is the slave with position n. Positions count the line as it is when nobody is missing: without those
//      that may be anywhere, and without hot connect groups. An optional slave that is not there is passed over when
//      the next one found does not fit it but one behind does.
//   2. Behind the highest position come those with position 0, group members too, in the order of the list.
//   3. Behind them whoever nobody expects, in the order of the ring.
// An expected slave that is not there has its number all the same: an entry with AL state NONE, ring 0, and its
// configuration; if that says what its process data is, config_map() keeps its place in the image. The supervision
// takes it in when it appears. slave(n).ring tells where it is.
struct ExpectedSlave {
    // 1 the first; 0: it is known by alias or device id, or by its group.
    std::uint16_t position = 0;
    std::optional<std::uint16_t> alias{};      // ESC register 0x0012, from the SII
    std::optional<std::uint16_t> device_id{};  // explicit device id (ETG.1020), mostly of a switch on the device
    // What.
    std::optional<std::uint32_t> vendor{};
    std::optional<std::uint32_t> product{};
    std::optional<std::uint32_t> revision{};
    std::optional<std::uint32_t> serial{};
    // That it is missing is no error, and its group of process data is right without it.
    bool optional = false;
    // config_init() may find another slave here than the one that is described: that is told in errors(), and the other
    // slave is configured and driven as the described one would be. Without `tolerate` another slave is held: see
    // Tolerance.
    bool tolerate = false;
    // Slaves that come and go together, at any port of the segment: neighbours in the list with the same number, not 0.
    // The first is the head and known by alias or device id; the others have position 0 and follow behind it, in this
    // order. The whole group may be missing; a member that is missing while the head is there is an error, unless it is
    // optional.
    std::uint8_t hot_connect = 0;
    // Becomes slave(n).config before the slave leaves INIT. nullptr: what the slave says itself. The caller's memory.
    const SlaveConfiguration* config = nullptr;
};

// What of a segment may differ from what expect() describes. All that is not tolerated makes config_init(),
// config_map() and the way to OP end with an error, which names the first such slave; what can be done with the slaves
// that are right is done all the same.
//
// A slave that is not the wanted one, or that nobody expects, is held while that is not tolerated: it stays in PREOP,
// in INIT where it has no mailbox; no start-up command is sent to it, none of its FMMUs is set, it gets no outputs; a
// request for SAFEOP or OP is refused. A slave that appears later in the place of another one is never taken in,
// whatever is tolerated.
struct Tolerance {
    // Another slave in the place of an expected one: configured and driven as the expected one would be.
    bool other_slaves = false;
    // Slaves that the list of expect() does not have.
    bool unexpected_slaves = false;
    // Expected slaves that have not been there since config_init(): like optional ones, the group is right without
    // them.
    bool missing_slaves = false;
};

}  // namespace margay
