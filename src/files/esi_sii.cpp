// The SII image of a device of an ESI file (ETG.1000.6 and ETG.2010: the tables of the SII).
#include <margay/files/esi.hpp>

#include "files/esi_categories.hpp"
#include "files/esi_types.hpp"
#include "files/xml.hpp"
#include "wire/sii_check.hpp"
#include "wire/sii_writer.hpp"

#include <algorithm>
#include <deque>

namespace margay::files {
namespace {

namespace sii = wire::sii;

constexpr std::size_t kConfigurationBytes = 14;

// Which names the image contains. The number of strings is limited, because a string number has one octet.
enum class SiiNames : std::uint8_t { all, without_entries, of_the_device };

std::uint32_t code_point(std::string_view text, std::size_t& at) {
    const auto lead = static_cast<unsigned char>(text[at++]);
    if (lead < 0x80) return lead;
    const int more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : 1;
    std::uint32_t point = lead & (0x3FU >> more);
    for (int n = 0; n < more && at < text.size(); ++n)
        point = point << 6 | (static_cast<unsigned char>(text[at++]) & 0x3FU);
    return point;
}

class Builder {
  public:
    Builder(const EsiDevice& device, SiiNames names) : device_(device), names_(names) {}

    sii::Description describe() {
        fixed_part();
        general();
        for (const EsiFmmu& fmmu : device_.fmmus) fmmus_.push_back(fmmu.use);
        d_.fmmus = fmmus_;
        sync_managers();
        pdos(Direction::inputs, tx_pdos_);
        pdos(Direction::outputs, rx_pdos_);
        d_.tx_pdos = tx_pdos_;
        d_.rx_pdos = rx_pdos_;
        modes();
        categories();
        return d_;
    }
    [[nodiscard]] const std::string& error() const { return error_; }
    [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }

  private:
    // Strings of the SII are ISO 8859-1.
    std::string_view text(std::string_view utf8) {
        std::string& latin1 = texts_.emplace_back();
        bool lost = false;
        for (std::size_t at = 0; at < utf8.size();) {
            const std::uint32_t point = code_point(utf8, at);
            latin1 += point < 0x100 ? static_cast<char>(static_cast<unsigned char>(point)) : '?';
            lost = lost || point >= 0x100;
        }
        if (lost && !named_characters_)
            remarks_.push_back("the SII has characters of ISO 8859-1 only, the others become '?': " + quoted(utf8));
        named_characters_ = named_characters_ || lost;
        if (latin1.size() <= 255) return latin1;
        remarks_.push_back("a name of more than 255 octets is cut: " + std::string(utf8.substr(0, 32)) + "…");
        latin1.resize(255);
        return latin1;
    }

    void fixed_part() {
        d_.identity = device_.identity;
        if (device_.eeprom) {
            std::array<std::byte, sii::kConfigurationBytes> words{};
            const auto& configuration = device_.eeprom->configuration;
            std::ranges::copy_n(configuration.begin(),
                                static_cast<std::ptrdiff_t>(std::min(configuration.size(), kConfigurationBytes)),
                                words.begin());
            d_.configuration = sii::load_configuration(words);
            if (configuration.size() > kConfigurationBytes)
                remarks_.push_back("ConfigData has more than 14 octets: the rest is not used");
            std::array<std::byte, 8> boot{};
            const auto& boot_mailbox = device_.eeprom->boot_mailbox;
            std::ranges::copy_n(boot_mailbox.begin(),
                                static_cast<std::ptrdiff_t>(std::min(boot_mailbox.size(), boot.size())), boot.begin());
            d_.boot_mailbox = {load_le<std::uint16_t>(boot, 0), load_le<std::uint16_t>(boot, 2),
                               load_le<std::uint16_t>(boot, 4), load_le<std::uint16_t>(boot, 6), 0};
        }
        for (const EsiSyncManager& sm : device_.sync_managers) {
            if (sm.type == SmType::mailbox_out && d_.mailbox.out_bytes == 0) {
                d_.mailbox.out_start = sm.start;
                d_.mailbox.out_bytes = sm.default_bytes;
            }
            if (sm.type == SmType::mailbox_in && d_.mailbox.in_bytes == 0) {
                d_.mailbox.in_start = sm.start;
                d_.mailbox.in_bytes = sm.default_bytes;
            }
        }
        if (device_.mailbox) d_.mailbox.protocols = device_.mailbox->protocols;
    }

