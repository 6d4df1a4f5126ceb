#include "subdevice/foe_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace foe = wire::foe;
using foe::Layout;
using foe::Opcode;
using wire::MailboxErrorCode;

void FoeServer::start(AlState state, const MailboxRoom& room) {
    end();
    state_ = state;
    receive_bytes_ = room.receive_bytes > foe::kHeaderBytes ? room.receive_bytes - foe::kHeaderBytes : 0;
}

void FoeServer::state_changed(AlState state) {
    if (state != state_) end();
    state_ = state;
}

void FoeServer::end() {
    if (transfer_ != Transfer::none) store_.give_up();
    transfer_ = Transfer::none;
    written_ = false;
}

std::optional<MailboxErrorCode> FoeServer::receive(const wire::MailboxMessage& message, Outbox& out, Time now) {
    const auto data = message.data;
    if (data.size() < foe::kHeaderBytes) return MailboxErrorCode::size_too_short;
    if (out.open().size() <= foe::kHeaderBytes) return MailboxErrorCode::no_more_memory;
    address_ = message.header.address;
    const auto body = data.subspan(foe::kHeaderBytes);
    switch (Layout::opcode::load(data)) {
        case Opcode::read: open(false, data, out, now); break;
        case Opcode::write: open(true, data, out, now); break;
        case Opcode::data: arrived(Layout::packet_number::load(data), body, out, now); break;
        case Opcode::acknowledge: acknowledged(Layout::packet_number::load(data), out, now); break;
        case Opcode::busy:  // the client cannot accept the packet yet, so the server sends it again
            if (transfer_ != Transfer::read) {
                fail(FoeError::illegal, out);
            } else {
                send_data(out, now);
            }
            break;
        case Opcode::error: end(); break;
        default: fail(FoeError::illegal, out);
    }
    return std::nullopt;
}

bool FoeServer::is_request_of_transfer(std::string_view name, std::uint32_t password) const {
    return password == password_ && name == std::string_view(name_.data(), name_bytes_);
}

void FoeServer::open(bool write, Bytes data, Outbox& out, Time now) {
    std::array<char, kNameBytes> name{};
    const auto body = data.subspan(foe::kHeaderBytes);
    const auto terminator = std::find(body.begin(), body.end(), std::byte{0});  // some clients send a terminating zero
    const auto length = std::min(static_cast<std::size_t>(terminator - body.begin()), kNameBytes + 1);
    std::transform(body.begin(), body.begin() + static_cast<std::ptrdiff_t>(std::min(length, kNameBytes)), name.begin(),
                   [](std::byte b) { return static_cast<char>(b); });
    const auto password = Layout::password::load(data);
    // A client repeats its request while the store is busy with the file or its first packet (ETG.1000.6 "FoE busy").
    const bool same = length <= kNameBytes && is_request_of_transfer({name.data(), length}, password);
    if (same && !write && transfer_ == Transfer::read && packet_ == 1 && !sent_) return send_data(out, now);
    const auto opening = write ? Transfer::opening_to_write : Transfer::opening_to_read;
    if (!same || transfer_ != opening) end();
    if (length > kNameBytes) return fail(FoeError::not_found, out);
    transfer_ = Transfer::none;  // give_up() is not called for a file that the store has not opened
    name_ = name;
    name_bytes_ = static_cast<std::uint8_t>(length);
    password_ = password;
    const FoeFile file{{name.data(), length}, password, state_};
    const auto answer = write ? store_.open_to_write(file, now) : store_.open_to_read(file, now);
    if (answer.is_busy()) transfer_ = opening;
    if (!answer.goes()) return refuse(answer, out);  // after "busy" the client sends the request again
    transfer_ = write ? Transfer::write : Transfer::read;
    offset_ = last_bytes_ = 0;
    last_ = finishing_ = sent_ = false;
    packet_ = write ? 0 : 1;
    if (write) {
        send_acknowledge(out);
    } else {
        send_data(out, now);
    }
}

// ------------------------------------------------------------------ read

// Sends packet_; also used to repeat it.
void FoeServer::send_data(Outbox& out, Time now) {
    const auto at = out.open();
    const auto room = at.subspan(foe::kHeaderBytes);
    std::size_t bytes = 0;
    const auto answer = store_.read(offset_, room, bytes, now);
    sent_ = answer.goes();
    if (!answer.goes()) return refuse(answer, out);
    Layout::opcode::store(at, Opcode::data);
    at[1] = std::byte{0};
    Layout::packet_number::store(at, packet_);
    last_bytes_ = std::min(bytes, room.size());
    last_ = last_bytes_ < room.size();
    commit(out, foe::kHeaderBytes + last_bytes_);
}

void FoeServer::acknowledged(std::uint32_t packet, Outbox& out, Time now) {
    if (transfer_ != Transfer::read) return fail(FoeError::illegal, out);
    // The store was busy at the last try, or the packet was lost and the client has sent its acknowledgement again.
    if (packet + 1 == packet_) return send_data(out, now);
    if (!sent_ || packet != packet_) return fail(FoeError::wrong_packet_number, out);
    if (last_) {
        transfer_ = Transfer::none;
        return;
    }
    offset_ += last_bytes_;
    ++packet_;
    send_data(out, now);
}

// ------------------------------------------------------------------ write

void FoeServer::arrived(std::uint32_t packet, Bytes data, Outbox& out, Time now) {
    const bool again = packet == packet_ && packet != 0 && !finishing_;  // our acknowledge was lost
    if (again && (transfer_ == Transfer::write || written_)) return send_acknowledge(out);
    if (transfer_ != Transfer::write) return fail(FoeError::illegal, out);
    if (packet != packet_ + 1) return fail(FoeError::wrong_packet_number, out);
    if (!finishing_) {
        const auto answer = store_.write(offset_, data, now);
        if (!answer.goes()) return refuse(answer, out);
        offset_ += data.size();
        finishing_ = data.size() < receive_bytes_;
    }
    if (finishing_) {
        const auto answer = store_.finish_write(offset_, now);
        if (!answer.goes()) return refuse(answer, out);
        transfer_ = Transfer::none;
        finishing_ = false;
        written_ = true;
    }
    packet_ = packet;
    send_acknowledge(out);
}

void FoeServer::send_acknowledge(Outbox& out) {
    const auto at = out.open();
    Layout::opcode::store(at, Opcode::acknowledge);
    at[1] = std::byte{0};
    Layout::packet_number::store(at, packet_);
    commit(out, foe::kHeaderBytes);
}

void FoeServer::refuse(const FoeAnswer& answer, Outbox& out) {
    const auto at = out.open();
    auto text = answer.text();
    at[1] = std::byte{0};
    if (answer.is_busy()) {
        Layout::opcode::store(at, Opcode::busy);
        Layout::done::store(at, answer.done());
        Layout::entire::store(at, answer.entire());
    } else {
        end();
        if (text.empty() && texts_ != nullptr) text = texts_(answer.code());
        Layout::opcode::store(at, Opcode::error);
        Layout::error_code::store(at, answer.code());
    }
    text = text.substr(0, at.size() - foe::kHeaderBytes);
    std::transform(text.begin(), text.end(), at.begin() + foe::kHeaderBytes,
                   [](char c) { return static_cast<std::byte>(c); });
    commit(out, foe::kHeaderBytes + text.size());
}

}  // namespace margay::subdevice
