#include "common/sii_text.hpp"

#include "common/slave_report.hpp"
#include "wire/sii_category.hpp"
#include "wire/sync_manager.hpp"

#include <fmt/format.h>

#include <iterator>

namespace margay::samples {
namespace {

namespace sii = wire::sii;

struct BitName {
    unsigned bit;
    std::string_view name;
};

// Names of bits, such as "CoE FoE". Bits without a name are shown as a number.
std::string bit_names(unsigned bits, std::initializer_list<BitName> names) {
    std::string out;
    const auto add = [&out](std::string_view text) {
        if (!out.empty()) out += ' ';
        out += text;
    };
    for (const auto& [bit, name] : names) {
        if ((bits & bit) != 0) add(name);
        bits &= ~bit;
    }
    if (bits != 0) add(fmt::format("0x{:x}", bits));
    return out.empty() ? "none" : out;
}

std::string_view sm_type_text(SmType type) {
    switch (type) {
        case SmType::unused: return "unused";
        case SmType::mailbox_out: return "mailbox out";
        case SmType::mailbox_in: return "mailbox in";
        case SmType::outputs: return "outputs";
        case SmType::inputs: return "inputs";
    }
    return "unknown type";
}

std::string_view fmmu_text(FmmuUse use) {
    switch (use) {
        case FmmuUse::unused: return "unused";
        case FmmuUse::outputs: return "outputs";
        case FmmuUse::inputs: return "inputs";
        case FmmuUse::mailbox_status: return "mailbox status";
    }
    return "unknown";
}

std::string_view port_text(sii::PhysicalPort port) {
    switch (port) {
        case sii::PhysicalPort::unused: return "-";
        case sii::PhysicalPort::mii: return "MII";
        case sii::PhysicalPort::reserved: return "reserved";
        case sii::PhysicalPort::ebus: return "E-bus";
        case sii::PhysicalPort::fast_hot_connect: return "fast hot connect";
    }
    return "unknown";
}

// The CoE base types that PDO entries have (ETG.1000.6, "Base data types").
std::string data_type_text(std::uint8_t type) {
    switch (type) {
        case 0x01: return "BOOL";
        case 0x02: return "SINT";
        case 0x03: return "INT";
        case 0x04: return "DINT";
        case 0x05: return "USINT";
        case 0x06: return "UINT";
        case 0x07: return "UDINT";
        case 0x08: return "REAL";
        case 0x11: return "LREAL";
        case 0x15: return "LINT";
        case 0x1B: return "ULINT";
        default: return fmt::format("type 0x{:02x}", type);
    }
}

class Text {
  public:
    explicit Text(Bytes image, bool used_part = false)
        : used_part_(used_part),
          image_(image),
          strings_(sii::find_category(image, sii::category::kStrings).value_or(Bytes{})) {}

    std::string run() {
        if (sii::is_blank(image_)) {
            line("{}", sii::to_text(sii::Fault::blank));
            return std::move(out_);
        }
        if (image_.size() >= sii::kFixedBytes) fixed_part();
        sii::CategoryWalker walker(image_);
        while (const auto found = walker.next()) category(*found);
        auto findings = sii_findings(image_);
        if (used_part_)
            std::erase_if(findings, [](const sii::Finding& one) {
                return one.fault == sii::Fault::size_mismatch && one.expected < one.actual;
            });
        if (!findings.empty()) line("\nfaults");
        for (const auto& finding : findings) line("  {}", finding_text(finding));
        return std::move(out_);
    }

  private:
    template <class... Arguments>
    void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        fmt::format_to(std::back_inserter(out_), format, std::forward<Arguments>(arguments)...);
        while (out_.ends_with(' ')) out_.pop_back();
        out_ += '\n';
    }

    static std::string utf8(Bytes octets) {
        return words_of_slave({reinterpret_cast<const char*>(octets.data()), octets.size()});
    }

    // A string and its number, such as `"EL2004" (1)`; empty for number 0.
    [[nodiscard]] std::string name(sii::StringNumber number) const {
        if (number == 0) return "";
        const auto found = sii::string(strings_, number);
        return found.ok() ? fmt::format("\"{}\" ({})", utf8(found.value), number)
                          : fmt::format("string {}: {}", number, sii::to_text(found.fault));
    }