    void general() {
        d_.group = text(device_.group);
        // A file needs a name for each group. If a group has no name, the file uses its type.
        if (device_.group_name != device_.group) d_.group_name = text(device_.group_name);
        d_.order = text(device_.type);
        d_.name = text(device_.name);
        sii::General& g = d_.general;
        g.ebus_current_ma = device_.ebus_current_ma;
        for (unsigned port = 0; port < device_.ports.size(); ++port) {
            const PortType kind = device_.ports[port];
            const unsigned value = kind == PortType::mii ? 1 : kind == PortType::ebus ? 3 : 0;
            g.physical_ports = static_cast<std::uint16_t>(g.physical_ports | value << (4 * port));
        }
        g.sysman_class = device_.sysman_class;
        g.identification_address = device_.device_id_address;
        if (device_.safeop_configuration) g.flags |= sii::general_flag::kEnableSafeOp;
        if (device_.no_lrw) g.flags |= sii::general_flag::kNotLrw;
        if (device_.device_id_by_al_status) g.flags |= sii::general_flag::kIdentAlStatus;
        if (device_.device_id_address != 0) g.flags |= sii::general_flag::kIdentMemory;
        if (!device_.mailbox) return;
        const EsiMailbox& mailbox = *device_.mailbox;
        if (mailbox.data_link_layer) g.flags |= sii::general_flag::kMailboxDataLink;
        g.coe_details = mailbox.coe_details;
        g.foe_details = (mailbox.protocols & mailbox_protocol::kFoE) != 0 ? 1 : 0;
        g.eoe_details = (mailbox.protocols & mailbox_protocol::kEoE) != 0 ? 1 : 0;
        g.soe_channels = mailbox.soe_channels;
        g.ds402_channels = mailbox.ds402_channels;
    }

    void sync_managers() {
        for (const EsiSyncManager& sm : device_.sync_managers) {
            SmType type = sm.type;
            // The SyncManager has a name of the vendor. For a master, the direction in the control octet is more useful
            // than "unused".
            if (const auto direction = direction_by_control(sm))
                type = direction == Direction::outputs ? SmType::outputs : SmType::inputs;
            std::uint8_t enable = sm.enabled ? sii::sm_enable::kEnable : std::uint8_t{0};
            if (sm.is_virtual) enable |= sii::sm_enable::kVirtual;
            if (sm.op_only) enable |= sii::sm_enable::kOpOnly;
            sms_.push_back({sm.start, sm.default_bytes, sm.control, enable, type});
        }
        d_.sync_managers = sms_;
    }

    void pdos(Direction direction, std::vector<sii::PdoDescription>& into) {
        for (const EsiPdo& pdo : device_.pdos) {
            if (pdo.direction != direction) continue;
            auto& entries = entries_.emplace_back();
            for (const EsiEntry& entry : pdo.entries) add_entry(pdo, entry, entries);
            unsigned flags = 0;
            if (pdo.mandatory) flags |= sii::pdo_flag::kMandatory;
            if (pdo.fixed) flags |= sii::pdo_flag::kFixedContent;
            if (pdo.is_virtual) flags |= sii::pdo_flag::kVirtual;
            into.push_back({.index = pdo.index,
                            .sync_manager = pdo.sync_manager.value_or(sii::Pdo::kNoSyncManager),
                            .name = names_ == SiiNames::of_the_device ? std::string_view{} : text(pdo.name),
                            .flags = static_cast<std::uint16_t>(flags),
                            .entries = entries});
        }
    }

    // An entry of the SII has at most 255 bits: a longer gap is several gaps.
    void add_entry(const EsiPdo& pdo, const EsiEntry& entry, std::vector<sii::PdoEntryDescription>& into) {
        std::uint32_t left = entry.bits;
        for (; entry.index == 0 && left > 255; left -= 255) into.push_back({.bit_length = 255});
        if (left > 255 && error_.empty())
            error_ = "the entry " + hex(entry.index) + " of PDO " + hex(pdo.index) + " has " + std::to_string(left) +
                     " bits, and the SII has room for 255";
        into.push_back({.index = entry.index,
                        .subindex = entry.index == 0 ? std::uint8_t{0} : entry.subindex,
                        .name = names_ == SiiNames::all && entry.index != 0 ? text(entry.name) : std::string_view{},
                        .data_type = entry.index == 0 ? std::uint8_t{0} : data_type_number(entry.data_type),
                        .bit_length = static_cast<std::uint8_t>(left)});
    }

