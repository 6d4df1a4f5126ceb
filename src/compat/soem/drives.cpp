// Parameters of drives (SoE).
#include "compat/soem/facade.hpp"

using namespace margay::soem;

namespace {

constexpr int kDrives = 8;

// The number of bits of the telegram of a drive in the process data: the data of an IDN list, and the control word or
// the status word.
unsigned telegram_bits(ecx_contextt* context, uint16 slave, uint8 drive, uint16 list) {
    ec_SoEmappingt mapping{};
    int size = sizeof(mapping);
    if (ecx_SoEread(context, slave, drive, EC_SOE_VALUE_B, list, &size, &mapping, EC_TIMEOUTRXM) <= 0 || size < 4)
        return 0;
    unsigned bits = 16;  // control word or status word
    const int idns = std::min((etohs(mapping.currentlength)) / 2, EC_SOE_MAXMAPPING);
    for (int n = 0; n < idns; ++n) {
        ec_SoEattributet attribute{};
        size = sizeof(attribute);
        if (ecx_SoEread(context, slave, drive, EC_SOE_ATTRIBUTE_B, etohs(mapping.idn[n]), &size, &attribute,
                        EC_TIMEOUTRXM) > 0 &&
            attribute.list == 0)
            bits += 8U << attribute.length;
    }
    return bits;
}

}  // namespace

extern "C" {

int ecx_SoEread(ecx_contextt* context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int* psize, void* p,
                int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) || *psize < 0) return 0;
    margay::SoeRead request;
    request.slave = slave;
    request.drive = driveNo;
    request.idn = {idn};
    request.elements = elementflags;
    request.data = octets_at(p, static_cast<std::size_t>(*psize));
    request.timeout = mail_time(timeout);
    const auto done = session->run(request);
    if (done) *psize = static_cast<int>(request.bytes);
    return mail_result(*context, slave, done.error(), idn, driveNo);
}

int ecx_SoEwrite(ecx_contextt* context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int psize, void* p,
                 int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) || psize < 0) return 0;
    margay::SoeWrite request;
    request.slave = slave;
    request.drive = driveNo;
    request.idn = {idn};
    request.elements = elementflags;
    const void* const value = p;
    request.data = octets_at(value, static_cast<std::size_t>(psize));
    request.timeout = mail_time(timeout);
    const auto done = session->run(request);
    return mail_result(*context, slave, done.error(), idn, driveNo);
}

int ecx_readIDNmap(ecx_contextt* context, uint16 slave, MapBits* Osize, MapBits* Isize) {
    *Osize = 0;
    *Isize = 0;
    for (uint8 drive = 0; drive < kDrives; ++drive) {
        *Osize += static_cast<MapBits>(telegram_bits(context, slave, drive, EC_IDN_MDTCONFIG));
        *Isize += static_cast<MapBits>(telegram_bits(context, slave, drive, EC_IDN_ATCONFIG));
    }
    return *Osize > 0 || *Isize > 0 ? 1 : 0;
}

}  // extern "C"