    void fixed_part() {
        const auto [fixed, fault] = sii::load_fixed_part(image_);
        const auto& c = fixed.configuration;
        line("size                   {} octets by word 0x003e, {} here", fixed.eeprom_bytes, image_.size());
        line("version                {}", fixed.version);
        line("PDI control            0x{:04x}", c.pdi_control);
        line("PDI configuration      0x{:04x}, extended 0x{:04x}", c.pdi_configuration, c.extended_pdi_configuration);
        line("SYNC pulse length      {} ns", c.sync_pulse_length_10ns * 10U);
        line("alias                  0x{:04x}", c.alias);
        line("checksum               0x{:02x}, {}", c.checksum & 0xFF,
             fault == sii::Fault::checksum ? fmt::format("should be 0x{:02x}", sii::checksum(image_)) : "right");
        line("vendor                 0x{:08x}", fixed.identity.vendor);
        line("product                0x{:08x}", fixed.identity.product);
        line("revision               0x{:08x}", fixed.identity.revision);
        line("serial                 0x{:08x}", fixed.identity.serial);
        mailbox("mailbox", fixed.mailboxes.standard);
        mailbox("boot mailbox", fixed.mailboxes.boot);
        line("mailbox protocols      {}",
             bit_names(fixed.mailboxes.standard.protocols, {{mailbox_protocol::kAoE, "AoE"},
                                                            {mailbox_protocol::kEoE, "EoE"},
                                                            {mailbox_protocol::kCoE, "CoE"},
                                                            {mailbox_protocol::kFoE, "FoE"},
                                                            {mailbox_protocol::kSoE, "SoE"},
                                                            {mailbox_protocol::kVoE, "VoE"}}));
    }

    void mailbox(std::string_view what, const MailboxInfo& m) {
        if (m.out_bytes == 0 && m.in_bytes == 0) return line("{:<22} none", what);
        line("{:<22} out 0x{:04x} {} octets, in 0x{:04x} {} octets", what, m.out_start, m.out_bytes, m.in_start,
             m.in_bytes);
    }

    void category(const sii::Category& found) {
        const auto& [type, words, word] = found.place;
        line("\ncategory {} {}: word 0x{:04x}, {} words", type, sii::category::name(type), word, words);
        switch (type) {
            case sii::category::kStrings: return strings(found.content);
            case sii::category::kGeneral: return general(found.content);
            case sii::category::kFmmu: return fmmus(found.content);
            case sii::category::kSyncManager: return sync_managers(found.content);
            case sii::category::kTxPdo:
            case sii::category::kRxPdo: return pdos(found.content);
            case sii::category::kDc: return dc(found.content);
            default: return octets(found.content);
        }
    }

    void strings(Bytes content) {
        for (unsigned number = 1; number <= sii::string_count(content); ++number) {
            const auto found = sii::string(content, static_cast<sii::StringNumber>(number));
            if (!found.ok()) return;  // the findings report this fault
            line("  {:>3} \"{}\"", number, utf8(found.value));
        }
    }

    void general(Bytes content) {
        const auto g = sii::parse_general(content).value;
        line("  group                {}", name(g.group));
        line("  image                {}", name(g.image));
        line("  order                {}", name(g.order));
        line("  name                 {}", name(g.name));
        line("  CoE                  {}",
             bit_names(g.coe_details, {{coe_detail::kSdo, "SDO"},
                                       {coe_detail::kSdoInformation, "SDO-information"},
                                       {coe_detail::kPdoAssignment, "PDO-assignment"},
                                       {coe_detail::kPdoConfiguration, "PDO-configuration"},
                                       {coe_detail::kUploadAtStartup, "upload-at-startup"},
                                       {coe_detail::kCompleteAccess, "complete-access"}}));
        line("  FoE, EoE             0x{:02x}, 0x{:02x}", g.foe_details, g.eoe_details);
        line("  SoE channels         {}", g.soe_channels);
        line("  DS402 channels       {}", g.ds402_channels);
        line("  SysMan class         {}", g.sysman_class);
        line("  flags                {}",
             bit_names(g.flags, {{sii::general_flag::kEnableSafeOp, "enable-SAFEOP"},
                                 {sii::general_flag::kNotLrw, "no-LRW"},
                                 {sii::general_flag::kMailboxDataLink, "mailbox-data-link-layer"},
                                 {sii::general_flag::kIdentAlStatus, "identification-by-AL-status"},
                                 {sii::general_flag::kIdentMemory, "identification-by-memory"}}));
        line("  E-bus current        {} mA{}", g.ebus_current_ma, g.ebus_current_ma < 0 ? " (fed in)" : "");
        line("  ports                {}, {}, {}, {}", port_text(sii::physical_port(g, 0)),
             port_text(sii::physical_port(g, 1)), port_text(sii::physical_port(g, 2)),
             port_text(sii::physical_port(g, 3)));
        if ((g.flags & sii::general_flag::kIdentMemory) != 0)
            line("  identification at    0x{:04x}", g.identification_address);
    }

