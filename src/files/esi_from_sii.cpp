// Makes the description of a device from its SII: the reverse of esi_sii.cpp.
#include <margay/files/esi.hpp>

#include "files/esi_categories.hpp"
#include "files/esi_types.hpp"
#include "files/xml.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::files {
namespace {

namespace sii = wire::sii;

class Describer {
  public:
    explicit Describer(Bytes image)
        : image_(image), strings_(sii::find_category(image, sii::category::kStrings).value_or(Bytes{})) {}

    EsiDevice run(const sii::FixedPart& fixed) {
        d_.identity = fixed.identity;
        d_.identity.serial = 0;
        general();
        sync_managers();
        if (const auto fmmus = sii::find_category(image_, sii::category::kFmmu)) {
            sii::FmmuUses uses(*fmmus);
            while (const auto use = uses.next()) d_.fmmus.push_back({*use, {}});
            while (!d_.fmmus.empty() && d_.fmmus.back().use == FmmuUse::unused) d_.fmmus.pop_back();
        }
        pdos(sii::category::kRxPdo, Direction::outputs);
        pdos(sii::category::kTxPdo, Direction::inputs);
        modes();
        mailbox(fixed);
        eeprom(fixed);
        return std::move(d_);
    }

    [[nodiscard]] const std::vector<Remark>& remarks() const { return remarks_; }

  private:
    std::string text(sii::StringNumber number) const {
        std::array<char, 768> into{};
        return std::string(sii::to_utf8(sii::string(strings_, number).value, into));
    }

    void general() {
        const auto content = sii::find_category(image_, sii::category::kGeneral);
        if (!content) return;
        general_ = sii::parse_general(*content).value;
        d_.type = text(general_.order);
        d_.name = text(general_.name);
        d_.group = text(general_.group);
        constexpr std::size_t kGroupName = 14;
        if (content->size() > kGroupName) d_.group_name = text(load_le<std::uint8_t>(*content, kGroupName));
        d_.ebus_current_ma = general_.ebus_current_ma;
        for (unsigned port = 0; port < d_.ports.size(); ++port) {
            const auto kind = sii::physical_port(general_, port);
            if (kind == sii::PhysicalPort::mii || kind == sii::PhysicalPort::fast_hot_connect)
                d_.ports[port] = PortType::mii;
            if (kind == sii::PhysicalPort::ebus) d_.ports[port] = PortType::ebus;
        }
        d_.sysman_class = general_.sysman_class;
        d_.no_lrw = (general_.flags & sii::general_flag::kNotLrw) != 0;
        d_.safeop_configuration = (general_.flags & sii::general_flag::kEnableSafeOp) != 0;
        d_.device_id_by_al_status = (general_.flags & sii::general_flag::kIdentAlStatus) != 0;
        if ((general_.flags & sii::general_flag::kIdentMemory) != 0)
            d_.device_id_address = general_.identification_address;
    }

    void sync_managers() {
        const auto content = sii::find_category(image_, sii::category::kSyncManager);
        if (!content) return;
        sii::SyncManagers list(*content);
        while (const auto sm = list.next())
            d_.sync_managers.push_back({.type = sm->type,
                                        .use = sm->type == SmType::unused ? kUnusedSm : "",
                                        .start = sm->start,
                                        .control = sm->control,
                                        .default_bytes = sm->length_bytes,
                                        .enabled = (sm->enable & sii::sm_enable::kEnable) != 0,
                                        .op_only = (sm->enable & sii::sm_enable::kOpOnly) != 0,
                                        .is_virtual = (sm->enable & sii::sm_enable::kVirtual) != 0});
    }

