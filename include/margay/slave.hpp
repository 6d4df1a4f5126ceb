// A slave for the application. The library fills in the facts about the slave, which are plain values. A context
// returns a const Slave, so that the application can read the facts and cannot write them. `config` and `hooks` belong
// to the application, which may write them at the times in their comments. For the thread that owns the context.
#pragma once

#include <margay/address.hpp>
#include <margay/al_state.hpp>
#include <margay/configuration.hpp>
#include <margay/error.hpp>
#include <margay/hook.hpp>
#include <margay/idn.hpp>
#include <margay/process_data.hpp>
#include <margay/result.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace margay {

// The identity of a slave: SII words 0x0008–0x000F.
struct Identity {
    std::uint32_t vendor = 0;
    std::uint32_t product = 0;
    std::uint32_t revision = 0;
    std::uint32_t serial = 0;
    friend constexpr bool operator==(const Identity&, const Identity&) = default;
};

// The features of the ESC: ESC registers 0x0000–0x0009.
struct DlInformation {
    std::uint8_t type = 0;
    std::uint8_t revision = 0;
    std::uint16_t build = 0;
    std::uint8_t fmmus = 0;
    std::uint8_t sync_managers = 0;
    std::uint8_t ram_kib = 0;
    std::uint16_t features = 0;
    // The clock, by the features register; after configdc(), by the registers of the clock itself.
    bool dc = false;
    bool dc_64bit = false;
};

// The kind of a port, from ESC register 0x0007.
enum class PortType : std::uint8_t { not_implemented, not_configured, ebus, mii };

// A port of a slave, as the DL status (ESC register 0x0110) and the topology show it.
struct Port {
    PortType type = PortType::not_implemented;
    bool link : 1 = false;        // the port has a physical link
    bool open : 1 = false;        // the loop of the port is open: frames leave and arrive at this port
    std::uint16_t neighbour = 0;  // number of the slave at the other end, the first is 1; 0: none, or the master
};

// The use of a SyncManager, with the values of the SII and of object 0x1C00.
enum class SmType : std::uint8_t { unused = 0, mailbox_out = 1, mailbox_in = 2, outputs = 3, inputs = 4 };

// A SyncManager as the SII describes it. "Out" is from the master to the slave.
struct SmInfo {
    std::uint16_t start = 0;
    std::uint16_t length_bytes = 0;
    std::uint8_t control = 0;
    std::uint8_t enable = 0;  // the enable octet of the SII: bit 0 goes into the activate register
    SmType type = SmType::unused;
};

// The use of an FMMU, with the values of the SII.
enum class FmmuUse : std::uint8_t { unused = 0, outputs = 1, inputs = 2, mailbox_status = 3 };

// The mailbox protocols of a slave, with the bits of SII word 0x001C.
namespace mailbox_protocol {
inline constexpr std::uint16_t kAoE = 0x01;
inline constexpr std::uint16_t kEoE = 0x02;
inline constexpr std::uint16_t kCoE = 0x04;
inline constexpr std::uint16_t kFoE = 0x08;
inline constexpr std::uint16_t kSoE = 0x10;
inline constexpr std::uint16_t kVoE = 0x20;
}  // namespace mailbox_protocol

// The mailboxes of a slave. All zero: the slave has none.
struct MailboxInfo {
    std::uint16_t out_start = 0;  // the master writes here (SyncManager 0)
    std::uint16_t out_bytes = 0;
    std::uint16_t in_start = 0;  // the master reads here (SyncManager 1)
    std::uint16_t in_bytes = 0;
    std::uint16_t protocols = 0;  // mailbox_protocol bits
    [[nodiscard]] constexpr bool present() const { return out_bytes != 0 && in_bytes != 0; }
};

// The CoE services of a slave, with the bits of the SII.
namespace coe_detail {
inline constexpr std::uint8_t kSdo = 0x01;
inline constexpr std::uint8_t kSdoInformation = 0x02;
inline constexpr std::uint8_t kPdoAssignment = 0x04;
inline constexpr std::uint8_t kPdoConfiguration = 0x08;
inline constexpr std::uint8_t kUploadAtStartup = 0x10;
inline constexpr std::uint8_t kCompleteAccess = 0x20;
}  // namespace coe_detail

// The end of a ring with two NICs to which a slave is connected: the NIC whose frames reach the slave.
enum class RingEnd : std::uint8_t { first_nic, second_nic };

// How a slave reports its explicit device id, according to its SII.
enum class DeviceIdSource : std::uint8_t { none, al_status, memory };

class Context;
struct ExpectedSlave;

// Functions of the application that poll() calls while it works on one slave. The library hands `user` to them.
struct SlaveHooks {
    // Called in PREOP, before the library reads or configures the process data of the slave (SOEM's PO2SO hook): here
    // the application can select PDOs. An error keeps the slave in PREOP.
    Hook<> preop_to_safeop;
    void* user = nullptr;
    // Called around each state change that the library makes, from the time on when it is set (at the first start-up
    // config_init() has passed INIT to PREOP before a hook can be set): before the library requests the state, after
    // the commands of SlaveSetup::startup for this transition; and after the slave has reached the state. On the way
    // up, an error keeps the slave in its present state. On the way down, the error is added to errors() and the state
    // change continues. An error of the hook after the state change is an error of the slave.
    Hook<Transition, Moment> transition;
};

