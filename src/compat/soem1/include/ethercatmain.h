/* Slaves, groups, the context; states, mailboxes, EEPROM and process data */
#ifndef MARGAY_SOEM1_ETHERCATMAIN_H
#define MARGAY_SOEM1_ETHERCATMAIN_H

#include "ethercattype.h"
#include "nicdrv.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes and flags */
#define EC_MAXNAME 40
#ifndef EC_MAXSLAVE
#define EC_MAXSLAVE 200
#endif
#ifndef EC_MAXGROUP
#define EC_MAXGROUP 2
#endif
#define EC_MAXEEPDO 0x200
#define EC_MAXSM 8
#ifndef EC_MAX_MAPT
#define EC_MAX_MAPT 1
#endif
#ifndef EC_MAXELIST
#define EC_MAXELIST 64
#endif
#define EC_MAXIOSEGMENTS 64
#ifndef EC_MAXMBX
#define EC_MAXMBX 1486
#endif
#define EC_MAXFMMU 4
#define EC_MAXLEN_ADAPTERNAME 128

#include "margay_soem/main.h"

/* Frames of process data that are under way */
typedef struct {
    uint8 pushed;
    uint8 pulled;
    uint8 idx[EC_MAXBUF];
    void * data[EC_MAXBUF];
    uint16 length[EC_MAXBUF];
} ec_idxstackT;

/* A slave; number 0 stands for all slaves */
typedef struct ec_slave {
    uint16 state;
    uint16 ALstatuscode;
    uint16 configadr;
    uint16 aliasadr;
    uint32 eep_man;
    uint32 eep_id;
    uint32 eep_rev;
    uint32 eep_sn;
    uint16 Itype;
    uint16 Dtype;
    uint16 Obits;
    uint32 Obytes;
    uint8 *outputs;
    uint8 Ostartbit;
    uint16 Ibits;
    uint32 Ibytes;
    uint8 *inputs;
    uint8 Istartbit;
    ec_smt SM[EC_MAXSM];
    uint8 SMtype[EC_MAXSM];
    ec_fmmut FMMU[EC_MAXFMMU];
    uint8 FMMU0func;
    uint8 FMMU1func;
    uint8 FMMU2func;
    uint8 FMMU3func;
    uint16 mbx_l;
    uint16 mbx_wo;
    uint16 mbx_rl;
    uint16 mbx_ro;
    uint16 mbx_proto;
    uint8 mbx_cnt;
    boolean hasdc;
    uint8 ptype;
    uint8 topology;
    uint8 activeports;
    uint8 consumedports;
    uint16 parent;
    uint8 parentport;
    uint8 entryport;
    int32 DCrtA;
    int32 DCrtB;
    int32 DCrtC;
    int32 DCrtD;
    int32 pdelay;
    uint16 DCnext;
    uint16 DCprevious;
    int32 DCcycle;
    int32 DCshift;
    uint8 DCactive;
    uint16 configindex;
    uint16 SIIindex;
    uint8 eep_8byte;
    uint8 eep_pdi;
    uint8 CoEdetails;
    uint8 FoEdetails;
    uint8 EoEdetails;
    uint8 SoEdetails;
    int16 Ebuscurrent;
    uint8 blockLRW;
    uint8 group;
    uint8 FMMUunused;
    boolean islost;
    int (*PO2SOconfig)(uint16 slave);
    int (*PO2SOconfigx)(ecx_contextt *context, uint16 slave);
    void *user;
    char name[EC_MAXNAME + 1];
} ec_slavet;

/* Slaves that are exchanged together */
typedef struct ec_group {
    uint32 logstartaddr;
    uint32 Obytes;
    uint8 *outputs;
    uint32 Ibytes;
    uint8 *inputs;
    boolean hasdc;
    uint16 DCnext;
    int16 Ebuscurrent;
    uint8 blockLRW;
    uint16 nsegments;
    uint16 Isegment;
    uint16 Ioffset;
    uint16 outputsWKC;
    uint16 inputsWKC;
    boolean docheckstate;
    uint32 IOsegment[EC_MAXIOSEGMENTS];
} ec_groupt;

