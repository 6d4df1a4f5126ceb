#include "gateway/mail_job.hpp"

#include <algorithm>
#include <array>

namespace margay::gateway {
namespace {

constexpr std::size_t kRingBytes = 32768;

const MailJob& job_of(const RawMail& request) { return static_cast<const MailJob&>(request); }

}  // namespace

Rooms rooms_of(const SlaveFacts& slave) {
    const auto room = [](std::size_t octets) {
        return octets > wire::kMailboxHeaderBytes ? octets - wire::kMailboxHeaderBytes : 0;
    };
    return {.to_slave = room(slave.out_bytes), .from_slave = room(slave.in_bytes)};
}

// is_answer and more_follows are called in poll().
void MailJob::take(const SlaveFacts& facts, std::size_t ring_bytes) {
    slave = facts.number;
    station = facts.station;
    rooms = rooms_of(facts);
    answer_.resize(kMostDataBytes);
    memory_.resize(ring_bytes);
    ring_.emplace(memory_);
    more_follows = [](const RawMail& request, Bytes octets) {
        const bool more = gateway::more_follows(job_of(request).transaction, octets);
        if (more) job_of(request).keep(octets);
        return more;
    };
}

MailJob::MailJob(const SlaveFacts& facts, Mail message_of_client, const Transaction& t, Client& of)
    : mail(std::move(message_of_client)), transaction(t), client(&of) {
    const bool fragments = t.type == MailboxType::coe || t.type == MailboxType::soe;
    take(facts, fragments && t.kind == Transaction::Kind::answered ? kRingBytes : 0);
    type = t.type;
    message = mail.data;
    if (t.kind != Transaction::Kind::answered) return;
    answer = answer_;
    is_answer = [](const RawMail& request, Bytes octets) { return answers(job_of(request).transaction, octets); };
}

MailJob::MailJob(const SlaveFacts& facts, MailboxType protocol) {
    take(facts, kRingBytes);
    type = protocol;
    transaction = {.kind = Transaction::Kind::listening, .type = protocol};
    answer = answer_;
}

void MailJob::keep(Bytes earlier) const {
    std::array<std::byte, 2> size{};
    store_le(size, 0, static_cast<std::uint16_t>(earlier.size()));
    const bool fits = earlier.size() <= kMostDataBytes && ring_->add(size, earlier);
    if (!fits) lost_.store(true, std::memory_order_release);
}

std::optional<Octets> MailJob::earlier() {
    if (ring_->empty()) return std::nullopt;
    std::array<std::byte, 2> size{};
    ring_->peek(0, size);
    Octets found(load_le<std::uint16_t>(size));
    ring_->peek(size.size(), found);
    ring_->drop(size.size() + found.size());
    return found;
}

}  // namespace margay::gateway
