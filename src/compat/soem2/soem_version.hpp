// Access of the shared sources to the structures of SOEM 2.0, where the context contains all data.
#pragma once

#include <oshw.h>
#include <soem/soem.h>

#include <cstdint>

namespace margay::soem {

inline constexpr bool kBytesUnlessPacked = true;  // each slave begins on an octet
inline constexpr bool kStatusOctets = true;       // an octet for each slave with a mailbox behind the inputs
inline constexpr bool kVersionCallsContextHooks = true;
using MapBits = uint32;
using PdoBits = uint32;
using FrameIndex = uint8;
using DatagramOffset = uint16;
using SdoText = const char*;

inline ecx_portt& port_of(ecx_contextt& c) { return c.port; }
inline ec_slavet* slaves_of(ecx_contextt& c) { return c.slavelist; }
inline ec_groupt* groups_of(ecx_contextt& c) { return c.grouplist; }
inline int& slave_count(ecx_contextt& c) { return c.slavecount; }
inline int most_slaves(const ecx_contextt&) { return EC_MAXSLAVE; }
inline int most_groups(const ecx_contextt&) { return EC_MAXGROUP; }
inline boolean& error_flag(ecx_contextt& c) { return c.ecaterror; }
inline int64& dc_time(ecx_contextt& c) { return c.DCtime; }
inline ec_eringt& error_ring(ecx_contextt& c) { return c.elist; }
inline std::uint8_t* sii_octets(ecx_contextt& c) { return c.esibuf; }
inline std::uint32_t* sii_known(ecx_contextt& c) { return c.esimap; }
inline ec_eepromFMMUt& sii_fmmu(ecx_contextt& c) { return c.eepFMMU; }
inline bool packed(const ecx_contextt& c) { return c.packedMode != 0; }
inline bool has_hook(const ec_slavet& s) { return s.PO2SOconfig != nullptr; }

inline void call_hooks(ecx_contextt& c, std::uint16_t number, bool) {
    if (c.slavelist[number].PO2SOconfig != nullptr) c.slavelist[number].PO2SOconfig(&c, number);
}

inline void set_time(ec_timet& to, std::int64_t ns) {
    to.tv_sec = static_cast<time_t>(ns / 1000000000);
    to.tv_nsec = static_cast<long>(ns % 1000000000);
}

inline void set_serial(ec_slavet& s, std::uint32_t serial) { s.eep_ser = serial; }
inline void set_offsets(ec_slavet& s, std::uint32_t outputs, std::uint32_t inputs) {
    s.Ooffset = outputs;
    s.Ioffset = inputs;
}
inline void set_status(ec_slavet& s, std::uint8_t* octet) { s.mbxstatus = octet; }
inline void set_status(ec_groupt& g, std::uint8_t* octets, int count) {
    g.mbxstatus = octets;
    g.mbxstatuslength = count;
}
inline void set_status_slave(ec_groupt& g, int place, std::uint16_t number) { g.mbxstatuslookup[place] = number; }
inline void begin_context(ecx_contextt& c) { ecx_initmbxpool(&c); }
// Ends the pool of mailbox buffers. Other threads may take and give back buffers at the same time.
void end_context(ecx_contextt& c);
inline void before_hooks(ecx_contextt& c, std::uint16_t number) { ecx_mbxENIinitcmds(&c, number, ECT_ESMTRANS_PS); }

}  // namespace margay::soem
