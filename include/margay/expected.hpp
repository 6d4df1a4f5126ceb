// The slaves that the application expects, and the configuration of each of them, given before the slaves are scanned.
#pragma once

#include <margay/configuration.hpp>

#include <cstdint>
#include <optional>

namespace margay {

// One expected slave. Only the members that are set are compared.
//
// An expected slave is located in one of three ways: by its place in the line (`number`); anywhere in the segment,
// identified by a setting of the device (`alias` or `device_id`, with number 0); or behind the first slave of its hot
// connect group.
//
// config_init() gives slave(n) the number n, which stays until the next config_init(), also when slaves leave or
// return:
// 1. The entry with the number n is slave(n). These numbers count the line with all its slaves present, without the
//    slaves that may be anywhere and without hot connect groups. If the next slave found does not match an optional
//    slave but matches an entry behind it, the optional slave is regarded as missing.
//    Slaves with equal entries in the list are distinguished only by their order: if one of them is missing at the
//    start, the present slaves are regarded as the first of these entries. If the application continues although a
//    slave is missing, the list must give such slaves an alias, a device id or a serial number.
// 2. The following numbers belong to the entries with number 0, members of groups included, in the order of the list.
// 3. If the list skips a number, the unexpected slave found at this place of the line gets that number. All other
//    unexpected slaves get the last numbers, in the order of the ring. slave(n) of a number that the list leaves out
//    and that no slave has is neither expected nor present: `wanted` is nullptr, its AL state is NONE.
//
// An expected slave that is missing has its number too: its Slave has AL state NONE, ring position 0, and its
// configuration. If the configuration describes its process data, config_map() reserves its part of the image. When the
// slave appears, the supervision starts it up. slave(n).ring_position is its position in the ring.
struct ExpectedSlave {
    // The first slave of the line is 1; 0: the slave is identified by alias or device id, or by its group.
    std::uint16_t number = 0;
    std::optional<std::uint16_t> alias{};      // ESC register 0x0012, loaded from the SII
    std::optional<std::uint16_t> device_id{};  // explicit device id (ETG.1020), mostly set by a switch on the device
    // The identity. Only the members that are set are compared. A slave that comes back with another revision than
    // before is accepted if `revision` is not set, and needs config_map() (Errc::remapping_needed).
    std::optional<std::uint32_t> vendor{};
    std::optional<std::uint32_t> product{};
    std::optional<std::uint32_t> revision{};
    std::optional<std::uint32_t> serial{};
    bool newer_revision = false;  // a slave with a greater revision than `revision` is accepted, too
    // The slave may be missing: that is no error, and its absence does not make a cycle of its group wrong.
    bool optional = false;
    // config_init() accepts another slave here than the described one: it reports the difference in errors(), and the
    // other slave is configured and operated like the described one. Without `tolerate` another slave is held: see
    // Tolerance.
    bool tolerate = false;
    // Number of a hot connect group, not 0: slaves that are connected and disconnected together, at any port of the
    // segment. The members are neighbours in the list and have the same number. The first member is identified by alias
    // or device id. The others have number 0 and follow behind the first member in this order. The whole group may be
    // missing. If the first slave is present, a missing member that is not optional is an error, and the expected
    // working counters include it. While a group that was connected starts up, the expected working counters do not
    // include its slaves.
    std::uint8_t hot_connect = 0;
    // The station address that config_init() gives to the slave, for tools that know the slaves by the addresses of a
    // configuration file (ENI: PhysAddr), for example by a mailbox gateway. 0: an address from 0x1001 on
    // that no entry of the list has. Two entries must not have the same address. config_init() needs 0x0C00 to 0x0FFF
    // for unknown slaves: expect() refuses these addresses.
    std::uint16_t station_address = 0;
    // Is copied to slave(n).config before the slave leaves INIT. nullptr: the library reads the configuration from the
    // slave. The caller's memory, which must live as long as the list.
    const SlaveConfiguration* config = nullptr;
};

// The differences from the list of expect() that the application accepts. Every difference that is not tolerated makes
// config_init(), config_map() and reach() return an error, which names the first such slave; the library works on the
// correct slaves nevertheless.
//
// A slave that is another one than expected, or unexpected, is held while that is not tolerated: the slave stays in
// PREOP (in INIT if it has no mailbox), the library sends it no start-up command and sets none of its FMMUs, it gets no
// outputs, and a request for SAFEOP or OP is refused. If another slave appears later in the place of a lost one, the
// library never starts it up, whatever is tolerated.
struct Tolerance {
    // Another slave in the place of an expected one: it is configured and operated like the expected one.
    bool other_slaves = false;
    // Slaves that are not in the list of expect().
    bool unexpected_slaves = false;
    // Expected slaves that have been missing since config_init(): like optional ones, their absence does not make a
    // cycle wrong.
    bool missing_slaves = false;
};

}  // namespace margay
