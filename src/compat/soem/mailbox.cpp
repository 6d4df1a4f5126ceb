// Mailbox messages of the program itself.
#include "compat/soem/mail.hpp"

#include <margay/mailbox_places.hpp>

#include <cstring>

namespace margay::soem {
namespace {

// Checks for mail that no request waits for, as long as the object exists.
class Watch {
  public:
    explicit Watch(Session& session) : session_(session) { session_.begin_watch(); }
    ~Watch() { session_.end_watch(); }
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

  private:
    Session& session_;
};

void put_letter(ecx_contextt& context, Session& session, const Letter& letter, ec_mbxbuft& into) {
    const auto station = value_of(context, session, letter.slave, &ec_slavet::configadr);
    put_letter(letter, station, value_of(context, session, letter.slave, &ec_slavet::mbx_cnt), into);
}

// Whether the hook has processed the fragment.
bool eaten(ecx_contextt& context, Session& session, const Letter& letter) {
    const auto hook = hook_at(context.EOEhook).load();
    if (hook == nullptr || letter.type != MailboxType::eoe) return false;
    ec_mbxbuft buffer{};
    put_letter(context, session, letter, buffer);
    return hook(&context, letter.slave, &buffer) > 0;
}

bool are_same(const MailboxInfo& one, const MailboxInfo& other) {
    return one.out_start == other.out_start && one.out_bytes == other.out_bytes && one.in_start == other.in_start &&
           one.in_bytes == other.in_bytes;
}

}  // namespace

// A program that has set the mailboxes of one state alone leaves the other mailboxes as the SII describes them.
void take_mailboxes(ecx_contextt& context, Session& session, std::uint16_t number, AlState state) {
    const Session::Guard guard(session);
    const ec_slavet& s = slaves_of(context)[number];
    const MailboxInfo written{.out_start = s.mbx_wo, .out_bytes = s.mbx_l, .in_start = s.mbx_ro, .in_bytes = s.mbx_rl};
    if (!written.present()) return;
    const Slave& slave = session.slave(number);
    if (are_same(written, slave.mailbox) || are_same(written, slave.boot_mailbox)) return;
    const auto placed = place_mailboxes(session.context(), number, state, written);
    if (placed) return;
    std::array<char, 400> text{};
    say_once("the mailboxes that the program has written are not used: " + std::string(describe(placed.error(), text)));
}

void put_letter(const Letter& letter, std::uint16_t station, std::uint8_t counter, ec_mbxbuft& into) {
    auto* const octets = reinterpret_cast<std::byte*>(into);
    const std::size_t size = std::min(letter.data.size(), sizeof(ec_mbxbuft) - kMailHeader);
    put_word(octets, static_cast<unsigned>(size));
    put_word(octets + 2, station);
    octets[4] = std::byte{0};
    octets[5] = static_cast<std::byte>(static_cast<unsigned>(letter.type) | (counter & 7U) << 4);
    std::memcpy(octets + kMailHeader, letter.data.data(), size);
}

std::optional<Letter> await_letter(ecx_contextt& context, Session& session, std::uint16_t slave,
                                   std::optional<MailboxType> type, Duration timeout) {
    const Watch watch(session);
    const Time until = later(session.now(), timeout);
    for (bool last = false;;) {
        for (;;) {
            std::optional<Letter> letter;
            {
                const Session::Guard guard(session);
                letter = session.inbox().take(slave, type);
            }
            if (!letter) break;
            if (!eaten(context, session, *letter)) return letter;
        }
        push_unasked(context, slave);
        if (last || session.closing()) return std::nullopt;
        last = session.now() >= until;
        session.pause(std::chrono::milliseconds(1));
    }
}

void serve_eoe_hook(ecx_contextt& context, Session& session) {
    if (hook_at(context.EOEhook) == nullptr) return;
    for (int n = 0; n < 64; ++n) {
        std::optional<Letter> letter;
        {
            const Session::Guard guard(session);
            letter = session.inbox().take_any(MailboxType::eoe);
        }
        if (!letter) return;
        static_cast<void>(eaten(context, session, *letter));
    }
}

int send_mail(Session& session, std::uint16_t slave, const ec_mbxbuft& mail, Duration timeout) {
    const auto* const octets = reinterpret_cast<const std::byte*>(mail);
    const std::size_t size = word_at(octets);
    if (size == 0 || size + kMailHeader > sizeof(ec_mbxbuft)) return 0;
    RawMail request;
    request.slave = slave;
    request.type = static_cast<MailboxType>(std::to_integer<unsigned>(octets[5]) & 0xFU);
    request.message = std::span<const std::byte>(octets + kMailHeader, size);
    request.address = 0;
    request.timeout = std::max(timeout, Duration(std::chrono::milliseconds(1)));
    return session.run(request) ? 1 : 0;
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

uint8 ec_nextmbxcnt(uint8 cnt) { return static_cast<uint8>(cnt >= 7 ? 1 : cnt + 1); }

void ec_clearmbx(ec_mbxbuft* Mbx) { std::memset(Mbx, 0, sizeof(ec_mbxbuft)); }

int ecx_mbxempty(ecx_contextt* context, uint16 slave, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    const std::uint16_t station = value_of(*context, *session, slave, &ec_slavet::configadr);
    const margay::Time until = margay::later(session->now(), us(timeout));
    for (;;) {
        std::array<std::byte, 1> status{};
        const int wkc = read_registers(*session, station, ECT_REG_SM0STAT, status, us(EC_TIMEOUTRET));
        if (wkc > 0 && (status[0] & std::byte{0x08}) == std::byte{0}) return 1;
        if (session->now() >= until || session->closing()) return 0;
        session->pause(std::chrono::microseconds(200));
    }
}

#ifdef EC_VER1

int ecx_mbxsend(ecx_contextt* context, uint16 slave, ec_mbxbuft* mbx, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) ||
        value_of(*context, *session, slave, &ec_slavet::mbx_l) == 0)
        return 0;
    return send_mail(*session, slave, *mbx, us(timeout));
}

