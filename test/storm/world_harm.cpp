// Faults of one device: hostile register writes, and writes to its EEPROM that end early.
#include "storm/world.hpp"

#include "wire/esc.hpp"
#include "wire/sii.hpp"

#include <algorithm>

namespace margay::storm {

using namespace std::chrono_literals;
namespace sii = wire::sii;

void World::insert_due(const Due& due) {
    const auto later = [&due](const Due& other) { return other.at > due.at; };
    world_steps_.insert(std::ranges::find_if(world_steps_, later), due);
}

// Returns 0 if the device is disconnected, because a request would reach another device with its address, or no device.
std::uint16_t World::slave_at(std::uint32_t device) {
    look_around();
    if (!reachable_[device]) return 0;
    const auto address = segment_.slave(device).station();
    const bool one = address > 0x1000 && std::size_t{address} - 0x1000 <= ctx_->slaves().size();
    return one ? static_cast<std::uint16_t>(address - 0x1000) : std::uint16_t{0};
}

// ------------------------------------------------------------------ registers

void World::hostile_write(const Step& step) {
    const auto device = number_of(step.args[0]);
    const auto slave = device ? slave_at(*device) : std::uint16_t{0};
    if (slave == 0) return;
    auto& write = hostile_writes_.emplace_back();
    std::uint64_t value = step.args[2];
    // A start time is relative to the present time.
    if (step.args[1] == wire::reg::kSyncStartTime.address) value += segment_.slave(*device).clock().copy(osal_.now());
    for (std::size_t n = 0; n < write.data.size(); ++n) write.data[n] = static_cast<std::byte>(value >> (8 * n));
    write.request.slave = slave;
    write.request.address = static_cast<std::uint16_t>(step.args[1]);
    write.request.data = std::span<const std::byte>(write.data).first(std::clamp(step.args[3], 1U, 8U));
    write.request.timeout = 1s;
    if (!submit(*ctx_, write.request)) return;
    hostile_registers_ = true;
    if (tampered_.insert(*device).second) {
        insert_due({osal_.now() + 2s, {0, Op::power_off, {step.args[0]}}});
        insert_due({osal_.now() + 2005ms, {0, Op::power_on, {step.args[0]}}});
    }
}

// ------------------------------------------------------------------ EEPROM

// Writes the configuration area of an EEPROM with another alias. `how` 1: the reserved words have values with which the
// words up to the first reserved word, together with the old checksum, look right.
void World::update_eeprom(const Step& step) {
    const auto device = number_of(step.args[0]);
    const auto slave = device ? slave_at(*device) : std::uint16_t{0};
    if (slave == 0) return;
    const Bytes image = segment_.slave(*device).sii().image();
    const bool busy = updates_.contains(*device) && updates_[*device].request.busy();
    if (busy || image.size() < sii::kConfigurationBytes || sii::is_blank(image) || !sii::checksum_right(image)) return;
    updates_.erase(*device);
    Update& update = updates_[*device];
    std::copy_n(image.begin(), update.old.size(), update.old.begin());
    update.wanted = update.old;
    const MutableBytes wanted(update.wanted);
    constexpr std::size_t kAlias = 8, kReserved = 10, kLast = 12;
    store_le<std::uint16_t>(wanted, kAlias, static_cast<std::uint16_t>(step.args[1]));
    const auto right = sii::checksum(update.old);
    for (std::uint32_t n = 0; step.args[2] == 1 && n < 0x10000 && sii::checksum(wanted) != right; ++n)
        store_le<std::uint16_t>(wanted, kReserved, static_cast<std::uint16_t>(n));
    wanted[kLast] ^= std::byte{0x5A};
    store_le<std::uint16_t>(wanted, sii::kConfigurationBytes - 2, sii::checksum(wanted));
    update.since = osal_.now();
    update.request.slave = slave;
    update.request.data = update.wanted;
    if (!submit(*ctx_, update.request)) {
        updates_.erase(*device);
        return;
    }
    make_dirty(*device);
}

// Marks a device whose EEPROM or program has changed. The first slave of a group is not recognised without its alias.
void World::make_dirty(std::uint32_t device) {
    dirty_[device] = true;
    if (!group_.empty() && device == group_.front())
        for (const auto member : group_) dirty_[member] = true;
}

void World::eeprom_deaf(std::uint32_t device, std::uint32_t milliseconds) {
    faulty_eeproms_.insert(device);
    segment_.slave(device).sii().fail_next(1'000'000);
    insert_due({osal_.now() + std::chrono::milliseconds(std::min(milliseconds, 190U)),
                {0, Op::eeprom_nacks, {ids_[device], 0}}});
}

// At any moment the configuration area is the old area, the new area, or has a wrong checksum.
void World::check_eeproms() {
    for (auto& [device, update] : updates_) {
        const Bytes image = segment_.slave(device).sii().image();
        const auto is = [&image](Bytes area) { return std::ranges::equal(image.first(area.size()), area); };
        const bool whole = is(update.old) || is(update.wanted);
        if (!whole && sii::checksum_right(image))
            fail("a mixture of an old and a new EEPROM has a right checksum", "device " + std::to_string(ids_[device]));
        if (update.checked || update.request.busy()) continue;
        update.checked = true;
        const Errc code = update.request.error().code;
        if (code == Errc::none && !is(update.wanted))
            fail("a write to an EEPROM succeeds, and its content is another one",
                 "device " + std::to_string(ids_[device]));
        check_acknowledged(update.request, device, update.since);
        const bool by_eeprom = code == Errc::sii_nack || code == Errc::sii_busy || code == Errc::sii_verify;
        const bool quiet = !disturbed_ && !hostile_registers_ && presence_[device].since <= update.since;
        if (by_eeprom && !whole && quiet)
            fail("a write to an EEPROM fails and leaves a wrong checksum", "device " + std::to_string(ids_[device]));
    }
}

// An EEPROM that works acknowledges each word within 100 ms.
void World::check_acknowledged(const Request& request, std::uint32_t device, Time since) {
    if (request.error().code != Errc::sii_nack || faulty_eeproms_.contains(device) || hostile_registers_ || hostile_)
        return;
    const auto& quirks = plan_.devices[device].quirks;
    // A blank EEPROM does not contain its size, so the application may write behind its end.
    if (2U * request.error().word() + 2U > segment_.slave(device).sii().image().size()) return;
    if (std::ranges::find(quirks, "sii_nacks") != quirks.end() || presence_[device].since > since) return;
    std::array<char, 300> text{};
    fail("an EEPROM that works does not acknowledge", std::string(describe(request.error(), text)));
}

}  // namespace margay::storm
