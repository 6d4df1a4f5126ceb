// A slave as the application sees it. The facts are plain values that the library fills in; a context hands out a const
// Slave, so the application reads the facts and does not write them. The wishes, `config` and `hooks`, belong to the
// application, which may write them at any time that their comments allow. Read and write from the thread that owns the
// context.
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

// SII words 0x0008–0x000F.
struct Identity {
    std::uint32_t vendor = 0;
    std::uint32_t product = 0;
    std::uint32_t revision = 0;
    std::uint32_t serial = 0;
    friend constexpr bool operator==(const Identity&, const Identity&) = default;
};

// ESC registers 0x0000–0x0009.
struct DlInformation {
    std::uint8_t type = 0;
    std::uint8_t revision = 0;
    std::uint16_t build = 0;
    std::uint8_t fmmus = 0;
    std::uint8_t sync_managers = 0;
    std::uint8_t ram_kib = 0;
    std::uint16_t features = 0;
    bool dc = false;
    bool dc_64bit = false;
};

// How a port is wired, by ESC register 0x0007.
enum class PortType : std::uint8_t { not_implemented, not_configured, ebus, mii };

struct Port {
    PortType type = PortType::not_implemented;
    bool link : 1 = false;        // physical link
    bool open : 1 = false;        // the loop is open: frames leave and come in here
    std::uint16_t neighbour = 0;  // the slave at the other end, 1 the first; 0 none, or the master
};

enum class SmType : std::uint8_t { unused = 0, mailbox_out = 1, mailbox_in = 2, outputs = 3, inputs = 4 };

// A SyncManager as the SII describes it. Out is from the master to the slave.
struct SmInfo {
    std::uint16_t start = 0;
    std::uint16_t length_bytes = 0;
    std::uint8_t control = 0;
    std::uint8_t enable = 0;  // the SII's enable octet: bit 0 is what goes into the activate register
    SmType type = SmType::unused;
};

enum class FmmuUse : std::uint8_t { unused = 0, outputs = 1, inputs = 2, mailbox_status = 3 };

namespace mailbox_protocol {
inline constexpr std::uint16_t kAoE = 0x01;
inline constexpr std::uint16_t kEoE = 0x02;
inline constexpr std::uint16_t kCoE = 0x04;
inline constexpr std::uint16_t kFoE = 0x08;
inline constexpr std::uint16_t kSoE = 0x10;
inline constexpr std::uint16_t kVoE = 0x20;
}  // namespace mailbox_protocol

// Where the mailboxes are. All zero: the slave has none.
struct MailboxInfo {
    std::uint16_t out_start = 0;  // master writes here (SyncManager 0)
    std::uint16_t out_bytes = 0;
    std::uint16_t in_start = 0;  // master reads here (SyncManager 1)
    std::uint16_t in_bytes = 0;
    std::uint16_t protocols = 0;  // mailbox_protocol bits
    [[nodiscard]] constexpr bool present() const { return out_bytes != 0 && in_bytes != 0; }
};

namespace coe_detail {
inline constexpr std::uint8_t kSdo = 0x01;
inline constexpr std::uint8_t kSdoInformation = 0x02;
inline constexpr std::uint8_t kPdoAssignment = 0x04;
inline constexpr std::uint8_t kPdoConfiguration = 0x08;
inline constexpr std::uint8_t kUploadAtStartup = 0x10;
inline constexpr std::uint8_t kCompleteAccess = 0x20;
}  // namespace coe_detail

// How a slave tells its explicit device id, by its SII.
enum class DeviceIdSource : std::uint8_t { none, al_status, memory };

class Context;
struct ExpectedSlave;

// What a drive tells by SoE without being asked: that a procedure command has been executed, or an emergency.
struct SoeNotification {
    bool emergency = false;
    std::uint8_t drive = 0;
    std::uint8_t elements = 0;  // soe_element bits
    Idn idn;                    // of the command
    std::span<const std::byte> data;
};

// Functions of the application that poll() calls on the way of one slave. `user` is handed to them.
struct SlaveHooks {
    // Before the slave's process data is looked at, in PREOP (SOEM's PO2SO hook): the place to choose its PDOs. An
    // error keeps the slave in PREOP.
    Hook<> preop_to_safeop;
    void* user = nullptr;
    // Around the changes of state that the library makes: before the state is requested, after the commands of
    // SlaveSetup::startup for it, and after the slave has reached the state. On the way up, an error keeps the slave in
    // the state that it has; on the way down, the error is added to errors() and the slave goes all the same. What has
    // failed after the change is an error of the slave.
    Hook<Transition, Moment> transition;

