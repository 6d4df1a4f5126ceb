/* Constants, enumerations and the error entry, equal in SOEM 1.4 and 2.0. The headers of both versions include this file where their own sizes are known. */
#ifndef MARGAY_SOEM_TYPE_H
#define MARGAY_SOEM_TYPE_H

/* Structures without padding */
#define MARGAY_SOEM_PACKED __attribute__((__packed__))

#define EC_NOFRAME (-1)
#define ETH_HEADERSIZE 14
#define EC_ESTAT_R64 0x0040
#define ECT_SDO_SMCOMMTYPE 0x1c00
#define ECT_SDO_PDOASSIGN 0x1c10
#define ETH_P_ECAT 0x88A4
#define EC_OTHERFRAME (-2)
#define EC_ERROR (-3)
#define EC_SLAVECOUNTEXCEEDED (-4)
#define EC_TIMEOUT (-5)
#define EC_MAXECATFRAME 1518
#define EC_MAXLRWDATA (EC_MAXECATFRAME - 32)
#define EC_FIRSTDCDATAGRAM 20
#define EC_ECATTYPE 0x1000
#define EC_HEADERSIZE 12
#define EC_ELENGTHSIZE 2
#define EC_CMDOFFSET 2
#define EC_WKCSIZE 2
#define EC_DATAGRAMFOLLOWS 0x8000
#define EC_ESTAT_BUSY 0x8000
#define EC_ESTAT_EMASK 0x7800
#define EC_ESTAT_NACK 0x2000
#define ECT_SII_START 0x0040
#define ECT_SDO_RXPDOASSIGN 0x1c12
#define ECT_SDO_TXPDOASSIGN 0x1c13
#define MBX_HDR_SET_CNT(cnt) ((uint8)((cnt) << 4))

/* A frame buffer */
typedef uint8 ec_bufT[EC_BUFSIZE];

/* General results */
typedef enum {
    EC_ERR_OK = 0, EC_ERR_ALREADY_INITIALIZED = 1, EC_ERR_NOT_INITIALIZED = 2, EC_ERR_TIMEOUT = 3,
    EC_ERR_NO_SLAVES = 4, EC_ERR_NOK = 5
} ec_err;

/* AL states; the last two are the same bit, set by the slave as error and by the master as acknowledgement */
typedef enum {
    EC_STATE_NONE = 0, EC_STATE_INIT = 1, EC_STATE_PRE_OP = 2, EC_STATE_BOOT = 3, EC_STATE_SAFE_OP = 4,
    EC_STATE_OPERATIONAL = 8, EC_STATE_ACK = 0x10, EC_STATE_ERROR = 0x10
} ec_state;

/* What a frame buffer of the port contains */
typedef enum {
    EC_BUF_EMPTY = 0, EC_BUF_ALLOC = 1, EC_BUF_TX = 2, EC_BUF_RCVD = 3, EC_BUF_COMPLETE = 4
} ec_bufstate;

/* CoE data types */
typedef enum {
    ECT_BOOLEAN = 1, ECT_INTEGER8 = 2, ECT_INTEGER16 = 3, ECT_INTEGER32 = 4, ECT_UNSIGNED8 = 5, ECT_UNSIGNED16 = 6,
    ECT_UNSIGNED32 = 7, ECT_REAL32 = 8, ECT_VISIBLE_STRING = 9, ECT_OCTET_STRING = 0xa, ECT_UNICODE_STRING = 0xb,
    ECT_TIME_OF_DAY = 0xc, ECT_TIME_DIFFERENCE = 0xd, ECT_DOMAIN = 0xf, ECT_INTEGER24 = 0x10, ECT_REAL64 = 0x11,
    ECT_INTEGER64 = 0x15, ECT_UNSIGNED24 = 0x16, ECT_UNSIGNED64 = 0x1b, ECT_BIT1 = 0x30, ECT_BIT2 = 0x31,
    ECT_BIT3 = 0x32, ECT_BIT4 = 0x33, ECT_BIT5 = 0x34, ECT_BIT6 = 0x35, ECT_BIT7 = 0x36, ECT_BIT8 = 0x37
} ec_datatype;

/* Commands of datagrams */
typedef enum {
    EC_CMD_NOP = 0, EC_CMD_APRD = 1, EC_CMD_APWR = 2, EC_CMD_APRW = 3, EC_CMD_FPRD = 4, EC_CMD_FPWR = 5,
    EC_CMD_FPRW = 6, EC_CMD_BRD = 7, EC_CMD_BWR = 8, EC_CMD_BRW = 9, EC_CMD_LRD = 0xa, EC_CMD_LWR = 0xb,
    EC_CMD_LRW = 0xc, EC_CMD_ARMW = 0xd, EC_CMD_FRMW = 0xe
} ec_cmdtype;

