// ESI files (ETG.2000): the descriptions of devices by their vendors, and their use in a master: names of process data,
// the configuration of a slave, operation modes, modules in slots, and the SII image of a device.
//
//     const auto content = margay::files::read_file("device.xml");
//     if (!content.error.empty()) …;                   // the file cannot be read
//     const auto esi = margay::files::read_esi(content.octets);
//     if (!esi) …;                                           // to_text(esi.problem): the place and the reason
//     const auto* device = margay::files::find_device(*esi, ctx.slave(1).identity);
//
// For systems with a heap. No function here accesses a bus, except check_modules().
#pragma once

#include <margay/configuration.hpp>
#include <margay/files/text_place.hpp>
#include <margay/slave.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace margay {
class Context;
class HostConfiguration;
}  // namespace margay

namespace margay::files {

// One entry of a PDO. Index 0: a gap.
struct EsiEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint16_t bits = 0;
    std::string name{};
    std::string data_type{};  // as in the file: "UINT", "BOOL", or the name of a type of the dictionary
};

struct EsiPdo {
    Direction direction = Direction::outputs;  // RxPdo: outputs, TxPdo: inputs
    std::uint16_t index = 0;
    std::string name{};
    std::optional<std::uint8_t> sync_manager{};  // assigned by default to this one; not set: not assigned
    bool fixed = false;                          // the entries cannot be changed
    bool mandatory = false;                      // cannot be taken out of the assignment
    bool is_virtual = false;
    bool overwritten_by_module = false;
    bool depends_on_slot = false;  // of a module: the index grows with the number of the slot
    std::vector<std::uint16_t> excludes{};
    std::vector<EsiEntry> entries{};
    std::vector<bool> entry_depends_on_slot{};  // for each entry, of a module
    [[nodiscard]] std::uint32_t bits() const;
};

struct EsiSyncManager {
    SmType type = SmType::unused;  // unused: the file has "Unused", or a name outside the standard
    std::string use{};             // as in the file
    std::uint16_t start = 0;
    std::uint8_t control = 0;
    std::uint16_t default_bytes = 0;
    std::uint16_t least_bytes = 0;
    std::uint16_t most_bytes = 0;
    bool enabled = false;
    bool op_only = false;
    bool is_virtual = false;
    // The direction by `type`, otherwise by the control octet.
    [[nodiscard]] Direction direction() const;
};

struct EsiFmmu {
    FmmuUse use = FmmuUse::unused;
    std::string text{};
};

// A start-up command of the device. CoE: `index` and `subindex`; SoE: `index` is the IDN, `subindex` the drive; EoE:
// `index` is the type of the request, 2 (IP parameters), 4 (address filter) or 0 (`data` shows it), and the EoE header
// may be missing in `data`; AoE: `data` is a command that writes, from the AoE header on.
struct EsiCommand {
    std::uint16_t protocol = mailbox_protocol::kCoE;
    Transition transitions = Transition::none;
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;
    bool depends_on_slot = false;
    std::vector<std::byte> data{};
    std::string comment{};
};

struct EsiMailbox {
    bool data_link_layer = false;  // the slave repeats a lost message
    std::uint16_t protocols = 0;   // mailbox_protocol bits
    std::uint8_t coe_details = 0;  // coe_detail bits
    std::uint8_t soe_channels = 0;
    std::uint8_t ds402_channels = 0;  // axes by CoE
    Duration request_timeout{0};
    Duration response_timeout{0};
    std::vector<EsiCommand> commands{};
};

// A SyncManager of an operation mode: the PDOs that the mode assigns to it. No PDOs: the mode does not change the
// assignment.
struct EsiModeSm {
    std::uint8_t number = 0;
    std::vector<std::uint16_t> pdos{};
};

// An operation mode with distributed clocks.
struct EsiMode {
    std::string name{};
    std::string description{};
    std::uint16_t assign_activate = 0;  // 0: without SYNC signals
    std::int64_t sync0_cycle_ns = 0;    // 0: by the factor
    std::int16_t sync0_factor = 0;      // n cycles of the master; negative: the nth part of a cycle
    bool sync0_cycle_given = false;
    std::int64_t sync0_shift_ns = 0;
    std::int64_t sync1_cycle_ns = 0;
    std::int16_t sync1_factor = 0;  // n cycles of SYNC0
    std::int64_t sync1_shift_ns = 0;
    std::vector<EsiModeSm> sync_managers{};
};

