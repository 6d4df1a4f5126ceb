// An example of a device on a microcontroller with a LAN9252 on SPI: state machine, CoE with an object dictionary, FoE
// for the firmware in BOOT, process data. It needs no operating system. To use it, fill in the functions of `board`
// below.
//
// On a PC it is compiled only to check it. There it ends at once, because no chip answers.
#include "common/lan9252_spi.hpp"

#include "subdevice/coe_server.hpp"
#include "subdevice/device.hpp"
#include "subdevice/foe_server.hpp"

namespace board {

using margay::Bytes;
using margay::MutableBytes;
using margay::Time;

// --- Fill in: an SPI transfer with chip select low, a clock, pins, flash ---

void spi_transfer(MutableBytes in_and_out) noexcept { (void)in_and_out; }
Time now() noexcept { return {}; }
void set_lamps(unsigned bits) noexcept { (void)bits; }
unsigned switches() noexcept { return 0; }
bool flash_write(std::size_t offset, Bytes data) noexcept { return offset + data.size() <= 64 * 1024; }
bool flash_check(std::size_t bytes) noexcept { return bytes != 0; }

}  // namespace board

namespace {

using namespace margay;
using namespace margay::subdevice;
using namespace std::chrono_literals;

// ------------------------------------------------------------------ description of the device

constexpr DeviceDescription kDevice{
    .vendor_id = 0x00004D47,
    .product_code = 0x9252,
    .revision = 1,
    .name = "Lamps and switches",
    .protocols = {.coe = true, .foe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 512}, {.start = 0x1200, .size_bytes = 512}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 2, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 2},
    .dc = {.supported = true},
};

struct Values {
    using lamps = Field<std::uint8_t, 0>;
    using switches = Field<std::uint8_t, 1>;
    using dimming = Field<std::uint16_t, 2>;
    static constexpr std::size_t bytes = dimming::end;
};

constexpr Entry kType[] = {constant<std::uint32_t>(0, "Device type", 0x00000191)};
constexpr Entry kName[] = {text(0, "Device name", kDevice.name)};
constexpr auto kIdentity = identity_entries(kDevice);
constexpr auto kSyncManagers = sync_manager_type_entries(kDevice);
constexpr auto kErrors = kErrorHistoryEntries<4>;
// Each PDO ends with a gap of one octet: a SyncManager of one octet is only a watchdog trigger, without buffers and
// events (ESC data sheets, register 0x0802).
constexpr Entry kRxPdo[] = {entry_count(2), mapped(1, 0x7000, 0, 8), mapped(2, 0, 0, 8)};
constexpr Entry kTxPdo[] = {entry_count(2), mapped(1, 0x6000, 0, 8), mapped(2, 0, 0, 8)};
constexpr Entry kRxAssignment[] = {entry_count(1), assigned(1, 0x1600)};
constexpr Entry kTxAssignment[] = {entry_count(1), assigned(1, 0x1A00)};
constexpr Entry kDimming[] = {value<Values::dimming>(0, "Dimming", od::kReadWrite, 1000).within(0, 1000)};
constexpr Entry kSwitches[] = {value<Values::switches>(0, "Switches", od::kRead | od::kTxMappable)};
constexpr Entry kLamps[] = {value<Values::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};

constexpr Object kObjects[] = {
    variable(0x1000, "Device type", kType),
    array(0x1003, "Pre-defined error field", kErrors, &kErrorHistoryHooks),
    variable(0x1008, "Device name", kName),
    record(0x1018, "Identity", kIdentity, nullptr, DataType::identity),
    record(0x1600, "Lamps", kRxPdo, nullptr, DataType::pdo_mapping),
    record(0x1A00, "Switches", kTxPdo, nullptr, DataType::pdo_mapping),
    array(0x1C00, "Sync manager types", kSyncManagers),
    array(0x1C12, "RxPDO assignment", kRxAssignment),
    array(0x1C13, "TxPDO assignment", kTxAssignment),
    variable(0x2000, "Dimming", kDimming),
    variable(0x6000, "Switches", kSwitches),
    variable(0x7000, "Lamps", kLamps),
};
#ifndef __SANITIZE_ADDRESS__  // GCC 12 with sanitizers does not accept this address in a constant expression
static_assert(well_formed(kObjects, Values::bytes));
#endif

// ------------------------------------------------------------------ behaviour of the device

// Memory for the messages and values. All other objects hold state only. The test embedded/footprint measures the
// footprint.
struct Buffers {
    MailboxMemory<512, 3> mailbox;
    std::array<std::byte, 256> staging{};
    std::array<std::byte, Values::bytes> values{};
    ProcessDataMemory<2, 2, 2> process_data;
    std::array<EmergencyMessage, 4> emergencies{};
    std::array<std::byte, 4 * 4> error_history{};
};

class Lamps final : public Application {
  public:
    Lamps(Buffers& buffers) : values_(buffers.values), emergencies_(buffers.emergencies, buffers.error_history) {}
    const DeviceDescription& description() const override { return kDevice; }
    Emergencies* emergencies() override { return &emergencies_; }
    void cycle(Time, bool) override {
        board::set_lamps(Values::lamps::load(values_));
        Values::switches::store(values_, static_cast<std::uint8_t>(board::switches()));
    }
    void safe_outputs(Time) override { board::set_lamps(0); }

  private:
    MutableBytes values_;
    Emergencies emergencies_;
};

class Firmware final : public FoeStore {
  public:
    FoeAnswer open_to_read(const FoeFile&, Time) override { return FoeAnswer::error(FoeError::access_denied); }
    FoeAnswer read(std::size_t, MutableBytes, std::size_t&, Time) override {
        return FoeAnswer::error(FoeError::illegal);
    }
    FoeAnswer open_to_write(const FoeFile& file, Time) override {
        if (file.state != AlState::boot) return FoeAnswer::error(FoeError::bootstrap_only);
        return file.name == "firmware" ? FoeAnswer::go() : FoeAnswer::error(FoeError::not_found);
    }
    FoeAnswer write(std::size_t offset, Bytes data, Time) override {
        return board::flash_write(offset, data) ? FoeAnswer::go() : FoeAnswer::error(FoeError::disk_full);
    }
    FoeAnswer finish_write(std::size_t bytes, Time) override {
        return board::flash_check(bytes) ? FoeAnswer::go() : FoeAnswer::error(FoeError::wrong_checksum);
    }
    void give_up() override {}
};

class Spi final : public samples::SpiBus {
  public:
    void transfer(MutableBytes in_and_out) noexcept override { board::spi_transfer(in_and_out); }
    Time now() noexcept override { return board::now(); }
};

// ------------------------------------------------------------------ all objects of the device, without a heap

Buffers buffers;
Spi spi;
samples::Lan9252 esc(spi);
Lamps lamps(buffers);
Firmware firmware;
ObjectDictionary dictionary(kObjects, buffers.values, &lamps);
CoeServer coe(dictionary, buffers.staging, kDevice.complete_access, lamps.emergencies());
FoeServer foe(firmware);
const MailboxProtocol kProtocols[] = {{wire::MailboxType::coe, &coe}, {wire::MailboxType::foe, &foe, true}};
Mailbox mailbox(esc, buffers.mailbox, kProtocols);
ProcessData process_data(esc, lamps, dictionary, buffers.process_data);
Device device(esc, lamps, process_data, &mailbox);

}  // namespace

int main() {
    if (!esc.begin()) return 1;
    device.start(esc.now());
    while (!esc.failed()) (void)device.step(esc.now());
    return 2;
}
