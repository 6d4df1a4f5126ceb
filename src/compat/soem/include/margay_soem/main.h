/* Registers, categories of the SII, mailboxes and lists, equal in SOEM 1.4 and 2.0. The headers of both versions include this file where their own sizes are known. */
#ifndef MARGAY_SOEM_MAIN_H
#define MARGAY_SOEM_MAIN_H

#define ECT_MBXPROT_COE 0x0004
#define ECT_COEDET_SDO 0x01
#define ECT_COEDET_SDOINFO 0x02
#define ECT_COEDET_PDOASSIGN 0x04
#define ECT_COEDET_PDOCONFIG 0x08
#define ECT_COEDET_UPLOAD 0x10
#define ECT_COEDET_SDOCA 0x20
#define ECT_MBXPROT_AOE 0x0001
#define ECT_MBXPROT_EOE 0x0002
#define ECT_MBXPROT_FOE 0x0008
#define ECT_MBXPROT_SOE 0x0010
#define ECT_MBXPROT_VOE 0x0020
#define EC_SMENABLEMASK 0xfffeffff

typedef struct ecx_context ecx_contextt;

/* A mailbox buffer */
typedef uint8 ec_mbxbuft[EC_MAXMBX + 1];

typedef struct ec_adapter ec_adaptert;
/* A network interface of the host, in a list */
struct ec_adapter {
    char name[EC_MAXLEN_ADAPTERNAME];
    char desc[EC_MAXLEN_ADAPTERNAME];
    ec_adaptert *next;
};

/* Registers of an FMMU */
typedef struct MARGAY_SOEM_PACKED {
    uint32 LogStart;
    uint16 LogLength;
    uint8 LogStartbit;
    uint8 LogEndbit;
    uint16 PhysStart;
    uint8 PhysStartBit;
    uint8 FMMUtype;
    uint8 FMMUactive;
    uint8 unused1;
    uint16 unused2;
} ec_fmmut;

/* Registers of a SyncManager */
typedef struct MARGAY_SOEM_PACKED {
    uint16 StartAddr;
    uint16 SMlength;
    uint32 SMflags;
} ec_smt;

/* AL status and status code */
typedef struct MARGAY_SOEM_PACKED {
    uint16 State;
    uint16 Unused;
    uint16 ALstatuscode;
} ec_state_status;

/* AL status and status code as read at once */
typedef struct MARGAY_SOEM_PACKED {
    uint16 alstatus;
    uint16 unused;
    uint16 alstatuscode;
} ec_alstatust;

/* Header of a mailbox message */
typedef struct MARGAY_SOEM_PACKED {
    uint16 length;
    uint16 address;
    uint8 priority;
    uint8 mbxtype;
} ec_mbxheadert;

/* FMMU category of the SII */
typedef struct {
    uint16 Startpos;
    uint8 nFMMU;
    uint8 FMMU0;
    uint8 FMMU1;
    uint8 FMMU2;
    uint8 FMMU3;
} ec_eepromFMMUt;

/* One SyncManager of the SII */
typedef struct {
    uint16 Startpos;
    uint8 nSM;
    uint16 PhStart;
    uint16 Plength;
    uint8 Creg;
    uint8 Sreg;
    uint8 Activate;
    uint8 PDIctrl;
} ec_eepromSMt;

/* PDO category of the SII */
typedef struct {
    uint16 Startpos;
    uint16 Length;
    uint16 nPDO;
    uint16 Index[EC_MAXEEPDO];
    uint16 SyncM[EC_MAXEEPDO];
    uint16 BitSize[EC_MAXEEPDO];
    uint16 SMbitsize[EC_MAXSM];
} ec_eepromPDOt;

/* The error list */
typedef struct {
    int16 head;
    int16 tail;
    ec_errort Error[EC_MAXELIST + 1];
} ec_eringt;

/* Object 0x1C00 */
typedef struct MARGAY_SOEM_PACKED {
    uint8 n;
    uint8 nu1;
    uint8 SMtype[EC_MAXSM];
} ec_SMcommtypet;

/* An assignment object 0x1C1x */
typedef struct MARGAY_SOEM_PACKED {
    uint8 n;
    uint8 nu1;
    uint16 index[256];
} ec_PDOassignt;

/* A mapping object */
typedef struct MARGAY_SOEM_PACKED {
    uint8 n;
    uint8 nu1;
    uint32 PDO[256];
} ec_PDOdesct;

#endif
