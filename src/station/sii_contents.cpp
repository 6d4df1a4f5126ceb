#include "station/sii_contents.hpp"

#include "station/sii_access.hpp"
#include "wire/datagram.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace sii = wire::sii;

constexpr unsigned kMostCategories = 64;
constexpr std::size_t kGeneralWanted = 14;        // up to the E-bus current
constexpr std::uint32_t kIdentificationWord = 9;  // of the general category: General::identification_address
constexpr std::size_t kBlockBytes = 8;

// Finds one string in the strings category, whose octets arrive in pieces.
class StringPicker {
  public:
    explicit StringPicker(sii::StringNumber wanted) : wanted_(wanted) {}
    [[nodiscard]] bool done() const { return done_; }
    [[nodiscard]] bool found() const { return current_ == wanted_ && left_ == 0; }
    [[nodiscard]] Bytes text() const { return Bytes(text_).first(size_); }

    void take(Bytes piece) {
        for (const std::byte octet : piece) take(octet);
    }

  private:
    void take(std::byte octet) {
        if (done_) return;
        const auto value = std::to_integer<std::uint8_t>(octet);
        if (!counted_) {
            counted_ = true;
            done_ = value < wanted_;  // the SII has fewer strings
        } else if (left_ == 0) {
            left_ = value;
            ++current_;
            done_ = found();
        } else {
            if (current_ == wanted_) text_[size_++] = octet;
            --left_;
            done_ = found();
        }
    }

    sii::StringNumber wanted_;
    sii::StringNumber current_ = 0;
    std::uint8_t left_ = 0;
    bool counted_ = false;
    bool done_ = false;
    std::uint8_t size_ = 0;
    std::array<std::byte, 255> text_{};
};

// Reads the SII of one slave, step by step.
class Contents {
  public:
    Contents(const Station& station, Slave& slave) : reader_(station), slave_(slave) {}

    // Each function fills its part of the slave. After configuration() reports a wrong checksum or invalid mailboxes,
    // the other functions are still called.
    [[nodiscard]] Task<Result<>> configuration();
    [[nodiscard]] Task<Result<>> categories();
    [[nodiscard]] Task<Result<>> name();
    [[nodiscard]] Arena& arena() { return reader_.arena(); }

  private:
    [[nodiscard]] Error error(sii::Fault fault, std::uint32_t word, std::uint32_t expected = 0,
                              std::uint32_t actual = 0) const;
    [[nodiscard]] Error mailbox_error(sii::Fault fault, const MailboxInfo& mailbox, std::uint32_t first_word) const;
    [[nodiscard]] Result<> read_fixed_part(Bytes head, Bytes mailboxes);
    [[nodiscard]] bool found_all() const {
        return generals_ > 0 && fmmus_ > 0 && sync_managers_ > 0 && strings_.word != 0;
    }
    // How many octets of a category are read.
    [[nodiscard]] static std::size_t wanted_bytes(std::uint16_t type);
    void mark(const sii::CategoryPlace& place);
    void read_category(const sii::CategoryPlace& place, Bytes content);
    void read_sync_managers(const sii::CategoryPlace& place, Bytes content);
    void read_general(const sii::CategoryPlace& place, Bytes content);

    SiiReader reader_;
    Slave& slave_;
    sii::CategoryPlace strings_;
    sii::StringNumber name_ = 0;
    Error oversized_;            // the first mailbox SyncManager that is too large
    std::uint8_t generals_ = 0;  // how many of these categories were found
    std::uint8_t fmmus_ = 0;
    std::uint8_t sync_managers_ = 0;
};

Error Contents::error(sii::Fault fault, std::uint32_t word, std::uint32_t expected, std::uint32_t actual) const {
    Error e = reader_.station().error(sii::to_errc(fault), Step::parse_sii, static_cast<std::uint16_t>(word));
    e.expected = expected;
    e.actual = actual;
    return e;
}

Error Contents::mailbox_error(sii::Fault fault, const MailboxInfo& mailbox, std::uint32_t first_word) const {
    if (fault != sii::Fault::mailbox_too_large) return error(fault, first_word);
    const auto place = sii::oversized_mailbox(mailbox);
    return error(fault, first_word + place.word, static_cast<std::uint32_t>(wire::kMaxDatagramData), place.bytes);
}

