#include "mailbox/coe_complete.hpp"

#include <algorithm>
#include <array>

namespace margay {
namespace {

namespace coe = wire::coe;

constexpr std::size_t kCountBytes = 2;  // octets of subindex 0 in a complete access

bool is(const Error& error, coe::Abort code) {
    return error.code == Errc::sdo_abort && error.detail == static_cast<std::uint32_t>(code);
}

// Octets of each value in objects whose format is fixed by the standard; 0: another object.
std::size_t element_bytes(std::uint16_t index) {
    const bool mapping = (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
    const bool assignment = index >= 0x1C10 && index < 0x1C30;
    return mapping ? 4 : assignment ? 2 : 0;
}

Error misfit(MailboxChannel& channel, const SdoObject& object, Step step, Errc code, std::size_t expected,
             std::size_t actual) {
    Error error = channel.station().error(code, step, object.index);
    error.subindex = object.subindex;
    error.expected = static_cast<std::uint32_t>(expected);
    error.actual = static_cast<std::uint32_t>(actual);
    return error;
}

// Whether the object is a list of the standard that may be empty: lists of errors, PDOs, SyncManagers and modules.
bool may_be_empty(std::uint16_t index) {
    return index == 0x1003 || (index >= 0x1600 && index < 0x1C30) || (index >= 0xF030 && index < 0xF060);
}

// Whether the mailbox was closed or interrupted since the first of the accesses that form one transfer.
bool is_cut(const MailboxChannel& channel, std::uint32_t epoch) { return channel.epoch() != epoch; }
Error cut_error(MailboxChannel& channel, const SdoObject& object, Step step) {
    return misfit(channel, object, step, channel.cut_by(), 0, 0);
}

Task<Result<std::uint8_t>> read_count(MailboxChannel& channel, std::uint16_t index, const MailPatience& patience) {
    std::array<std::byte, 4> count{};  // the standard has one octet, and some slaves send more
    auto read = co_await sdo_upload_once(channel, {.index = index}, count, patience);
    const bool is_longer = !read && read.error().code == Errc::capacity && read.error().expected != 0;
    if (!read && !is_longer) co_return read.error();
    const auto value = load_le<std::uint32_t>(count);
    // An object without entries has its value at subindex 0, and an empty string has no octets. A 0 of more than one
    // octet is such a value, except in a list that may be empty: a slave that does not announce the size of the count
    // returns 4 octets.
    if (is_longer || value > 255 || (value == 0 && *read != 1 && !may_be_empty(index)))
        co_return misfit(channel, {.index = index}, Step::sdo_upload, Errc::unsupported, 0, 0);
    co_return std::to_integer<std::uint8_t>(count[0]);
}

// Returns how many octets of `left` belong to the value of this subindex; 0: the object has no such subindex.
Task<Result<std::size_t>> value_bytes(MailboxChannel& channel, SdoObject object, std::size_t left,
                                      const MailPatience& patience) {
    if (const std::size_t fixed = element_bytes(object.index); fixed != 0) co_return std::min(fixed, left);
    std::array<std::byte, 8> now{};
    auto read = co_await sdo_upload_once(channel, object, now, patience);
    if (read) co_return *read;
    if (read.error().code == Errc::capacity && read.error().expected != 0)  // otherwise the arena had no memory
        co_return std::size_t{read.error().expected};
    if (is(read.error(), coe::Abort::no_subindex)) co_return std::size_t{0};
    co_return read.error();
}

Task<Result<>> write_values(MailboxChannel& channel, SdoObject object, Bytes value, unsigned count,
                            const MailPatience& patience) {
    std::size_t at = 0;
    const std::uint32_t epoch = channel.epoch();
    for (unsigned n = 1; n <= count && at < value.size(); ++n) {
        const SdoObject one{.index = object.index, .subindex = static_cast<std::uint8_t>(n)};
        if (is_cut(channel, epoch)) co_return cut_error(channel, one, Step::sdo_download);
        const auto bytes = co_await required(value_bytes(channel, one, value.size() - at, patience));
        if (bytes > value.size() - at)
            co_return misfit(channel, one, Step::sdo_download, Errc::wrong_size, bytes, value.size() - at);
        if (bytes == 0) continue;
        if (is_cut(channel, epoch)) co_return cut_error(channel, one, Step::sdo_download);
        co_await required(sdo_download_once(channel, one, value.subspan(at, bytes), patience));
        at += bytes;
    }
    if (at == value.size()) co_return Nothing{};
    co_return misfit(channel, object, Step::sdo_download, Errc::wrong_size, at, value.size());
}

Task<Result<>> write_count(MailboxChannel& channel, std::uint16_t index, std::uint8_t count,
                           const MailPatience& patience) {
    const std::array<std::byte, 1> octet{std::byte{count}};
    auto written = co_await sdo_download_once(channel, {.index = index}, octet, patience);
    if (written || !is(written.error(), coe::Abort::read_only)) co_return written;
    auto has = co_await read_count(channel, index, patience);
    co_return has&&* has == count ? Result<>() : written;
}

}  // namespace

Task<Result<std::size_t>> sdo_upload_singly(MailboxChannel& channel, SdoObject object, MutableBytes into,
                                            const MailPatience& patience) {
    const std::uint32_t epoch = channel.epoch();
    const auto count = co_await required(read_count(channel, object.index, patience));
    std::size_t at = object.subindex == 0 ? kCountBytes : 0;
    if (at > into.size()) co_return misfit(channel, object, Step::sdo_upload, Errc::capacity, at, into.size());
    if (at != 0) store_le<std::uint16_t>(into, 0, count);
    for (unsigned n = 1; n <= count; ++n) {
        const SdoObject one{.index = object.index, .subindex = static_cast<std::uint8_t>(n)};
        if (is_cut(channel, epoch)) co_return cut_error(channel, one, Step::sdo_upload);
        auto read = co_await sdo_upload_once(channel, one, into.subspan(at), patience);
        if (read) at += *read;
        if (read || is(read.error(), coe::Abort::no_subindex)) continue;
        if (read.error().code != Errc::capacity || read.error().expected == 0) co_return read;
        co_return misfit(channel, object, Step::sdo_upload, Errc::capacity, at + read.error().expected, into.size());
    }
    // The object does not have the entries that subindex 0 counts. So subindex 0 is the value of an object without
    // entries.
    if (count != 0 && at == (object.subindex == 0 ? kCountBytes : 0))
        co_return misfit(channel, object, Step::sdo_upload, Errc::unsupported, 0, 0);
    co_return at;
}

Task<Result<>> sdo_download_singly(MailboxChannel& channel, SdoObject object, Bytes value,
                                   const MailPatience& patience) {
    const bool with_count = object.subindex == 0;
    if (with_count && value.size() < kCountBytes)
        co_return misfit(channel, object, Step::sdo_download, Errc::wrong_size, kCountBytes, value.size());
    const std::uint32_t epoch = channel.epoch();
    unsigned count = 255;
    if (with_count) count = std::to_integer<std::uint8_t>(value[0]);
    if (with_count && element_bytes(object.index) != 0) {
        co_await required(write_count(channel, object.index, 0, patience));
    }
    if (is_cut(channel, epoch)) co_return cut_error(channel, object, Step::sdo_download);
    auto written = co_await write_values(channel, object, value.subspan(with_count ? kCountBytes : 0), count, patience);
    if (!written || !with_count) co_return written;
    if (is_cut(channel, epoch)) co_return cut_error(channel, object, Step::sdo_download);
    co_return co_await required(write_count(channel, object.index, static_cast<std::uint8_t>(count), patience));
}

}  // namespace margay
