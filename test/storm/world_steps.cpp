// The effect of each step of a plan.
#include "storm/world.hpp"

#include "sim/library/quirk.hpp"
#include "wire/sii.hpp"

namespace margay::storm {

namespace {
Rate per_million(std::uint32_t value) { return {std::min(value, 1'000'000U)}; }
}  // namespace

std::optional<std::uint32_t> World::number_of(std::uint32_t id) const {
    for (std::uint32_t n = 0; n < ids_.size(); ++n)
        if (ids_[n] == id) return n;
    return std::nullopt;
}

void World::do_step(const Step& step) {
    const auto& a = step.args;
    switch (step.op) {
        case Op::submit: submit_slot(step, true); break;
        case Op::submit_other: submit_slot(step, false); break;
        case Op::cancel: slots_[a[0] % kSlots].cancel(); break;
        case Op::destroy: slots_[a[0] % kSlots].operation.reset(); break;
        case Op::ask_cancel:
            osal_.thread = 2;
            slots_[a[0] % kSlots].cancel();
            osal_.thread = 1;
            break;
        case Op::cycles:
            cycling_ = a[0] != 0;
            next_cycle_ = osal_.now();
            break;
        case Op::map: (void)map_now(static_cast<std::uint8_t>(a[0] % images_.size())); break;
        case Op::late:
            late_ = std::chrono::microseconds(a[0]);
            disturbed_ = disturbed_ || a[0] != 0;
            break;
        case Op::watch: (void)watch_mailboxes(*ctx_, std::chrono::microseconds(a[0])); break;
        case Op::configure: configure(a[0], a[1], a[2]); break;
        case Op::write_state: {
            call_ = "writestate()", call_since_ = osal_.now();
            constexpr std::array kWantedStates{AlState::init, AlState::preop, AlState::safeop, AlState::op};
            (void)writestate(*ctx_, static_cast<std::uint16_t>(a[0]), kWantedStates[a[1] % kWantedStates.size()]);
            call_ = nullptr;
            break;
        }
        case Op::hostile: hostile_write(step); break;
        case Op::eeprom_update: update_eeprom(step); break;
        default: world_step(step);
    }
}

// Steps that lose, delay or double frames.
void World::note_disturbance(const Step& step) {
    constexpr std::uint32_t kMuch = 50'000;  // frames per million
    switch (step.op) {
        case Op::noise:
        case Op::drop:
        case Op::duplicate: disturbed_much_ = disturbed_much_ || std::max(step.args[0], step.args[1]) > kMuch; break;
        case Op::delay:
        case Op::busy: disturbed_much_ = disturbed_much_ || step.args[0] > kMuch; break;
        case Op::flip: break;
        default: return;
    }
    disturbed_ = disturbed_ || step.args[0] != 0 || step.args[1] != 0;
}

void World::world_step(const Step& step) {
    const auto& a = step.args;
    std::uint32_t device = 0;
    if (info(step.op).names_device) {
        const auto found = number_of(a[0]);
        if (!found) return;
        device = *found;
    }
    const Time now = osal_.now();
    segment_.advance(now);
    note_disturbance(step);
    switch (step.op) {
        case Op::cut: segment_.set_cable({device, 0}, false); break;
        case Op::mend: segment_.set_cable({device, 0}, true); break;
        case Op::power_off:
            segment_.set_power(device, false, now);
            tampered_.erase(device);
            break;
        case Op::power_on:
            if (!segment_.powered(device)) halted_[device] = false;
            segment_.set_power(device, true, now);
            break;
        case Op::noise: segment_.set_noise({a[0] / 1e6, a[1] / 1e6, plan_.seed + 1}); break;
        case Op::eeprom_nacks:
            segment_.slave(device).sii().fail_next(a[1]);
            faulty_eeproms_.insert(device);
            break;
        case Op::hoard: hoard(a[0], a[1]); break;
        case Op::eeprom_deaf: eeprom_deaf(device, a[1]); break;
        case Op::eeprom_word:
            if (a[1] >= wire::sii::word::kIdentity && a[1] < wire::sii::word::kIdentity + 8U) renamed_.insert(device);
            if (auto& image = segment_.slave(device).sii().image(); 2 * std::size_t{a[1]} + 1 < image.size()) {
                image[2 * std::size_t{a[1]}] = static_cast<std::byte>(a[2]);
                image[2 * std::size_t{a[1]} + 1] = static_cast<std::byte>(a[2] >> 8);
                dirty_[device] = true;
                updates_.erase(device);
            }
            break;
        case Op::halt:
            if (!segment_.powered(device)) break;
            segment_.slave(device).halt_firmware(now);
            halted_[device] = true;
            break;
        case Op::quirk:
            if (spies_[device] != nullptr) {
                std::vector<std::byte> sii = segment_.slave(device).sii().image();
                (void)spies_[device]->add_quirk(static_cast<sim::Quirk>(a[1]), sii);
                make_dirty(device);
                updates_.erase(device);
                faulty_eeproms_.insert(device);
            }
            break;
        case Op::replug:
            segment_.set_cable({device, 0}, false);
            segment_.set_cable({device, 0}, true);
            break;
        case Op::drop: nic_->rates.drop_out = per_million(a[0]), nic_->rates.drop_in = per_million(a[1]); break;
        case Op::duplicate: nic_->rates.twice_out = per_million(a[0]), nic_->rates.twice_in = per_million(a[1]); break;
        case Op::delay:
            nic_->rates.delay = per_million(a[0]), nic_->rates.delay_up_to = std::chrono::microseconds(a[1]);
            break;
        case Op::flip:
            nic_->rates.flip = per_million(a[0]);
            hostile_ = hostile_ || a[0] != 0;
            break;
        case Op::busy:
            nic_->rates.busy = per_million(a[0]), nic_->rates.busy_for = std::chrono::microseconds(a[1]);
            break;
        default: break;
    }
}

void World::submit_slot(const Step& step, bool by_owner) {
    Slot& slot = slots_[step.args[0] % kSlots];
    const std::uint32_t kind = step.args[1];
    if (kind >= kinds().size()) return;
    const KindInfo& of = kinds()[kind];
    if (!by_owner && !of.mail) return;
    const bool busy = slot.operation && slot.operation->request().busy();
    if (busy && slot.operation->kind() != kind) return;  // another kind of request is busy in this slot
    if (!busy) {
        if (slot.operation && slot.operation->kind() == kind)  // the same request object is used again
            set_operation(*slot.operation, step.args[2], step.args[3], step.args[4]);
        else
            slot.operation = make_operation(kind, step.args[2], step.args[3], step.args[4]);
        if (of.name == "map") {
            auto& map = static_cast<MapRequest&>(slot.operation->request());
            map.group = static_cast<std::uint8_t>(step.args[2] % images_.size());
            map.image = images_[map.group];
            configure_all();
        }
        slot.since = osal_.now();
        slot.checked = slot.cancelled = false;
    }
    if (!by_owner) osal_.thread = 2;
    if (!by_owner) check_ownership();
    const auto submitted = slot.operation->submit(*ctx_);
    osal_.thread = 1;
    if (busy && submitted) fail("a busy request is taken again", std::string(of.name));
    if (!submitted && !busy && slot.operation->request().busy())
        fail("a request that was refused is busy", std::string(of.name));
    if (!submitted && !busy) slot.checked = true;
}

void World::set_group(const Slave& slave, std::uint8_t group) {
    if (slave.config.group != group) regrouped_[slave.number] = osal_.now();
    slave.config.group = group;
}

void World::configure(std::uint32_t number, std::uint32_t what, std::uint32_t value) {
    const Slave& slave = ctx_->slave(number);
    if (slave.number == 0) return;
    switch (what % 6) {
        case 0: set_group(slave, static_cast<std::uint8_t>(value % images_.size())); break;
        case 1: slave.config.block_lrw = value % 2 != 0; break;
        case 2: slave.config.mailbox_status = value % 2 != 0; break;
        case 3: slave.config.optional = value % 2 != 0; break;
        case 4:
            slave.config.highest = value % 3 == 0 ? AlState::preop : value % 3 == 1 ? AlState::safeop : AlState::op;
            break;
        case 5: slave.config.no_complete_access = value % 2 != 0; break;
        default: break;
    }
}

Result<> World::map_now(std::uint8_t group) {
    configure_all();
    note_presence(true);
    call_ = "config_map()", call_since_ = osal_.now();
    const auto mapped = config_map(*ctx_, images_[group], group);
    call_ = nullptr;
    if (mapped.error().code == Errc::canceled) fail("a request that nobody cancelled is canceled", "config_map()");
    check_bits(group, call_since_);
    on_their_way_[group].clear();
    next_cycle_ = std::max(next_cycle_, osal_.now());
    return mapped ? Result<>() : Result<>(mapped.error());
}

// Ends all faults.
void World::heal() {
    world_steps_.clear();
    owner_steps_.clear();
    meddling_ = false;
    hoard(0, 0);
    nic_->settle();
    segment_.set_noise({});
    late_ = Duration{0};
    segment_.advance(osal_.now());
    for (std::uint32_t n = 0; n < segment_.size(); ++n) {
        segment_.set_cable({n, 0}, true);
        segment_.slave(n).sii().fail_next(0);
        if (halted_[n] || tampered_.contains(n)) segment_.set_power(n, false, osal_.now());
    }
    note_presence(true);
    run_for(std::chrono::milliseconds(5));
    for (std::uint32_t n = 0; n < segment_.size(); ++n) {
        halted_[n] = false;
        segment_.set_power(n, true, osal_.now());
    }
    tampered_.clear();
    note_presence(true);
}

}  // namespace margay::storm
