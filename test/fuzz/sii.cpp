// The readers of the SII with random input. The readers end, and their results are inside the input. The strict check
// reports the same findings to a short list and to a long list. A fixed part that is read and written has the same
// octets again, except the checksum.
#include "wire/sii_category.hpp"
#include "wire/sii_check.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <span>
#include <vector>

using namespace margay;
using namespace margay::wire;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

bool within(Bytes part, Bytes whole) {
    return part.empty() || (part.data() >= whole.data() && part.data() + part.size() <= whole.data() + whole.size());
}

void check_strings(Bytes content) {
    for (unsigned number = 0; number < 256; ++number) {
        const auto found = sii::string(content, static_cast<sii::StringNumber>(number));
        require(within(found.value, content));
        require(found.ok() || found.value.empty());
        std::array<char, 48> text{};
        require(sii::to_utf8(found.value, text).size() <= text.size());
    }
}

void check_pdos(Bytes content) {
    sii::Pdos pdos(content);
    std::size_t octets = 0;
    while (const auto pdo = pdos.next()) {
        require(within(pdo->entries, content));
        require(pdo->entries.size() == pdo->entry_count * sii::kPdoEntryBytes);
        octets += sii::kPdoBytes + pdo->entries.size();
        sii::PdoEntries entries(pdo->entries);
        unsigned count = 0;
        while (entries.next()) ++count;
        require(count == pdo->entry_count && entries.fault() == sii::Fault::none);
    }
    require((pdos.fault() == sii::Fault::none) == (octets == content.size()));
}

template <class Reader>
void check_entries(Bytes content) {
    Reader reader(content);
    auto expected = reader.count();
    require(expected == content.size() / Reader::kEntryBytes);
    while (reader.next()) --expected;
    require(expected == 0);
}

void check_categories(Bytes image) {
    sii::CategoryWalker walker(image);
    std::uint32_t last = 0;
    while (const auto found = walker.next()) {
        require(found->place.word > last && found->content.size() == found->place.words * std::size_t{2});
        require(found->content.data() == image.data() + found->place.word * std::size_t{2});
        require(within(found->content, image));
        last = found->place.word;
        // Each reader reads each content, because the image alone determines the type of a category.
        check_strings(found->content);
        check_pdos(found->content);
        check_entries<sii::FmmuUses>(found->content);
        check_entries<sii::SyncManagers>(found->content);
        check_entries<sii::DcOpModes>(found->content);
        require(sii::parse_general(found->content).ok() == (found->content.size() >= sii::kGeneralBytes));
    }
    require(!walker.next());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto image = std::as_bytes(std::span(data, size));
    check_strings(image);
    check_pdos(image);
    check_categories(image);

    std::array<sii::Finding, 4> few{};
    const auto count = sii::check_image(image, few);
    std::vector<sii::Finding> all(count);
    require(sii::check_image(image, all) == count);
    require(std::equal(few.begin(), few.begin() + static_cast<long>(std::min(count, few.size())), all.begin()));
    for (const auto& finding : all) require(finding.fault != sii::Fault::none && finding.word * std::size_t{2} <= size);

    const auto fixed = sii::load_fixed_part(image);
    require((fixed.fault == sii::Fault::truncated) == (size < sii::kFixedBytes));
    if (size < sii::kFixedBytes) return 0;
    std::vector<std::byte> again(image.begin(), image.end());
    const std::span<std::byte> to(again);
    sii::store_configuration(to, fixed.value.configuration);
    sii::store_identity(to.subspan(sii::word::kIdentity * 2), fixed.value.identity);
    sii::store_mailboxes(to.subspan(sii::word::kBootMailbox * 2), fixed.value.mailboxes);
    require(sii::checksum_right(again));
    require(std::equal(again.begin() + 16, again.end(), image.begin() + 16));
    require(std::equal(again.begin(), again.begin() + 14, image.begin()));
    return 0;
}
