#include "analyse/slave_tracks.hpp"

#include "wire/esc.hpp"
#include "wire/sii.hpp"

#include <algorithm>

namespace margay::analyse {

using wire::Command;
namespace reg = wire::reg;

namespace {

constexpr std::size_t kMostSiiOctets = wire::sii::kMostContentBytes;

}  // namespace

bool reads_registers(Command c) {
    return c == Command::APRD || c == Command::FPRD || c == Command::BRD || c == Command::APRW || c == Command::FPRW;
}
bool writes_registers(Command c) {
    return c == Command::APWR || c == Command::FPWR || c == Command::BWR || c == Command::APRW || c == Command::FPRW;
}

bool SlaveTrack::sii_has(std::size_t from, std::size_t octets) const {
    if (from + octets > sii_read.size()) return false;
    return std::all_of(sii_read.begin() + static_cast<std::ptrdiff_t>(from),
                       sii_read.begin() + static_cast<std::ptrdiff_t>(from + octets), [](bool read) { return read; });
}

SlaveTrack* SlaveTracks::added() {
    if (tracks_.capacity() < kMostSlaves) tracks_.reserve(kMostSlaves);
    if (tracks_.size() >= kMostSlaves) {
        ++analysis_.slaves_left_out;
        return nullptr;
    }
    tracks_.push_back({.number = tracks_.size()});
    analysis_.slaves.emplace_back();
    return &tracks_.back();
}

SlaveTrack* SlaveTracks::by_position(std::uint16_t position, bool add) {
    if (const auto found = positions_.find(position); found != positions_.end()) return &tracks_[found->second];
    if (!add) return nullptr;
    auto* slave = added();
    if (slave == nullptr) return nullptr;
    facts(*slave).position = position;
    positions_[position] = slave->number;
    return slave;
}

SlaveTrack* SlaveTracks::by_station(std::uint16_t station, bool add) {
    if (const auto found = stations_.find(station); found != stations_.end()) return &tracks_[found->second];
    if (!add) return nullptr;
    auto* slave = added();
    if (slave == nullptr) return nullptr;
    facts(*slave).station = station;
    stations_[station] = slave->number;
    return slave;
}

SlaveTrack* SlaveTracks::find(const Exchanged& e) {
    const auto adp = e.header.address.adp();
    const bool add = e.answered && e.wkc != 0;
    switch (e.header.command) {
        case Command::APRD:
        case Command::APWR:
        case Command::APRW:
        case Command::ARMW:
            if (!e.address_known) return nullptr;
            return by_position(static_cast<std::uint16_t>(-adp), add);
        case Command::FPRD:
        case Command::FPWR:
        case Command::FPRW:
        case Command::FRMW: return by_station(adp, add);
        // A broadcast combines the answers of all slaves, so it describes a slave only if there is no other one.
        case Command::BRD: return ring_ == 1 && add ? by_position(0, true) : nullptr;
        default: return nullptr;
    }
}

void SlaveTracks::look_at_ring(const Exchanged& e) {
    if (!e.passed || e.passed == ring_) return;
    ring_ = e.passed;
    analysis_.ring_sizes.add({e.at, *e.passed}, kMostEvents);
}

// A slave that was seen by this station address and whose position is not known, because the recording begins after the
// scan.
SlaveTrack* SlaveTracks::without_position(std::uint16_t station) {
    for (const auto* known : {&stations_, &cleared_})
        if (const auto at = known->find(station); at != known->end())
            return facts(tracks_[at->second]).position ? nullptr : &tracks_[at->second];
    return nullptr;
}

// Joins two tracks of one slave: it was seen by its station address before, and by its position until now.
SlaveTrack& SlaveTracks::join(SlaveTrack& slave, SlaveTrack& to) {
    auto& from = facts(slave);
    auto& into = facts(to);
    into.position = from.position;
    if (from.alias) into.alias = from.alias;
    if (from.state) into.state = from.state;
    if (from.unanswered != 0 && into.unanswered == 0) into.first_unanswered = from.first_unanswered;
    into.unanswered += from.unanswered;
    if (!into.clock.seen()) into.clock = from.clock;
    for (std::size_t n = 0; n < slave.sii.size(); ++n) {
        if (!slave.sii_read[n]) continue;
        if (to.sii.size() <= n) {
            to.sii.resize(n + 1, std::byte{0xFF});
            to.sii_read.resize(n + 1);
        }
        if (!to.sii_read[n]) ++into.sii_octets;
        to.sii[n] = slave.sii[n];
        to.sii_read[n] = true;
    }
    to.sii_word = slave.sii_word;
    to.sii_reading = slave.sii_reading;
    to.sii_eight = slave.sii_eight;
    for (const auto& [n, sm] : slave.sync_managers) to.sync_managers[n] = sm;
    positions_[*from.position] = to.number;
    slave.joined_to = to.number;
    return to;
}

SlaveTrack& SlaveTracks::assign_station(SlaveTrack& slave, std::uint16_t station) {
    auto& f = facts(slave);
    SlaveTrack* before = station == 0 || f.station || !f.position ? nullptr : without_position(station);
    if (before != nullptr) {
        stations_[station] = before->number;
        return join(slave, *before);
    }
    if (f.station)
        if (const auto old = stations_.find(*f.station); old != stations_.end() && old->second == slave.number)
            stations_.erase(old);
    f.station = station;
    stations_[station] = slave.number;
    return slave;
}

SlaveTrack* SlaveTracks::look(const Exchanged& e, SlaveTrack* slave) {
    look_at_ring(e);
    const bool well = e.answered && e.wkc != 0;
    if (well && writes_registers(e.header.command)) {
        if (const auto at = octets_at(e, e.sent, reg::kStationAddress.address, 2)) {
            if (slave != nullptr) {
                slave = &assign_station(*slave, load_le<std::uint16_t>(*at));
            } else if (e.header.command == Command::BWR) {
                if (!stations_.empty()) cleared_ = std::move(stations_);
                stations_.clear();
            }
        }
        if (e.header.command == Command::BWR)
            for (auto& track : tracks_) look_at_sii(e, track);
    }
    if (slave == nullptr || !well) return slave;
    if (reads_registers(e.header.command)) {
        if (const auto at = octets_at(e, e.received, reg::kStationAlias.address, 2))
            facts(*slave).alias = load_le<std::uint16_t>(*at);
        if (const auto at = octets_at(e, e.received, reg::kStationAddress.address, 2);
            at && e.header.command == Command::APRD) {
            const auto station = load_le<std::uint16_t>(*at);
            const auto known = stations_.find(station);
            if (station != 0 && (known == stations_.end() || !facts(tracks_[known->second]).position))
                slave = &assign_station(*slave, station);
        }
    }
    look_at_sii(e, *slave);
    look_at_sync_managers(e, *slave);
    return slave;
}

void SlaveTracks::finish() {
    std::vector<std::size_t> place(tracks_.size());
    std::vector<Slave> kept;
    for (auto& track : tracks_) {
        if (track.joined_to) continue;
        place[track.number] = kept.size();
        kept.push_back(std::move(facts(track)));
    }
    for (const auto& track : tracks_)
        if (track.joined_to) place[track.number] = place[*track.joined_to];
    for (auto& event : analysis_.states.items)
        if (event.slave) event.slave = place[*event.slave];
    for (auto& conversation : analysis_.conversations.items) conversation.slave = place[conversation.slave];
    for (auto& emergency : analysis_.emergencies.items) emergency.slave = place[emergency.slave];
    if (analysis_.reference.slave) analysis_.reference.slave = place[*analysis_.reference.slave];
    analysis_.slaves = std::move(kept);
}

namespace {

// A datagram may contain only the low half of the address, because few EEPROMs need the high half.
void take_sii_address(SlaveTrack& slave, const Exchanged& e, Bytes data) {
    const auto low = octets_at(e, data, reg::kSiiAddress.address, 2);
    const auto high = octets_at(e, data, reg::kSiiAddress.address + 2U, 2);
    const std::uint32_t before = slave.sii_word.value_or(0);
    if (low) slave.sii_word = (before & 0xFFFF'0000) | load_le<std::uint16_t>(*low);
    if (high && slave.sii_word)
        slave.sii_word = (*slave.sii_word & 0xFFFF) | std::uint32_t{load_le<std::uint16_t>(*high)} << 16;
}

}  // namespace

void SlaveTracks::look_at_sii(const Exchanged& e, SlaveTrack& slave) {
    if (writes_registers(e.header.command)) {
        take_sii_address(slave, e, e.sent);
        if (const auto at = octets_at(e, e.sent, reg::kSiiControl.address, 2))
            slave.sii_reading =
                (load_le<std::uint16_t>(*at) & wire::sii_control::kCommandMask) == wire::sii_control::kCommandRead;
    }
    if (!reads_registers(e.header.command)) return;
    if (const auto at = octets_at(e, e.received, reg::kSiiControl.address, 2)) {
        const auto status = load_le<std::uint16_t>(*at);
        slave.sii_eight = (status & wire::sii_control::kReads8Bytes) != 0;
        if ((status & wire::sii_control::kBusy) != 0) return;
    }
    take_sii_address(slave, e, e.received);
    if (octets_at(e, e.received, reg::kSiiData.address, 4))
        take_sii(slave, e.received.subspan(reg::kSiiData.address - e.header.address.ado()));
}

void SlaveTracks::take_sii(SlaveTrack& slave, Bytes data) {
    if (!slave.sii_reading || !slave.sii_word || *slave.sii_word >= kMostSiiOctets / 2) return;
    const std::size_t at = std::size_t{*slave.sii_word} * 2;
    const auto count = std::min<std::size_t>({data.size(), slave.sii_eight ? 8U : 4U, kMostSiiOctets - at});
    if (slave.sii.size() < at + count) {
        slave.sii.resize(at + count, std::byte{0xFF});
        slave.sii_read.resize(at + count);
    }
    for (std::size_t i = 0; i < count; ++i) {
        slave.sii[at + i] = data[i];
        if (!slave.sii_read[at + i]) ++facts(slave).sii_octets;
        slave.sii_read[at + i] = true;
    }
}

void SlaveTracks::look_at_sync_managers(const Exchanged& e, SlaveTrack& slave) {
    constexpr unsigned kMost = 16;
    const auto take = [&](Bytes data) {
        for (unsigned n = 0; n < kMost; ++n)
            if (const auto at = octets_at(e, data, reg::sync_manager(n).address, reg::kSyncManagerStride))
                slave.sync_managers[n] = wire::load_sync_manager(*at);
    };
    const std::uint32_t ado = e.header.address.ado();
    if (ado + e.sent.size() <= reg::kSyncManagerBase || ado >= reg::sync_manager(kMost).address) return;
    if (writes_registers(e.header.command)) {
        take(e.sent);
        // When a SyncManager is configured or switched off, the mailbox counters may begin again. A write of only the
        // activate octet requests the repetition of a message, and does not reset the counters.
        for (unsigned n = 0; n < kMost; ++n) {
            const auto address = reg::sync_manager(n).address;
            const auto activate = octets_at(e, e.sent, address + wire::SyncManagerLayout::activate::offset, 1);
            if (octets_at(e, e.sent, address, 1) ||
                (activate && (std::to_integer<unsigned>(activate->front()) & wire::sm_activate::kEnable) == 0))
                for (auto& mail : slave.last_mail) mail.clear();
        }
    }
    if (reads_registers(e.header.command)) take(e.received);
}

}  // namespace margay::analyse