/* Commands of the EEPROM interface */
typedef enum {
    EC_ECMD_NOP = 0, EC_ECMD_READ = 0x100, EC_ECMD_WRITE = 0x201, EC_ECMD_RELOAD = 0x300
} ec_ecmdtype;

/* Categories of the SII */
enum {
    ECT_SII_STRING = 0xa, ECT_SII_GENERAL = 0x1e, ECT_SII_FMMU = 0x28, ECT_SII_SM = 0x29, ECT_SII_PDO = 0x32
};

/* Mailbox protocols, low half of the type octet */
enum {
    ECT_MBXT_ERR = 0, ECT_MBXT_AOE = 1, ECT_MBXT_EOE = 2, ECT_MBXT_COE = 3, ECT_MBXT_FOE = 4, ECT_MBXT_SOE = 5,
    ECT_MBXT_VOE = 0xf
};

/* CoE services */
enum {
    ECT_COES_EMERGENCY = 1, ECT_COES_SDOREQ = 2, ECT_COES_SDORES = 3, ECT_COES_TXPDO = 4, ECT_COES_RXPDO = 5,
    ECT_COES_TXPDO_RR = 6, ECT_COES_RXPDO_RR = 7, ECT_COES_SDOINFO = 8
};

/* SDO command specifiers */
enum {
    ECT_SDO_DOWN_INIT = 0x21, ECT_SDO_DOWN_EXP = 0x23, ECT_SDO_DOWN_INIT_CA = 0x31, ECT_SDO_UP_REQ = 0x40,
    ECT_SDO_UP_REQ_CA = 0x50, ECT_SDO_SEG_UP_REQ = 0x60, ECT_SDO_ABORT = 0x80
};

/* SDO information services */
enum {
    ECT_GET_ODLIST_REQ = 1, ECT_GET_ODLIST_RES = 2, ECT_GET_OD_REQ = 3, ECT_GET_OD_RES = 4, ECT_GET_OE_REQ = 5,
    ECT_GET_OE_RES = 6, ECT_SDOINFO_ERROR = 7
};

/* FoE services */
enum {
    ECT_FOE_READ = 1, ECT_FOE_WRITE = 2, ECT_FOE_DATA = 3, ECT_FOE_ACK = 4, ECT_FOE_ERROR = 5, ECT_FOE_BUSY = 6
};

/* SoE services */
enum {
    ECT_SOE_READREQ = 1, ECT_SOE_READRES = 2, ECT_SOE_WRITEREQ = 3, ECT_SOE_WRITERES = 4, ECT_SOE_NOTIFICATION = 5,
    ECT_SOE_EMERGENCY = 6
};

/* Addresses of ESC registers */
enum {
    ECT_REG_TYPE = 0, ECT_REG_PORTDES = 7, ECT_REG_ESCSUP = 8, ECT_REG_STADR = 0x10, ECT_REG_ALIAS = 0x12,
    ECT_REG_DLCTL = 0x100, ECT_REG_DLPORT = 0x101, ECT_REG_DLALIAS = 0x103, ECT_REG_DLSTAT = 0x110,
    ECT_REG_ALCTL = 0x120, ECT_REG_ALSTAT = 0x130, ECT_REG_ALSTATCODE = 0x134, ECT_REG_PDICTL = 0x140,
    ECT_REG_IRQMASK = 0x200, ECT_REG_RXERR = 0x300, ECT_REG_FRXERR = 0x308, ECT_REG_EPUECNT = 0x30c,
    ECT_REG_PECNT = 0x30d, ECT_REG_PECODE = 0x30e, ECT_REG_LLCNT = 0x310, ECT_REG_WDCNT = 0x442,
    ECT_REG_EEPCFG = 0x500, ECT_REG_EEPCTL = 0x502, ECT_REG_EEPSTAT = 0x502, ECT_REG_EEPADR = 0x504,
    ECT_REG_EEPDAT = 0x508, ECT_REG_FMMU0 = 0x600, ECT_REG_FMMU1 = 0x610, ECT_REG_FMMU2 = 0x620,
    ECT_REG_FMMU3 = 0x630, ECT_REG_SM0 = 0x800, ECT_REG_SM1 = 0x808, ECT_REG_SM2 = 0x810, ECT_REG_SM3 = 0x818,
    ECT_REG_SM0STAT = 0x805, ECT_REG_SM1STAT = 0x80d, ECT_REG_SM1ACT = 0x80e, ECT_REG_SM1CONTR = 0x80f,
    ECT_REG_DCTIME0 = 0x900, ECT_REG_DCTIME1 = 0x904, ECT_REG_DCTIME2 = 0x908, ECT_REG_DCTIME3 = 0x90c,
    ECT_REG_DCSYSTIME = 0x910, ECT_REG_DCSOF = 0x918, ECT_REG_DCSYSOFFSET = 0x920, ECT_REG_DCSYSDELAY = 0x928,
    ECT_REG_DCSYSDIFF = 0x92c, ECT_REG_DCSPEEDCNT = 0x930, ECT_REG_DCTIMEFILT = 0x934, ECT_REG_DCCUC = 0x980,
    ECT_REG_DCSYNCACT = 0x981, ECT_REG_DCSTART0 = 0x990, ECT_REG_DCCYCLE0 = 0x9a0, ECT_REG_DCCYCLE1 = 0x9a4
};

