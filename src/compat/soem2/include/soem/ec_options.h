/* Sizes, and timeouts in microseconds. A program may have other timeouts. It must have the sizes of the library. The number of slaves is
   chosen when the library is built (the variable MARGAY_SOEM2_MAXSLAVE of CMake), and the package defines it for programs */
#ifndef MARGAY_SOEM2_SOEM_EC_OPTIONS_H
#define MARGAY_SOEM2_SOEM_EC_OPTIONS_H

#ifndef EC_BUFSIZE
#define EC_BUFSIZE EC_MAXECATFRAME
#endif
#ifndef EC_MAXBUF
#define EC_MAXBUF 16
#endif
#ifndef EC_MAXEEPBITMAP
#define EC_MAXEEPBITMAP 128
#endif
#ifndef EC_MAXEEPBUF
#define EC_MAXEEPBUF 4096
#endif
#ifndef EC_LOGGROUPOFFSET
#define EC_LOGGROUPOFFSET 16
#endif
#ifndef EC_MAXELIST
#define EC_MAXELIST 64
#endif
#ifndef EC_MAXNAME
#define EC_MAXNAME 40
#endif
#ifndef MARGAY_SOEM2_MAXSLAVE
#define MARGAY_SOEM2_MAXSLAVE 200
#endif
#ifndef EC_MAXSLAVE
#define EC_MAXSLAVE MARGAY_SOEM2_MAXSLAVE
#endif
#ifndef EC_MAXGROUP
#define EC_MAXGROUP 2
#endif
#ifndef EC_MAXIOSEGMENTS
#define EC_MAXIOSEGMENTS 64
#endif
#ifndef EC_MAXMBX
#define EC_MAXMBX 1486
#endif
#ifndef EC_MBXPOOLSIZE
#define EC_MBXPOOLSIZE 32
#endif
#ifndef EC_MAXEEPDO
#define EC_MAXEEPDO 0x200
#endif
#ifndef EC_MAXSM
#define EC_MAXSM 8
#endif
#ifndef EC_MAXFMMU
#define EC_MAXFMMU 4
#endif
#ifndef EC_MAXLEN_ADAPTERNAME
#define EC_MAXLEN_ADAPTERNAME 128
#endif
#ifndef EC_MAX_MAPT
#define EC_MAX_MAPT 1
#endif
#ifndef EC_MAXODLIST
#define EC_MAXODLIST 1024
#endif
#ifndef EC_MAXOELIST
#define EC_MAXOELIST 256
#endif
#ifndef EC_SOE_MAXNAME
#define EC_SOE_MAXNAME 60
#endif
#ifndef EC_SOE_MAXMAPPING
#define EC_SOE_MAXMAPPING 64
#endif
#ifndef EC_TIMEOUTRET
#define EC_TIMEOUTRET 2000
#endif
#ifndef EC_TIMEOUTRET3
#define EC_TIMEOUTRET3 6000
#endif
#ifndef EC_TIMEOUTSAFE
#define EC_TIMEOUTSAFE 20000
#endif
#ifndef EC_TIMEOUTEEP
#define EC_TIMEOUTEEP 20000
#endif
#ifndef EC_TIMEOUTTXM
#define EC_TIMEOUTTXM 20000
#endif
#ifndef EC_TIMEOUTRXM
#define EC_TIMEOUTRXM 700000
#endif
#ifndef EC_TIMEOUTSTATE
#define EC_TIMEOUTSTATE 2000000
#endif
#ifndef EC_DEFAULTRETRIES
#define EC_DEFAULTRETRIES 3
#endif
#ifndef EC_PRIMARY_MAC_ARRAY
#define EC_PRIMARY_MAC_ARRAY { 0x0101, 0x0101, 0x0101 }
#endif
#ifndef EC_SECONDARY_MAC_ARRAY
#define EC_SECONDARY_MAC_ARRAY { 0x0404, 0x0404, 0x0404 }
#endif

/* The library would write beyond structures that are smaller than its own */
#if EC_MAXSLAVE != MARGAY_SOEM2_MAXSLAVE
#error "EC_MAXSLAVE is not that of the library: build the library with the CMake variable MARGAY_SOEM2_MAXSLAVE"
#endif
#if EC_MAXBUF != 16 || EC_MAXEEPBITMAP != 128 || EC_MAXEEPBUF != 4096 || EC_MAXELIST != 64 || EC_MAXNAME != 40 || EC_MAXGROUP != 2 || \
    EC_MAXIOSEGMENTS != 64 || EC_MAXMBX != 1486 || EC_MBXPOOLSIZE != 32 || EC_MAXEEPDO != 0x200 || EC_MAXSM != 8 || EC_MAXFMMU != 4 || \
    EC_MAXLEN_ADAPTERNAME != 128 || EC_MAX_MAPT != 1 || EC_MAXODLIST != 1024 || EC_MAXOELIST != 256 || EC_SOE_MAXNAME != 60 || \
    EC_SOE_MAXMAPPING != 64 || EC_LOGGROUPOFFSET != 16
#error "a size of structures is not that of the library"
#endif

#endif
