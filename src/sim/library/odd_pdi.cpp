#include "sim/library/odd_pdi.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"
#include "wire/mailbox.hpp"

#include <algorithm>
#include <array>

namespace margay::sim {

namespace reg = wire::reg;

namespace {
constexpr Duration kLeavesMail = std::chrono::milliseconds(20);
constexpr auto kReceiveStatus =
    static_cast<std::uint16_t>(reg::sync_manager(0).address + wire::SyncManagerLayout::status::offset);
}  // namespace

void OddPdi::read(std::uint16_t address, MutableBytes into) noexcept {
    esc_->read(address, into);
    // SOEM issue 249: only a request for INIT acknowledges an error.
    if (quirks_.has(Quirk::ignores_acknowledge) && address == reg::kAlControl.address && !into.empty() &&
        (std::to_integer<unsigned>(into[0]) & 0x0F) != 1)
        into[0] &= ~std::byte{wire::al::kErrorAcknowledge};
    if (quirks_.has(Quirk::mailbox_full) && address == kReceiveStatus && !into.empty()) hide_mail(into);
}

void OddPdi::hide_mail(MutableBytes status) {
    const bool full = (std::to_integer<std::uint8_t>(status[0]) & wire::sm_status::kMailboxFull) != 0;
    if (!full) {
        full_since_ = kNever;
        return;
    }
    if (full_since_ == kNever) full_since_ = now();
    if (now() < full_since_ + kLeavesMail) status[0] &= ~std::byte{wire::sm_status::kMailboxFull};
}

// A time that has passed is not returned, because the status may not be read again.
Time OddPdi::next() const {
    return full_since_ == kNever || esc_->now() >= full_since_ + kLeavesMail ? kNever : full_since_ + kLeavesMail;
}

bool OddPdi::repeats() {
    std::array<std::byte, 2> octets{};  // activate and PDI control octets of SM1
    esc_->read(static_cast<std::uint16_t>(reg::sync_manager(1).address + wire::SyncManagerLayout::activate::offset),
               octets);
    const bool request = (std::to_integer<unsigned>(octets[0]) & wire::sm_activate::kRepeatRequest) != 0;
    const bool acknowledged = (std::to_integer<unsigned>(octets[1]) & wire::sm_pdi_control::kRepeatAcknowledge) != 0;
    return request != acknowledged;
}

void OddPdi::write(std::uint16_t address, Bytes data) noexcept {
    // Reading the registers of SM1 clears the event of its activation, so that other writes must not do it.
    if (quirks_.has(Quirk::empty_repeats) && address >= reg::kProcessRam) {
        const auto box = subdevice::read_sync_manager(*esc_, 1);
        const bool inside = address >= box.physical_start && address < box.physical_start + box.length_bytes;
        if (inside && repeats()) return;
    }
    const bool spoils = quirks_.has(Quirk::counter_zero) || quirks_.has(Quirk::overlong_replies) ||
                        quirks_.has(Quirk::empty_replies) || quirks_.has(Quirk::short_replies);
    std::array<std::byte, 2048> copy{};
    if (!spoils || data.size() < wire::kMailboxHeaderBytes || data.size() > copy.size() ||
        address != subdevice::read_sync_manager(*esc_, 1).physical_start)
        return esc_->write(address, data);
    std::copy(data.begin(), data.end(), copy.begin());
    auto header = wire::load_mailbox_header(copy);
    if (quirks_.has(Quirk::counter_zero)) header.counter = 0;
    if (quirks_.has(Quirk::overlong_replies)) header.length = 0xFFF0;
    if (quirks_.has(Quirk::empty_replies)) header.length = 0;
    if (quirks_.has(Quirk::short_replies)) header.length = std::min<std::uint16_t>(header.length, 4);
    wire::store_mailbox_header(copy, header);
    esc_->write(address, Bytes(copy).first(data.size()));
}

}  // namespace margay::sim
