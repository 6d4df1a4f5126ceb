#include "subdevice/esm_checks.hpp"

#include "subdevice/esc_registers.hpp"

namespace margay::subdevice {

using wire::SyncManager;
namespace reg = wire::reg;

namespace {

// The octets that are not read are 0.
SyncManager read_octets(EscAccess& esc, unsigned n, std::size_t count) {
    std::array<std::byte, reg::kSyncManagerStride> bytes{};
    read_memory(esc, reg::sync_manager(n).address, MutableBytes(bytes).first(count));
    return wire::load_sync_manager(bytes);
}

}  // namespace

SyncManager read_sync_manager(EscAccess& esc, unsigned n) { return read_octets(esc, n, reg::kSyncManagerStride); }

std::uint8_t read_sync_manager_control(EscAccess& esc, unsigned n) {
    return read_register<std::uint8_t>(
        esc, static_cast<std::uint16_t>(reg::sync_manager(n).address + wire::SyncManagerLayout::control::offset));
}

void read_activations(EscAccess& esc) {
    const auto count = read_register<std::uint8_t>(esc, reg::kSyncManagerCount.address);
    for (unsigned n = 0; n < count; ++n)
        (void)read_register<std::uint8_t>(
            esc, static_cast<std::uint16_t>(reg::sync_manager(n).address + wire::SyncManagerLayout::activate::offset));
}

namespace {

// The interrupt and watchdog bits of the control octet are not compared: some masters write the value of the SII,
// others their own.
bool mailbox_fits(const SyncManager& sm, const MailboxArea& area, bool ecat_writes) {
    return sm.enabled() && sm.mailbox() && sm.ecat_writes() == ecat_writes && sm.physical_start == area.start &&
           area.allows(sm.length_bytes);
}

// An ESC that does not say how much RAM it has: the whole range of addresses.
std::uint32_t ram_end(EscAccess& esc) {
    const std::uint32_t kib = read_register<std::uint8_t>(esc, reg::kRamSize.address);
    return kib == 0 ? 0x10000 : reg::kProcessRam + 1024 * kib;
}

class Places {
  public:
    explicit Places(EscAccess& esc) : places_(ram_end(esc)) {}
    // Whether the memory of the SyncManager is in the RAM and does not overlap another SyncManager.
    [[nodiscard]] bool add(const SyncManager& sm) { return places_.add(sm) == wire::SyncManagerPlace::free; }

  private:
    wire::SyncManagerPlaces<kMostSyncManagers> places_;
};

AlStatusCode check_area(const SyncManager& sm, const ProcessDataArea& area, std::uint16_t bytes, bool ecat_writes,
                        AlStatusCode otherwise) {
    if (bytes == 0) return sm.enabled() && sm.length_bytes != 0 ? otherwise : AlStatusCode::none;
    if (!sm.enabled() || sm.length_bytes != bytes || sm.physical_start != area.start) return otherwise;
    const auto mode = sm.control & wire::sm_control::kModeMask;
    const auto expected_mode = area.three_buffers ? wire::sm_control::kModeBuffered : wire::sm_control::kModeMailbox;
    if (mode != expected_mode || sm.ecat_writes() != ecat_writes) return AlStatusCode::invalid_sync_manager_types;
    return AlStatusCode::none;
}

}  // namespace

AlStatusCode check_mailboxes(EscAccess& esc, const MailboxPair& expected, AlStatusCode otherwise) {
    if (!expected.present()) return AlStatusCode::none;
    const auto receive = read_sync_manager(esc, 0);
    const auto send = read_sync_manager(esc, 1);
    Places places(esc);
    const bool fits = mailbox_fits(receive, expected.receive, true) && mailbox_fits(send, expected.send, false) &&
                      places.add(receive) && places.add(send);
    return fits ? AlStatusCode::none : otherwise;
}

AlStatusCode check_process_data(EscAccess& esc, const DeviceDescription& device, const ProcessDataSizes& sizes) {
    if (sizes.fault != AlStatusCode::none) return sizes.fault;
    auto fault = AlStatusCode::none;
    Places places(esc);
    // The mailboxes have been checked. Their activate octets are not read: the AL event of a change stays for the state
    // machine.
    const unsigned mailboxes = device.mailbox.present() ? 2 : 0;
    for (unsigned n = 0; n < mailboxes; ++n)
        (void)places.add(read_octets(esc, n, wire::SyncManagerLayout::activate::offset));
    for (const bool outputs : {true, false}) {
        const auto otherwise =
            outputs ? AlStatusCode::invalid_output_configuration : AlStatusCode::invalid_input_configuration;
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t n) {
            if (fault != AlStatusCode::none) return;
            const auto sm = read_sync_manager(esc, area.sync_manager);
            const auto bytes = sizes.of(outputs, n);
            fault = check_area(sm, area, bytes, outputs, otherwise);
            if (fault == AlStatusCode::none && bytes != 0 && !places.add(sm)) fault = otherwise;
        });
    }
    return fault;
}

AlStatusCode check_watchdog(EscAccess& esc, const DeviceDescription& device, const ProcessDataSizes& sizes) {
    bool runs = true;
    for_each_area(device, true, [&](const ProcessDataArea& area, std::size_t n) {
        if (!area.watchdog_required || sizes.of(true, n) == 0) return;
        const auto control = read_sync_manager_control(esc, area.sync_manager);
        const auto time = read_register<std::uint16_t>(esc, reg::kProcessDataWatchdogTime.address);
        runs = runs && (control & wire::sm_control::kWatchdogTrigger) != 0 && time != 0;
    });
    return runs ? AlStatusCode::none : AlStatusCode::invalid_watchdog_configuration;
}

AlStatusCode check_dc(EscAccess& esc, const DcDescription& dc) {
    const auto activation = read_register<std::uint8_t>(esc, reg::kSyncActivation.address);
    const bool cyclic = (activation & wire::sync_activation::kCyclic) != 0;
    const bool sync0 = cyclic && (activation & wire::sync_activation::kSync0) != 0;
    const bool sync1 = cyclic && (activation & wire::sync_activation::kSync1) != 0;
    if (!cyclic) return dc.required ? AlStatusCode::invalid_dc_sync_configuration : AlStatusCode::none;
    if (!dc.supported || !sync0 || (dc.sync1 && !sync1)) return AlStatusCode::invalid_dc_sync_configuration;
    const Duration cycle{read_register<std::uint32_t>(esc, reg::kSync0CycleTime.address)};
    if (cycle == Duration::zero() || cycle < dc.min_cycle || (dc.max_cycle != Duration::zero() && cycle > dc.max_cycle))
        return AlStatusCode::invalid_dc_sync0_cycle_time;
    return AlStatusCode::none;
}

}  // namespace margay::subdevice