/* One master: everything that belongs together */
struct ecx_context {
    ecx_portt *port;
    ec_slavet *slavelist;
    int *slavecount;
    int maxslave;
    ec_groupt *grouplist;
    int maxgroup;
    uint8 *esibuf;
    uint32 *esimap;
    uint16 esislave;
    ec_eringt *elist;
    ec_idxstackT *idxstack;
    boolean *ecaterror;
    uint16 DCtO;
    uint16 DCl;
    int64 *DCtime;
    ec_SMcommtypet *SMcommtype;
    ec_PDOassignt *PDOassign;
    ec_PDOdesct *PDOdesc;
    ec_eepromSMt *eepSM;
    ec_eepromFMMUt *eepFMMU;
    int (*FOEhook)(uint16 slave, int packetnumber, int datasize);
    int (*EOEhook)(ecx_contextt *context, uint16 slave, void *eoembx);
    int manualstatechange;
    void *userdata;
};

#ifdef EC_VER1
extern ec_slavet ec_slave[EC_MAXSLAVE];
extern int ec_slavecount;
extern ec_groupt ec_group[EC_MAXGROUP];
extern boolean EcatError;
extern int64 ec_DCtime;
extern ecx_contextt ecx_context;
#endif

boolean ecx_poperror(ecx_contextt *context, ec_errort *Ec);
boolean ecx_iserror(ecx_contextt *context);
int ecx_init(ecx_contextt *context, const char *ifname);
int ecx_init_redundant(ecx_contextt *context, ecx_redportt *redport, const char *ifname, char *if2name);
void ecx_close(ecx_contextt *context);
uint8 ecx_siigetbyte(ecx_contextt *context, uint16 slave, uint16 address);
int16 ecx_siifind(ecx_contextt *context, uint16 slave, uint16 cat);
void ecx_siistring(ecx_contextt *context, char *str, uint16 slave, uint16 Sn);
int ecx_readstate(ecx_contextt *context);
int ecx_writestate(ecx_contextt *context, uint16 slave);
uint16 ecx_statecheck(ecx_contextt *context, uint16 slave, uint16 reqstate, int timeout);
int ecx_mbxsend(ecx_contextt *context, uint16 slave, ec_mbxbuft *mbx, int timeout);
int ecx_mbxreceive(ecx_contextt *context, uint16 slave, ec_mbxbuft *mbx, int timeout);
uint32 ecx_readeeprom(ecx_contextt *context, uint16 slave, uint16 eeproma, int timeout);
int ecx_writeeeprom(ecx_contextt *context, uint16 slave, uint16 eeproma, uint16 data, int timeout);
int ecx_eeprom2master(ecx_contextt *context, uint16 slave);
int ecx_eeprom2pdi(ecx_contextt *context, uint16 slave);
uint64 ecx_readeepromAP(ecx_contextt *context, uint16 aiadr, uint16 eeproma, int timeout);
int ecx_writeeepromAP(ecx_contextt *context, uint16 aiadr, uint16 eeproma, uint16 data, int timeout);
uint64 ecx_readeepromFP(ecx_contextt *context, uint16 configadr, uint16 eeproma, int timeout);
int ecx_writeeepromFP(ecx_contextt *context, uint16 configadr, uint16 eeproma, uint16 data, int timeout);
int ecx_send_processdata(ecx_contextt *context);
int ecx_send_overlap_processdata(ecx_contextt *context);
int ecx_receive_processdata(ecx_contextt *context, int timeout);
ec_adaptert *ec_find_adapters(void);
void ec_free_adapters(ec_adaptert *adapter);
void ec_clearmbx(ec_mbxbuft *Mbx);
void ecx_pusherror(ecx_contextt *context, const ec_errort *Ec);
void ecx_packeterror(ecx_contextt *context, uint16 Slave, uint16 Index, uint8 SubIdx, uint16 ErrorCode);
uint16 ecx_siiFMMU(ecx_contextt *context, uint16 slave, ec_eepromFMMUt *FMMU);
uint16 ecx_siiSM(ecx_contextt *context, uint16 slave, ec_eepromSMt *SM);
uint16 ecx_siiSMnext(ecx_contextt *context, uint16 slave, ec_eepromSMt *SM, uint16 n);
int ecx_siiPDO(ecx_contextt *context, uint16 slave, ec_eepromPDOt *PDO, uint8 t);
int ecx_mbxempty(ecx_contextt *context, uint16 slave, int timeout);
void ecx_esidump(ecx_contextt *context, uint16 slave, uint8 *esibuf);
void ecx_readeeprom1(ecx_contextt *context, uint16 slave, uint16 eeproma);
uint32 ecx_readeeprom2(ecx_contextt *context, uint16 slave, int timeout);
int ecx_send_processdata_group(ecx_contextt *context, uint8 group);
int ecx_send_overlap_processdata_group(ecx_contextt *context, uint8 group);
int ecx_receive_processdata_group(ecx_contextt *context, uint8 group, int timeout);
uint8 ec_nextmbxcnt(uint8 cnt);
int ecx_FPRD_multi(ecx_contextt *context, int n, uint16 *configlst, ec_alstatust *slstatlst, int timeout);
uint16 ecx_eeprom_waitnotbusyAP(ecx_contextt *context, uint16 aiadr, uint16 *estat, int timeout);
uint16 ecx_eeprom_waitnotbusyFP(ecx_contextt *context, uint16 configadr, uint16 *estat, int timeout);