// Mailboxes with invalid values are not copied: the slave then has no mailbox.
Result<> Contents::read_fixed_part(Bytes head, Bytes mailboxes) {
    const Bytes identity = head.subspan(sii::kConfigurationBytes);
    // The same as in read_identity().
    slave_.identity = sii::is_blank(identity) ? Identity{} : sii::load_identity(identity);
    const auto boxes = sii::load_mailboxes(mailboxes);
    const auto fault = sii::mailbox_fault(boxes.standard);
    auto boot = boxes.boot;
    boot.protocols = 0;
    if (fault == sii::Fault::none) slave_.mailbox = boxes.standard;
    const auto boot_fault = sii::mailbox_fault(boot);
    if (boot_fault == sii::Fault::none) slave_.boot_mailbox = boxes.boot;
    slave_.mailbox.protocols = boxes.standard.protocols;
    slave_.sii_read = true;
    if (fault != sii::Fault::none) return mailbox_error(fault, boxes.standard, sii::word::kMailbox);
    if (boot_fault == sii::Fault::mailbox_too_large) return mailbox_error(boot_fault, boot, sii::word::kBootMailbox);
    if (!sii::checksum_right(head))
        return error(sii::Fault::checksum, sii::word::kChecksum, sii::checksum(head),
                     static_cast<std::uint8_t>(head[sii::kConfigurationBytes - 2]));
    return Result<>();
}

Task<Result<>> Contents::configuration() {
    std::array<std::byte, sii::kConfigurationBytes + sii::kIdentityBytes> head{};
    co_await required(reader_.read(0, head, sii::word::kBootMailbox));
    std::array<std::byte, sii::kMailboxesBytes> mailboxes{};
    co_await required(reader_.read(sii::word::kBootMailbox, mailboxes, sii::word::kSize));
    std::array<std::byte, 2> size{};
    co_await required(reader_.read(sii::word::kSize, size, sii::word::kCategories));
    if (sii::is_blank(head)) co_return error(sii::Fault::blank, 0);
    slave_.sii_bytes = sii::eeprom_bytes(load_le<std::uint16_t>(size));
    co_return read_fixed_part(head, mailboxes);
}

std::size_t Contents::wanted_bytes(std::uint16_t type) {
    switch (type) {
        case sii::category::kGeneral: return kGeneralWanted;
        case sii::category::kFmmu: return Slave::kFmmus;
        case sii::category::kSyncManager: return Slave::kSyncManagers * wire::reg::kSyncManagerStride;
        default: return 0;
    }
}

// Counts the categories found. Only the first category of each type is used.
void Contents::mark(const sii::CategoryPlace& place) {
    switch (place.type) {
        case sii::category::kStrings: strings_ = strings_.word == 0 ? place : strings_; break;
        case sii::category::kGeneral: ++generals_; break;
        case sii::category::kFmmu: ++fmmus_; break;
        case sii::category::kSyncManager: ++sync_managers_; break;
        default: break;
    }
}

void Contents::read_general(const sii::CategoryPlace& place, Bytes content) {
    const auto general = sii::parse_general(content).value;
    name_ = general.name;
    slave_.coe_details = general.coe_details;
    slave_.foe_details = general.foe_details;
    slave_.eoe_details = general.eoe_details;
    slave_.ebus_current_ma = general.ebus_current_ma;
    if ((general.flags & sii::general_flag::kIdentMemory) != 0) {
        slave_.device_id_source = DeviceIdSource::memory;
        slave_.device_id_word = static_cast<std::uint16_t>(place.word + kIdentificationWord);
    } else if ((general.flags & sii::general_flag::kIdentAlStatus) != 0) {
        slave_.device_id_source = DeviceIdSource::al_status;
    }
}

