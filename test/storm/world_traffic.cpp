// Rules about the contents of the cycle (queued datagrams within their budget, the status of mailboxes), about the
// rings of the context, and about sequences without memory.
#include "api/master.hpp"
#include "storm/world.hpp"
#include "wire/esc.hpp"

#include <algorithm>

namespace margay::storm {

// Before init() all facts can be read, and slaves that do not exist can be written.
void World::read_what_is_not_there() {
    if (ctx_->errors().take() || ctx_->warnings().take() || ctx_->events().take() ||
        ctx_->statistics().frames_sent != 0 || emergencies(*ctx_, 1).take())
        fail("something is there before init()", "");
    for (const std::size_t number : {0U, 1U, 70'000U}) ctx_->slave(number).image.outputs.bytes[0] = std::byte{1};
}

// ------------------------------------------------------------------ queued datagrams

void World::note_interval(std::uint8_t group) {
    const Duration period = std::chrono::microseconds(plan_.settings.cycle_us);
    Pace& pace = paces_[group];
    const bool first = ctx_->group(group).cycles_sent < 2 || pace.last == Time::min();
    const Duration interval = first ? Duration{0} : osal_.now() - pace.last;
    pace.equal = interval > period * 3 / 4 && interval < period * 5 / 4 ? pace.equal + 1 : 0;
    pace.last = osal_.now();
}

// While the cycles of any group keep their interval, queued datagrams are sent with them, and poll() sends no frame.
void World::check_poll(std::uint64_t frames_before) {
    const Settings& s = plan_.settings;
    const Duration period = std::chrono::microseconds(s.cycle_us);
    if (s.in_flight > 1 || s.acyclic_bytes == 0 || nic_->sent().frames == frames_before) return;
    for (std::size_t g = 0; g < paces_.size(); ++g)
        if (ctx_->group(g).mapped && ctx_->group(g).cycles_sent > 3 && paces_[g].equal > 2 &&
            osal_.now() < paces_[g].last + period * 5 / 4)
            fail("poll() sends queued datagrams although cycles keep their interval", "group " + std::to_string(g));
}

// A cycle sends queued datagrams up to the budget of the group, or one longer datagram.
void World::check_budget(std::uint8_t group, const ChaosNic::Sent& before) {
    if (plan_.settings.in_flight > 1) return;
    const ProcessGroup& of = master_of(*ctx_)->network.process.groups[group];
    std::uint64_t datagrams = 0;
    std::uint64_t bytes = 0;
    for (const PreparedFrame& frame : of.prepared) {
        datagrams += frame.datagram_count;
        bytes += frame.size - wire::kFramePrefixBytes;
    }
    const ChaosNic::Sent& now = nic_->sent();
    if (now.datagrams - before.datagrams <= datagrams + 1 || now.bytes - before.bytes <= bytes) return;
    const std::uint64_t queued = now.bytes - before.bytes - bytes;
    if (queued > of.config.acyclic_bytes)
        fail("queued datagrams exceed the budget of their group",
             std::to_string(queued) + " octets of " + std::to_string(of.config.acyclic_bytes));
}

// ------------------------------------------------------------------ the status of mailboxes

std::vector<World::Mailbox> World::look_at_mailboxes(std::uint8_t group) {
    constexpr std::uint16_t kStatus = 0x080D;  // SyncManager 1
    constexpr std::byte kFull{0x08};
    std::vector<Mailbox> all(ctx_->slaves().size() + 1, Mailbox::unknown);
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.image.group != group || slave.image.mailbox_status_bit == SlaveImage::kNone || !slave.takes_part)
            continue;
        const auto devices = devices_at(slave.number);
        if (devices.size() != 1) continue;
        const bool full = (segment_.slave(devices[0]).peek(kStatus, 1)[0] & kFull) != std::byte{0};
        all[slave.number] = full ? Mailbox::full : Mailbox::empty;
    }
    return all;
}

// The image contains the mailbox status of each slave whose inputs it contains, whatever happened to other slaves.
void World::check_mailboxes(std::uint8_t group, const Cycle& cycle) {
    if (hostile_ || hostile_registers_ || cycle.mapping || cycle.send_error != Errc::none) return;
    const Group& of = ctx_->group(group);
    if (!of.mapped || !std::ranges::all_of(of.datagrams, &DatagramStatus::usable)) return;
    const auto now = look_at_mailboxes(group);
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.number >= cycle.mailboxes.size() || now[slave.number] == Mailbox::unknown) continue;
        if (cycle.mailboxes[slave.number] != now[slave.number] || !inputs_fresh(*ctx_, slave.number)) continue;
        const std::uint32_t bit = slave.image.mailbox_status_bit;
        const bool set = (std::to_integer<unsigned>(of.image[bit / 8]) >> (bit % 8) & 1) != 0;
        if (set != (now[slave.number] == Mailbox::full))
            fail("the image has another mailbox status than the slave", place(slave.number) + counted(group));
    }
}

// ------------------------------------------------------------------ threads, rings, memory

// Another thread makes calls that only the owner may make.
void World::check_ownership() {
    const Errc received = receive_processdata(*ctx_, Duration{0}).error().code;
    const Errc tolerated = tolerate(*ctx_, {}).error().code;
    if (received != Errc::not_owner || tolerated != Errc::not_owner)
        fail("a thread that does not own the context is not refused", "");
}

void World::drain_emergencies() {
    for (const Slave& slave : ctx_->slaves()) {
        EmergencyRing& ring = emergencies(*ctx_, slave.number);
        for (std::uint32_t n = 0; ring.take(); ++n)
            if (n >= ring.capacity()) fail("a ring returns more values than it has room for", place(slave.number));
    }
}

void World::hoard(std::uint32_t milliseconds, std::size_t blocks_left) {
    Arena& arena = master_of(*ctx_)->network.arena();
    for (void* block : hoarded_) arena.release(block);
    hoarded_.clear();
    if (milliseconds == 0) return;
    while (void* block = arena.allocate(1)) hoarded_.push_back(block);
    std::ranges::sort(hoarded_);  // neighbours become larger blocks when they are released
    for (; blocks_left > 0 && !hoarded_.empty(); --blocks_left) {
        arena.release(hoarded_.back());
        hoarded_.pop_back();
    }
    insert_due({osal_.now() + std::chrono::milliseconds(milliseconds), {0, Op::hoard, {0}}});
}

}  // namespace margay::storm