int ecx_mbxreceive(ecx_contextt* context, uint16 slave, ec_mbxbuft* mbx, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) ||
        value_of(*context, *session, slave, &ec_slavet::mbx_rl) == 0)
        return 0;
    const auto letter = await_letter(*context, *session, slave, std::nullopt, us(timeout));
    if (!letter) return 0;
    put_letter(*context, *session, *letter, *mbx);
    return 1;
}

#else

int ecx_mbxsend(ecx_contextt* context, uint16 slave, ec_mbxbuft* mbx, int timeout) {
    const Pinned session = session_of(context);
    const bool usable = session != nullptr && is_slave(*context, *session, slave) &&
                        value_of(*context, *session, slave, &ec_slavet::mbx_l) != 0;
    const int sent = usable ? send_mail(*session, slave, *mbx, us(timeout)) : 0;
    ecx_dropmbx(context, mbx);  // the library owns the buffer from this call on
    return sent;
}

int ecx_mbxreceive(ecx_contextt* context, uint16 slave, ec_mbxbuft** mbx, int timeout) {
    *mbx = nullptr;
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) ||
        value_of(*context, *session, slave, &ec_slavet::mbx_rl) == 0)
        return 0;
    ec_mbxbuft* const buffer = ecx_getmbx(context);
    if (buffer == nullptr) return 0;  // mail waits until the program returns a buffer
    const auto letter = await_letter(*context, *session, slave, std::nullopt, us(timeout));
    if (!letter) {
        ecx_dropmbx(context, buffer);
        return 0;
    }
    put_letter(*context, *session, *letter, *buffer);
    *mbx = buffer;
    return 1;
}

int ecx_mbxhandler(ecx_contextt* context, uint8, int) {
    const Pinned session = session_of(context);
    if (session == nullptr) return 0;
    if (hook_at(context->EOEhook) != nullptr) session->watch_always();
    session->poll_now();
    serve_eoe_hook(*context, *session);
    const int slaves = slaves_found(*context, *session);
    for (uint16 n = 1; n <= slaves; ++n)
        if (value_of(*context, *session, n, &ec_slavet::mbxhandlerstate) == ECT_MBXH_CYCLIC) push_unasked(*context, n);
    return 0;
}

#endif

}  // extern "C"
