#include "compat/soem/eeprom.hpp"

namespace margay::soem {
namespace {

constexpr Duration kFrame = std::chrono::microseconds(EC_TIMEOUTRET3);
constexpr Duration kLook = std::chrono::microseconds(200);
constexpr Duration kRefused = std::chrono::milliseconds(1);  // after a command without acknowledgement
constexpr int kAttempts = EC_DEFAULTRETRIES;                 // the minimum, for each timeout
// No acknowledgement, or not allowed to write. The other errors concern the contents, and no command clears them.
constexpr unsigned kErrors = EC_ESTAT_NACK | 0x4000U;
// The address that clears an error, so that the interface shows the address of a reading only behind its command.
constexpr std::uint16_t kNoWord = 0xFFFF;

}  // namespace

bool Eeprom::look(Look& shown) {
    std::array<std::byte, 14> octets{};  // control, address, data
    const auto read = by_position_ ? DatagramCommand::aprd : DatagramCommand::fprd;
    if (session_.exchange(read, address_of(address_, ECT_REG_EEPSTAT), octets, kFrame) <= 0) return false;
    shown.status = word_at(octets.data());
    shown.word = word_at(octets.data() + 2);
    shown.data = 0;
    std::memcpy(&shown.data, octets.data() + 6, (shown.status & EC_ESTAT_R64) != 0 ? 8 : 4);
    return true;
}

bool Eeprom::wait_ready(Look& shown, Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (;;) {
        const bool answered = look(shown);
        if (answered && (shown.status & EC_ESTAT_BUSY) == 0) return true;
        if (!answered) shown = {};
        if (session_.now() >= until || session_.closing()) return false;
        session_.pause(kLook);
    }
}

bool Eeprom::wait_ready(std::uint16_t& status, Duration timeout) {
    const auto lock = session_.lock_eeproms();
    Look shown;
    const bool ready = wait_ready(shown, timeout);
    status = shown.status;
    return ready;
}

// Sent once, because a second command while the EEPROM is busy is an error. False: it is unknown whether the slave has
// received the command.
bool Eeprom::command(std::uint16_t command, std::uint16_t word, std::uint16_t data) {
    std::array<std::byte, 8> octets{};
    put_word(octets.data(), command);
    put_word(octets.data() + 2, word);
    put_word(octets.data() + 6, data);
    const auto sent = std::span(octets).first(command == EC_ECMD_WRITE ? 8 : 6);
    const auto write = by_position_ ? DatagramCommand::apwr : DatagramCommand::fpwr;
    return session_.exchange(write, address_of(address_, ECT_REG_EEPCTL), sent, kFrame, false) > 0;
}

// Clears the errors of an earlier command. False: the errors remain; the command that clears them may be lost.
bool Eeprom::clear_errors(const Look& shown) { return (shown.status & kErrors) == 0 || command(EC_ECMD_NOP, kNoWord); }

bool Eeprom::begin(std::uint16_t word, Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (int attempt = 0; attempt < kAttempts || session_.now() < until; ++attempt) {  // commands may be lost
        Look shown;
        if (!wait_ready(shown, timeout)) return false;
        if (clear_errors(shown) && command(EC_ECMD_READ, word)) return true;
    }
    return false;
}

// An EEPROM acknowledges no command during the milliseconds in which it stores the previous word, although the ESC is
// not busy. If the address differs, the data was read by the library, or the command was lost.
std::optional<std::uint64_t> Eeprom::end(std::uint16_t word, Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (int attempt = 0; attempt < kAttempts || session_.now() < until; ++attempt) {
        Look shown;
        if (!wait_ready(shown, timeout)) return std::nullopt;
        const bool refused = (shown.status & kErrors) != 0;
        if (!refused && shown.word == word) return shown.data;
        if (refused) session_.pause(kRefused);
        if (clear_errors(shown)) (void)command(EC_ECMD_READ, word);
    }
    return std::nullopt;
}

std::optional<std::uint64_t> Eeprom::read(std::uint16_t word, Duration timeout) {
    const auto lock = session_.lock_eeproms();
    if (!begin(word, timeout)) return std::nullopt;
    return end(word, timeout);
}

void Eeprom::begin_half(std::uint16_t word, Duration timeout) {
    const auto lock = session_.lock_eeproms();
    const Session::Half half{std::this_thread::get_id(), address_};
    session_.half_readings().erase(half);
    if (begin(word, timeout)) session_.half_readings()[half] = word;
}

std::optional<std::uint64_t> Eeprom::end_half(Duration timeout) {
    const auto lock = session_.lock_eeproms();
    const auto begun = session_.half_readings().find({std::this_thread::get_id(), address_});
    if (begun == session_.half_readings().end()) return std::nullopt;
    const std::uint16_t word = begun->second;
    session_.half_readings().erase(begun);
    return end(word, timeout);
}

// Reads the word back: an EEPROM that is protected against writing acknowledges the command and stores nothing.
bool Eeprom::write(std::uint16_t word, std::uint16_t value, Duration timeout) {
    const auto lock = session_.lock_eeproms();
    const std::uint16_t octets = word_at(reinterpret_cast<const std::byte*>(&value));  // in the order of the wire
    const Time until = later(session_.now(), timeout);
    for (int attempt = 0; attempt < kAttempts || session_.now() < until; ++attempt) {
        Look shown;
        if (!wait_ready(shown, timeout)) return false;
        if (!clear_errors(shown) || !command(EC_ECMD_WRITE, word, octets)) continue;  // a frame may be lost
        if (!wait_ready(shown, timeout)) return false;
        if ((shown.status & kErrors) != 0) {  // no acknowledgement: try again
            session_.pause(kRefused);
            continue;
        }
        const auto stored = begin(word, timeout) ? end(word, timeout) : std::nullopt;
        if (stored && std::memcmp(&*stored, &value, sizeof(value)) == 0) return true;
    }
    return false;
}

namespace {

// With the lock of the EEPROMs.
Eeprom eeprom_of(ecx_contextt& context, Session& session, std::uint16_t number) {
    return {session, slaves_of(context)[number].configadr, false};
}

// Gives the interface of the EEPROM to the master or to the processor of the slave.
int assign(ecx_contextt& context, std::uint16_t number, bool to_pdi) {
    const Pinned session = session_of(context);
    if (session == nullptr || number >= most_slaves(context)) return 0;
    const auto lock = session->lock_eeproms();
    ec_slavet& slave = slaves_of(context)[number];
    if ((slave.eep_pdi != 0) == to_pdi) return 1;
    int wkc = 0;
    std::array<std::byte, 1> value{};
    if (!to_pdi) {  // takes it away from a processor that does not release it
        value[0] = std::byte{2};
        write_registers(*session, slave.configadr, ECT_REG_EEPCFG, value, us(EC_TIMEOUTRET3));
    }
    value[0] = to_pdi ? std::byte{1} : std::byte{0};
    wkc = write_registers(*session, slave.configadr, ECT_REG_EEPCFG, value, us(EC_TIMEOUTRET3));
    if (wkc > 0) slave.eep_pdi = to_pdi ? 1 : 0;
    return std::max(wkc, 0);
}

}  // namespace

std::optional<std::uint64_t> read_sii(ecx_contextt& context, std::uint16_t slave, std::uint16_t word) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(context)) return std::nullopt;
    const auto lock = session->lock_eeproms();
    ecx_eeprom2master(&context, slave);
    return eeprom_of(context, *session, slave).read(word, us(EC_TIMEOUTEEP));
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_eeprom2master(ecx_contextt* context, uint16 slave) { return assign(*context, slave, false); }
int ecx_eeprom2pdi(ecx_contextt* context, uint16 slave) { return assign(*context, slave, true); }

