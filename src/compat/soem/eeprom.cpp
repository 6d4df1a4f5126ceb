#include "compat/soem/eeprom.hpp"

namespace margay::soem {
namespace {

constexpr Duration kFrame = std::chrono::microseconds(EC_TIMEOUTRET3);
constexpr Duration kLook = std::chrono::microseconds(200);
constexpr int kAttempts = EC_DEFAULTRETRIES;  // at least, whatever the timeout is

}  // namespace

bool Eeprom::get(std::uint16_t reg, std::span<std::byte> data) {
    const auto command = by_position_ ? DatagramCommand::aprd : DatagramCommand::fprd;
    return session_.exchange(command, address_of(address_, reg), data, kFrame) > 0;
}

// Sent once: a command that comes a second time while the EEPROM is busy is an error.
bool Eeprom::put(std::uint16_t reg, std::span<std::byte> data) {
    const auto command = by_position_ ? DatagramCommand::apwr : DatagramCommand::fpwr;
    return session_.exchange(command, address_of(address_, reg), data, kFrame, false) > 0;
}

bool Eeprom::wait_ready(std::uint16_t& status, Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (;;) {
        std::array<std::byte, 2> octets{};
        const bool read = get(ECT_REG_EEPSTAT, octets);
        status = read ? word_at(octets.data()) : std::uint16_t{0};
        if (read && (status & EC_ESTAT_BUSY) == 0) return true;
        if (session_.now() >= until) return false;
        session_.pause(kLook);
    }
}

bool Eeprom::command(std::uint16_t command, std::uint16_t word) {
    std::array<std::byte, 6> octets{};
    put_word(octets.data(), command);
    put_word(octets.data() + 2, word);
    return put(ECT_REG_EEPCTL, octets);
}

bool Eeprom::begin_read(std::uint16_t word, Duration timeout) {
    for (int attempt = 0; attempt < kAttempts; ++attempt) {  // a frame with a command may be lost
        std::uint16_t status = 0;
        if (!wait_ready(status, timeout)) return false;
        if ((status & EC_ESTAT_EMASK) != 0 && !command(EC_ECMD_NOP, 0)) continue;  // clears old errors
        if (command(EC_ECMD_READ, word)) return true;
    }
    return false;
}

// The ESC keeps the address of the last command. So the call that repeats a command need not be the call that gave it.
void Eeprom::repeat_read() {
    std::array<std::byte, 2> octets{};
    if (!get(ECT_REG_EEPADR, octets)) return;
    const std::uint16_t word = word_at(octets.data());
    static_cast<void>(command(EC_ECMD_NOP, word) && command(EC_ECMD_READ, word));
}

// An EEPROM acknowledges no command while it stores the word before, for some milliseconds, and the ESC is not busy
// meanwhile.
std::optional<std::uint64_t> Eeprom::end_read(Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (int attempt = 0; attempt < kAttempts || session_.now() < until; ++attempt) {
        std::uint16_t status = 0;
        if (!wait_ready(status, timeout)) return std::nullopt;
        if ((status & EC_ESTAT_NACK) != 0) {
            session_.pause(kLook * 5);
            repeat_read();
            continue;
        }
        std::array<std::byte, 8> octets{};
        const std::size_t size = (status & EC_ESTAT_R64) != 0 ? 8 : 4;
        if (!get(ECT_REG_EEPDAT, std::span(octets).first(size))) return std::nullopt;
        std::uint64_t value = 0;
        std::memcpy(&value, octets.data(), sizeof(value));  // in the order of the wire
        return value;
    }
    return std::nullopt;
}

std::optional<std::uint64_t> Eeprom::read(std::uint16_t word, Duration timeout) {
    if (!begin_read(word, timeout)) return std::nullopt;
    return end_read(timeout);
}

bool Eeprom::write(std::uint16_t word, std::uint16_t value, Duration timeout) {
    const Time until = later(session_.now(), timeout);
    for (int attempt = 0; attempt < kAttempts || session_.now() < until; ++attempt) {
        std::uint16_t status = 0;
        if (!wait_ready(status, timeout)) return false;
        if ((status & EC_ESTAT_EMASK) != 0 && !command(EC_ECMD_NOP, 0)) continue;
        std::array<std::byte, 2> data{};
        std::memcpy(data.data(), &value, sizeof(value));
        if (!put(ECT_REG_EEPDAT, data) || !command(EC_ECMD_WRITE, word)) continue;  // a frame may be lost
        if (!wait_ready(status, timeout)) return false;
        if ((status & EC_ESTAT_EMASK) == 0) return true;
        session_.pause(kLook * 5);  // no acknowledgement: once more
    }
    return false;
}

namespace {

Eeprom eeprom_of(ecx_contextt& context, Session& session, std::uint16_t number) {
    return {session, slaves_of(context)[number].configadr, false};
}

// Gives the interface of the EEPROM to the master or to the processor of the slave.
int assign(ecx_contextt& context, std::uint16_t number, bool to_pdi) {
    const Pinned session = session_of(context);
    if (session == nullptr || number >= most_slaves(context)) return 0;
    ec_slavet& slave = slaves_of(context)[number];
    if ((slave.eep_pdi != 0) == to_pdi) return 1;
    int wkc = 0;
    std::array<std::byte, 1> value{};
    if (!to_pdi) {  // takes it away from a processor that does not give it back
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
    ecx_eeprom2master(context, slave);
    eeprom_of(*context, *session, slave).begin_read(eeproma, us(EC_TIMEOUTEEP));
}

uint32 ecx_readeeprom2(ecx_contextt* context, uint16 slave, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
    const auto read = eeprom_of(*context, *session, slave).end_read(us(timeout));
    return read ? static_cast<uint32>(*read) : 0;
}

uint32 ecx_readeeprom(ecx_contextt* context, uint16 slave, uint16 eeproma, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
    ecx_eeprom2master(context, slave);
    const auto read = eeprom_of(*context, *session, slave).read(eeproma, us(timeout));
    return read ? static_cast<uint32>(*read) : 0;
}

int ecx_writeeeprom(ecx_contextt* context, uint16 slave, uint16 eeproma, uint16 data, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return 0;
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
