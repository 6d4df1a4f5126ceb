// An example of a device on a microcontroller with a LAN9252 on SPI: state machine, CoE with an object dictionary, FoE
// for the firmware in BOOT, process data. It needs no operating system. To use it, fill in the functions of `board`
// below.
//
// On a PC it is compiled only to check it. There it ends at once, because no chip answers.
#include "common/lan9252_spi.hpp"

#include "subdevice/foe_server.hpp"
#include "subdevice/standard_device.hpp"

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
    std::uint8_t lamps;
    std::uint8_t switches;
    Le<std::uint16_t> dimming;
};

constexpr auto kErrors = kErrorHistoryEntries<4>;
constexpr Entry kDimming[] = {value<&Values::dimming>(0, "Dimming", od::kReadWrite, 1000).within(kLimits<0, 1000>)};
constexpr Entry kSwitches[] = {value<&Values::switches>(0, "Switches", od::kRead | od::kTxMappable)};
constexpr Entry kLamps[] = {value<&Values::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};

// The objects of the device itself. StandardDevice adds the objects that every device has, and the PDOs.
constexpr Object kObjects[] = {
    array(0x1003, "Pre-defined error field", kErrors, &kErrorHistoryHooks),
    variable(0x2000, "Dimming", kDimming),
    variable(0x6000, "Switches", kSwitches),
    variable(0x7000, "Lamps", kLamps),
};
using Stack = StandardDevice<kDevice, kObjects, Values, 1, 0x00000191>;

// ------------------------------------------------------------------ behaviour of the device

// Memory for the messages and values. All other objects hold state only. The test embedded/footprint measures the
// footprint.
struct Buffers {
    Stack::Memory stack;
    std::array<EmergencyMessage, 4> emergencies{};
    std::array<std::byte, 4 * 4> error_history{};
};

class Lamps final : public Application {
  public:
    Lamps(Buffers& buffers) : values_(buffers.stack.values), emergencies_(buffers.emergencies, buffers.error_history) {}
    const DeviceDescription& description() const override { return kDevice; }
    Emergencies* emergencies() override { return &emergencies_; }
    void cycle(Time, bool) override {
        board::set_lamps(values_.lamps);
        values_.switches = static_cast<std::uint8_t>(board::switches());
    }
    void safe_outputs(Time) override { board::set_lamps(0); }

  private:
    Values& values_;
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
FoeServer foe(firmware);
Stack stack(esc, lamps, buffers.stack, {{{wire::MailboxType::foe, &foe, true}}});

}  // namespace

int main() {
    if (!esc.begin()) return 1;
    stack.device.start(esc.now());
    while (!esc.failed()) (void)stack.device.step(esc.now());
    return 2;
}
