#include "mailbox/soe_pdo.hpp"

#include <margay/features.hpp>

#include <array>

namespace margay {
namespace {

using wire::soe::ErrorCode;

using namespace wire::soe::idn;
using wire::soe::kConfigurable;
constexpr std::uint32_t kWordBits = 16;
constexpr MailPatience kPatience{};

bool is_refusal(const Error& error) { return error.code == Errc::soe_error || error.code == Errc::mailbox_error; }

// A list of IDNs: read from the drive, or fixed.
struct IdnList {
    static constexpr std::size_t kMost = 64;
    std::array<std::byte, wire::soe::kListHeadBytes + 2 * kMost> octets{};
    std::size_t count = 0;
    [[nodiscard]] Idn at(std::size_t n) const {
        return {load_le<std::uint16_t>(octets, wire::soe::kListHeadBytes + 2 * n)};
    }
    void add(Idn idn) { store_le(octets, wire::soe::kListHeadBytes + 2 * count++, idn.value); }
};

Task<Result<>> read_list(MailboxChannel& channel, SoeTarget target, IdnList& list) {
    const auto read = co_await required(soe_read(channel, target, list.octets, kPatience));
    const std::size_t length = wire::soe::ListLayout::current_bytes::load(list.octets);
    if (read < wire::soe::kListHeadBytes || length > read - wire::soe::kListHeadBytes) {
        Error error = channel.station().error(Errc::protocol, Step::soe_read, target.idn.value);
        error.subindex = target.drive;
        error.expected = static_cast<std::uint32_t>(wire::soe::kListHeadBytes + length);
        error.actual = static_cast<std::uint32_t>(read);
        co_return error;
    }
    list.count = length / 2;
    co_return Nothing{};
}

// Returns the bits of the listed parameters, and of the control word or status word, which comes first and is not
// listed.
Task<Result<std::uint32_t>> listed_bits(MailboxChannel& channel, std::uint8_t drive, const IdnList& list, Idn word,
                                        CheckValue& content) {
    std::uint32_t bits = kWordBits;
    content.add_word(std::uint32_t{drive} << 16 | word.value);
    for (std::size_t n = 0; n < list.count; ++n) {
        if (list.at(n) == word) continue;
        std::array<std::byte, wire::soe::kAttributeBytes> octets{};
        const SoeTarget target{.idn = list.at(n), .drive = drive, .elements = soe_element::kAttribute};
        const auto read = co_await required(soe_read(channel, target, octets, kPatience));
        if (read != octets.size()) co_return soe_wrong_size(channel, target, octets.size(), read);
        const SoeAttribute attribute = soe_attribute(load_le<std::uint32_t>(octets));
        content.add_word(std::uint32_t{attribute.bytes} << 16 | list.at(n).value);
        if (!attribute.list) bits += attribute.bytes * 8U;  // the length of a list cannot be configured
    }
    co_return bits;
}

// Returns the bits of one direction of a drive. The telegram type defines the content; for the configurable telegram
// the drive's list defines it.
Task<Result<std::uint32_t>> direction_bits(MailboxChannel& channel, std::uint8_t drive, unsigned telegram, bool mdt,
                                           CheckValue& content) {
    IdnList list;
    if (telegram == kConfigurable) {
        co_await required(read_list(channel, {.idn = mdt ? kMdtList : kAtList, .drive = drive}, list));
    } else {
        for (const Idn idn : wire::soe::telegram(telegram, mdt))
            if (idn != Idn{}) list.add(idn);
    }
    co_return co_await required(listed_bits(channel, drive, list, mdt ? kControlWord : kStatusWord, content));
}

struct DriveBits {
    bool there = false;
    std::uint32_t outputs = 0;
    std::uint32_t inputs = 0;
};

Task<Result<DriveBits>> drive_bits(MailboxChannel& channel, std::uint8_t drive, CheckValue& content) {
    constexpr std::size_t kTypeBytes = 2;
    std::array<std::byte, 4> octets{};
    const SoeTarget target{.idn = kTelegramType, .drive = drive};
    auto type = co_await soe_read(channel, target, octets, kPatience);
    if (type && *type < kTypeBytes) co_return soe_wrong_size(channel, target, kTypeBytes, *type);
    if (!type && !is_refusal(type.error())) co_return type.error();
    if (!type && type.error().detail == static_cast<std::uint32_t>(ErrorCode::invalid_drive)) co_return DriveBits{};
    // Some drives support only the configurable telegram and have no parameter for the type.
    const unsigned telegram = type ? load_le<std::uint16_t>(octets) & 7U : kConfigurable;
    DriveBits bits{.there = true};
    auto inputs = co_await direction_bits(channel, drive, telegram, false, content);
    if (!inputs && !type && is_refusal(inputs.error())) co_return DriveBits{};
    if (!inputs) co_return inputs.error();
    const auto outputs = co_await required(direction_bits(channel, drive, telegram, true, content));
    bits.inputs = *inputs;
    bits.outputs = outputs;
    co_return bits;
}

// The SyncManager of a direction: by its type in the SII, otherwise the number that the standard gives.
std::uint8_t find_sync_manager(const Slave& slave, SmType type, std::uint8_t otherwise) {
    for (std::uint8_t n = 0; n < slave.sm_count; ++n)
        if (slave.sync_managers[n].type == type) return n;
    return otherwise;
}

void configure(const Slave& slave, const DriveBits& all, FoundSms& found) {
    for (const bool out : {true, false}) {
        const auto n = out ? find_sync_manager(slave, SmType::outputs, 2) : find_sync_manager(slave, SmType::inputs, 3);
        if (n >= slave.sm_count) continue;
        found[n] = {.any = true,
                    .direction = out ? Direction::outputs : Direction::inputs,
                    .bits = out ? all.outputs : all.inputs};
    }
}

}  // namespace

Task<Result<bool>> find_sms_by_soe(MailboxChannel& channel, const Slave& slave, FoundSms& found, CheckValue& content) {
    if (!channel.was_open() || (slave.mailbox.protocols & mailbox_protocol::kSoE) == 0) co_return false;
    DriveBits all;
    for (std::uint8_t drive = 0; drive < wire::soe::kDrives; ++drive) {
        const auto one = co_await required(drive_bits(channel, drive, content));
        all.there = all.there || one.there;
        all.outputs += one.outputs;
        all.inputs += one.inputs;
    }
    if (!all.there) co_return false;
    configure(slave, all, found);
    co_return true;
}

const SoeFeature kSoeFeature{.find_sms = find_sms_by_soe};

}  // namespace margay
