// Rules about the ends of requests, about slaves that are reported lost, and about the process data of a mapping.
#include "storm/device_bits.hpp"
#include "storm/world.hpp"
#include "util/bytes.hpp"

#include <algorithm>

namespace margay::storm {

using namespace std::chrono_literals;

// ------------------------------------------------------------------ requests

// Returns the minimum time of a request before it ends with a timeout; zero: unknown.
Duration World::patience_of(const Slot& slot) {
    constexpr Duration kEachAnswer = 3s;
    const KindInfo& of = kinds()[slot.operation->kind()];
    const Duration own = slot.operation->request().timeout;
    if (of.mail) return own > Duration{0} ? std::min(own, kEachAnswer) : kEachAnswer;
    const bool simple = of.name == "register_read" || of.name == "register_write" || of.name == "sii_read" ||
                        of.name == "sii_write" || of.name == "state_check";
    return simple ? own : Duration{0};
}

void World::check_ends() {
    std::array<char, 300> text{};
    for (Slot& slot : slots_) {
        if (slot.checked || !slot.operation || slot.operation->request().busy()) continue;
        slot.checked = true;
        const Request& request = slot.operation->request();
        const Error& error = request.error();
        const auto words = std::string(kind_name(slot.operation->kind())) + ": " + std::string(describe(error, text));
        if (error.code == Errc::canceled && !slot.cancelled) fail("a request that nobody cancelled is canceled", words);
        const Duration patience = patience_of(slot);
        if (error.code == Errc::timeout && patience > Duration{0} && osal_.now() < slot.since + patience)
            fail("a request ends before its time is over", words);
        if (error.code == Errc::reply_lost && !disturbed_much_ && !hostile_ && !hostile_registers_)
            fail("a lost reply was not asked for again", words);
        if (kinds()[slot.operation->kind()].name == "map")
            check_bits(static_cast<const MapRequest&>(request).group, slot.since);
        if (kinds()[slot.operation->kind()].name != "sii_write") continue;
        for (const auto device : devices_at(static_cast<const SiiWriteRequest&>(request).slave))
            check_acknowledged(request, device, slot.since);
    }
}

// ------------------------------------------------------------------ lost slaves

// Must be called when cables, power or addresses may have changed.
void World::note_presence(bool ring_changed) {
    if (ring_changed) {
        std::fill(in_ring_.begin(), in_ring_.end(), false);
        for (const auto n : segment_.order()) in_ring_[n] = segment_.powered(n);
    }
    for (std::uint32_t n = 0; n < presence_.size(); ++n) {
        const Presence now{in_ring_[n], segment_.slave(n).station(), osal_.now()};
        if (now.there && presence_[n].there && now.station != presence_[n].station) check_renamed(n, now.station);
        if (now.there != presence_[n].there || now.station != presence_[n].station) presence_[n] = now;
    }
}

// The search gives its own addresses to devices that it has to identify. A device that answers at the address of a
// slave that was present before is identified by its address.
void World::check_renamed(std::uint32_t device, std::uint16_t now) {
    constexpr std::uint16_t kNewcomers = 0x0D00;
    constexpr std::uint16_t kNewcomersMask = 0xFF00;
    if (hostile_ || hostile_registers_ || (now & kNewcomersMask) != kNewcomers) return;
    const auto before = presence_[device].station;
    const auto has_it = [before](const Presence& one) { return one.there && one.station == before; };
    // if two devices have one address, one of them is a newcomer
    if (std::ranges::count_if(presence_, has_it) != 1) return;
    for (const Slave& slave : ctx_->slaves())
        if (slave.seen && slave.station_address.value == before)
            fail("a slave with its address is taken for a newcomer", place(slave.number) + story());
}

// A slave that has answered at its address for two seconds is not lost, whatever happened to frames.
void World::check_lost(std::uint16_t number, Time at, const char* how) {
    if (hostile_ || hostile_registers_ || number == 0 || number > ctx_->slaves().size()) return;
    const auto address = ctx_->slave(number).station_address.value;
    const auto is_there = [&](std::uint32_t n) { return presence_[n].there && presence_[n].station == address; };
    std::vector<std::uint32_t> there;
    for (std::uint32_t n = 0; n < presence_.size(); ++n)
        if (is_there(n)) there.push_back(n);
    // If two devices have one address, the master cannot know which of them has answered, and both lose the address.
    if (there.size() != 1 || renamed_.contains(there[0])) return;
    // A device that was disconnected during a scan comes back with an address that now belongs to another slave. The
    // device is not this slave.
    constexpr std::size_t kProductAt = 20;  // SII word 0x000A
    const auto& sii = segment_.slave(there[0]).sii().image();
    const std::uint32_t known = ctx_->slave(number).identity.product;
    if (sii.size() >= kProductAt + 4 && known != 0 && load_le<std::uint32_t>(Bytes(sii), kProductAt) != known) return;
    if (presence_[there[0]].since + 2s < at) fail("a slave is lost that answers", place(number) + ": " + how + story());
}

void World::check_states() {
    const auto slaves = ctx_->slaves();
    // A call that has waited may have read the states at any time since the last check.
    const Time last_look = std::exchange(looked_at_, osal_.now());
    if (states_.size() != slaves.size()) states_.assign(slaves.size(), AlState::none);
    for (const Slave& slave : slaves) {
        AlState& before = states_[slave.number - 1U];
        if (before != AlState::none && slave.al.state == AlState::none && slave.seen)
            check_lost(slave.number, last_look, "its state is none");
        before = slave.al.state;
    }
}

// ------------------------------------------------------------------ process data

namespace {

// Quirks that do not change the process data of a device, or with which the process data cannot be read.
constexpr std::array<std::string_view, 19> kSameBits{
    "old_mail",        "counter_zero",  "replies_twice",   "emergency_first", "ethernet_first",
    "mail_for_others", "mailbox_full",  "slow_replies",    "never_replies",   "overlong_replies",
    "empty_replies",   "short_replies", "foreign_replies", "empty_repeats",   "slow_state_changes",
    "sii_4_bytes",     "sii_slow",      "sii_nacks",       "slow_firmware"};

bool keeps_bits(const DevicePlan& device, const Slave& slave) {
    constexpr unsigned kAsked = mailbox_protocol::kCoE | mailbox_protocol::kSoE;
    if (device.name == "modular_io") return false;  // the storm changes its plugged modules
    return std::ranges::all_of(device.quirks, [&](const std::string& quirk) {
        if (quirk == "sii_no_pdos" || quirk == "sii_sync_managers_off")
            return (slave.mailbox.protocols & kAsked) != 0;  // its process data can be read by mail
        return std::ranges::find(kSameBits, quirk) != kSameBits.end();
    });
}

}  // namespace

// After a mapping each slave that was present all the time has the process data of its device, unless the master
// reports that the process data is unknown.
void World::check_bits(std::uint8_t group, Time since) {
    if (hostile_ || hostile_registers_ || !ctx_->group(group).mapped) return;
    note_presence(true);
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.config.group != group || slave.held || slave.config.highest < AlState::safeop) continue;
        // A slave that was moved to this group during the mapping need not have a place.
        if (const auto at = regrouped_.find(slave.number); at != regrouped_.end() && at->second >= since) continue;
        if (slave.al.state == AlState::none || slave.pdos_failed || slave.unplaced || slave.hook_failed) continue;
        for (std::uint32_t n = 0; n < presence_.size(); ++n) {
            const auto& one = presence_[n];
            if (!one.there || one.station != slave.station_address.value || one.since > since || dirty_[n]) continue;
            if (!keeps_bits(plan_.devices[n], slave)) continue;
            const DeviceBits bits = bits_of_device(plan_.devices[n].name);
            if (slave.image.inputs.bits == bits.inputs && slave.image.outputs.bits == bits.outputs) continue;
            fail("a slave is mapped without its process data",
                 place(slave.number) + ": inputs " + std::to_string(slave.image.inputs.bits) + " of " +
                     std::to_string(bits.inputs) + ", outputs " + std::to_string(slave.image.outputs.bits) + " of " +
                     std::to_string(bits.outputs) + story());
        }
    }
}

}  // namespace margay::storm
