// The sizes of the process data, read by the program itself from the dictionary of a slave.
#include "compat/soem/facade.hpp"

using namespace margay::soem;

namespace {

constexpr uint16 kLengthOfEntry = 0xFF;  // bits of the length in a mapping entry

// Reads an object of at most four octets; 0 if the slave does not have it.
uint32 read_number(ecx_contextt* context, uint16 slave, uint16 index, uint8 subindex) {
    std::array<uint8, 4> octets{};
    int size = octets.size();
    if (ecx_SDOread(context, slave, index, subindex, FALSE, &size, octets.data(), EC_TIMEOUTRXM) <= 0) return 0;
    return octets[0] | uint32{octets[1]} << 8 | uint32{octets[2]} << 16 | uint32{octets[3]} << 24;
}

// The number of bits of all PDOs that are assigned to a SyncManager.
unsigned assigned_bits(ecx_contextt* context, uint16 slave, uint16 assignment) {
    unsigned bits = 0;
    const uint32 pdos = read_number(context, slave, assignment, 0);
    for (uint32 n = 1; n <= pdos && n < 256; ++n) {
        const auto pdo = static_cast<uint16>(read_number(context, slave, assignment, static_cast<uint8>(n)));
        if (pdo == 0) continue;
        const uint32 entries = read_number(context, slave, pdo, 0);
        for (uint32 entry = 1; entry <= entries && entry < 256; ++entry)
            bits += read_number(context, slave, pdo, static_cast<uint8>(entry)) & kLengthOfEntry;
    }
    return bits;
}

// Data of a SyncManager, read from the dictionary.
struct Read {
    uint32 type = 0;
    unsigned bits = 0;
};

Read read_sync_manager(ecx_contextt* context, uint16 slave, unsigned sm) {
    Read read{.type = read_number(context, slave, ECT_SDO_SMCOMMTYPE, static_cast<uint8>(sm + 1))};
    if (sm == 2 && read.type == 2) read.type = 3;  // some devices have this wrong type
    if (read.type == 3 || read.type == 4)
        read.bits = assigned_bits(context, slave, static_cast<uint16>(ECT_SDO_PDOASSIGN + sm));
    return read;
}

int read_map(ecx_contextt* context, uint16 slave, MapBits* Osize, MapBits* Isize) {
    *Osize = 0;
    *Isize = 0;
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    const uint32 count = read_number(context, slave, ECT_SDO_SMCOMMTYPE, 0);
    if (count <= 2) return 0;
    const unsigned end = std::min<unsigned>(count, EC_MAXSM);
    std::array<Read, EC_MAXSM> all{};
    for (unsigned sm = 2; sm < end; ++sm) all[sm] = read_sync_manager(context, slave, sm);
    // Changes all SyncManagers under the lock, because another thread may configure the slave.
    const Session::Guard guard(*session);
    ec_slavet& s = slaves_of(*context)[slave];
    for (unsigned sm = 2; sm < end; ++sm) {
        const Read& read = all[sm];
        s.SMtype[sm] = static_cast<uint8>(read.type);
        if (read.type == 0) s.SM[sm].SMflags = htoel(etohl(s.SM[sm].SMflags) & EC_SMENABLEMASK);
        if (read.bits == 0) continue;
        s.SM[sm].SMlength = htoes(static_cast<uint16>((read.bits + 7) / 8));
        (read.type == 3 ? *Osize : *Isize) += static_cast<MapBits>(read.bits);
    }
    // So that they do not count as changed by the program.
    std::memcpy(session->shown(slave).data(), s.SM, sizeof(s.SM));
    return *Osize > 0 || *Isize > 0 ? 1 : 0;
}

}  // namespace

extern "C" {

int ecx_readPDOmap(ecx_contextt* context, uint16 Slave, MapBits* Osize, MapBits* Isize) {
    return read_map(context, Slave, Osize, Isize);
}

// The same as without CA, because complete access would only save messages.
int ecx_readPDOmapCA(ecx_contextt* context, uint16 Slave, int, MapBits* Osize, MapBits* Isize) {
    return read_map(context, Slave, Osize, Isize);
}

}  // extern "C"
