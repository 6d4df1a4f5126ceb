#include "mailbox/coe_information.hpp"

#include "mailbox/coe_sdo.hpp"

#include <algorithm>

namespace margay {

namespace coe = wire::coe;
using coe::InfoLayout;
using coe::InfoOpcode;

namespace {

constexpr std::size_t kPayload = coe::kInfoHeaderBytes;
constexpr std::size_t kObjectHead = coe::kObjectResponseBytes - kPayload;
constexpr std::size_t kEntryHead = coe::kEntryResponseBytes - kPayload;
constexpr std::uint32_t kMostObjects = 0x10000;  // all indices
// Octets of one description; a longer description ends the query with an error.
constexpr std::size_t kMostDescription = 4096;

template <std::size_t N>
std::uint8_t copy_name(Bytes from, std::array<char, N>& name) {
    const auto end = std::ranges::find(from, std::byte{0});  // some slaves end the name with a zero
    const auto bytes = std::min<std::size_t>(N, static_cast<std::size_t>(end - from.begin()));
    std::ranges::transform(from.first(bytes), name.begin(), [](std::byte b) { return static_cast<char>(b); });
    return static_cast<std::uint8_t>(bytes);
}

}  // namespace

void InfoQuery::fail(Errc code, std::size_t expected, std::size_t actual) {
    over_ = true;
    error_.code = code;
    error_.expected = static_cast<std::uint32_t>(expected);
    error_.actual = static_cast<std::uint32_t>(actual);
}

std::size_t InfoQuery::compose(MutableBytes data) {
    if (data.size() < coe::kEntryRequestBytes) return 0;
    std::ranges::fill(data.first(coe::kEntryRequestBytes), std::byte{0});
    coe::store_header(data, {0, coe::Service::sdo_information});
    InfoLayout::opcode::store(data, static_cast<std::uint8_t>(request_));
    return kPayload + compose_request(data.subspan(kPayload));
}

MailClient::Taken InfoQuery::accept(const wire::MailboxMessage& mail) {
    if (!is_ours(mail.data)) return Taken::no;
    if (!over_) return Taken::more;
    const bool last = mail.data.size() < kPayload || (InfoLayout::opcode::load(mail.data) & coe::kInfoIncomplete) == 0;
    return last ? Taken::all : Taken::broken;
}

bool InfoQuery::is_ours(Bytes data) {
    if (over_ || data.size() < coe::kHeaderBytes) return false;
    if (coe::load_header(data).service != coe::Service::sdo_information) return false;
    if (data.size() < kPayload) {
        fail(Errc::protocol, kPayload, data.size());
        return true;
    }
    const auto octet = InfoLayout::opcode::load(data);
    const bool last = (octet & coe::kInfoIncomplete) == 0;
    const auto opcode = static_cast<InfoOpcode>(octet & 0x7F);
    if (opcode == InfoOpcode::error) {
        if (data.size() < coe::kInfoErrorBytes) {
            fail(Errc::protocol, coe::kInfoErrorBytes, data.size());
        } else {
            fail(Errc::sdo_abort);
            error_.detail = static_cast<std::uint32_t>(InfoLayout::abort::load(data));
        }
        return true;
    }
    if (opcode != response_) return false;
    const auto payload = data.subspan(kPayload);
    if (begun_ && payload.empty() && !last) {  // the answer would never end
        fail(Errc::protocol);
        return true;
    }
    if (!read_fragment(payload, !begun_, last)) return false;
    begun_ = true;
    over_ = over_ || last;
    return true;
}

// ------------------------------------------------------------------ lists

std::size_t ObjectListQuery::compose_request(MutableBytes data) const {
    store_le<std::uint16_t>(data, 0, static_cast<std::uint16_t>(list_));
    return coe::kListRequestBytes - kPayload;
}

bool ObjectListQuery::read_fragment(Bytes payload, bool first, bool) {
    if (first) {
        if (payload.size() < sizeof(std::uint16_t) ||
            load_le<std::uint16_t>(payload) != static_cast<std::uint16_t>(list_))
            return false;
        payload = payload.subspan(sizeof(std::uint16_t));
    }
    std::array<std::uint16_t, 32> some{};
    while (payload.size() >= sizeof(std::uint16_t)) {
        const std::size_t n = std::min(some.size(), payload.size() / sizeof(std::uint16_t));
        for (std::size_t i = 0; i < n; ++i) some[i] = load_le<std::uint16_t>(payload, 2 * i);
        payload = payload.subspan(n * sizeof(std::uint16_t));
        const std::size_t known = std::min<std::size_t>(n, count_ - std::min(count_, came_));
        came_ += static_cast<std::uint32_t>(n);
        count_ = std::max(count_, came_);
        if (count_ > kMostObjects) {
            fail(Errc::protocol, kMostObjects, count_);
            return true;
        }
        if (found_ != nullptr && known < n) found_(std::span<const std::uint16_t>(some).first(n).subspan(known), user_);
    }
    return true;
}

// ------------------------------------------------------------------ descriptions

bool DescriptionQuery::read_fragment(Bytes payload, bool first, bool last) {
    if (first && !matches(payload)) return false;
    const std::size_t kept = std::min(payload.size(), all_.size() - kept_);
    std::ranges::copy(payload.first(kept), all_.begin() + static_cast<std::ptrdiff_t>(kept_));
    kept_ += kept;
    came_ += payload.size();
    if (came_ > kMostDescription)
        fail(Errc::protocol, kMostDescription, came_);
    else if (last)
        decode(Bytes(all_).first(kept_));
    return true;
}

std::size_t ObjectQuery::compose_request(MutableBytes data) const {
    store_le<std::uint16_t>(data, 0, index_);
    return coe::kObjectRequestBytes - kPayload;
}

bool ObjectQuery::matches(Bytes first) const { return first.size() >= 2 && load_le<std::uint16_t>(first) == index_; }

void ObjectQuery::decode(Bytes all) {
    if (all.size() < kObjectHead) return fail(Errc::protocol, kObjectHead, all.size());
    description = {.index = index_,
                   .data_type = load_le<std::uint16_t>(all, InfoLayout::data_type::offset - kPayload),
                   .max_subindex = load_le<std::uint8_t>(all, InfoLayout::max_subindex::offset - kPayload),
                   .object_code = load_le<std::uint8_t>(all, InfoLayout::object_code::offset - kPayload)};
    description.name_bytes = copy_name(all.subspan(kObjectHead), description.name_text);
}

std::size_t EntryQuery::compose_request(MutableBytes data) const {
    store_le<std::uint16_t>(data, 0, index_);
    store_le<std::uint8_t>(data, 2, subindex_);
    const unsigned wanted =
        coe::value_info::kUnit | coe::value_info::kDefault | coe::value_info::kMinimum | coe::value_info::kMaximum;
    store_le<std::uint8_t>(data, 3, static_cast<std::uint8_t>(with_values_ ? wanted : 0U));
    return coe::kEntryRequestBytes - kPayload;
}

bool EntryQuery::matches(Bytes first) const {
    return first.size() >= 3 && load_le<std::uint16_t>(first) == index_ && load_le<std::uint8_t>(first, 2) == subindex_;
}

void EntryQuery::decode(Bytes all) {
    if (all.size() < kEntryHead) return fail(Errc::protocol, kEntryHead, all.size());
    EntryDescription& d = description;
    d.index = index_;
    d.subindex = subindex_;
    d.data_type = load_le<std::uint16_t>(all, InfoLayout::entry_data_type::offset - kPayload);
    d.bit_length = load_le<std::uint16_t>(all, InfoLayout::entry_bit_length::offset - kPayload);
    d.access = load_le<std::uint16_t>(all, InfoLayout::entry_access::offset - kPayload);
    const auto contents = load_le<std::uint8_t>(all, InfoLayout::entry_value_info::offset - kPayload);
    auto rest = all.subspan(kEntryHead);
    if ((contents & coe::value_info::kUnit) != 0) {
        if (rest.size() < sizeof d.unit) return fail(Errc::protocol, sizeof d.unit, rest.size());
        d.unit = load_le<std::uint32_t>(rest);
        rest = rest.subspan(sizeof d.unit);
    }
    const std::size_t bytes = (d.bit_length + std::size_t{7}) / 8;
    const auto value = [&](std::uint8_t bit, EntryDescription::Value& to) {
        if ((contents & bit) == 0) return;
        const std::size_t there = std::min(bytes, rest.size());
        if (bytes <= to.octets.size() && there == bytes) {
            std::ranges::copy(rest.first(bytes), to.octets.begin());
            to.bytes = static_cast<std::uint8_t>(bytes);
        }
        rest = rest.subspan(there);
    };
    value(coe::value_info::kDefault, d.default_value);
    value(coe::value_info::kMinimum, d.minimum);
    value(coe::value_info::kMaximum, d.maximum);
    d.name_bytes = copy_name(rest, d.name_text);
}

// ------------------------------------------------------------------ over the bus

Task<Result<>> ask_information(MailboxChannel& channel, InfoQuery& query, SdoObject about,
                               const MailPatience& patience) {
    const auto complete = [&](Error error) {
        error.slave = channel.station().number;
        error.step = Step::sdo_information;
        error.index = about.index;
        error.subindex = about.subindex;
        return error;
    };
    MailSession session(channel, wire::MailboxType::coe, patience.priority, patience.give_up);
    const Error refused = co_await session;
    if (refused.code != Errc::none) co_return complete(refused);
    if (channel.send_room() < coe::kEntryRequestBytes) co_return complete({.code = Errc::unsupported});
    // An error of SDO information does not contain the object.
    constexpr auto key = mail_key::of(mail_key::Kind::sdo_information);
    Error failed{.code = Errc::reply_lost};
    for (unsigned n = 0; failed.code == Errc::reply_lost && n <= kMostAskedAgain; ++n) {
        if (channel.is_doubtful(key))
            co_await required(settle_owed(channel, session, key, patience, Step::sdo_information));
        if (n != 0) query.restart();
        MailExchange exchange(session, query,
                              {.patience = patience, .key = key, .mails = MailExchange::kManyMails, .in_parts = true});
        failed = co_await exchange;
    }
    if (failed.code != Errc::none) co_return complete(failed);
    if (query.error().code != Errc::none) co_return complete(query.error());
    co_return Nothing{};
}

}  // namespace margay
