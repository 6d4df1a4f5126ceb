/* Names, lists and attributes of SoE, equal in SOEM 1.4 and 2.0. The headers of both versions include this file where their own sizes are known. */
#ifndef MARGAY_SOEM_SOE_H
#define MARGAY_SOEM_SOE_H

#define EC_SOE_DATASTATE_B 0x01
#define EC_SOE_NAME_B 0x02
#define EC_SOE_ATTRIBUTE_B 0x04
#define EC_SOE_UNIT_B 0x08
#define EC_SOE_MIN_B 0x10
#define EC_SOE_MAX_B 0x20
#define EC_SOE_VALUE_B 0x40
#define EC_SOE_DEFAULT_B 0x80
#define EC_IDN_MDTCONFIG 24
#define EC_IDN_ATCONFIG 16
#define EC_SOE_LENGTH_1 0x00
#define EC_SOE_LENGTH_2 0x01
#define EC_SOE_LENGTH_4 0x02
#define EC_SOE_LENGTH_8 0x03
#define EC_SOE_TYPE_BINARY 0x00
#define EC_SOE_TYPE_UINT 0x01
#define EC_SOE_TYPE_INT 0x02
#define EC_SOE_TYPE_HEX 0x03
#define EC_SOE_TYPE_STRING 0x04
#define EC_SOE_TYPE_IDN 0x05
#define EC_SOE_TYPE_FLOAT 0x06
#define EC_SOE_TYPE_PARAMETER 0x07

/* Name of an IDN */
typedef struct MARGAY_SOEM_PACKED {
    uint16 currentlength;
    uint16 maxlength;
    char name[EC_SOE_MAXNAME];
} ec_SoEnamet;

/* List value of an IDN */
typedef struct MARGAY_SOEM_PACKED {
    uint16 currentlength;
    uint16 maxlength;
    __extension__ union {
        uint8 byte[8];
        uint16 word[4];
        uint32 dword[2];
        uint64 lword[1];
    };
} ec_SoElistt;

/* Cyclic data of a drive: IDN 16 or 24 */
typedef struct MARGAY_SOEM_PACKED {
    uint16 currentlength;
    uint16 maxlength;
    uint16 idn[EC_SOE_MAXMAPPING];
} ec_SoEmappingt;

/* Attribute of an IDN */
typedef struct MARGAY_SOEM_PACKED {
    uint32 evafactor : 16;
    uint32 length : 2;
    uint32 list : 1;
    uint32 command : 1;
    uint32 datatype : 3;
    uint32 reserved1 : 1;
    uint32 decimals : 4;
    uint32 wppreop : 1;
    uint32 wpsafeop : 1;
    uint32 wpop : 1;
    uint32 reserved2 : 1;
} ec_SoEattributet;

#endif
