#include "sim/sii_firmware.hpp"

#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::sim {

using subdevice::Transition;
using subdevice::Verdict;
namespace reg = wire::reg;
namespace al_event = wire::al_event;

namespace {

constexpr std::uint32_t kSyncManagerEvents = 0x00FFFF00;
constexpr Duration kLookAgain = std::chrono::milliseconds(1);

}  // namespace

void SiiFirmware::start(subdevice::EscAccess& esc, Time) {
    esc_ = &esc;
    wait_until_ = kNever;
    begin(esc);
    esm_.reset();
    if (emulation_) return;
    esm_.emplace(esc, device_, static_cast<subdevice::EsmClient&>(*this));
    esm_->init();
}

// ETG.1000.6: in SAFEOP outputs are read, which feeds the watchdog, but not applied.
Time SiiFirmware::step(Time now) {
    const auto events = subdevice::read_register<std::uint32_t>(*esc_, reg::kAlEventRequest.address);
    const auto mail = (events & al_event::sync_manager(0)) != 0;
    // Whether an event says so or not: outputs of digital I/O, and many another SII's, come without.
    if (emulation_ || esm_->state() == AlState::op) {
        read_outputs();
    } else if (esm_->state() == AlState::safeop) {
        read_outputs();
        clear_outputs();
    }
    Time next = kNever;
    if (esm_) {
        next = esm_->step(now, events);
        if ((events & al_event::kWatchdog) != 0) {
            (void)subdevice::read_register<std::uint16_t>(*esc_, reg::kProcessDataWatchdogStatus.address);
            clear_outputs();
            if (esm_->state() == AlState::op)
                esm_->fall_back(AlState::safeop, subdevice::AlStatusCode::sync_manager_watchdog, now);
        }
        if (mail && device_.mailbox.present()) discard_mail();
    } else {
        // Reading the activate octets is what clears the event.
        std::array<std::byte, reg::kSyncManagerStride> raw{};
        esc_->read(reg::sync_manager(0).address, raw);
    }
    if (esm_ || (events & (al_event::kSmActivation | kSyncManagerEvents)) != 0) {
        configure();
        write_inputs();
    }
    return next;
}

// The mapping of a device with CoE may be anything that its memory holds: what the master has written there
// is taken.
subdevice::ProcessDataSizes SiiFirmware::process_data_sizes() {
    const auto size = [&](const subdevice::ProcessDataArea& described) -> std::uint16_t {
        if (!described.present()) return 0;
        std::uint32_t bits = 0;
        std::uint16_t length = 0;
        for (const auto& area : areas_)
            if (area.sync_manager == described.sync_manager)
                bits = area.pdo_bits, length = area.info.length_bytes;
        const auto configured = subdevice::read_register<std::uint16_t>(
            *esc_, static_cast<std::uint16_t>(reg::sync_manager(described.sync_manager).address + 2));
        if (device_.protocols.coe) return configured;
        return bits != 0 ? static_cast<std::uint16_t>((bits + 7) / 8) : length;
    };
    return {size(device_.outputs), size(device_.inputs), subdevice::AlStatusCode::none};
}

// OP waits for the first outputs (ETG.1000.6), as long as the description says.
Verdict SiiFirmware::before(Transition transition, Time now) {
    const auto& outputs = device_.outputs;
    if (transition != Transition{AlState::safeop, AlState::op} || !outputs.present()) return Verdict::go();
    std::array<std::byte, reg::kSyncManagerStride> raw{};
    esc_->read(reg::sync_manager(outputs.sync_manager).address, raw);
    const auto status = wire::SyncManagerLayout::status::load(raw);
    const bool off = wire::load_sync_manager(raw).length_bytes == 0;
    const bool written = (status & wire::sm_status::kLastBufferMask) != wire::sm_status::kLastBufferMask;
    if (off || written || !outputs.three_buffers) return Verdict::go();
    if (wait_until_ == kNever) wait_until_ = now + device_.outputs_wait;
    if (now < wait_until_) return Verdict::wait(std::min(wait_until_, now + kLookAgain));
    wait_until_ = kNever;
    return Verdict::refuse(subdevice::AlStatusCode::no_valid_outputs);
}

void SiiFirmware::after(Transition, Time) { wait_until_ = kNever; }

// Nobody here to answer it; the mailbox must not stay full.
void SiiFirmware::discard_mail() {
    std::array<std::byte, 2048> mail;
    const auto& box = device_.mailbox.receive;
    for (std::uint32_t done = 0; done < box.size_bytes; done += mail.size())
        esc_->read(static_cast<std::uint16_t>(box.start + done),
                   MutableBytes(mail).first(std::min<std::size_t>(mail.size(), box.size_bytes - done)));
}

}  // namespace margay::sim