struct EsiCategory {
    std::uint16_t type = 0;
    std::vector<std::byte> content{};
};

struct EsiEeprom {
    std::uint32_t bytes = 0;                 // size of the EEPROM; 0: not given
    std::vector<std::byte> whole{};          // the whole image, if the file contains it
    std::vector<std::byte> configuration{};  // words 0 to 6
    std::vector<std::byte> boot_mailbox{};   // words 20 to 23
    std::vector<EsiCategory> categories{};
};

// An object of the dictionary.
struct EsiObject {
    struct Item {
        std::uint8_t subindex = 0;
        std::string name{};
        std::string data_type{};
        std::uint32_t bits = 0;
        std::string access{};  // "ro", "rw", "wo"; empty: not given
        char pdo_mapping = 0;  // 'R' (outputs), 'T' (inputs), 'B' (both), 0 (none)
    };
    std::uint16_t index = 0;
    std::string name{};
    std::string data_type{};
    std::uint32_t bits = 0;
    std::string access{};
    char pdo_mapping = 0;
    std::vector<std::byte> default_data{};
    std::vector<Item> items{};
};

struct EsiModuleIdent {
    std::uint32_t ident = 0;
    bool is_default = false;
};

struct EsiSlot {
    std::string name{};
    std::uint32_t least = 0;
    std::uint32_t most = 1;
    std::vector<EsiModuleIdent> idents{};
    std::vector<std::string> classes{};
};

struct EsiSlots {
    std::uint32_t most = 0;  // 0: the number of slots
    std::uint32_t pdo_increment = 0;
    std::uint32_t index_increment = 0;
    bool download_ident_list = false;  // the master writes 0xF030
    std::vector<EsiSlot> slots{};
    // The number of slots, instances of slots included.
    [[nodiscard]] std::uint32_t count() const;
    // The description of slot `number`, the first is 0; nullptr: there is none.
    [[nodiscard]] const EsiSlot* slot(std::uint32_t number) const;
};

struct EsiModule {
    std::uint32_t ident = 0;
    std::string type{};
    std::string name{};
    std::string module_class{};
    std::vector<EsiPdo> pdos{};
    std::vector<EsiCommand> commands{};
};

// How the revision of a found device is compared with the revision in the file (CheckRevisionNo).
enum class RevisionCheck : std::uint8_t { none, equal, equal_or_greater, low_equal, low_equal_high_equal_or_greater };
[[nodiscard]] bool revision_fits(RevisionCheck check, std::uint32_t described, std::uint32_t found);

struct EsiDevice {
    std::uint32_t line = 0;  // of the file
    std::string type{};      // the order code
    std::string name{};
    std::string group{};  // GroupType
    std::string group_name{};
    Identity identity{};  // the vendor of the file
    RevisionCheck revision_check = RevisionCheck::none;
    std::array<PortType, 4> ports{};
    bool no_lrw = false;  // the device cannot be exchanged by LRW
    bool safeop_configuration = false;
    std::int16_t ebus_current_ma = 0;
    std::uint8_t sysman_class = 0;  // TcSmClass
    SlaveTimes times{};
    std::uint16_t device_id_address = 0;  // IdentificationAdo
    bool device_id_by_al_status = false;
    std::vector<EsiSyncManager> sync_managers{};
    std::vector<EsiFmmu> fmmus{};
    std::vector<EsiPdo> pdos{};
    std::optional<EsiMailbox> mailbox{};
    std::vector<EsiMode> modes{};  // the first is the default
    bool has_dc = false;           // the element Dc is there
    std::vector<EsiObject> dictionary{};
    std::optional<EsiSlots> slots{};
    std::optional<EsiEeprom> eeprom{};
    std::optional<std::uint16_t> watchdog_divider{};       // ESC register 0x0400
    std::optional<std::uint16_t> pdi_watchdog{};           // 0x0410, in units of the divider
    std::optional<std::uint16_t> process_data_watchdog{};  // 0x0420

    [[nodiscard]] const EsiPdo* find_pdo(std::uint16_t index) const;
};

struct EsiFile {
    std::uint32_t vendor = 0;
    std::string vendor_name{};
    std::vector<EsiDevice> devices{};
    std::vector<EsiModule> modules{};
    std::vector<std::string> further_files{};  // InfoReference: files with modules