    // A TxPDO has come by mailbox (CoE service TxPDO) that no request waited for. Called by poll(): must neither wait
    // nor call the library. `data` is valid until it returns.
    void (*mailbox_pdo)(std::uint16_t slave, std::uint16_t number, std::span<const std::byte> data,
                        void* user) = nullptr;
    // The slave asks for an RxPDO (CoE service RxPDO remote request): a MailPdoSend, submitted once poll() has
    // returned, answers it. Called as mailbox_pdo is, with the same user.
    void (*mailbox_pdo_wanted)(std::uint16_t slave, std::uint16_t number, void* user) = nullptr;
    void* mailbox_pdo_user = nullptr;

    // A notification has come by SoE. Called as mailbox_pdo is; what it is told is valid until it returns.
    void (*soe_notification)(std::uint16_t slave, const SoeNotification& told, void* user) = nullptr;
    void* soe_notification_user = nullptr;
};

struct Slave {
    static constexpr std::size_t kNameBytes = 64;
    static constexpr std::size_t kSyncManagers = 8;
    static constexpr std::size_t kFmmus = 8;

    std::uint16_t position = 0;  // its number, 1 the first; as config_init() gave it (expect() says how)
    StationAddress station_address;
    std::uint16_t alias = 0;  // ESC register 0x0012, loaded from the SII
    std::uint16_t dl_status = 0;
    Identity identity;
    DlInformation dl;
    AlStatus al;  // as last read
    // Its place in the ring as seen last, 1 the first; 0: it is not there. Without hot connect groups and missing
    // slaves the same as `position`.
    std::uint16_t ring = 0;
    // Explicit device id (ETG.1020), of a switch on the device mostly; asked for where expect() wants one.
    std::optional<std::uint16_t> device_id{};
    bool device_emulation : 1 = false;  // AL status mirrors AL control: never acknowledge an error here
    bool seen : 1 = false;              // it has been there since config_init() began: what ESC and SII say is known
    bool hook_failed : 1 = false;  // preop_to_safeop has ended with an error the last time: the slave stays in PREOP
    bool pdos_failed : 1 = false;  // its PDOs cannot be made what its configuration wants: likewise
    bool takes_part : 1 = false;   // its process data is configured and, as far as known, exchanged
    bool other : 1 = false;        // config_init() has found another slave than ExpectedSlave wants here
    bool unexpected : 1 = false;   // config_init() has found it, and the list of expect() does not have it
    // `other` or `unexpected`, and not tolerated: the slave is held in PREOP, or in INIT where it has no mailbox, and
    // gets no outputs.
    bool held : 1 = false;
    bool place_kept : 1 = false;  // its place in the image follows from SlaveSetup::pdos; the slave was not asked yet
    bool unplaced : 1 = false;    // it is wanted in the image, but its sizes were not known when that was laid out
    bool counted : 1 = false;     // its share is in the expected working counters of its group
    // What set_target() has said of this slave; NONE: nothing, the target of all slaves counts.
    AlState target = AlState::none;

    // Topology: every slave but the first hangs at a port of another one.
    std::uint16_t parent = 0;  // 0: the master
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    std::array<Port, 4> ports{};

    // From the SII. sync_managers and fmmus are in the order of the SII, cut at the size of the table.
    std::uint32_t sii_bytes = 0;  // size of the EEPROM by its own word 0x003E
    MailboxInfo mailbox;
    MailboxInfo boot_mailbox;      // protocols as in mailbox
    std::uint8_t coe_details = 0;  // coe_detail bits
    std::uint8_t foe_details = 0;
    std::uint8_t eoe_details = 0;
    DeviceIdSource device_id_source = DeviceIdSource::none;
    std::uint16_t device_id_word = 0;  // of the SII: where it says at which ESC address the device id is
    std::int16_t ebus_current_ma = 0;  // taken from the E-bus; negative: fed into it
    bool sii_read = false;
    std::uint8_t sm_count = 0;
    std::uint8_t fmmu_count = 0;
    std::uint8_t name_bytes = 0;  // of name_text
    std::array<SmInfo, kSyncManagers> sync_managers{};
    std::array<FmmuUse, kFmmus> fmmu_use{};

    // The first thing that went wrong with this slave since the last scan began; errc none when nothing has.
    Error error;

    // Whom expect() wants here; nullptr: nobody in particular. The list of the caller.
    const ExpectedSlave* wanted = nullptr;

    // Where the process data of the slave is located in the image, once its group is mapped. The octets are writable.
    SlaveImage image;

    // The wishes of the application. They are mutable because a context hands out a const Slave.
    mutable SlaveConfiguration config;
    mutable SlaveHooks hooks;

    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
    std::array<char, kNameBytes> name_text{};
};
static_assert(sizeof(void*) != 8 || sizeof(Slave) <= 536);  // many of them fit a small memory

}  // namespace margay
