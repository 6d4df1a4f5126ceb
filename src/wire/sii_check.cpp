#include "wire/sii_check.hpp"

#include "wire/datagram.hpp"
#include "wire/sii_category.hpp"

namespace margay::wire::sii {
namespace {

class Checker {
  public:
    Checker(Bytes image, std::span<Finding> findings)
        : image_(image), findings_(findings), strings_(find_category(image, category::kStrings).value_or(Bytes{})) {}

    std::size_t run() {
        if (is_blank(image_)) {
            add(Fault::blank, 0);
            return count_;
        }
        if (image_.size() % kWordBytes != 0) add(Fault::odd_length, 0, 0, image_.size());
        if (image_.size() < kFixedBytes) {
            add(Fault::truncated, 0, kFixedBytes, image_.size());
            return count_;
        }
        check_fixed_part();
        check_categories();
        return count_;
    }

  private:
    void add(Fault fault, std::uint32_t at_word, std::size_t expected = 0, std::size_t actual = 0) {
        if (fault == Fault::none) return;
        if (count_ < findings_.size())
            findings_[count_] = {fault, category_, at_word, static_cast<std::uint32_t>(expected),
                                 static_cast<std::uint32_t>(actual)};
        ++count_;
    }

    void check_fixed_part() {
        const auto fixed = load_fixed_part(image_);
        const auto& [configuration, identity, mailboxes, size, version] = fixed.value;
        if (fixed.fault == Fault::checksum)
            add(Fault::checksum, word::kChecksum, checksum(image_), configuration.checksum & 0xFF);
        auto boot = mailboxes.boot;
        boot.protocols = 0;  // most slaves have no boot mailbox
        check_mailboxes(boot, word::kBootMailbox);
        check_mailboxes(mailboxes.standard, word::kMailbox);
        if (size != image_.size()) add(Fault::size_mismatch, word::kSize, image_.size(), size);
    }

    void check_mailboxes(const MailboxInfo& mailbox, std::uint32_t first_word) {
        const auto fault = mailbox_fault(mailbox);
        const auto place = oversized_mailbox(mailbox);
        if (fault == Fault::mailbox_too_large)
            add(fault, first_word + place.word, kMaxDatagramData, place.bytes);
        else
            add(fault, first_word);
    }

    void check_categories() {
        std::uint32_t seen = 0;
        CategoryWalker walker(image_);
        while (const auto found = walker.next()) {
            category_ = found->place.type;
            at_ = found->place.word;
            const auto bit = bit_of_single(category_);
            if ((seen & bit) != 0) add(Fault::category_repeated, at_);
            seen |= bit;
            check_content(found->content);
        }
        category_ = category::kEnd;
        add(walker.fault(), walker.stopped_at());
    }

    static std::uint32_t bit_of_single(std::uint16_t type) {
        switch (type) {
            case category::kStrings: return 1;
            case category::kGeneral: return 2;
            case category::kFmmu: return 4;
            case category::kSyncManager: return 8;
            default: return 0;
        }
    }

    void check_content(Bytes content) {
        switch (category_) {
            case category::kStrings: return check_strings(content);
            case category::kGeneral: return check_general(content);
            case category::kFmmu: return check_fmmus(content);
            case category::kSyncManager: return check_sync_managers(content);
            case category::kTxPdo:
            case category::kRxPdo: return check_pdos(content);
            case category::kDc: return check_dc(content);
            default: return;
        }
    }

    // The word address of octet `offset` of the content.
    [[nodiscard]] std::uint32_t word_at(std::size_t offset) const {
        return at_ + static_cast<std::uint32_t>(offset / kWordBytes);
    }

    void check_reference(StringNumber number, std::size_t offset) {
        if (number > string_count(strings_))
            add(Fault::string_missing, word_at(offset), string_count(strings_), number);
    }

    // To find the last string, all other strings are read; so a too long string is found with the last one.
    void check_strings(Bytes content) {
        const auto count = string_count(content);
        if (content.empty()) add(Fault::truncated, at_);
        add(string(content, count).fault, at_);
    }

    void check_general(Bytes content) {
        const auto general = parse_general(content);
        if (!general.ok()) add(general.fault, at_, kGeneralBytes, content.size());
        const StringNumber references[] = {general.value.group, general.value.image, general.value.order,
                                           general.value.name};
        for (std::size_t i = 0; i < std::size(references); ++i) check_reference(references[i], i);
    }

    void check_fmmus(Bytes content) {
        for (std::size_t i = 0; i < content.size(); ++i) {
            const auto octet = load_le<std::uint8_t>(content, i);
            if (octet > static_cast<std::uint8_t>(FmmuUse::mailbox_status) && octet != 0xFF)
                add(Fault::unknown_value, word_at(i), 0, octet);
        }
    }

    void check_sync_managers(Bytes content) {
        SyncManagers managers(content);
        if (managers.fault() != Fault::none) add(managers.fault(), word_at(content.size()));
        for (std::size_t offset = 0; const auto manager = managers.next(); offset += kSyncManagerBytes) {
            if (manager->type > SmType::inputs)
                add(Fault::unknown_value, word_at(offset), 0, static_cast<std::uint8_t>(manager->type));
            else if ((manager->type == SmType::mailbox_out || manager->type == SmType::mailbox_in) &&
                     manager->length_bytes > kMaxDatagramData)
                add(Fault::mailbox_too_large, word_at(offset), kMaxDatagramData, manager->length_bytes);
        }
    }

    void check_pdos(Bytes content) {
        Pdos pdos(content);
        std::size_t offset = 0;
        while (const auto pdo = pdos.next()) {
            check_reference(pdo->name, offset);
            offset += kPdoBytes;
            PdoEntries entries(pdo->entries);
            for (; const auto entry = entries.next(); offset += kPdoEntryBytes) check_reference(entry->name, offset);
        }
        if (pdos.fault() != Fault::none) add(pdos.fault(), word_at(offset));
    }

    void check_dc(Bytes content) {
        DcOpModes modes(content);
        if (modes.fault() != Fault::none) add(modes.fault(), word_at(content.size()));
        for (std::size_t offset = 0; const auto mode = modes.next(); offset += kDcOpModeBytes) {
            check_reference(mode->name, offset);
            check_reference(mode->description, offset);
        }
    }

    Bytes image_;
    std::span<Finding> findings_;
    Bytes strings_;
    std::size_t count_ = 0;
    std::uint16_t category_ = category::kEnd;
    std::uint32_t at_ = 0;
};

}  // namespace

std::size_t check_image(Bytes image, std::span<Finding> findings) { return Checker(image, findings).run(); }

}  // namespace margay::wire::sii