    // Reads all categories of the type, because some generators write one category for each PDO.
    void pdos(std::uint16_t type, Direction direction) {
        sii::CategoryWalker walker(image_);
        while (const auto category = walker.next()) {
            if (category->place.type != type) continue;
            sii::Pdos list(category->content);
            while (const auto pdo = list.next()) {
                EsiPdo& one = d_.pdos.emplace_back();
                one.direction = direction;
                one.index = pdo->index;
                one.name = text(pdo->name);
                if (pdo->assigned()) one.sync_manager = pdo->sync_manager;
                one.fixed = (pdo->flags & sii::pdo_flag::kFixedContent) != 0;
                one.mandatory = (pdo->flags & sii::pdo_flag::kMandatory) != 0;
                one.is_virtual = (pdo->flags & sii::pdo_flag::kVirtual) != 0;
                sii::PdoEntries entries(pdo->entries);
                while (const auto entry = entries.next()) {
                    if (entry->bit_length == 0) continue;
                    one.entries.push_back({entry->index, entry->subindex, entry->bit_length, text(entry->name),
                                           std::string(data_type_name(entry->data_type, entry->bit_length))});
                }
                one.entry_depends_on_slot.resize(one.entries.size());
            }
        }
    }

    void modes() {
        const auto content = sii::find_category(image_, sii::category::kDc);
        if (!content) return;
        d_.has_dc = true;
        sii::DcOpModes list(*content);
        while (const auto mode = list.next())
            d_.modes.push_back({.name = text(mode->name),
                                .description = text(mode->description),
                                .assign_activate = mode->assign_activate,
                                .sync0_cycle_ns = mode->sync0_cycle_time_ns,
                                .sync0_factor = mode->sync0_cycle_factor,
                                .sync0_cycle_given = true,
                                .sync0_shift_ns = mode->sync0_shift_time_ns,
                                .sync1_factor = mode->sync1_cycle_factor,
                                .sync1_shift_ns = mode->sync1_shift_time_ns});
    }

    void mailbox(const sii::FixedPart& fixed) {
        if (fixed.mailboxes.standard.protocols == 0) return;
        EsiMailbox& mailbox = d_.mailbox.emplace();
        mailbox.protocols = fixed.mailboxes.standard.protocols;
        mailbox.coe_details = general_.coe_details;
        mailbox.soe_channels = general_.soe_channels;
        mailbox.ds402_channels = general_.ds402_channels;
        mailbox.data_link_layer = (general_.flags & sii::general_flag::kMailboxDataLink) != 0;
    }

    void eeprom(const sii::FixedPart& fixed) {
        EsiEeprom& eeprom = d_.eeprom.emplace();
        eeprom.bytes = fixed.eeprom_bytes;
        eeprom.configuration.assign(image_.begin(), image_.begin() + 14);
        eeprom.configuration[8] = eeprom.configuration[9] = std::byte{0};  // the alias belongs to one slave
        const Bytes boot = image_.subspan(sii::word::kBootMailbox * sii::kWordBytes, 8);
        if (std::ranges::any_of(boot, [](std::byte octet) { return octet != std::byte{0}; }))
            eeprom.boot_mailbox.assign(boot.begin(), boot.end());
        categories(eeprom);
    }

    // The categories that are not made from the description of the device.
    void categories(EsiEeprom& eeprom) {
        constexpr std::uint16_t kProductionData = 3;
        sii::CategoryWalker walker(image_);
        while (const auto category = walker.next()) {
            const std::uint16_t type = category->place.type;
            if (is_described_category(type) || type == sii::category::kNop) continue;
            if (type == kProductionData)
                remarks_.push_back({.text = "category 3 of the SII, with production data of one slave, is left out"});
            else
                eeprom.categories.push_back({type, {category->content.begin(), category->content.end()}});
        }
    }

    Bytes image_;
    Bytes strings_;
    sii::General general_;
    EsiDevice d_;
    std::vector<Remark> remarks_;
};

}  // namespace

Read<EsiDevice> describe_sii(std::span<const std::byte> image) {
    Read<EsiDevice> result;
    const auto fixed = sii::load_fixed_part(image);
    if (fixed.fault == sii::Fault::truncated || sii::is_blank(image)) {
        result.problem.text = "the SII is blank, or shorter than its fixed part";
        return result;
    }
    if (fixed.fault != sii::Fault::none) result.remarks.push_back({.text = std::string(to_text(fixed.fault))});
    Describer describer(image);
    result.value = describer.run(fixed.value);
    result.remarks.insert(result.remarks.end(), describer.remarks().begin(), describer.remarks().end());
    return result;
}

}  // namespace margay::files
