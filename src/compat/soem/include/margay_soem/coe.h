/* Lists of objects, equal in SOEM 1.4 and 2.0. The headers of both versions include this file where their own sizes are known. */
#ifndef MARGAY_SOEM_COE_H
#define MARGAY_SOEM_COE_H

/* Objects of a dictionary */
typedef struct {
    uint16 Slave;
    uint16 Entries;
    uint16 Index[EC_MAXODLIST];
    uint16 DataType[EC_MAXODLIST];
    uint8 ObjectCode[EC_MAXODLIST];
    uint8 MaxSub[EC_MAXODLIST];
    char Name[EC_MAXODLIST][EC_MAXNAME + 1];
} ec_ODlistt;

/* Entries of one object */
typedef struct {
    uint16 Entries;
    uint8 ValueInfo[EC_MAXOELIST];
    uint16 DataType[EC_MAXOELIST];
    uint16 BitLength[EC_MAXOELIST];
    uint16 ObjAccess[EC_MAXOELIST];
    char Name[EC_MAXOELIST][EC_MAXNAME + 1];
} ec_OElistt;

#endif
