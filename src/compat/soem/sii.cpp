// The contents of the SII, read when a program needs them, and cached for one slave.
#include "compat/soem/eeprom.hpp"

#include <cstring>

namespace margay::soem {
namespace {

constexpr std::uint16_t kCategories = ECT_SII_START * 2;  // the first category, in octets
constexpr std::uint16_t kEndMark = 0xFFFF;

class Sii {
  public:
    Sii(ecx_contextt& context, std::uint16_t slave) : context_(context), slave_(slave) {}

    std::uint8_t octet(std::uint16_t address) { return ecx_siigetbyte(&context_, slave_, address); }
    std::uint16_t word(std::uint16_t address) {
        return static_cast<std::uint16_t>(octet(address) | octet(static_cast<std::uint16_t>(address + 1)) << 8);
    }

  private:
    ecx_contextt& context_;
    std::uint16_t slave_;
};

// Locks the EEPROM against other threads, and at the end returns it to the processor of the slave if the processor had
// it.
class Taken {
  public:
    Taken(ecx_contextt& context, std::uint16_t slave)
        : session_(session_of(context)),
          lock_(session_ != nullptr ? session_->lock_eeproms() : Session::LongLock()),
          context_(context),
          slave_(slave),
          pdi_had_it_(slaves_of(context)[slave].eep_pdi != 0) {}
    ~Taken() {
        if (pdi_had_it_) ecx_eeprom2pdi(&context_, slave_);
    }
    Taken(const Taken&) = delete;
    Taken& operator=(const Taken&) = delete;

