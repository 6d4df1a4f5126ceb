#include "analyse/sent_mail.hpp"

#include "wire/esc.hpp"

#include <algorithm>
#include <utility>

namespace margay::analyse {
namespace {

using wire::Command;

constexpr std::size_t kMostReceivers = 4096;
constexpr std::size_t kMostForOne = 8;  // messages of one slave

bool writes_memory(const wire::DatagramHeader& header) {
    return (header.command == Command::FPWR || header.command == Command::APWR) &&
           header.address.ado() >= wire::reg::kProcessRam;
}

}  // namespace

SentMail::Key SentMail::key_of(const wire::DatagramHeader& header) {
    return {header.command == Command::APWR || header.command == Command::APRD, header.address.adp()};
}

void SentMail::note(const Exchanged& request) {
    if (!writes_memory(request.header)) return;
    const Key key = key_of(request.header);
    if (messages_.size() >= kMostReceivers && !messages_.contains(key)) messages_.clear();
    auto& messages = messages_[key];
    messages.push_back({request.sent_at, request.header.address.ado(), {request.sent.begin(), request.sent.end()}});
    if (messages.size() > kMostForOne) messages.pop_front();
}

void SentMail::came_back(const Exchanged& reply) {
    if (!reply.answered || !writes_memory(reply.header)) return;
    const auto found = messages_.find(key_of(reply.header));
    if (found == messages_.end()) return;
    std::erase_if(found->second, [&](const SentMessage& message) { return message.when.frame == reply.sent_at.frame; });
}

std::deque<SentMessage> SentMail::take(const wire::DatagramHeader& header, Moment before) {
    const auto found = messages_.find(key_of(header));
    if (found == messages_.end()) return {};
    auto& messages = found->second;
    const auto later =
        std::ranges::find_if_not(messages, [&](const SentMessage& one) { return one.when.is_before(before); });
    std::deque<SentMessage> taken(std::make_move_iterator(messages.begin()), std::make_move_iterator(later));
    messages.erase(messages.begin(), later);
    return taken;
}

}  // namespace margay::analyse
