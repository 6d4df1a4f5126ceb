// ENI files (ETG.2100): the configuration of a segment by a configuration tool. The reader makes the same plain data of
// it that an application writes by hand: expected slaves with their configuration, groups, clocks.
//
//     const auto content = margay::files::read_file("machine.xml");
//     if (!content.error.empty()) …;                   // the file cannot be read
//     const auto eni = margay::files::read_eni(content.octets);
//     if (!eni) …;                                    // to_text(eni.problem): the place and the reason
//     for (const auto& remark : eni.remarks) …;       // parts of the file that the library does not use, by line
//     margay::HostContext ctx(eni->limits());
//     … init() …
//     margay::files::bring_up(ctx, *eni, image);      // expect(), config_init(), configdc(), config_map(): to SAFEOP
//
// For systems with a heap.
//
// The library does some work in its own way and does not send the file's commands for it: the scan, the assignment of
// the station addresses that the file gives, the access to the SII, requests and checks of AL states (their timeouts
// are used), the mailbox SyncManagers (from the SII of the slave; remarks_after_scan() compares), clearing of FMMUs and
// SyncManagers, and the clocks. All other init commands become start-up commands of their slaves; a command that
// broadcasts a value becomes one command for each slave.
#pragma once

#include <margay/clocks.hpp>
#include <margay/context.hpp>
#include <margay/expected.hpp>
#include <margay/files/text_place.hpp>
#include <margay/group.hpp>
#include <margay/host_configuration.hpp>
#include <margay/limits.hpp>
#include <margay/slave.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::files {

// A port of a slave of the file. Ports A to D are 0 to 3.
struct EniPort {
    std::uint8_t port = 0;
    std::uint16_t station_address = 0;  // the PhysAddr of the slave
};

// The control octet that the file gives a SyncManager. The place has no text.
struct EniSyncManager {
    std::uint8_t number = 0;
    std::uint8_t control = 0;
    bool is_used = false;  // true: a SyncManager of process data gets this octet; false: a mailbox gets that of the SII
    Remark place{};
};

// A slave of the file. `number` is the number of this slave in the context after config_init().
struct EniSlave {
    std::uint16_t number = 0;
    std::string name{};
    std::uint32_t line = 0;
    std::uint16_t station_address = 0;             // PhysAddr, which config_init() assigns; 0: not given
    std::optional<std::uint16_t> ring_position{};  // as in the file, from 0; Slave::ring_position: from 1
    Identity identity{};
    // The modules that the file writes to the list of configured modules (object 0xF030), from slot 0 on, by their
    // idents; 0: an empty slot.
    std::vector<std::uint32_t> modules{};
    // From the file: the mailboxes, the mailboxes of BOOT, both without protocols, the SyncManagers, and the ports to
    // which the slave may be connected (PreviousPort). Only compared: see remarks_after_scan(). Places have no text.
    MailboxInfo mailbox{};
    Remark mailbox_place{};
    MailboxInfo boot_mailbox{};
    Remark boot_mailbox_place{};
    std::vector<EniSyncManager> sync_managers{};
    std::vector<EniPort> previous_ports{};
    Remark ports_place{};
};

// A variable of the process image.
struct EniVariable {
    std::string name{};
    std::string comment{};
    std::string data_type{};
    Direction direction = Direction::inputs;
    std::uint32_t bits = 0;
    std::uint32_t file_bit = 0;  // BitOffs in the image of the file
    // The slave that the variable belongs to, and the first bit in the data of this slave (slave(n).image.inputs or
    // .outputs). 0: the variable is not on the wire (some tools have variables for states of their own).
    std::uint16_t slave = 0;
    std::uint32_t bit = 0;
};

// A group: the slaves of one Cyclic element.
struct EniGroup {
    GroupConfiguration config{};
    Duration cycle{0};  // 0: the file does not contain it
};

