// The list of errors, and the texts of errors.
#include "compat/soem/mail.hpp"

#include "wire/al_status_code.hpp"
#include "wire/mailbox.hpp"

#include <pthread.h>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <set>
#include <string>

namespace margay::soem {
namespace {

// Several threads add entries, and a thread of the program takes them.
std::mutex ring_mutex;

std::int64_t wall_clock_ns() {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return static_cast<std::int64_t>(now.tv_sec) * 1000000000 + now.tv_nsec;
}

void add(ecx_contextt& context, const ec_errort& entry) {
    const std::lock_guard<std::mutex> guard(ring_mutex);
    ec_eringt& ring = error_ring(context);
    ring.Error[ring.head] = entry;
    ring.Error[ring.head].Signal = TRUE;
    ring.head = static_cast<int16>(ring.head >= EC_MAXELIST ? 0 : ring.head + 1);
    if (ring.head == ring.tail) ring.tail = static_cast<int16>(ring.tail >= EC_MAXELIST ? 0 : ring.tail + 1);
    error_flag(context) = TRUE;
}

// A text of a table, which is never freed. The interface returns pointers to non-const characters.
char* kept(std::string_view text) {
    static std::mutex mutex;
    static auto* const texts = new std::set<std::string, std::less<>>;  // threads may use it while the process ends
    const std::lock_guard<std::mutex> guard(mutex);
    auto found = texts->find(text);
    if (found == texts->end()) found = texts->emplace(text).first;
    return const_cast<char*>(found->c_str());
}

struct Places {
    std::size_t next;
    std::array<std::array<char, 256>, 16> texts;
};

// The texts of the calling thread: until it ends, for the main thread until the process has ended. They are not
// variables of the thread: glibc has little memory for these in a shared object that a program loads while it runs.
Places& places_of_thread() {
    static const pthread_key_t key = [] {
        pthread_key_t made{};
        pthread_key_create(&made, std::free);  // no code of a plugin, which may be unloaded before the thread ends
        return made;
    }();
    auto* places = static_cast<Places*>(pthread_getspecific(key));
    if (places == nullptr) {
        places = static_cast<Places*>(std::calloc(1, sizeof(Places)));
        if (places == nullptr) std::abort();
        pthread_setspecific(key, places);
    }
    return *places;
}

// A text with numbers. It is valid until the same thread has requested 15 more texts.
char* kept_for_now(std::string_view text) {
    Places& places = places_of_thread();
    std::array<char, 256>& place = places.texts[places.next++ % places.texts.size()];
    const std::size_t size = std::min(text.size(), place.size() - 1);
    std::copy_n(text.data(), size, place.data());
    place[size] = '\0';
    return place.data();
}

std::string text_of(const ec_errort& e) {
    char line[200];
    int type = 0;  // the program may have written any value
    static_assert(sizeof(type) == sizeof(e.Etype));
    std::memcpy(&type, &e.Etype, sizeof(type));
    switch (type) {
        case EC_ERR_TYPE_SDO_ERROR:
        case EC_ERR_TYPE_SDOINFO_ERROR: {
            const auto text = sdo_abort_text(static_cast<std::uint32_t>(e.AbortCode));
            std::snprintf(line, sizeof(line), "SDO slave:%d index:%4.4x.%2.2x error:%8.8x %.*s\n", e.Slave, e.Index,
                          e.SubIdx, static_cast<unsigned>(e.AbortCode), static_cast<int>(text.size()), text.data());
            return line;
        }
        case EC_ERR_TYPE_EMERGENCY:
            std::snprintf(line, sizeof(line), "EMERGENCY slave:%d error:%4.4x register:%2.2x\n", e.Slave, e.ErrorCode,
                          e.ErrorReg);
            return line;
        case EC_ERR_TYPE_MBX_ERROR: {
            const auto text = wire::to_text(static_cast<wire::MailboxErrorCode>(e.ErrorCode));
            std::snprintf(line, sizeof(line), "MBX slave:%d error:%4.4x %.*s\n", e.Slave, e.ErrorCode,
                          static_cast<int>(text.size()), text.data());
            return line;
        }
        case EC_ERR_TYPE_SOE_ERROR: {
            const auto text = soe_error_text(e.ErrorCode);
            std::snprintf(line, sizeof(line), "SoE slave:%d IDN:%4.4x error:%4.4x %.*s\n", e.Slave, e.Index,
                          e.ErrorCode, static_cast<int>(text.size()), text.data());
            return line;
        }
        case EC_ERR_TYPE_PACKET_ERROR:
            std::snprintf(line, sizeof(line), "PACKET slave:%d index:%4.4x.%2.2x error:%d\n", e.Slave, e.Index,
                          e.SubIdx, e.ErrorCode);
            return line;
        default:
            std::snprintf(line, sizeof(line), "slave:%d index:%4.4x.%2.2x type:%d error:%8.8x\n", e.Slave, e.Index,
                          e.SubIdx, type, static_cast<unsigned>(e.AbortCode));
            return line;
    }
}

bool has_mailbox(ecx_contextt& context, std::uint16_t slave) {
    const Pinned session = session_of(context);
    return session != nullptr && value_of(context, *session, slave, &ec_slavet::mbx_l) != 0;
}

}  // namespace

void push(ecx_contextt& context, ec_errort& entry) {
    set_time(entry.Time, wall_clock_ns());
    add(context, entry);
}

int mail_result(ecx_contextt& context, std::uint16_t slave, const Error& error, std::uint16_t index,
                std::uint8_t subindex) {
    push_unasked(context, slave);
    if (error.code == Errc::none) return 1;
    ec_errort entry{};
    entry.Slave = slave;
    entry.Index = index;
    entry.SubIdx = subindex;
    switch (error.code) {
        case Errc::sdo_abort:
            entry.Etype = EC_ERR_TYPE_SDO_ERROR;
            entry.AbortCode = static_cast<int32>(error.detail);
            break;
        case Errc::mailbox_error:
            entry.Etype = EC_ERR_TYPE_MBX_ERROR;
            entry.ErrorCode = static_cast<uint16>(error.detail);
            break;
        // The library does not send the request: the error is the reply of a slave without the service.
        case Errc::unsupported:
            if (!has_mailbox(context, slave)) return 0;
            entry.Etype = EC_ERR_TYPE_MBX_ERROR;
            entry.ErrorCode = static_cast<uint16>(wire::MailboxErrorCode::unsupported_protocol);
            break;
        case Errc::soe_error:
            entry.Etype = EC_ERR_TYPE_SOE_ERROR;
            entry.ErrorCode = static_cast<uint16>(error.detail);
            break;
        case Errc::capacity:
        case Errc::wrong_size:
            entry.Etype = EC_ERR_TYPE_PACKET_ERROR;
            entry.ErrorCode = 3;  // the buffer of the program is too small
            break;
        case Errc::protocol:
            entry.Etype = EC_ERR_TYPE_PACKET_ERROR;
            entry.ErrorCode = 1;  // unexpected reply
            break;
        default: return 0;  // no reply in time
    }
    push(context, entry);
    return 0;
}

namespace {

// The code of a mailbox error.
std::uint16_t code_of(const Letter& letter) {
    constexpr std::size_t kCode = 2;  // behind the type of the reply
    return letter.data.size() < kCode + 2 ? std::uint16_t{0} : word_at(&letter.data[kCode]);
}

// A message that the slave has sent by itself, or as a reply to a message of the program.
struct Unasked {
    std::optional<Letter> error;
    std::optional<Emergency> emergency;
};
Unasked take_unasked(Session& session, std::uint16_t slave) {
    const Session::Guard guard(session);
    Unasked one{.error = session.inbox().take(slave, MailboxType::error), .emergency = {}};
    if (!one.error) one.emergency = emergencies(session.context(), slave).take();
    return one;
}

}  // namespace

void push_unasked(ecx_contextt& context, std::uint16_t slave) {
    const Pinned session = session_of(context);
    if (session == nullptr) return;
    for (;;) {
        const Unasked one = take_unasked(*session, slave);
        ec_errort entry{};
        entry.Slave = slave;
        if (one.error) {
            entry.Etype = EC_ERR_TYPE_MBX_ERROR;
            entry.ErrorCode = code_of(*one.error);
        } else if (one.emergency) {
            const auto octet = [&](std::size_t n) { return std::to_integer<unsigned>(one.emergency->data[n]); };
            entry.Etype = EC_ERR_TYPE_EMERGENCY;
            entry.ErrorCode = one.emergency->code;
            entry.ErrorReg = one.emergency->error_register;
            entry.b1 = static_cast<uint8>(octet(0));
            entry.w1 = static_cast<uint16>(octet(1) | octet(2) << 8);
            entry.w2 = static_cast<uint16>(octet(3) | octet(4) << 8);
        } else {
            return;
        }
        push(context, entry);
    }
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

void ecx_pusherror(ecx_contextt* context, const ec_errort* Ec) { add(*context, *Ec); }

boolean ecx_poperror(ecx_contextt* context, ec_errort* Ec) {
    const std::lock_guard<std::mutex> guard(ring_mutex);
    ec_eringt& ring = error_ring(*context);
    const bool any = ring.head != ring.tail;
    if (any) {
        *Ec = ring.Error[ring.tail];
        ring.Error[ring.tail].Signal = FALSE;
        ring.tail = static_cast<int16>(ring.tail >= EC_MAXELIST ? 0 : ring.tail + 1);
    } else {
        error_flag(*context) = FALSE;
    }
    return any ? TRUE : FALSE;
}

boolean ecx_iserror(ecx_contextt* context) {
    const std::lock_guard<std::mutex> guard(ring_mutex);
    return error_ring(*context).head != error_ring(*context).tail ? TRUE : FALSE;
}

void ecx_packeterror(ecx_contextt* context, uint16 Slave, uint16 Index, uint8 SubIdx, uint16 ErrorCode) {
    ec_errort entry{};
    entry.Slave = Slave;
    entry.Index = Index;
    entry.SubIdx = SubIdx;
    entry.Etype = EC_ERR_TYPE_PACKET_ERROR;
    entry.ErrorCode = ErrorCode;
    push(*context, entry);
}

void ecx_SDOerror(ecx_contextt* context, uint16 Slave, uint16 Index, uint8 SubIdx, int32 AbortCode) {
    ec_errort entry{};
    entry.Slave = Slave;
    entry.Index = Index;
    entry.SubIdx = SubIdx;
    entry.Etype = EC_ERR_TYPE_SDO_ERROR;
    entry.AbortCode = AbortCode;
    push(*context, entry);
}

SdoText ec_sdoerror2string(uint32 sdoerrorcode) { return kept(margay::sdo_abort_text(sdoerrorcode)); }

char* ec_ALstatuscode2string(uint16 ALstatuscode) { return kept(margay::wire::al_status_text(ALstatuscode)); }

char* ec_soeerror2string(uint16 errorcode) { return kept(margay::soe_error_text(errorcode)); }

char* ec_mbxerror2string(uint16 errorcode) {
    return kept(margay::wire::to_text(static_cast<margay::wire::MailboxErrorCode>(errorcode)));
}

char* ecx_err2string(const ec_errort Ec) { return kept_for_now(text_of(Ec)); }

char* ecx_elist2string(ecx_contextt* context) {
    ec_errort entry{};
    return ecx_poperror(context, &entry) != FALSE ? kept_for_now(text_of(entry)) : kept({});
}

}  // extern "C"