// One slave: the facts that the library knows about it, and the configuration that the application gives it.
struct Slave {
    static constexpr std::size_t kNameBytes = 64;
    static constexpr std::size_t kSyncManagers = 8;
    static constexpr std::size_t kFmmus = 8;

    std::uint16_t number = 0;  // the first is 1; config_init() assigns it (ExpectedSlave)
    StationAddress station_address;
    std::uint16_t alias = 0;  // ESC register 0x0012, loaded from the SII
    std::uint16_t dl_status = 0;
    Identity identity;
    DlInformation dl;
    AlStatus al;  // as read last
    // The slave's position in the ring as found last. The first slave has 1, although the standard and RingPosition
    // count from 0; 0: the slave is not in the ring. The position may differ from `number` when slaves are missing or
    // unexpected, or are identified by something else than their place.
    std::uint16_t ring_position = 0;
    // Explicit device id (ETG.1020), mostly set by a switch on the device; read if expect() names a device id for this
    // slave.
    std::optional<std::uint16_t> device_id{};
    bool device_emulation : 1 = false;  // AL status mirrors AL control: never acknowledge an error of this slave
    bool seen : 1 = false;  // the slave was present since config_init() began: its ESC registers and SII have been read
    bool hook_failed : 1 = false;  // the last preop_to_safeop has ended with an error: the slave stays in PREOP
    bool pdos_failed : 1 = false;  // the PDOs of the configuration could not be written: the slave stays in PREOP
    bool takes_part : 1 = false;   // its process data is configured and, as far as the library knows, exchanged
    bool other : 1 = false;        // config_init() has found another slave here than ExpectedSlave describes
    bool unexpected : 1 = false;   // config_init() has found the slave, and the list of expect() does not contain it
    // `other` or `unexpected`, and not tolerated: the slave is held in PREOP, or in INIT if it has no mailbox, and gets
    // no outputs.
    bool held : 1 = false;
    // config_map() could not read the slave: its part of the image has the sizes of SlaveSetup::pdos, which the slave's
    // own PDOs may contradict when the slave appears.
    bool place_kept : 1 = false;
    // config_map() could not read the slave and did not know its sizes: it has no part of the image until the next
    // config_map(). If the slave is wanted, no cycle is right meanwhile.
    bool unplaced : 1 = false;
    // The target that set_target() has set for this slave; NONE: none, the target of all slaves applies.
    AlState target = AlState::none;

    // Topology: every slave except the first is connected to a port of another slave. The topology follows from the DL
    // status of the slaves, provided that frames enter each slave with slaves behind it at port 0. Where cables are
    // swapped, configdc() finds the order by the receive times, and corrects these members (with one NIC). Until then,
    // without clocks, and after a slave there was lost and is back, these members are wrong for the slaves at the
    // swapped cables.
    std::uint16_t parent = 0;  // number of the slave before this one; 0: the master
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    // The NIC whose frames pass this slave first. While the ring is whole: the NIC at its beginning, which is the
    // second one if the cables are swapped (RedundancyStatus::swapped). Without redundancy always first_nic.
    RingEnd ring = RingEnd::first_nic;
    std::array<Port, 4> ports{};

    // From the SII. sync_managers and fmmu_use have the order of the SII; entries that do not fit the arrays are
    // dropped.
    std::uint32_t sii_bytes = 0;  // size of the EEPROM, as SII word 0x003E reports it
    MailboxInfo mailbox;
    MailboxInfo boot_mailbox;      // `protocols` as in `mailbox`
    std::uint8_t coe_details = 0;  // coe_detail bits
    std::uint8_t foe_details = 0;
    std::uint8_t eoe_details = 0;
    DeviceIdSource device_id_source = DeviceIdSource::none;
    std::uint16_t device_id_word = 0;  // SII word: the ESC address at which the device id is located
    std::int16_t ebus_current_ma = 0;  // current that the slave draws from the E-bus; negative: it feeds the E-bus
    bool sii_read = false;
    std::uint8_t sm_count = 0;
    std::uint8_t fmmu_count = 0;
    std::uint8_t name_bytes = 0;  // length of name_text
    std::array<SmInfo, kSyncManagers> sync_managers{};
    std::array<FmmuUse, kFmmus> fmmu_use{};

    // The first error of this slave since the last scan began, since clear_error(), or since the supervision has
    // brought the slave back to its target state; code none if there was none.
    Error error;

    // The entry of the list of expect() for this slave; nullptr: there is none. Points into the caller's list.
    const ExpectedSlave* wanted = nullptr;

    // The slave's part of the image of its group, after the group is mapped. The octets are writable.
    SlaveImage image;

    // The configuration that the application gives the slave. Mutable, because a context returns a const Slave.
    mutable SlaveConfiguration config;
    mutable SlaveHooks hooks;

    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
    std::array<char, kNameBytes> name_text{};
};
static_assert(sizeof(void*) != 8 || sizeof(Slave) <= 528);  // so that many slaves fit into a small memory

}  // namespace margay
