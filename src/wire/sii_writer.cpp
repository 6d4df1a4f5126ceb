#include "wire/sii_writer.hpp"

#include <algorithm>
#include <limits>

namespace margay::wire::sii {
namespace {

constexpr std::size_t kMaxOctet = std::numeric_limits<std::uint8_t>::max();
constexpr std::size_t kMaxCategoryBytes = std::numeric_limits<std::uint16_t>::max() * kWordBytes;

class Writer {
  public:
    Writer(const Description& device, MutableBytes eeprom) : device_(device), eeprom_(eeprom) {}

    Parsed<std::size_t> run() {
        if (eeprom_.empty() || eeprom_.size() % 128 != 0) return {0, Fault::odd_length};
        std::fill(eeprom_.begin(), eeprom_.end(), std::byte{0xFF});
        fixed_part();
        raw(device_.device_specific);
        strings();
        general();
        fmmus();
        sync_managers();
        pdos(category::kTxPdo, device_.tx_pdos);
        pdos(category::kRxPdo, device_.rx_pdos);
        dc();
        raw(device_.others);
        put<std::uint16_t>(category::kEnd);
        return {fault_ == Fault::none ? at_ : 0, fault_};
    }

  private:
    void fail(Fault fault) {
        if (fault_ == Fault::none) fault_ = fault;
    }

    // Writes nothing after the first fault.
    template <class T>
    void put(T value) {
        if (sizeof(T) > eeprom_.size() - at_) fail(Fault::no_room);
        if (fault_ != Fault::none) return;
        store_le(eeprom_, at_, value);
        at_ += sizeof(T);
    }
    void put_octets(Bytes octets) {
        if (octets.size() > eeprom_.size() - at_) fail(Fault::no_room);
        if (fault_ != Fault::none) return;
        std::copy(octets.begin(), octets.end(), eeprom_.begin() + static_cast<std::ptrdiff_t>(at_));
        at_ += octets.size();
    }

    void begin(std::uint16_t type) {
        put(type);
        put<std::uint16_t>(0);
        begun_ = at_;
    }
    // Pads to a whole word and writes the length into the header.
    void end() {
        if ((at_ - begun_) % kWordBytes != 0) put<std::uint8_t>(fill_);
        if (at_ - begun_ > kMaxCategoryBytes) fail(Fault::too_long);
        if (fault_ == Fault::none)
            store_le(eeprom_, begun_ - kWordBytes, static_cast<std::uint16_t>((at_ - begun_) / kWordBytes));
    }

    void fixed_part() {
        if (eeprom_.size() < kFixedBytes) return fail(Fault::no_room);
        std::fill_n(eeprom_.begin(), kFixedBytes, std::byte{0});
        store_configuration(eeprom_, device_.configuration);
        store_identity(eeprom_.subspan(word::kIdentity * kWordBytes), device_.identity);
        store_mailboxes(eeprom_.subspan(word::kBootMailbox * kWordBytes), {device_.boot_mailbox, device_.mailbox});
        if (eeprom_.size() / 128 > std::numeric_limits<std::uint16_t>::max() + std::size_t{1})
            return fail(Fault::too_long);
        store_le(eeprom_, word::kSize * kWordBytes, size_word(static_cast<std::uint32_t>(eeprom_.size())));
        store_le(eeprom_, word::kVersion * kWordBytes, device_.version);
        at_ = kFixedBytes;
    }

    void raw(std::span<const RawCategory> categories) {
        for (const auto& one : categories) {
            begin(one.type);
            put_octets(one.content);
            end();
        }
    }

    // Calls `visit` for every text.
    template <class Visit>
    void each_text(Visit visit) const {
        for (const auto text : {device_.order, device_.group, device_.group_name, device_.image, device_.name})
            visit(text);
        for (const auto& list : {device_.tx_pdos, device_.rx_pdos})
            for (const auto& pdo : list) {
                visit(pdo.name);
                for (const auto& entry : pdo.entries) visit(entry.name);
            }
        for (const auto& mode : device_.dc) {
            visit(mode.name);
            visit(mode.description);
        }
    }