void Contents::read_category(const sii::CategoryPlace& place, Bytes content) {
    const std::uint16_t type = place.type;
    if (type == sii::category::kGeneral && generals_ == 1) {
        read_general(place, content);
    } else if (type == sii::category::kFmmu && fmmus_ == 1) {
        sii::FmmuUses uses(content);
        while (const auto use = uses.next()) slave_.fmmu_use[slave_.fmmu_count++] = *use;
    } else if (type == sii::category::kSyncManager && sync_managers_ == 1) {
        read_sync_managers(place, content);
    }
}

// A mailbox SyncManager with a length that no frame can carry is reported, and its length is set to 0. (The SyncManager
// registers are written from the mailbox words, not from this category.)
void Contents::read_sync_managers(const sii::CategoryPlace& place, Bytes content) {
    sii::SyncManagers sms(content);
    while (const auto read = sms.next()) {
        SmInfo sm = *read;
        const bool mailbox = sm.type == SmType::mailbox_out || sm.type == SmType::mailbox_in;
        if (mailbox && sm.length_bytes > wire::kMaxDatagramData) {
            const std::uint32_t word =
                place.word + slave_.sm_count * std::uint32_t{wire::reg::kSyncManagerStride / 2} + 1;
            constexpr auto kMost = static_cast<std::uint32_t>(wire::kMaxDatagramData);
            if (oversized_.code == Errc::none)
                oversized_ = error(sii::Fault::mailbox_too_large, word, kMost, sm.length_bytes);
            sm.length_bytes = 0;
        }
        slave_.sync_managers[slave_.sm_count++] = sm;
    }
}

Task<Result<>> Contents::categories() {
    sii::CategoryChain chain(sii::content_end_word(slave_.sii_bytes));
    for (unsigned n = 0; chain.more() && !found_all(); ++n) {
        if (n == kMostCategories) co_return error(sii::Fault::no_end, chain.header_word());
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        // The first category is usually the strings category, which is read later. The content of the other categories
        // is usually read at once.
        const auto behind = n == 0 ? SiiReader::kNone : chain.header_word() + 2;
        co_await required(reader_.read(chain.header_word(), header, behind));
        const auto place = chain.step(header);
        if (!place) break;
        std::array<std::byte, Slave::kSyncManagers * wire::reg::kSyncManagerStride> content{};
        const auto wanted =
            MutableBytes(content).first(std::min(place->words * sii::kWordBytes, wanted_bytes(place->type)));
        mark(*place);
        co_await required(reader_.read(place->word, wanted, found_all() ? strings_.word : chain.header_word()));
        read_category(*place, wanted);
    }
    if (chain.fault() != sii::Fault::none) co_return error(chain.fault(), chain.header_word());
    co_return oversized_.code == Errc::none ? Result<>() : Result<>(oversized_);
}

Task<Result<>> Contents::name() {
    if (name_ == 0 || strings_.words == 0) co_return Nothing{};
    StringPicker picker(name_);
    const std::uint32_t end = strings_.word + strings_.words;
    for (std::uint32_t word = strings_.word; word < end && !picker.done(); word += kBlockBytes / sii::kWordBytes) {
        std::array<std::byte, kBlockBytes> block{};
        const auto part = MutableBytes(block).first(std::min<std::size_t>(kBlockBytes, (end - word) * sii::kWordBytes));
        const std::uint32_t next = word + kBlockBytes / sii::kWordBytes;
        co_await required(reader_.read(word, part, next < end ? next : SiiReader::kNone));
        picker.take(part);
    }
    slave_.name_bytes = static_cast<std::uint8_t>(sii::to_utf8(picker.text(), slave_.name_text).size());
    if (picker.found()) co_return Nothing{};
    co_return error(picker.done() ? sii::Fault::string_missing : sii::Fault::string_past_end, strings_.word, name_);
}

}  // namespace

Task<Result<>> read_sii_contents(Station station, Slave& slave) {
    Contents contents(station, slave);
    auto configuration = co_await contents.configuration();
    if (!configuration && configuration.error().step != Step::parse_sii) co_return configuration;
    if (configuration.error().code == Errc::sii_blank) co_return configuration;
    auto categories = co_await contents.categories();
    auto name = co_await contents.name();
    if (!configuration) co_return configuration;
    co_return categories ? name : categories;
}

}  // namespace margay