    void modes() {
        for (const EsiMode& mode : device_.modes) {
            constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
            const auto shift = [&](std::int64_t ns) {
                if (ns < -kMost - 1 || ns > kMost)
                    error_ = "a shift time of the operation mode '" + mode.name + "' does not fit in 32 bits";
                return static_cast<std::int32_t>(ns);
            };
            if (mode.sync1_cycle_ns != 0)
                remarks_.push_back("CycleTimeSync1 of the operation mode '" + mode.name + "' is " +
                                   std::to_string(mode.sync1_cycle_ns) + " ns: the SII has its factor only");
            sii::DcOpMode m{.sync0_cycle_time_ns = static_cast<std::uint32_t>(mode.sync0_cycle_ns),
                            .sync0_shift_time_ns = shift(mode.sync0_shift_ns),
                            .sync1_shift_time_ns = shift(mode.sync1_shift_ns),
                            .sync1_cycle_factor = mode.sync1_factor,
                            .assign_activate = mode.assign_activate,
                            .sync0_cycle_factor = mode.sync0_factor};
            dc_.push_back({m, text(mode.name), text(mode.description)});
        }
        d_.dc = dc_;
    }

    void categories() {
        if (!device_.eeprom) return;
        for (const EsiCategory& one : device_.eeprom->categories) {
            const bool first = one.type <= sii::category::kLastDeviceSpecific;
            if (is_described_category(one.type)) {
                remarks_.push_back("the file's category " + std::to_string(one.type) +
                                   " is not used: it is made from the description of the device");
                continue;
            }
            (first ? before_ : after_).push_back({one.type, one.content});
        }
        d_.device_specific = before_;
        d_.others = after_;
    }

    const EsiDevice& device_;
    SiiNames names_;
    sii::Description d_;
    std::deque<std::string> texts_;
    std::vector<FmmuUse> fmmus_;
    std::vector<SmInfo> sms_;
    std::vector<sii::PdoDescription> tx_pdos_;
    std::vector<sii::PdoDescription> rx_pdos_;
    std::deque<std::vector<sii::PdoEntryDescription>> entries_;
    std::vector<sii::DcDescription> dc_;
    std::vector<sii::RawCategory> before_;
    std::vector<sii::RawCategory> after_;
    std::vector<std::string> remarks_;
    bool named_characters_ = false;
    std::string error_;
};

SiiImage failed(std::string error) { return {.error = std::move(error)}; }

SiiImage whole_image(const EsiEeprom& eeprom) {
    SiiImage image{.octets = eeprom.whole};
    if (image.octets.size() < sii::kFixedBytes)
        return failed("the image in the file has " + std::to_string(image.octets.size()) + " octets, less than " +
                      std::to_string(sii::kFixedBytes));
    if (image.octets.size() % 2 != 0) return failed("the image in the file is not a whole number of words");
    image.used = image.octets.size();
    if (eeprom.bytes > image.octets.size() && eeprom.bytes <= sii::kMostContentBytes)
        image.octets.resize(eeprom.bytes, std::byte{0xFF});
    return image;
}

}  // namespace

SiiImage make_sii(const EsiDevice& device) {
    if (device.eeprom && !device.eeprom->whole.empty()) return whole_image(*device.eeprom);
    constexpr std::uint32_t kUsualBytes = 2048;
    const std::uint32_t wanted = device.eeprom ? device.eeprom->bytes : 0;
    const std::uint32_t bytes = wanted == 0 ? kUsualBytes : wanted;
    if (bytes % 128 != 0 || bytes > 4U * 1024 * 1024)
        return failed("ByteSize of the EEPROM is " + std::to_string(bytes) +
                      ": it must be a multiple of 128, and at most 4194304");
    for (const SiiNames names : {SiiNames::all, SiiNames::without_entries, SiiNames::of_the_device}) {
        Builder builder(device, names);
        const sii::Description description = builder.describe();
        if (!builder.error().empty()) return failed(builder.error());
        SiiImage image{.octets = std::vector<std::byte>(bytes), .remarks = builder.remarks()};
        auto written = sii::write_image(description, image.octets);
        // Without ByteSize, the EEPROM gets the least sufficient size.
        for (std::uint32_t larger = bytes; written.fault == sii::Fault::no_room && wanted == 0 && larger < 65536;) {
            larger *= 2;
            image.octets.assign(larger, std::byte{0});
            written = sii::write_image(description, image.octets);
        }
        image.used = written.value;
        if (written.ok()) {
            if (names == SiiNames::without_entries)
                image.remarks.emplace_back("the names of entries do not fit and are left out");
            if (names == SiiNames::of_the_device)
                image.remarks.emplace_back("the names of PDOs and entries do not fit and are left out");
            return image;
        }
        if (names == SiiNames::of_the_device)
            return failed("the image of " + device.type + " cannot be made for an EEPROM of " + std::to_string(bytes) +
                          " octets: " + std::string(to_text(written.fault)));
    }
    return failed("the image cannot be made");
}

}  // namespace margay::files
