/* Slaves, groups, the context; states, mailboxes, EEPROM and process data */
#ifndef MARGAY_SOEM2_SOEM_EC_MAIN_H
#define MARGAY_SOEM2_SOEM_EC_MAIN_H

#include "soem/ec_type.h"
#include "nicdrv.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes and flags */
#define ECT_MBXH_CYCLIC 1
#define ECT_MBXH_LOST 2
#define EC_MBXINENABLE ((uint8 *)1)
#define EC_MBXQUEUESTATE_NONE 0
#define EC_MBXQUEUESTATE_REQ 1
#define EC_MBXQUEUESTATE_FAIL 2
#define EC_MBXQUEUESTATE_DONE 3
#define ECT_MBXH_NONE 0
#define ECT_ESMTRANS_IP 0x0001
#define ECT_ESMTRANS_PS 0x0002
#define ECT_ESMTRANS_PI 0x0004
#define ECT_ESMTRANS_SP 0x0008
#define ECT_ESMTRANS_SO 0x0010
#define ECT_ESMTRANS_SI 0x0020
#define ECT_ESMTRANS_OS 0x0040
#define ECT_ESMTRANS_OP 0x0080
#define ECT_ESMTRANS_OI 0x0100
#define ECT_ESMTRANS_IB 0x0200
#define ECT_ESMTRANS_BI 0x0400
#define ECT_ESMTRANS_II 0x0800
#define ECT_ESMTRANS_PP 0x1000
#define ECT_ESMTRANS_SS 0x2000

#include "margay_soem/main.h"

/* Pool of mailbox buffers */
typedef struct {
    int listhead;
    int listtail;
    int listcount;
    int mbxemptylist[EC_MBXPOOLSIZE];
    osal_mutext *mbxmutex;
    ec_mbxbuft mbx[EC_MBXPOOLSIZE];
} ec_mbxpoolt;

/* Mailbox messages that wait to be sent */
typedef struct {
    int listhead;
    int listtail;
    int listcount;
    ec_mbxbuft * mbx[EC_MBXPOOLSIZE];
    int mbxstate[EC_MBXPOOLSIZE];
    int mbxremove[EC_MBXPOOLSIZE];
    int mbxticket[EC_MBXPOOLSIZE];
    uint16 mbxslave[EC_MBXPOOLSIZE];
    osal_mutext *mbxmutex;
} ec_mbxqueuet;

/* A CoE command of a network description */
typedef struct {
    uint16 Transition;
    boolean CA;
    uint8 Ccs;
    uint16 Index;
    uint8 SubIdx;
    int Timeout;
    int DataSize;
    void *Data;
} ec_enicoecmdt;

/* The commands of one slave */
typedef struct {
    uint16 Slave;
    uint32 VendorId;
    uint32 ProductCode;
    uint32 RevisionNo;
    ec_enicoecmdt *CoECmds;
    int CoECmdCount;
} ec_enislavet;

/* A network description */
typedef struct {
    ec_enislavet *slave;
    int slavecount;
} ec_enit;

/* Frames of process data that are under way */
typedef struct {
    uint8 pushed;
    uint8 pulled;
    uint8 idx[EC_MAXBUF];
    void * data[EC_MAXBUF];
    uint16 length[EC_MAXBUF];
    uint16 dcoffset[EC_MAXBUF];
    uint8 type[EC_MAXBUF];
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
    uint32 eep_ser;
    uint16 Itype;
    uint16 Dtype;
    uint16 Obits;
    uint32 Obytes;
    uint8 *outputs;
    uint32 Ooffset;
    uint8 Ostartbit;
    uint16 Ibits;
    uint32 Ibytes;
    uint8 *inputs;
    uint32 Ioffset;
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
    int (*PO2SOconfig)(ecx_contextt *context, uint16 slave);
    int mbxhandlerstate;
    int mbxrmpstate;
    uint16 mbxinstateex;
    uint8 *coembxin;
    boolean coembxinfull;
    int coembxoverrun;
    uint8 *soembxin;
    boolean soembxinfull;
    int soembxoverrun;
    uint8 *foembxin;
    boolean foembxinfull;
    int foembxoverrun;
    uint8 *eoembxin;
    boolean eoembxinfull;
    int eoembxoverrun;
    uint8 *voembxin;
    boolean voembxinfull;
    int voembxoverrun;
    uint8 *aoembxin;
    boolean aoembxinfull;
    int aoembxoverrun;
    uint8 *mbxstatus;
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
    uint8 *mbxstatus;
    int32 mbxstatuslength;
    uint16 mbxstatuslookup[EC_MAXSLAVE];
    uint16 lastmbxpos;
    ec_mbxqueuet mbxtxqueue;
} ec_groupt;