#ifdef EC_VER1
boolean ec_poperror(ec_errort *Ec);
boolean ec_iserror(void);
int ec_init(const char *ifname);
int ec_init_redundant(const char *ifname, char *if2name);
void ec_close(void);
uint8 ec_siigetbyte(uint16 slave, uint16 address);
int16 ec_siifind(uint16 slave, uint16 cat);
void ec_siistring(char *str, uint16 slave, uint16 Sn);
int ec_readstate(void);
int ec_writestate(uint16 slave);
uint16 ec_statecheck(uint16 slave, uint16 reqstate, int timeout);
int ec_mbxsend(uint16 slave, ec_mbxbuft *mbx, int timeout);
int ec_mbxreceive(uint16 slave, ec_mbxbuft *mbx, int timeout);
uint32 ec_readeeprom(uint16 slave, uint16 eeproma, int timeout);
int ec_writeeeprom(uint16 slave, uint16 eeproma, uint16 data, int timeout);
int ec_eeprom2master(uint16 slave);
int ec_eeprom2pdi(uint16 slave);
uint64 ec_readeepromAP(uint16 aiadr, uint16 eeproma, int timeout);
int ec_writeeepromAP(uint16 aiadr, uint16 eeproma, uint16 data, int timeout);
uint64 ec_readeepromFP(uint16 configadr, uint16 eeproma, int timeout);
int ec_writeeepromFP(uint16 configadr, uint16 eeproma, uint16 data, int timeout);
int ec_send_processdata(void);
int ec_send_overlap_processdata(void);
int ec_receive_processdata(int timeout);
void ec_pusherror(const ec_errort *Ec);
void ec_packeterror(uint16 Slave, uint16 Index, uint8 SubIdx, uint16 ErrorCode);
uint16 ec_siiFMMU(uint16 slave, ec_eepromFMMUt *FMMU);
uint16 ec_siiSM(uint16 slave, ec_eepromSMt *SM);
uint16 ec_siiSMnext(uint16 slave, ec_eepromSMt *SM, uint16 n);
int ec_siiPDO(uint16 slave, ec_eepromPDOt *PDO, uint8 t);
int ec_mbxempty(uint16 slave, int timeout);
void ec_esidump(uint16 slave, uint8 *esibuf);
void ec_readeeprom1(uint16 slave, uint16 eeproma);
uint32 ec_readeeprom2(uint16 slave, int timeout);
int ec_send_processdata_group(uint8 group);
int ec_send_overlap_processdata_group(uint8 group);
int ec_receive_processdata_group(uint8 group, int timeout);
uint16 ec_eeprom_waitnotbusyAP(uint16 aiadr, uint16 *estat, int timeout);
uint16 ec_eeprom_waitnotbusyFP(uint16 configadr, uint16 *estat, int timeout);
#endif

#ifdef __cplusplus
}
#endif

#endif