    void fmmus(Bytes content) {
        sii::FmmuUses uses(content);
        for (unsigned number = 0; const auto use = uses.next(); ++number)
            line("  FMMU {}  {}", number, fmmu_text(*use));
    }

    void sync_managers(Bytes content) {
        sii::SyncManagers managers(content);
        for (unsigned number = 0; const auto sm = managers.next(); ++number)
            line("  SM {}  0x{:04x} {:>5} octets  control 0x{:02x}  {}  {}", number, sm->start, sm->length_bytes,
                 sm->control, sm_type_text(sm->type),
                 bit_names(sm->enable, {{sii::sm_enable::kEnable, "enabled"},
                                        {sii::sm_enable::kFixedContent, "fixed-content"},
                                        {sii::sm_enable::kVirtual, "virtual"},
                                        {sii::sm_enable::kOpOnly, "op-only"}}));
    }

    void pdos(Bytes content) {
        sii::Pdos all(content);
        while (const auto pdo = all.next()) {
            const auto where = pdo->assigned() ? fmt::format("SM {}", pdo->sync_manager) : std::string("not assigned");
            line("  PDO 0x{:04x}  {}  {}  {}", pdo->index, where,
                 bit_names(pdo->flags, {{sii::pdo_flag::kMandatory, "mandatory"},
                                        {sii::pdo_flag::kDefault, "default"},
                                        {sii::pdo_flag::kFixedContent, "fixed-content"},
                                        {sii::pdo_flag::kVirtual, "virtual"}}),
                 name(pdo->name));
            sii::PdoEntries entries(pdo->entries);
            while (const auto e = entries.next()) {
                if (e->index == 0)
                    line("    gap        {:>3} bits", e->bit_length);
                else
                    line("    0x{:04x}:{:<3}{:>4} bits  {:<5}  {}", e->index, e->subindex, e->bit_length,
                         data_type_text(e->data_type), name(e->name));
            }
        }
    }

    void dc(Bytes content) {
        sii::DcOpModes modes(content);
        while (const auto mode = modes.next()) {
            line("  mode {}  {}", name(mode->name), name(mode->description));
            line("    AssignActivate 0x{:04x}", mode->assign_activate);
            line("    SYNC0 cycle {} ns, factor {}, shift {} ns", mode->sync0_cycle_time_ns, mode->sync0_cycle_factor,
                 mode->sync0_shift_time_ns);
            line("    SYNC1 factor {}, shift {} ns", mode->sync1_cycle_factor, mode->sync1_shift_time_ns);
        }
    }

    void octets(Bytes content) {
        constexpr std::size_t kOctetsALine = 16;
        for (std::size_t at = 0; at < content.size(); at += kOctetsALine) {
            std::string hex;
            std::string shown;
            for (const auto octet : content.subspan(at, std::min(kOctetsALine, content.size() - at))) {
                const auto value = std::to_integer<unsigned>(octet);
                hex += fmt::format("{:02x} ", value);
                shown += value >= 0x20 && value < 0x7F ? static_cast<char>(value) : '.';
            }
            line("  {:04x}  {:<48} {}", at, hex, shown);
        }
    }

    bool used_part_;
    Bytes image_;
    Bytes strings_;
    std::string out_;
};

}  // namespace

std::string sii_text(Bytes image) { return Text(image).run(); }
std::string sii_text_of_used_part(Bytes image) { return Text(image, true).run(); }

std::vector<sii::Finding> sii_findings(Bytes image) {
    std::vector<sii::Finding> findings(sii::check_image(image, {}));
    (void)sii::check_image(image, findings);
    return findings;
}

std::string finding_text(const sii::Finding& finding) {
    std::string out = fmt::format("word 0x{:04x}: ", finding.word);
    if (finding.category != sii::category::kEnd)
        out += fmt::format("category {} {}: ", finding.category, sii::category::name(finding.category));
    out += sii::to_text(finding.fault);
    if (finding.expected != finding.actual) {
        const bool octet = finding.fault == sii::Fault::checksum;
        out += octet ? fmt::format(" (expected 0x{:02x}, found 0x{:02x})", finding.expected, finding.actual)
                     : fmt::format(" (expected {}, found {})", finding.expected, finding.actual);
    }
    return out;
}

}  // namespace margay::samples