/* One master: everything that belongs together */
struct ecx_context {
    ecx_portt port;
    ec_slavet slavelist[EC_MAXSLAVE];
    int slavecount;
    ec_groupt grouplist[EC_MAXGROUP];
    boolean ecaterror;
    int64 DCtime;
    uint8 esibuf[EC_MAXEEPBUF];
    uint32 esimap[EC_MAXEEPBITMAP];
    uint16 esislave;
    ec_eringt elist;
    ec_idxstackT idxstack;
    ec_SMcommtypet SMcommtype[EC_MAX_MAPT];
    ec_PDOassignt PDOassign[EC_MAX_MAPT];
    ec_PDOdesct PDOdesc[EC_MAX_MAPT];
    ec_eepromSMt eepSM;
    ec_eepromFMMUt eepFMMU;
    ec_mbxpoolt mbxpool;
    ec_enit *ENI;
    int (*FOEhook)(uint16 slave, int packetnumber, int datasize);
    int (*EOEhook)(ecx_contextt *context, uint16 slave, void *eoembx);
    int manualstatechange;
    void *userdata;
    boolean overlappedMode;
    boolean packedMode;
};

ec_adaptert *ec_find_adapters(void);
void ec_free_adapters(ec_adaptert *adapter);
int ecx_init(ecx_contextt *context, const char *ifname);
void ecx_close(ecx_contextt *context);
uint8 ecx_siigetbyte(ecx_contextt *context, uint16 slave, uint16 address);
int16 ecx_siifind(ecx_contextt *context, uint16 slave, uint16 cat);
void ecx_siistring(ecx_contextt *context, char *str, uint16 slave, uint16 Sn);
int ecx_readstate(ecx_contextt *context);
int ecx_writestate(ecx_contextt *context, uint16 slave);
uint16 ecx_statecheck(ecx_contextt *context, uint16 slave, uint16 reqstate, int timeout);
int ecx_mbxhandler(ecx_contextt *context, uint8 group, int limit);
uint32 ecx_readeeprom(ecx_contextt *context, uint16 slave, uint16 eeproma, int timeout);
int ecx_eeprom2pdi(ecx_contextt *context, uint16 slave);
uint64 ecx_readeepromAP(ecx_contextt *context, uint16 aiadr, uint16 eeproma, int timeout);
int ecx_writeeepromAP(ecx_contextt *context, uint16 aiadr, uint16 eeproma, uint16 data, int timeout);
int ecx_send_processdata(ecx_contextt *context);
int ecx_receive_processdata(ecx_contextt *context, int timeout);
int ecx_slavembxcyclic(ecx_contextt *context, uint16 slave);
uint8 ec_nextmbxcnt(uint8 cnt);
void ec_clearmbx(ec_mbxbuft *Mbx);
void ecx_pusherror(ecx_contextt *context, const ec_errort *Ec);
boolean ecx_poperror(ecx_contextt *context, ec_errort *Ec);
boolean ecx_iserror(ecx_contextt *context);
void ecx_packeterror(ecx_contextt *context, uint16 Slave, uint16 Index, uint8 SubIdx, uint16 ErrorCode);
int ecx_init_redundant(ecx_contextt *context, ecx_redportt *redport, const char *ifname, char *if2name);
uint16 ecx_siiFMMU(ecx_contextt *context, uint16 slave, ec_eepromFMMUt *FMMU);
uint16 ecx_siiSM(ecx_contextt *context, uint16 slave, ec_eepromSMt *SM);
uint16 ecx_siiSMnext(ecx_contextt *context, uint16 slave, ec_eepromSMt *SM, uint16 n);
uint32 ecx_siiPDO(ecx_contextt *context, uint16 slave, ec_eepromPDOt *PDO, uint8 t);
int ecx_mbxempty(ecx_contextt *context, uint16 slave, int timeout);
int ecx_mbxsend(ecx_contextt *context, uint16 slave, ec_mbxbuft *mbx, int timeout);
int ecx_mbxreceive(ecx_contextt *context, uint16 slave, ec_mbxbuft **mbx, int timeout);
int ecx_mbxENIinitcmds(ecx_contextt *context, uint16 slave, uint16_t transition);
void ecx_esidump(ecx_contextt *context, uint16 slave, uint8 *esibuf);
int ecx_writeeeprom(ecx_contextt *context, uint16 slave, uint16 eeproma, uint16 data, int timeout);
int ecx_eeprom2master(ecx_contextt *context, uint16 slave);
uint64 ecx_readeepromFP(ecx_contextt *context, uint16 configadr, uint16 eeproma, int timeout);
int ecx_writeeepromFP(ecx_contextt *context, uint16 configadr, uint16 eeproma, uint16 data, int timeout);
void ecx_readeeprom1(ecx_contextt *context, uint16 slave, uint16 eeproma);
uint32 ecx_readeeprom2(ecx_contextt *context, uint16 slave, int timeout);
int ecx_receive_processdata_group(ecx_contextt *context, uint8 group, int timeout);
int ecx_send_processdata_group(ecx_contextt *context, uint8 group);
ec_mbxbuft *ecx_getmbx(ecx_contextt *context);
int ecx_dropmbx(ecx_contextt *context, ec_mbxbuft *mbx);
int ecx_initmbxpool(ecx_contextt *context);
int ecx_initmbxqueue(ecx_contextt *context, uint8 group);

#ifdef __cplusplus
}
#endif

#endif
