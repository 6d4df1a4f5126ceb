#include "subdevice/mailbox.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"

#include <algorithm>
#include <utility>

namespace margay::subdevice {

namespace reg = wire::reg;
using wire::MailboxErrorCode;
using wire::MailboxHeader;
using wire::MailboxType;
using Layout = wire::SyncManagerLayout;

namespace {
constexpr Duration kPollEvery = std::chrono::milliseconds(1);  // used when the sync managers raise no event
}

bool Mailbox::fits() {
    const auto fit = [this](const wire::SyncManager& setting) {
        constexpr auto kShortest = wire::kMailboxHeaderBytes + wire::kMailboxErrorBytes;
        return setting.length_bytes >= kShortest && setting.length_bytes <= rx_.size();
    };
    receive_ = read_sync_manager(esc_, 0);
    send_ = read_sync_manager(esc_, 1);
    return fit(receive_) && fit(send_);
}

void Mailbox::start(AlState state) {
    forget();
    state_ = state;
    // Acknowledges a repeat toggle of an earlier master; there is no reply to repeat yet. The master may have changed
    // the sizes since fits().
    watch_repeat();
    running_ = !lost_;
    if (lost_) return;
    const MailboxRoom room{receive_.length_bytes - wire::kMailboxHeaderBytes,
                           send_.length_bytes - wire::kMailboxHeaderBytes};
    for (const auto& line : protocols_)
        if (serves(line)) line.server->start(state, room);
}

void Mailbox::stop() {
    for (const auto& line : protocols_)
        if (serves(line)) line.server->stop();
    forget();
    running_ = false;
}

void Mailbox::state_changed(AlState state) {
    for (const auto& line : protocols_)
        if (serves(line)) line.server->state_changed(state);
}

void Mailbox::forget() {
    first_ = kept_ = boxed_ = queued_ = received_bytes_ = parked_bytes_ = 0;
    last_received_ = last_sent_ = 0;
    lost_ = repeated_ = looks_ = false;  // the present step reads no further message
}

Time Mailbox::step(Time now, std::uint32_t events) {
    if (!running_) return kNever;
    const auto came = [&](unsigned sync_manager) {
        return silent_ || (events & wire::al_event::sync_manager(sync_manager)) != 0;
    };
    // A master that switches SM1 off and on again empties it without an event of SM1.
    const bool changed = (events & wire::al_event::kSmActivation) != 0;
    if (came(1) || changed || std::exchange(repeated_, false)) watch_fetched();
    looks_ = came(0);
    if (changed) watch_repeat();
    if (lost_) return kNever;  // Device brings the state machine to INIT
    Time next = kNever;
    std::size_t passes = 0;
    do {
        // The last free slot is for the reply to a request: servers that send without a request would use it all the
        // time.
        if (used() + 1 == slots_) (void)fetch();
        deliver(now);
        next = kNever;
        for (const auto& line : protocols_)
            if (serves(line)) next = std::min(next, line.server->step(*this, now));
        put_next();
        // The bound: a mailbox that the master is enlarging meanwhile stays full when its old octets are read. The
        // next step notices the change.
    } while (++passes <= slots_ && fetch());
    return silent_ ? std::min(next, now + kPollEvery) : next;
}

std::uint8_t Mailbox::status(unsigned sync_manager) {
    return read_register<std::uint8_t>(
        esc_, static_cast<std::uint16_t>(reg::sync_manager(sync_manager).address + Layout::status::offset));
}

// When SM1 is empty again, the master has read the reply. The reply is kept for a repeat.
void Mailbox::watch_fetched() {
    if (boxed_ == 0 || (status(1) & wire::sm_status::kMailboxFull) != 0) return;
    if (kept_ != 0) {
        // The slot of the reply kept so far becomes the last free slot.
        if (parked_bytes_ != 0) std::copy_n(slot(slots_ - 1).begin(), parked_bytes_, slot(0).begin());
        first_ = (first_ + 1) % slots_;
    }
    kept_ = 1;
    boxed_ = 0;
}

// The master toggles the repeat request when a reply was lost. The reply that the master read last is written into SM1
// again, before a reply that may already wait there. Then the repeat acknowledge is set to the value of the request.
// A SyncManager with another place or size is lost: the messages in it are no messages of this mailbox.
void Mailbox::watch_repeat() {
    std::array<std::byte, 2 * reg::kSyncManagerStride> octets{};  // SM0 and SM1
    read_memory(esc_, reg::sync_manager(0).address, octets);
    const auto receive = wire::load_sync_manager(octets);
    const auto send = wire::load_sync_manager(Bytes(octets).subspan(reg::kSyncManagerStride));
    const auto activate = send.activate;
    const auto pdi_control = std::to_integer<std::uint8_t>(octets.back());
    const auto same = [](const wire::SyncManager& a, const wire::SyncManager& b) {
        return a.enabled() && a.physical_start == b.physical_start && a.length_bytes == b.length_bytes;
    };
    lost_ = !same(receive, receive_) || !same(send, send_);
    if (lost_) return;
    silent_ = (receive.control & send.control & wire::sm_control::kPdiInterrupt) == 0;
    const bool request = (activate & wire::sm_activate::kRepeatRequest) != 0;
    const bool acknowledged = (pdi_control & wire::sm_pdi_control::kRepeatAcknowledge) != 0;
    if (request == acknowledged) return;

    const auto address = static_cast<std::uint16_t>(reg::sync_manager(1).address + Layout::pdi_control::offset);
    const auto acknowledge = request ? wire::sm_pdi_control::kRepeatAcknowledge : std::uint8_t{0};
    if (kept_ != 0) {
        if (boxed_ != 0)  // deactivating and activating SM1 empties it
            write_register(esc_, address,
                           static_cast<std::uint8_t>((pdi_control & ~1u) | wire::sm_pdi_control::kDeactivate));
        if (boxed_ != 0) write_register(esc_, address, static_cast<std::uint8_t>(pdi_control & ~1u));
        queued_ += kept_ + boxed_;
        kept_ = boxed_ = 0;
        ++counters_.repeats;
        put_next();
        repeated_ = true;
    }
    write_register(esc_, address, acknowledge);
}

void Mailbox::put_next() {
    if (boxed_ != 0 || queued_ == 0) return;
    const auto message = slot(kept_);
    const auto bytes = wire::kMailboxHeaderBytes + wire::load_mailbox_header(message).length;
    write_memory(esc_, send_.physical_start, message.first(bytes));
    if (bytes < send_.length_bytes)  // a write to the last octet marks the mailbox as full
        write_register(esc_, static_cast<std::uint16_t>(send_.physical_start + send_.length_bytes - 1),
                       std::uint8_t{0});
    boxed_ = 1;
    --queued_;
    ++counters_.sent;
}

// Reads a message from SM0 when there is one and when a slot for its reply is free. Returns true when it has read one.
// The event of SM0 stays active until its message is read, so without the event there is none to look for.
bool Mailbox::fetch() {
    if (!looks_ || received_bytes_ != 0 || full() || (status(0) & wire::sm_status::kMailboxFull) == 0) return false;
    const std::size_t size = receive_.length_bytes;
    read_memory(esc_, receive_.physical_start, rx_.first(wire::kMailboxHeaderBytes));
    const auto announced = wire::kMailboxHeaderBytes + wire::load_mailbox_header(rx_).length;
    const auto bytes = std::min(size, announced);
    if (bytes > wire::kMailboxHeaderBytes)
        read_memory(esc_, static_cast<std::uint16_t>(receive_.physical_start + wire::kMailboxHeaderBytes),
                    rx_.subspan(wire::kMailboxHeaderBytes, bytes - wire::kMailboxHeaderBytes));
    if (bytes < size)  // a read of the last octet marks the mailbox as empty
        (void)read_register<std::uint8_t>(esc_, static_cast<std::uint16_t>(receive_.physical_start + size - 1));
    received_bytes_ = bytes;
    ++counters_.received;
    return true;
}

std::uint32_t Mailbox::events() const {
    const bool takes = !running_ || (received_bytes_ == 0 && !full());
    return (takes ? wire::al_event::sync_manager(0) : 0) | (boxed_ != 0 ? wire::al_event::sync_manager(1) : 0);
}

// The parked message was received before the message in rx_.
void Mailbox::deliver(Time now) {
    if (parked_bytes_ != 0 && used() + 1 < slots_) {
        const auto message = slot(slots_ - 1).first(parked_bytes_);
        auto* const server = server_of(wire::load_mailbox_header(message).type);
        if (!server->busy()) {
            pass_on(message, server, now);
            parked_bytes_ = 0;
        }
    }
    if (received_bytes_ != 0) dispatch(now);
}

void Mailbox::dispatch(Time now) {
    if (full()) return;  // no slot for a reply: the message waits in rx_
    const auto header = wire::load_mailbox_header(rx_);
    // A master that did not see that its write arrived sends the message again with the same counter.
    const bool repeated = header.counter != 0 && header.counter == last_received_;
    const auto message = wire::load_mailbox_message(rx_.first(received_bytes_));
    auto* const server = message && header.channel == 0 && !message->data.empty() ? server_of(header.type) : nullptr;
    if (!repeated && server != nullptr) {
        const bool behind = parked_bytes_ != 0 && wire::load_mailbox_header(slot(slots_ - 1)).type == header.type;
        if (server->busy() && !behind) return park();
        if (behind) return;
    }
    const auto bytes = std::exchange(received_bytes_, std::size_t{0});
    if (repeated) {
        ++counters_.duplicates;
        return;
    }
    last_received_ = header.counter;
    pass_on(rx_.first(bytes), server, now);
}

// Copies the message into the last free slot when another slot stays free for replies.
void Mailbox::park() {
    if (parked_bytes_ != 0 || used() + 2 > slots_) return;
    parked_bytes_ = std::exchange(received_bytes_, std::size_t{0});
    std::copy_n(rx_.begin(), parked_bytes_, slot(slots_ - 1).begin());
    last_received_ = wire::load_mailbox_header(rx_).counter;
}

// `server` is nullptr when the message has an error.
void Mailbox::pass_on(MutableBytes bytes, MailboxServer* server, Time now) {
    const auto header = wire::load_mailbox_header(bytes);
    const auto message = wire::load_mailbox_message(bytes);
    if (!message) return reply_error(MailboxErrorCode::invalid_size, bytes);
    if (header.type == MailboxType::error) return;  // an error message gets no reply
    if (header.channel != 0) return reply_error(MailboxErrorCode::invalid_channel, bytes);
    if (server == nullptr)
        return reply_error(server_of(header.type) == nullptr ? MailboxErrorCode::unsupported_protocol
                                                             : MailboxErrorCode::size_too_short,
                           bytes);
    if (const auto error = server->receive(*message, *this, now)) reply_error(*error, bytes);
}

void Mailbox::reply_error(MailboxErrorCode code, Bytes request) {
    const auto data = open();
    if (data.empty()) return;
    wire::MailboxErrorLayout::type::store(data, wire::kMailboxErrorTypeCommand);
    wire::MailboxErrorLayout::detail::store(data, code);
    commit(MailboxType::error, wire::kMailboxErrorBytes, wire::load_mailbox_header(request).address);
    ++counters_.errors;
}

MailboxServer* Mailbox::server_of(MailboxType type) const {
    for (const auto& line : protocols_)
        if (line.type == type && serves(line)) return line.server;
    return nullptr;
}

// The mailbox may have ended during the call of a server, because a hook of the author called Device::fall_back(). The
// server finds a slot for its reply nevertheless, and commit() drops the reply.
MutableBytes Mailbox::open() {
    if (full()) return {};
    return slot(used()).subspan(wire::kMailboxHeaderBytes, send_.length_bytes - wire::kMailboxHeaderBytes);
}

void Mailbox::commit(MailboxType type, std::size_t bytes, std::uint16_t address) {
    if (!running_) return;
    last_sent_ = wire::next_mailbox_counter(last_sent_);
    wire::store_mailbox_header(
        slot(used()),
        {.length = static_cast<std::uint16_t>(bytes), .address = address, .type = type, .counter = last_sent_});
    ++queued_;
}

}  // namespace margay::subdevice