// The sizes in the file for the EoE switch of the master. The library has no such switch: an EoePort has the memory
// that the application gives it.
struct EniEoe {
    std::uint32_t ports = 0;
    std::uint32_t frames = 0;
    std::uint32_t macs = 0;
};

// The configuration that the file describes. Owns all memory that the data points to: it must live as long as the
// context uses it. It can be moved.
struct EniConfiguration {
    std::string master_name{};
    std::vector<EniSlave> slaves{};  // in the order of the file
    std::vector<EniGroup> groups{};
    std::vector<EniVariable> variables{};
    std::optional<EniEoe> eoe{};
    // The clocks, if the file uses distributed clocks.
    std::optional<ClockSettings> clocks{};
    std::uint32_t image_bytes = 0;  // enough for the images of all groups together
    std::unique_ptr<HostConfiguration> owner = std::make_unique<HostConfiguration>();

    [[nodiscard]] Borrowed<ExpectedSlave> expected() const { return owner->expected(); }
    // A context with these limits has room for the slaves and groups of the file.
    [[nodiscard]] Limits limits() const;
    // nullptr: there is no such variable.
    [[nodiscard]] const EniVariable* find(std::string_view name) const;
};

[[nodiscard]] Read<EniConfiguration> read_eni(std::string_view octets);

// Sets the configuration of the groups and the list of expected slaves. Call it after init() and before config_init().
// Errors: as expect(), unknown_group (limits().groups).
Result<> apply(Context& ctx, const EniConfiguration& eni);

// Compares the modules that a slave has detected (0xF050) with the file's modules, where the slave is in PREOP and has
// this list. Call it after each config_init() and before config_map(), in the thread of the owner. Waits. Does this for
// all slaves; returns the first error: from reading the list, or check_failed with index 0xF050 and the subindex of
// the first slot with another module (expected and actual: the idents).
Result<> check_modules(Context& ctx, const EniConfiguration& eni);

// Contents of the file that the library does not apply, found after the scan. One remark for each slave whose
// mailboxes, also of BOOT, differ from its SII (the library uses the SII); for each SyncManager whose control octet
// differs from the SII (mode, direction, interrupt to the slave's processor, watchdog); and for each slave that is
// connected to another port.
// Call it after config_init(). Never waits.
[[nodiscard]] std::vector<Remark> remarks_after_scan(Context& ctx, const EniConfiguration& eni);

// Brings the segment to SAFEOP by the configuration of the file: apply(), config_init(), check_modules(), configdc() if
// the file uses clocks, and config_map() of each group; `image` has at least eni.image_bytes octets and is divided
// between the groups. Returns the first error, after which the segment can be used as after an error of the same
// function. Waits. After the call, remarks_after_scan() names the parts of the file that the library does not apply.
// Where eni.clocks is set, the cycle that brings the slaves to OP must follow the reference clock, with the cycle time
// of the group: MasterClock (master_clock.hpp).
Result<> bring_up(Context& ctx, const EniConfiguration& eni, std::span<std::byte> image);

// Parts of the ENI that write_eni() does not read from the slaves.
struct EniSettings {
    std::string master_name = "Margay";
    Duration cycle = std::chrono::milliseconds(1);
    std::optional<EniEoe> eoe{};  // the switch for EoE: the library has none
};

// Describes the segment of the context as an ENI: the slaves that config_init() has found, and of each mapped group its
// process data, with the configuration in use. The slaves must be in SAFEOP or OP, because the function reads their
// SyncManagers, FMMUs and SYNC registers. The members of the list of expect() are written too: alias or device id,
// serial number, newer revisions, and the hot connect groups that are present. Waits. read_eni() of the text and
// bring_up() write the same registers and station addresses again. Remarks report the facts that an ENI cannot express.
// A missing slave is left out.
[[nodiscard]] Written write_eni(Context& ctx, const EniSettings& settings = {});

}  // namespace margay::files
