#include "gateway/frame.hpp"

#include <algorithm>

namespace margay::gateway {

std::optional<std::size_t> frame_bytes(Bytes from) {
    if (from.size() < wire::kFrameHeaderBytes) return 0;
    const auto header = wire::load_frame_header(from);
    if (header.type != kFrameTypeMailbox || header.length < wire::kMailboxHeaderBytes) return std::nullopt;
    return wire::kFrameHeaderBytes + header.length;
}

std::vector<Mail> messages_of(Bytes frame) {
    std::vector<Mail> all;
    auto left = frame.subspan(std::min(frame.size(), wire::kFrameHeaderBytes));
    while (left.size() >= wire::kMailboxHeaderBytes) {
        Mail mail{.header = wire::load_mailbox_header(left)};
        left = left.subspan(wire::kMailboxHeaderBytes);
        mail.complete = mail.header.length <= left.size();
        const auto data = left.first(std::min<std::size_t>(mail.header.length, left.size()));
        mail.data.assign(data.begin(), data.end());
        left = left.subspan(data.size());
        all.push_back(std::move(mail));
    }
    return all;
}

Octets frame_of(wire::MailboxHeader header, Bytes data) {
    data = data.first(std::min(data.size(), kMostDataBytes));
    Octets frame(wire::kFrameHeaderBytes + wire::kMailboxHeaderBytes + data.size());
    header.length = static_cast<std::uint16_t>(data.size());
    wire::store_frame_header(frame, {.length = static_cast<std::uint16_t>(frame.size() - wire::kFrameHeaderBytes),
                                     .type = kFrameTypeMailbox});
    const auto at = MutableBytes(frame).subspan(wire::kFrameHeaderBytes);
    wire::store_mailbox_header(at, header);
    std::ranges::copy(data, at.begin() + wire::kMailboxHeaderBytes);
    return frame;
}

}  // namespace margay::gateway