  private:
    Pinned session_;
    Session::LongLock lock_;
    ecx_contextt& context_;
    std::uint16_t slave_;
    bool pdi_had_it_;
};

constexpr std::uint16_t offset(std::uint16_t address, int by) { return static_cast<std::uint16_t>(address + by); }

bool has_slave(ecx_contextt* context, std::uint16_t slave) {
    const Pinned session = session_of(context);
    return session != nullptr && is_slave(*context, *session, slave);
}

bool answers(ecx_contextt& context, Session& session, std::uint16_t slave) {
    std::array<std::byte, 1> octet{};
    return read_registers(session, slaves_of(context)[slave].configadr, ECT_REG_TYPE, octet, us(EC_TIMEOUTRET3)) == 1;
}

// One SyncManager of the category.
void fill_sm(Sii& sii, std::uint16_t at, ec_eepromSMt& sm) {
    sm.PhStart = sii.word(at);
    sm.Plength = sii.word(offset(at, 2));
    sm.Creg = sii.octet(offset(at, 4));
    sm.Sreg = sii.octet(offset(at, 5));
    sm.Activate = sii.octet(offset(at, 6));
    sm.PDIctrl = sii.octet(offset(at, 7));
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

uint8 ecx_siigetbyte(ecx_contextt* context, uint16 slave, uint16 address) {
    const Pinned session = session_of(*context);
    if (session == nullptr || !is_slave(*context, *session, slave) || address >= EC_MAXEEPBUF) return 0xFF;
    const auto lock = session->lock_eeproms();
    std::uint8_t* const octets = sii_octets(*context);
    std::uint32_t* const known = sii_known(*context);
    if (context->esislave != slave) {
        std::fill_n(known, EC_MAXEEPBITMAP, 0U);
        context->esislave = slave;
    }
    const auto is_known = [&](unsigned n) { return (known[n / 32] >> (n % 32) & 1U) != 0; };
    if (is_known(address)) return octets[address];
    const unsigned first = address & ~3U;
    // Frames may be lost, and the caller cannot tell 0xFF from contents.
    constexpr int kMostTries = 3;
    auto read = read_sii(*context, slave, static_cast<std::uint16_t>(first / 2));
    for (int n = 1; n < kMostTries && !read && answers(*context, *session, slave); ++n)
        read = read_sii(*context, slave, static_cast<std::uint16_t>(first / 2));
    if (!read) return 0xFF;
    const auto words = static_cast<std::uint32_t>(*read);
    std::memcpy(octets + first, &words, sizeof(words));
    for (unsigned n = first; n < first + 4; ++n) known[n / 32] |= 1U << (n % 32);
    return octets[address];
}

int16 ecx_siifind(ecx_contextt* context, uint16 slave, uint16 cat) {
    if (!has_slave(context, slave)) return 0;
    const Taken taken(*context, slave);
    Sii sii(*context, slave);
    for (unsigned at = kCategories; at + 4 <= EC_MAXEEPBUF;) {
        const std::uint16_t type = sii.word(static_cast<std::uint16_t>(at));
        if (type == kEndMark) return 0;
        if (type == cat) return static_cast<int16>(at + 2);
        at += 4 + 2U * sii.word(static_cast<std::uint16_t>(at + 2));
    }
    return 0;
}

void ecx_siistring(ecx_contextt* context, char* str, uint16 slave, uint16 Sn) {
    if (!has_slave(context, slave)) return;
    const Taken taken(*context, slave);
    const int16 category = ecx_siifind(context, slave, ECT_SII_STRING);
    if (category <= 0) return;
    Sii sii(*context, slave);
    auto at = static_cast<std::uint16_t>(category + 2);
    const unsigned count = sii.octet(at++);
    str[0] = '\0';
    if (Sn == 0 || Sn > count) return;
    for (unsigned n = 1; n <= Sn; ++n) {
        const unsigned length = sii.octet(at++);
        if (n < Sn) {
            at = offset(at, static_cast<int>(length));
            continue;
        }
        const unsigned kept = std::min<unsigned>(length, EC_MAXNAME);
        for (unsigned i = 0; i < kept; ++i) str[i] = static_cast<char>(sii.octet(offset(at, static_cast<int>(i))));
        str[kept] = '\0';
    }
}

uint16 ecx_siiFMMU(ecx_contextt* context, uint16 slave, ec_eepromFMMUt* FMMU) {
    *FMMU = {};
    if (!has_slave(context, slave)) return 0;
    const Taken taken(*context, slave);
    const int16 category = ecx_siifind(context, slave, ECT_SII_FMMU);
    if (category <= 0) return 0;
    Sii sii(*context, slave);
    const auto at = static_cast<std::uint16_t>(category);
    FMMU->Startpos = at;
    FMMU->nFMMU = static_cast<uint8>(sii.word(at) * 2);
    FMMU->FMMU0 = sii.octet(offset(at, 2));
    FMMU->FMMU1 = sii.octet(offset(at, 3));
    if (FMMU->nFMMU > 2) FMMU->FMMU2 = sii.octet(offset(at, 4));
    if (FMMU->nFMMU > 3) FMMU->FMMU3 = sii.octet(offset(at, 5));
    return FMMU->nFMMU;
}

uint16 ecx_siiSM(ecx_contextt* context, uint16 slave, ec_eepromSMt* SM) {
    *SM = {};
    if (!has_slave(context, slave)) return 0;
    const Taken taken(*context, slave);
    const int16 category = ecx_siifind(context, slave, ECT_SII_SM);
    if (category <= 0) return 0;
    Sii sii(*context, slave);
    SM->Startpos = static_cast<uint16>(category);
    SM->nSM = static_cast<uint8>(sii.word(SM->Startpos) / 4);
    fill_sm(sii, offset(SM->Startpos, 2), *SM);
    return SM->nSM;
}

uint16 ecx_siiSMnext(ecx_contextt* context, uint16 slave, ec_eepromSMt* SM, uint16 n) {
    if (!has_slave(context, slave) || n >= SM->nSM) return 0;
    const Taken taken(*context, slave);
    Sii sii(*context, slave);
    fill_sm(sii, offset(SM->Startpos, 2 + n * 8), *SM);
    return 1;
}

PdoBits ecx_siiPDO(ecx_contextt* context, uint16 slave, ec_eepromPDOt* PDO, uint8 t) {
    *PDO = {};
    if (!has_slave(context, slave) || t > 1) return 0;
    const Taken taken(*context, slave);
    const int16 category = ecx_siifind(context, slave, static_cast<uint16>(ECT_SII_PDO + t));
    if (category <= 0) return 0;
    Sii sii(*context, slave);
    auto at = static_cast<std::uint16_t>(category);
    PDO->Startpos = at;
    PDO->Length = sii.word(at);
    at = offset(at, 2);
    const unsigned end = at + PDO->Length * 2U;
    unsigned total = 0;
    while (at + 8U <= end && PDO->nPDO + 1 < EC_MAXEEPDO) {
        const std::uint16_t n = ++PDO->nPDO;  // the first has the index 1
        PDO->Index[n] = sii.word(at);
        const unsigned entries = sii.octet(offset(at, 2));
        PDO->SyncM[n] = sii.octet(offset(at, 3));
        at = offset(at, 8);
        for (unsigned entry = 0; entry < entries && at + 8U <= end; ++entry, at = offset(at, 8))
            PDO->BitSize[n] = static_cast<uint16>(PDO->BitSize[n] + sii.octet(offset(at, 5)));
        if (PDO->SyncM[n] < EC_MAXSM) {  // other values mean no SyncManager
            PDO->SMbitsize[PDO->SyncM[n]] = static_cast<uint16>(PDO->SMbitsize[PDO->SyncM[n]] + PDO->BitSize[n]);
            total += PDO->BitSize[n];
        }
    }
    return static_cast<PdoBits>(total);
}

void ecx_esidump(ecx_contextt* context, uint16 slave, uint8* esibuf) {
    if (!has_slave(context, slave)) return;
    const Taken taken(*context, slave);
    Sii sii(*context, slave);
    unsigned header = kCategories;  // of the next category
    for (unsigned at = 0; at + 2 <= EC_MAXEEPBUF; at += 2) {
        const std::uint16_t word = sii.word(static_cast<std::uint16_t>(at));
        std::memcpy(esibuf + at, &word, sizeof(word));
        if (at != header) continue;
        if (word == kEndMark) return;
        header += 4 + 2U * sii.word(static_cast<std::uint16_t>(at + 2));
    }
}

}  // extern "C"
