#include "storm/spy.hpp"

#include "subdevice/esc_registers.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay::storm {

namespace reg = wire::reg;

Value first_bits(const Value& value, std::uint32_t bits) {
    const std::size_t bytes = (bits + 7) / 8;
    Value cut(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(std::min(bytes, value.size())));
    cut.resize(bytes);
    if (bits % 8 != 0) cut.back() &= static_cast<std::byte>((1U << (bits % 8)) - 1);
    return cut;
}

void Spy::start(subdevice::EscAccess& esc, Time now) {
    esc_ = &esc;
    last_applied_.clear();
    inner_->start(*this, now);
}

bool Spy::starts_sm(std::uint16_t address, std::size_t length, bool outputs) {
    const auto count =
        std::min<unsigned>(subdevice::read_register<std::uint8_t>(*esc_, reg::kSyncManagerCount.address), 16);
    for (unsigned n = 0; n < count; ++n) {
        // Reads without the activate octet, because reading it would clear an event that the program waits for.
        std::array<std::byte, reg::kSyncManagerStride> raw{};
        esc_->read(reg::sync_manager(n).address, MutableBytes(raw).first(wire::SyncManagerLayout::activate::offset));
        const auto sm = wire::load_sync_manager(raw);
        if (!sm.mailbox() && sm.physical_start == address && sm.length_bytes == length && sm.ecat_writes() == outputs)
            return true;
    }
    return false;
}

void Spy::read(std::uint16_t address, MutableBytes into) noexcept {
    esc_->read(address, into);
    if (address < 0x0F00 || (address >= 0x0F20 && address < 0x1000)) return;
    if (std::equal(into.begin(), into.end(), last_applied_.begin(), last_applied_.end())) return;
    if (!starts_sm(address, into.size(), true)) return;
    if ((subdevice::read_register<std::uint16_t>(*esc_, reg::kAlStatus.address) & 0x1F) != 0x08) return;
    last_applied_.assign(into.begin(), into.end());
    applied_.push_back(last_applied_);
}

void Spy::write(std::uint16_t address, Bytes data) noexcept {
    esc_->write(address, data);
    const bool plain = address == 0x1000 && data.size() == 1;  // inputs of one octet, shown while the SM is off too
    if (address < 0x1000 || (!plain && !starts_sm(address, data.size(), false))) return;
    Value value(data.begin(), data.end());
    if (!shown_.empty() && shown_.back().value == value) return;
    if (shown_.size() == kMostShown) shown_.pop_front();
    ever_.insert(value);
    shown_.push_back({esc_->now(), std::move(value)});
}

bool Spy::has_shown(const Value& value, std::uint32_t bits, Time from) const {
    for (auto at = shown_.rbegin(); at != shown_.rend(); ++at) {
        if (first_bits(at->value, bits) == value) return true;
        if (at->at <= from) return false;  // the value before it ended at this time
    }
    return false;
}

bool Spy::has_ever_shown(const Value& value, std::uint32_t bits) const {
    if (bits % 8 == 0 && ever_.contains(value)) return true;
    return std::ranges::any_of(ever_, [&](const Value& one) { return first_bits(one, bits) == value; });
}

}  // namespace margay::storm