    [[nodiscard]] const EsiModule* find_module(std::uint32_t ident) const;
};

// Reads the octets of an ESI file (root EtherCATInfo), or of a file with modules only (EtherCATModule). A device or
// module with a fault is left out and named in `remarks`; when nothing is left, its fault is the problem of the file.
[[nodiscard]] Read<EsiFile> read_esi(std::string_view octets);

// The device of this identity: vendor and product are equal, and the revision fits the device's RevisionCheck. Of
// several such devices, the one with the greatest revision. nullptr: there is none.
[[nodiscard]] const EsiDevice* find_device(const EsiFile& esi, const Identity& identity);
// The device with this order code (Type), or with this name. Of several such devices, the one with the greatest
// revision.
[[nodiscard]] const EsiDevice* find_device(const EsiFile& esi, std::string_view type);

// The name of an entry of process data as the file gives it. Empty: the device has no such entry.
[[nodiscard]] std::string_view entry_name(const EsiDevice& device, Direction direction, std::uint16_t index,
                                          std::uint8_t subindex);

// The index of a basic data type of CoE (ETG.1000.6), as the SII contains it; 0: not a basic type.
[[nodiscard]] std::uint8_t data_type_number(std::string_view name);

// Builds the SII image of a device. `octets` is the whole EEPROM, with 0xFF behind the end mark.
struct SiiImage {
    std::vector<std::byte> octets{};
    std::size_t used = 0;  // octets up to the end mark, included
    std::string error{};   // a sentence; empty: the image is valid
    std::vector<std::string> remarks{};
    [[nodiscard]] explicit operator bool() const { return error.empty(); }
};
[[nodiscard]] SiiImage make_sii(const EsiDevice& device);

// The description of a device as its SII gives it: the reverse of make_sii(). The vendor is in the identity. Data that
// belongs to one slave alone is left out: the serial number, the alias, and the category of production data (3).
[[nodiscard]] Read<EsiDevice> describe_sii(std::span<const std::byte> image);

// The selection of a mode, a cycle and modules for a device.
struct EsiChoice {
    std::size_t mode = 0;  // number of the operation mode, the first is 0; ignored if the device has none
    Duration cycle = std::chrono::milliseconds(1);  // for factors of the operation mode
    // The modules in the slots, from slot 0 on, by their idents; 0: an empty slot. Not set: the default modules.
    std::optional<std::vector<std::uint32_t>> modules{};
};

// The number of the operation mode with this name; nullopt: there is none.
[[nodiscard]] std::optional<std::size_t> find_mode(const EsiDevice& device, std::string_view name);
// The SYNC settings of an operation mode. Source `none` for a mode without SYNC signals.
[[nodiscard]] SyncSettings sync_settings(const EsiMode& mode, Duration cycle);

// A configuration of the device as the file describes it: PDOs with their entries, start-up commands, times, SYNC
// signals, and with modules the list 0xF030. The library writes the PDOs only where the device allows that.
struct EsiConfiguration {
    const SlaveConfiguration* config = nullptr;  // belongs to the HostConfiguration; nullptr: see `error`
    std::vector<EsiPdo> pdos{};                  // the assigned PDOs in their order, also of modules
    std::string error{};
    std::vector<std::string> remarks{};
};
[[nodiscard]] EsiConfiguration configure(const EsiFile& esi, const EsiDevice& device, const EsiChoice& choice,
                                         HostConfiguration& owner);

// Compares the modules that a slave has detected (object 0xF050) with the wanted ones. Waits. The result names the
// first slot that differs in a sentence; empty: they are equal.
[[nodiscard]] std::string check_modules(Context& ctx, std::uint16_t slave, std::span<const std::uint32_t> wanted);

// The description of a slave from its SII, and from its object dictionary if it has CoE with SDO information. The
// function reads the SII: bring the slave to PREOP before. Waits.
[[nodiscard]] Read<EsiDevice> describe_slave(Context& ctx, std::uint16_t slave);

// Writes an ESI file in the order of elements that ETG.2000 requires. read_esi() of the text gives the same devices.
// Of a dictionary the objects with their types and access rights are written, and no start values except DefaultData.
[[nodiscard]] Written write_esi(const EsiFile& esi);

}  // namespace margay::files