void ecx_readeeprom1(ecx_contextt* context, uint16 slave, uint16 eeproma) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return;
    const auto lock = session->lock_eeproms();
    ecx_eeprom2master(context, slave);
    eeprom_of(*context, *session, slave).begin_half(eeproma, us(EC_TIMEOUTEEP));
}

uint32 ecx_readeeprom2(ecx_contextt* context, uint16 slave, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
    const auto lock = session->lock_eeproms();
    const auto read = eeprom_of(*context, *session, slave).end_half(us(timeout));
    return read ? static_cast<uint32>(*read) : 0;
}

uint32 ecx_readeeprom(ecx_contextt* context, uint16 slave, uint16 eeproma, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
    const auto lock = session->lock_eeproms();
    ecx_eeprom2master(context, slave);
    const auto read = eeprom_of(*context, *session, slave).read(eeproma, us(timeout));
    return read ? static_cast<uint32>(*read) : 0;
}

int ecx_writeeeprom(ecx_contextt* context, uint16 slave, uint16 eeproma, uint16 data, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
    const auto lock = session->lock_eeproms();
    ecx_eeprom2master(context, slave);
    return eeprom_of(*context, *session, slave).write(eeproma, data, us(timeout)) ? 1 : 0;
}

uint64 ecx_readeepromAP(ecx_contextt* context, uint16 aiadr, uint16 eeproma, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr) return 0;
    return Eeprom(*session, aiadr, true).read(eeproma, us(timeout)).value_or(0);
}
int ecx_writeeepromAP(ecx_contextt* context, uint16 aiadr, uint16 eeproma, uint16 data, int timeout) {
    const Pinned session = session_of(context);
    return session != nullptr && Eeprom(*session, aiadr, true).write(eeproma, data, us(timeout)) ? 1 : 0;
}
uint64 ecx_readeepromFP(ecx_contextt* context, uint16 configadr, uint16 eeproma, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr) return 0;
    return Eeprom(*session, configadr, false).read(eeproma, us(timeout)).value_or(0);
}
int ecx_writeeepromFP(ecx_contextt* context, uint16 configadr, uint16 eeproma, uint16 data, int timeout) {
    const Pinned session = session_of(context);
    return session != nullptr && Eeprom(*session, configadr, false).write(eeproma, data, us(timeout)) ? 1 : 0;
}

#ifdef EC_VER1
uint16 ecx_eeprom_waitnotbusyAP(ecx_contextt* context, uint16 aiadr, uint16* estat, int timeout) {
    const Pinned session = session_of(context);
    return session != nullptr && Eeprom(*session, aiadr, true).wait_ready(*estat, us(timeout)) ? 1 : 0;
}
uint16 ecx_eeprom_waitnotbusyFP(ecx_contextt* context, uint16 configadr, uint16* estat, int timeout) {
    const Pinned session = session_of(context);
    return session != nullptr && Eeprom(*session, configadr, false).wait_ready(*estat, us(timeout)) ? 1 : 0;
}
#endif

}  // extern "C"
