#include "network/entry_names.hpp"

#include "mailbox/coe_information.hpp"
#include "mailbox/coe_list.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace sii = wire::sii;

constexpr unsigned kMostCategories = 64;

std::size_t copy_text(std::string_view text, std::span<char> into) {
    const std::size_t bytes = std::min(text.size(), into.size());
    std::copy_n(text.begin(), bytes, into.begin());
    return bytes;
}

// The name of the entry itself, otherwise that of its object.
Task<Result<std::size_t>> name_by_dictionary(MailboxChannel& channel, SdoObject object, std::span<char> into,
                                             const MailPatience& patience) {
    EntryQuery entry(object.index, object.subindex, false);
    auto asked = co_await ask_information(channel, entry, object, patience);
    if (!asked && !is_refusal(asked.error())) co_return asked.error();
    if (asked && entry.description.name_bytes != 0) co_return copy_text(entry.description.name(), into);
    ObjectQuery whole(object.index);
    asked = co_await ask_information(channel, whole, {.index = object.index}, patience);
    if (!asked && !is_refusal(asked.error())) co_return asked.error();
    co_return asked ? copy_text(whole.description.name(), into) : std::size_t{0};
}

// The values of the SII from which the name of an entry is read.
struct SiiName {
    sii::StringNumber number = 0;
    sii::CategoryPlace strings{};
};

Task<Result<>> look_through_pdos(SiiReader& reader, sii::CategoryPlace place, SdoObject object, SiiName& name) {
    constexpr std::uint32_t kHeadWords = sii::kPdoBytes / sii::kWordBytes;
    constexpr std::uint32_t kEntryWords = sii::kPdoEntryBytes / sii::kWordBytes;
    const std::uint32_t end = place.word + place.words;
    std::uint32_t entries = 0;  // of the current PDO that are not read yet
    for (std::uint32_t word = place.word; word + kHeadWords <= end && name.number == 0;) {
        std::array<std::byte, sii::kPdoBytes> octets{};
        static_assert(sii::kPdoBytes == sii::kPdoEntryBytes);
        co_await required(reader.read(word, octets, word + kEntryWords));
        word += kEntryWords;
        if (entries == 0) {
            entries = sii::load_pdo(octets).entry_count;
            continue;
        }
        --entries;
        const sii::PdoEntry entry = sii::load_pdo_entry(octets);
        if (entry.index == object.index && entry.subindex == object.subindex) name.number = entry.name;
    }
    co_return Nothing{};
}

Task<Result<>> look_through_categories(SiiReader& reader, const Slave& slave, SdoObject object, SiiName& name) {
    sii::CategoryChain chain(static_cast<std::uint32_t>(slave.sii_bytes / sii::kWordBytes));
    for (unsigned n = 0; chain.more() && n < kMostCategories; ++n) {
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        co_await required(reader.read(chain.header_word(), header, chain.header_word() + 2));
        const auto place = chain.step(header);
        if (!place) break;
        if (place->type == sii::category::kStrings) name.strings = *place;
        if (place->type != sii::category::kTxPdo && place->type != sii::category::kRxPdo) continue;
        co_await required(look_through_pdos(reader, *place, object, name));
    }
    co_return Nothing{};
}

// Reads one octet of a category. The reader caches the block that it has read last.
Task<Result<std::uint8_t>> octet_at(SiiReader& reader, sii::CategoryPlace place, std::uint32_t octet) {
    std::array<std::byte, sii::kWordBytes> word{};
    const std::uint32_t offset = octet / static_cast<std::uint32_t>(sii::kWordBytes);
    if (offset >= place.words) co_return std::uint8_t{0};
    co_await required(reader.read(place.word + offset, word));
    co_return std::to_integer<std::uint8_t>(word[octet % sii::kWordBytes]);
}

// Reads the string name.number, skipping the strings before it.
Task<Result<std::size_t>> read_string(SiiReader& reader, SiiName name, std::span<char> into) {
    const auto count = co_await required(octet_at(reader, name.strings, 0));
    if (count < name.number) co_return std::size_t{0};
    std::uint32_t at = 1;
    for (unsigned n = 1;; ++n) {
        const auto length = co_await required(octet_at(reader, name.strings, at));
        ++at;
        if (n < name.number) {
            at += length;
            continue;
        }
        std::array<std::byte, 255> text{};
        for (unsigned i = 0; i < length; ++i) {
            const auto octet = co_await required(octet_at(reader, name.strings, at));
            ++at;
            text[i] = std::byte{octet};
        }
        co_return sii::to_utf8(Bytes(text).first(length), into).size();
    }
}

Task<Result<std::size_t>> name_by_sii(Station station, const Slave& slave, SdoObject object, std::span<char> into) {
    if (!slave.sii_read) co_return std::size_t{0};
    co_await required(sii_assign(station, false));
    SiiReader reader(station);
    SiiName name;
    Result<std::size_t> bytes;
    auto looked = co_await look_through_categories(reader, slave, object, name);
    if (!looked) bytes = looked.error();
    if (looked && name.number != 0 && name.strings.words != 0) bytes = co_await read_string(reader, name, into);
    auto given_back = co_await sii_assign(station, true);
    if (bytes && !given_back) co_return given_back.error();
    co_return bytes;
}

}  // namespace

Task<Result<std::size_t>> find_entry_name(Network& network, Slave& slave, std::uint16_t index, std::uint8_t subindex,
                                          std::span<char> into, const MailPatience& patience) {
    const SdoObject object{.index = index, .subindex = subindex};
    const bool informs = network.has_mailbox(slave) && network.mailbox(slave).is_open() &&
                         (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0 &&
                         (slave.coe_details & coe_detail::kSdoInformation) != 0;
    if (informs) {
        auto found = co_await name_by_dictionary(network.mailbox(slave), object, into, patience);
        if (!found || *found != 0) co_return found;
    }
    co_return co_await required(name_by_sii(network.station(slave), slave, object, into));
}

}  // namespace margay