/* Kinds of entries in the error list */
typedef enum {
    EC_ERR_TYPE_SDO_ERROR = 0, EC_ERR_TYPE_EMERGENCY = 1, EC_ERR_TYPE_PACKET_ERROR = 3,
    EC_ERR_TYPE_SDOINFO_ERROR = 4, EC_ERR_TYPE_FOE_ERROR = 5, EC_ERR_TYPE_FOE_BUF2SMALL = 6,
    EC_ERR_TYPE_FOE_PACKETNUMBER = 7, EC_ERR_TYPE_SOE_ERROR = 8, EC_ERR_TYPE_MBX_ERROR = 9,
    EC_ERR_TYPE_FOE_FILE_NOTFOUND = 0xa, EC_ERR_TYPE_EOE_INVALID_RX_DATA = 0xb
} ec_err_type;

/* An entry of the error list; SDO errors have the abort code, all others the members beside it */
typedef struct {
    ec_timet Time;
    boolean Signal;
    uint16 Slave;
    uint16 Index;
    uint8 SubIdx;
    ec_err_type Etype;
    __extension__ union {
        int32 AbortCode;
        __extension__ struct {
            uint16 ErrorCode;
            uint8 ErrorReg;
            uint8 b1;
            uint16 w1;
            uint16 w2;
        };
    };
} ec_errort;

/* Ethernet header */
typedef struct MARGAY_SOEM_PACKED {
    uint16 da0;
    uint16 da1;
    uint16 da2;
    uint16 sa0;
    uint16 sa1;
    uint16 sa2;
    uint16 etype;
} ec_etherheadert;

/* EtherCAT header with the header of the first datagram */
typedef struct MARGAY_SOEM_PACKED {
    uint16 elength;
    uint8 command;
    uint8 index;
    uint16 ADP;
    uint16 ADO;
    uint16 dlength;
    uint16 irpt;
} ec_comt;

/* Words from octets, and octets of words */
#define MK_WORD(msb, lsb) ((((uint16)(msb)) << 8) | (lsb))
#define HI_BYTE(w) ((w) >> 8)
#define LO_BYTE(w) ((w) & 0x00ff)
#define SWAP(w) ((((w) & 0xff00) >> 8) | (((w) & 0x00ff) << 8))
#define LO_WORD(l) ((l) & 0xffff)
#define HI_WORD(l) ((l) >> 16)

/* Unaligned access */
#define get_unaligned(ptr) \
    (__extension__({ __typeof__(*(ptr)) margay_value; memcpy(&margay_value, (ptr), sizeof(*(ptr))); margay_value; }))
#define put_unaligned32(val, ptr) (memcpy((ptr), &(val), 4))
#define put_unaligned64(val, ptr) (memcpy((ptr), &(val), 8))

/* Host order to the order of the wire, and back */
#if (defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__) || defined(EC_BIG_ENDIAN)
#define htoes(A) ((uint16)__builtin_bswap16((uint16)(A)))
#define htoel(A) ((uint32)__builtin_bswap32((uint32)(A)))
#define htoell(A) ((uint64)__builtin_bswap64((uint64)(A)))
#else
#ifndef EC_LITTLE_ENDIAN
#define EC_LITTLE_ENDIAN
#endif
#define htoes(A) (A)
#define htoel(A) (A)
#define htoell(A) (A)
#endif
#define etohs(A) htoes(A)
#define etohl(A) htoel(A)
#define etohll(A) htoell(A)

#endif
