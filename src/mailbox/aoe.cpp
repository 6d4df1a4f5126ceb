#include "mailbox/aoe.hpp"

#include <algorithm>
#include <chrono>

namespace margay {

namespace aoe = wire::aoe;

std::size_t AoeClient::compose(MutableBytes data) {
    const std::size_t bytes = call_.head_bytes + call_.data.size();
    if (data.size() < aoe::kHeaderBytes + bytes) return 0;
    aoe::store_header(data, {.target = call_.target,
                             .source = call_.source,
                             .command = call_.command,
                             .data_bytes = static_cast<std::uint32_t>(bytes),
                             .invoke_id = invoke_id_});
    const auto head = data.subspan(aoe::kHeaderBytes);
    std::copy_n(call_.head.begin(), call_.head_bytes, head.begin());
    std::ranges::copy(call_.data, head.begin() + call_.head_bytes);
    return aoe::kHeaderBytes + bytes;
}

MailClient::Taken AoeClient::accept(const wire::MailboxMessage& mail) {
    if (mail.data.size() < aoe::kHeaderBytes) return Taken::no;
    const auto header = aoe::load_header(mail.data);
    const bool response = (header.flags & aoe::state_flag::kResponse) != 0;
    if (!response || header.command != call_.command || header.invoke_id != invoke_id_) return Taken::no;
    const auto data = mail.data.subspan(aoe::kHeaderBytes);
    if (header.error_code != 0)
        error_ = refusal(Errc::aoe_error, header.error_code);
    else if (header.data_bytes > data.size())
        error_ = {
            .code = Errc::protocol, .expected = header.data_bytes, .actual = static_cast<std::uint32_t>(data.size())};
    else
        error_ = take(data.first(header.data_bytes));
    return Taken::all;
}

// The error of a command with index group and index offset contains both.
Error AoeClient::refusal(Errc code, std::uint32_t detail) const {
    Error error{.code = code, .detail = detail};
    if (call_.head_bytes >= aoe::kIndexBytes) {
        error.expected = aoe::IndexLayout::group::load(call_.head);
        error.actual = aoe::IndexLayout::offset::load(call_.head);
    }
    return error;
}

Error AoeClient::take(Bytes response) {
    if (response.size() < aoe::kResultBytes) return {.code = Errc::protocol};
    if (const auto result = load_le<std::uint32_t>(response); result != 0) return refusal(Errc::aoe_result, result);
    Bytes octets = response.subspan(aoe::kResultBytes);
    if (call_.counted) {
        if (octets.size() < sizeof(std::uint32_t)) return {.code = Errc::protocol};
        const auto announced = load_le<std::uint32_t>(octets);
        octets = octets.subspan(sizeof(std::uint32_t));
        if (announced > octets.size()) return {.code = Errc::protocol};
        octets = octets.first(announced);
    } else if (octets.size() < call_.into.size()) {
        return {.code = Errc::protocol};
    } else {
        octets = octets.first(call_.into.size());
    }
    bytes_ = octets.size();
    std::ranges::copy(octets.first(std::min(octets.size(), call_.into.size())), call_.into.begin());
    if (bytes_ <= call_.into.size()) return {};
    return {.code = Errc::capacity,
            .expected = static_cast<std::uint32_t>(bytes_),
            .actual = static_cast<std::uint32_t>(call_.into.size())};
}

namespace {

bool only_reads(aoe::Command command) {
    return command == aoe::Command::read || command == aoe::Command::read_state ||
           command == aoe::Command::read_device_info;
}

}  // namespace

std::uint32_t aoe_invoke_id(Time now) {
    return 0x8000'0000U | static_cast<std::uint32_t>(now.time_since_epoch() / std::chrono::microseconds(1));
}

Task<Result<std::size_t>> aoe_call(MailboxChannel& channel, const AoeCall& call, std::uint32_t invoke_id,
                                   const MailPatience& patience) {
    AoeClient client(call, invoke_id);
    Error failed;
    for (unsigned left = only_reads(call.command) ? kMostAskedAgain + 1 : 1; left > 0; --left) {
        MailExchange exchange(channel, wire::MailboxType::aoe, client, {.patience = patience});
        failed = co_await exchange;
        if (failed.code != Errc::reply_lost) break;
    }
    if (failed.code == Errc::none) failed = client.error();
    if (failed.code == Errc::none) co_return client.bytes();
    failed.slave = channel.station().number;
    failed.step = call.step;
    co_return failed;
}

}  // namespace margay
