// The functions of one global master: the same functions with the global context.
#include "compat/soem/cycle.hpp"

#include <ethercat.h>

extern "C" {

boolean ec_poperror(ec_errort* Ec) { return ecx_poperror(&ecx_context, Ec); }
boolean ec_iserror(void) { return ecx_iserror(&ecx_context); }
int ec_init(const char* ifname) { return ecx_init(&ecx_context, ifname); }
void ec_close(void) { ecx_close(&ecx_context); }
uint8 ec_siigetbyte(uint16 slave, uint16 address) { return ecx_siigetbyte(&ecx_context, slave, address); }
int16 ec_siifind(uint16 slave, uint16 cat) { return ecx_siifind(&ecx_context, slave, cat); }
void ec_siistring(char* str, uint16 slave, uint16 Sn) { ecx_siistring(&ecx_context, str, slave, Sn); }
int ec_readstate(void) { return ecx_readstate(&ecx_context); }
int ec_writestate(uint16 slave) { return ecx_writestate(&ecx_context, slave); }
uint16 ec_statecheck(uint16 slave, uint16 reqstate, int timeout) {
    return ecx_statecheck(&ecx_context, slave, reqstate, timeout);
}
int ec_mbxsend(uint16 slave, ec_mbxbuft* mbx, int timeout) { return ecx_mbxsend(&ecx_context, slave, mbx, timeout); }
int ec_mbxreceive(uint16 slave, ec_mbxbuft* mbx, int timeout) {
    return ecx_mbxreceive(&ecx_context, slave, mbx, timeout);
}
uint32 ec_readeeprom(uint16 slave, uint16 eeproma, int timeout) {
    return ecx_readeeprom(&ecx_context, slave, eeproma, timeout);
}
int ec_writeeeprom(uint16 slave, uint16 eeproma, uint16 data, int timeout) {
    return ecx_writeeeprom(&ecx_context, slave, eeproma, data, timeout);
}
int ec_eeprom2master(uint16 slave) { return ecx_eeprom2master(&ecx_context, slave); }
int ec_eeprom2pdi(uint16 slave) { return ecx_eeprom2pdi(&ecx_context, slave); }
uint64 ec_readeepromAP(uint16 aiadr, uint16 eeproma, int timeout) {
    return ecx_readeepromAP(&ecx_context, aiadr, eeproma, timeout);
}
int ec_writeeepromAP(uint16 aiadr, uint16 eeproma, uint16 data, int timeout) {
    return ecx_writeeepromAP(&ecx_context, aiadr, eeproma, data, timeout);
}
uint64 ec_readeepromFP(uint16 configadr, uint16 eeproma, int timeout) {
    return ecx_readeepromFP(&ecx_context, configadr, eeproma, timeout);
}
int ec_writeeepromFP(uint16 configadr, uint16 eeproma, uint16 data, int timeout) {
    return ecx_writeeepromFP(&ecx_context, configadr, eeproma, data, timeout);
}
int ec_send_processdata(void) { return margay::soem::send_group(ecx_context, 0); }
int ec_send_overlap_processdata(void) { return ecx_send_overlap_processdata(&ecx_context); }
int ec_receive_processdata(int timeout) { return margay::soem::receive_group(ecx_context, 0, timeout); }
void ec_pusherror(const ec_errort* Ec) { ecx_pusherror(&ecx_context, Ec); }
void ec_packeterror(uint16 Slave, uint16 Index, uint8 SubIdx, uint16 ErrorCode) {
    ecx_packeterror(&ecx_context, Slave, Index, SubIdx, ErrorCode);
}
uint16 ec_siiFMMU(uint16 slave, ec_eepromFMMUt* FMMU) { return ecx_siiFMMU(&ecx_context, slave, FMMU); }
uint16 ec_siiSM(uint16 slave, ec_eepromSMt* SM) { return ecx_siiSM(&ecx_context, slave, SM); }
uint16 ec_siiSMnext(uint16 slave, ec_eepromSMt* SM, uint16 n) { return ecx_siiSMnext(&ecx_context, slave, SM, n); }
int ec_siiPDO(uint16 slave, ec_eepromPDOt* PDO, uint8 t) { return ecx_siiPDO(&ecx_context, slave, PDO, t); }
int ec_mbxempty(uint16 slave, int timeout) { return ecx_mbxempty(&ecx_context, slave, timeout); }
void ec_esidump(uint16 slave, uint8* esibuf) { ecx_esidump(&ecx_context, slave, esibuf); }
void ec_readeeprom1(uint16 slave, uint16 eeproma) { ecx_readeeprom1(&ecx_context, slave, eeproma); }
uint32 ec_readeeprom2(uint16 slave, int timeout) { return ecx_readeeprom2(&ecx_context, slave, timeout); }
int ec_send_processdata_group(uint8 group) { return margay::soem::send_group(ecx_context, group); }
int ec_send_overlap_processdata_group(uint8 group) { return ecx_send_overlap_processdata_group(&ecx_context, group); }
int ec_receive_processdata_group(uint8 group, int timeout) {
    return margay::soem::receive_group(ecx_context, group, timeout);
}
int ec_config_init(uint8 usetable) { return ecx_config_init(&ecx_context, usetable); }
int ec_config_map_group(void* pIOmap, uint8 group) { return ecx_config_map_group(&ecx_context, pIOmap, group); }
int ec_config_overlap_map_group(void* pIOmap, uint8 group) {
    return ecx_config_overlap_map_group(&ecx_context, pIOmap, group);
}
int ec_recover_slave(uint16 slave, int timeout) { return ecx_recover_slave(&ecx_context, slave, timeout); }
int ec_reconfig_slave(uint16 slave, int timeout) { return ecx_reconfig_slave(&ecx_context, slave, timeout); }
int ec_config_map_group_aligned(void* pIOmap, uint8 group) {
    return ecx_config_map_group_aligned(&ecx_context, pIOmap, group);
}
boolean ec_configdc(void) { return ecx_configdc(&ecx_context); }
void ec_dcsync0(uint16 slave, boolean act, uint32 CyclTime, int32 CyclShift) {
    ecx_dcsync0(&ecx_context, slave, act, CyclTime, CyclShift);
}
void ec_dcsync01(uint16 slave, boolean act, uint32 CyclTime0, uint32 CyclTime1, int32 CyclShift) {
    ecx_dcsync01(&ecx_context, slave, act, CyclTime0, CyclTime1, CyclShift);
}
int ec_SDOread(uint16 slave, uint16 index, uint8 subindex, boolean CA, int* psize, void* p, int timeout) {
    return ecx_SDOread(&ecx_context, slave, index, subindex, CA, psize, p, timeout);
}
int ec_SDOwrite(uint16 Slave, uint16 Index, uint8 SubIndex, boolean CA, int psize, const void* p, int Timeout) {
    return ecx_SDOwrite(&ecx_context, Slave, Index, SubIndex, CA, psize, p, Timeout);
}
int ec_readODlist(uint16 Slave, ec_ODlistt* pODlist) { return ecx_readODlist(&ecx_context, Slave, pODlist); }
int ec_readODdescription(uint16 Item, ec_ODlistt* pODlist) {
    return ecx_readODdescription(&ecx_context, Item, pODlist);
}
int ec_readOEsingle(uint16 Item, uint8 SubI, ec_ODlistt* pODlist, ec_OElistt* pOElist) {
    return ecx_readOEsingle(&ecx_context, Item, SubI, pODlist, pOElist);
}
int ec_readOE(uint16 Item, ec_ODlistt* pODlist, ec_OElistt* pOElist) {
    return ecx_readOE(&ecx_context, Item, pODlist, pOElist);
}
void ec_SDOerror(uint16 Slave, uint16 Index, uint8 SubIdx, int32 AbortCode) {
    ecx_SDOerror(&ecx_context, Slave, Index, SubIdx, AbortCode);
}
int ec_RxPDO(uint16 Slave, uint16 RxPDOnumber, int psize, const void* p) {
    return ecx_RxPDO(&ecx_context, Slave, RxPDOnumber, psize, p);
}
int ec_TxPDO(uint16 slave, uint16 TxPDOnumber, int* psize, void* p, int timeout) {
    return ecx_TxPDO(&ecx_context, slave, TxPDOnumber, psize, p, timeout);
}
int ec_readPDOmap(uint16 Slave, int* Osize, int* Isize) { return ecx_readPDOmap(&ecx_context, Slave, Osize, Isize); }
int ec_readPDOmapCA(uint16 Slave, int Thread_n, int* Osize, int* Isize) {
    return ecx_readPDOmapCA(&ecx_context, Slave, Thread_n, Osize, Isize);
}
int ec_FOEread(uint16 slave, char* filename, uint32 password, int* psize, void* p, int timeout) {
    return ecx_FOEread(&ecx_context, slave, filename, password, psize, p, timeout);
}
int ec_FOEwrite(uint16 slave, char* filename, uint32 password, int psize, void* p, int timeout) {
    return ecx_FOEwrite(&ecx_context, slave, filename, password, psize, p, timeout);
}
int ec_FOEdefinehook(void* hook) { return ecx_FOEdefinehook(&ecx_context, hook); }
char* ec_elist2string(void) { return ecx_elist2string(&ecx_context); }
int ec_BRD(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_BRD(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_APRD(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_APRD(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_FRMW(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_FRMW(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_FPRD(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_FPRD(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_APWR(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_APWR(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_FPWR(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_FPWR(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_setupdatagram(void* frame, uint8 com, uint8 idx, uint16 ADP, uint16 ADO, uint16 length, void* data) {
    return ecx_setupdatagram(&ecx_port, frame, com, idx, ADP, ADO, length, data);
}
int ec_adddatagram(void* frame, uint8 com, uint8 idx, boolean more, uint16 ADP, uint16 ADO, uint16 length, void* data) {
    return ecx_adddatagram(&ecx_port, frame, com, idx, more, ADP, ADO, length, data);
}
int ec_BWR(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_BWR(&ecx_port, ADP, ADO, length, data, timeout);
}
int ec_ARMW(uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return ecx_ARMW(&ecx_port, ADP, ADO, length, data, timeout);
}
uint16 ec_APRDw(uint16 ADP, uint16 ADO, int timeout) { return ecx_APRDw(&ecx_port, ADP, ADO, timeout); }
uint16 ec_FPRDw(uint16 ADP, uint16 ADO, int timeout) { return ecx_FPRDw(&ecx_port, ADP, ADO, timeout); }
int ec_APWRw(uint16 ADP, uint16 ADO, uint16 data, int timeout) { return ecx_APWRw(&ecx_port, ADP, ADO, data, timeout); }
int ec_FPWRw(uint16 ADP, uint16 ADO, uint16 data, int timeout) { return ecx_FPWRw(&ecx_port, ADP, ADO, data, timeout); }
int ec_LRW(uint32 LogAdr, uint16 length, void* data, int timeout) {
    return ecx_LRW(&ecx_port, LogAdr, length, data, timeout);
}
int ec_LRD(uint32 LogAdr, uint16 length, void* data, int timeout) {
    return ecx_LRD(&ecx_port, LogAdr, length, data, timeout);
}
int ec_LWR(uint32 LogAdr, uint16 length, void* data, int timeout) {
    return ecx_LWR(&ecx_port, LogAdr, length, data, timeout);
}
int ec_LRWDC(uint32 LogAdr, uint16 length, void* data, uint16 DCrs, int64* DCtime, int timeout) {
    return ecx_LRWDC(&ecx_port, LogAdr, length, data, DCrs, DCtime, timeout);
}
int ec_SoEread(uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int* psize, void* p, int timeout) {
    return ecx_SoEread(&ecx_context, slave, driveNo, elementflags, idn, psize, p, timeout);
}
int ec_SoEwrite(uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int psize, void* p, int timeout) {
    return ecx_SoEwrite(&ecx_context, slave, driveNo, elementflags, idn, psize, p, timeout);
}
int ec_readIDNmap(uint16 slave, int* Osize, int* Isize) { return ecx_readIDNmap(&ecx_context, slave, Osize, Isize); }
int ec_setupnic(const char* ifname, int secondary) { return ecx_setupnic(&ecx_port, ifname, secondary); }
int ec_closenic(void) { return ecx_closenic(&ecx_port); }
void ec_setbufstat(int idx, int bufstat) { ecx_setbufstat(&ecx_port, idx, bufstat); }
int ec_getindex(void) { return ecx_getindex(&ecx_port); }
int ec_outframe(int idx, int sock) { return ecx_outframe(&ecx_port, idx, sock); }
int ec_outframe_red(int idx) { return ecx_outframe_red(&ecx_port, idx); }
int ec_waitinframe(int idx, int timeout) { return ecx_waitinframe(&ecx_port, idx, timeout); }
int ec_srconfirm(int idx, int timeout) { return ecx_srconfirm(&ecx_port, idx, timeout); }
uint16 ec_eeprom_waitnotbusyAP(uint16 aiadr, uint16* estat, int timeout) {
    return ecx_eeprom_waitnotbusyAP(&ecx_context, aiadr, estat, timeout);
}
uint16 ec_eeprom_waitnotbusyFP(uint16 configadr, uint16* estat, int timeout) {
    return ecx_eeprom_waitnotbusyFP(&ecx_context, configadr, estat, timeout);
}

}  // extern "C"
