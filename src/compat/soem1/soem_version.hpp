// Access of the shared sources to the structures of SOEM 1.4, where the context points to memory of the program.
#pragma once

#include <ethercat.h>
#include <oshw.h>

#include <cstdint>

namespace margay::soem {

inline constexpr bool kBytesUnlessPacked = false;         // slaves of less than an octet share octets
inline constexpr bool kStatusOctets = false;              // no octets for the status of mailboxes in the image
inline constexpr bool kVersionCallsContextHooks = false;  // when a slave is configured again
using MapBits = int;
using PdoBits = int;
using FrameIndex = int;
using DatagramOffset = int;
using SdoText = char*;

inline ecx_portt& port_of(ecx_contextt& c) { return *c.port; }
inline ec_slavet* slaves_of(ecx_contextt& c) { return c.slavelist; }
inline ec_groupt* groups_of(ecx_contextt& c) { return c.grouplist; }
inline int& slave_count(ecx_contextt& c) { return *c.slavecount; }
inline int most_slaves(const ecx_contextt& c) { return c.maxslave; }
inline int most_groups(const ecx_contextt& c) { return c.maxgroup; }
inline boolean& error_flag(ecx_contextt& c) { return *c.ecaterror; }
inline int64& dc_time(ecx_contextt& c) { return *c.DCtime; }
inline ec_eringt& error_ring(ecx_contextt& c) { return *c.elist; }
inline std::uint8_t* sii_octets(ecx_contextt& c) { return c.esibuf; }
inline std::uint32_t* sii_known(ecx_contextt& c) { return c.esimap; }
inline ec_eepromFMMUt& sii_fmmu(ecx_contextt& c) { return *c.eepFMMU; }
inline bool packed(const ecx_contextt&) { return true; }
inline bool has_hook(const ec_slavet& s) { return s.PO2SOconfig != nullptr || s.PO2SOconfigx != nullptr; }

// The hooks of a slave. Forks of the interface give the first one a pointer of the program as second argument; on the
// systems of this library a function with one parameter ignores it.
inline void call_hooks(ecx_contextt& c, std::uint16_t number, bool with_context) {
    ec_slavet& s = c.slavelist[number];
    using WithUser = int (*)(uint16, void*);
    if (s.PO2SOconfig != nullptr)
        reinterpret_cast<WithUser>(reinterpret_cast<void (*)()>(s.PO2SOconfig))(number, s.user);
    if (with_context && s.PO2SOconfigx != nullptr) s.PO2SOconfigx(&c, number);
}

inline void set_time(ec_timet& to, std::int64_t ns) {
    to.sec = static_cast<uint32>(ns / 1000000000);
    to.usec = static_cast<uint32>(ns % 1000000000 / 1000);
}

// Functions that only the other version has.
inline void set_serial(ec_slavet& s, std::uint32_t serial) { s.eep_sn = serial; }
inline void set_offsets(ec_slavet&, std::uint32_t, std::uint32_t) {}
inline void set_status(ec_slavet&, std::uint8_t*) {}
inline void set_status(ec_groupt&, std::uint8_t*, int) {}
inline void set_status_slave(ec_groupt&, int, std::uint16_t) {}
inline void begin_context(ecx_contextt&) {}
inline void end_context(ecx_contextt&) {}
inline void before_hooks(ecx_contextt&, std::uint16_t) {}

}  // namespace margay::soem

// The source addresses of the two sides.
#define EC_PRIMARY_MAC_ARRAY \
    { 0x0101, 0x0101, 0x0101 }
#define EC_SECONDARY_MAC_ARRAY \
    { 0x0404, 0x0404, 0x0404 }