    // The number of a text in the strings written so far; 0 when the text is not found or empty.
    [[nodiscard]] StringNumber number(std::string_view text) const {
        if (text.empty() || strings_.empty()) return 0;
        const std::size_t count = string_count(strings_);
        std::size_t at = 1;
        for (std::size_t n = 1; n <= count; ++n) {
            const std::size_t length = load_le<std::uint8_t>(strings_, at);
            const auto stored = strings_.subspan(at + 1, length);
            if (std::equal(stored.begin(), stored.end(), text.begin(), text.end(),
                           [](std::byte b, char c) { return b == static_cast<std::byte>(c); }))
                return static_cast<StringNumber>(n);
            at += 1 + length;
        }
        return 0;
    }

    void add_text(std::string_view text) {
        if (text.empty() || fault_ != Fault::none || number(text) != 0) return;
        const std::size_t count = string_count(strings_);
        if (count == kMaxOctet || text.size() > kMaxOctet) return fail(Fault::too_long);
        put(static_cast<std::uint8_t>(text.size()));
        for (const char c : text) put(static_cast<std::uint8_t>(c));
        if (fault_ != Fault::none) return;
        store_le(eeprom_, begun_, static_cast<std::uint8_t>(count + 1));
        strings_ = eeprom_.subspan(begun_, at_ - begun_);
    }

    void strings() {
        bool any = false;
        each_text([&any](std::string_view text) { any = any || !text.empty(); });
        if (!any) return;
        begin(category::kStrings);
        put<std::uint8_t>(0);
        if (fault_ != Fault::none) return;
        strings_ = eeprom_.subspan(begun_, 1);
        each_text([this](std::string_view text) { add_text(text); });
        end();
    }

    void general() {
        const auto& g = device_.general;
        begin(category::kGeneral);
        put(number(device_.group));
        put(number(device_.image));
        put(number(device_.order));
        put(number(device_.name));
        put<std::uint8_t>(0);
        put(g.coe_details);
        put(g.foe_details);
        put(g.eoe_details);
        put(g.soe_channels);
        put(g.ds402_channels);
        put(g.sysman_class);
        put(g.flags);
        put(g.ebus_current_ma);
        put(number(device_.group_name));
        put<std::uint8_t>(0);
        put(g.physical_ports);
        put(g.identification_address);
        while (at_ - begun_ < kGeneralBytes && fault_ == Fault::none) put<std::uint8_t>(0);
        end();
    }

    void fmmus() {
        if (device_.fmmus.empty()) return;
        begin(category::kFmmu);
        for (const auto use : device_.fmmus) put(use);
        fill_ = 0xFF;  // no further FMMU
        end();
        fill_ = 0;
    }

    void sync_managers() {
        if (device_.sync_managers.empty()) return;
        begin(category::kSyncManager);
        for (const auto& manager : device_.sync_managers) {
            put(manager.start);
            put(manager.length_bytes);
            put(manager.control);
            put<std::uint8_t>(0);
            put(manager.enable);
            put(manager.type);
        }
        end();
    }

    void pdos(std::uint16_t type, std::span<const PdoDescription> list) {
        if (list.empty()) return;
        begin(type);
        for (const auto& pdo : list) {
            if (pdo.entries.size() > kMaxOctet) return fail(Fault::too_long);
            put(pdo.index);
            put(static_cast<std::uint8_t>(pdo.entries.size()));
            put(pdo.sync_manager);
            put(pdo.synchronization);
            put(number(pdo.name));
            put(pdo.flags);
            for (const auto& entry : pdo.entries) {
                put(entry.index);
                put(entry.subindex);
                put(number(entry.name));
                put(entry.data_type);
                put(entry.bit_length);
                put(entry.flags);
            }
        }
        end();
    }

    void dc() {
        if (device_.dc.empty()) return;
        begin(category::kDc);
        for (const auto& [mode, name, description] : device_.dc) {
            put(mode.sync0_cycle_time_ns);
            put(mode.sync0_shift_time_ns);
            put(mode.sync1_shift_time_ns);
            put(mode.sync1_cycle_factor);
            put(mode.assign_activate);
            put(mode.sync0_cycle_factor);
            put(number(name));
            put(number(description));
            put<std::uint32_t>(0);
        }
        end();
    }

    const Description& device_;
    MutableBytes eeprom_;
    std::size_t at_ = 0;
    std::size_t begun_ = 0;  // start of the content of the current category
    std::uint8_t fill_ = 0;
    Bytes strings_;
    Fault fault_ = Fault::none;
};

}  // namespace

Parsed<std::size_t> write_image(const Description& device, MutableBytes eeprom) { return Writer(device, eeprom).run(); }

}  // namespace margay::wire::sii
