// The phases of a run: bring-up, the end of the faults, and the comparison with the beginning.
#include "api/master.hpp"
#include "storm/world.hpp"
#include "wire/esc.hpp"

namespace margay::storm {

using namespace std::chrono_literals;

namespace {

constexpr Duration kBringUp = 120s;
constexpr Duration kBack = 120s;
constexpr Duration kCompletes = 600s;

constexpr std::array kStartup{
    write_register(Transition::init_to_preop, 0x0F80, std::uint16_t{0x1234}),
    check_register(Transition::preop_to_safeop, 0x0F80, std::uint16_t{0x1234}, std::uint16_t{0xFFFF}),
    write_object(Transition::preop_to_safeop, 0x3001, 7, std::uint16_t{1}).that_may_fail(),
    write_register(Transition::safeop_to_op, 0x0F82, std::uint16_t{0x5678}),
    write_register(Transition::op_to_safeop, 0x0F84, std::uint16_t{1}),
};
constexpr SlaveSetup kSetup{.startup = kStartup};

}  // namespace

// Hooks of the application.
struct Hooks {
    static Result<> transition(HookedSlave slave, Transition, Moment, void* user) {
        World& world = *static_cast<World*>(user);
        ++world.hook_calls_;
        if (world.plan_.settings.hooks == 1 && world.hook_calls_ % 4 != 0)
            return Error{.code = Errc::busy, .slave = slave.number()};
        if (world.plan_.settings.hooks == 4) world.meddle(world.hook_calls_ / 3);
        // The remainder changes. Otherwise, when few tasks start the slaves in turn, the same slave would fail for
        // ever.
        if (world.plan_.settings.hooks == 2 && (world.hook_calls_ + world.hook_calls_ / 64) % 16 == 5)
            return Error{.code = Errc::check_failed, .slave = slave.number()};
        return Result<>();
    }
    static Task<> preop_to_safeop(HookedSlave slave, void*) {
        auto read = co_await slave.sdo_read<std::uint32_t>(0x1000, 0);
        (void)read;
        co_return Result<>();
    }
};

void World::configure_all() {
    const Settings& s = plan_.settings;
    for (std::uint8_t g = 0; g < images_.size(); ++g) {
        if (ctx_->group(g).mapped) continue;
        auto& config = ctx_->group(g).config;
        config.packing = s.bits != 0 ? Packing::bits : Packing::bytes;
        config.overlapped = s.overlapped != 0;
        config.block_lrw = s.group_lrd_lwr != 0;
        config.al_status = s.al_status != 0;
        config.acyclic_bytes = static_cast<std::uint16_t>(s.acyclic_bytes);
        config.reserve_bytes = static_cast<std::uint16_t>(s.reserve_bytes);
        config.cycles_in_flight = static_cast<std::uint8_t>(s.in_flight);
        config.shared = s.shared != 0 ? shared_[g].get() : nullptr;
    }
    for (const Slave& slave : ctx_->slaves()) {
        const bool expected = slave.wanted != nullptr && slave.wanted->config != nullptr;
        if (!expected && s.groups > 1) set_group(slave, static_cast<std::uint8_t>(slave.number % s.groups));
        slave.config.block_lrw = s.slave_lrd_lwr != 0 && slave.number % s.slave_lrd_lwr == 0;
        slave.config.mailbox_status = s.mailbox_status != 0 && slave.number % s.mailbox_status == 0;
        if (s.watchdog_us != 0) slave.config.process_data_watchdog = SlaveConfiguration::Watchdog(s.watchdog_us);
        if (s.startup != 0 && slave.config.setup == nullptr) slave.config.setup = &kSetup;
        if (s.hooks == 1 || s.hooks == 2 || s.hooks == 4) slave.hooks.transition = Hooks::transition;
        if (s.hooks == 3) slave.hooks.preop_to_safeop = Hooks::preop_to_safeop;
        slave.hooks.user = this;
    }
}

// An error of config_init() or config_map() is allowed when it names a slave that has quirks or is not the expected
// slave. In this case all other work was done.
void World::blame(const char* rule, const Error& error) {
    if (error.code == Errc::none) return;
    std::array<char, 300> text{};
    const auto words = std::string(describe(error, text));
    if (error.slave == 0) fail(rule, words);
    if (error.code == Errc::missing_slave || error.code == Errc::other_slave) {
        if (plan_.settings.expect < 2) fail(rule, words);
        return;
    }
    const auto named = devices_at(error.slave);  // a disconnected device may keep the address of another device
    if (std::ranges::any_of(named, [this](std::uint32_t n) { return clean(n); })) fail(rule, words);
}

void World::lose_frames() {
    nic_->rates.drop_in = {std::min(plan_.settings.bring_up_drop, 1'000'000U)};
    disturbed_ = disturbed_much_ = true;
}

Result<> World::scan_now() {
    call_ = "config_init()", call_since_ = osal_.now();
    const auto found = config_init(*ctx_);
    call_ = nullptr;
    if (found.error().code == Errc::canceled) fail("a request that nobody cancelled is canceled", "config_init()");
    return found ? Result<>() : Result<>(found.error());
}

// Maps all groups. If frames are lost or hooks fail, a failed mapping is repeated, as an application would do. Until
// then a slave whose process data is unknown has no place.
void World::map_all() {
    for (std::uint8_t g = 0; g < images_.size(); ++g) {
        if (plan_.settings.bring_up_drop != 0) lose_frames();
        const auto mapped = map_now(g);
        nic_->settle();
        const bool again = plan_.settings.bring_up_drop != 0 || plan_.settings.hooks == 2;
        if (again && !mapped) (void)map_now(g);
    }
}

void World::bring_up() {
    if (plan_.settings.bring_up_drop != 0) lose_frames();
    auto found = scan_now();
    if (plan_.settings.bring_up_drop != 0 && !found) {
        nic_->settle();
        found = scan_now();
    }
    look_around();
    blame("bring-up", found.error());
    if (ctx_->slaves().size() != plan_.devices.size()) fail("bring-up", "config_init() does not find all slaves");
    if (plan_.settings.expect >= 4) {
        map_all();
        keep_places();
        switch_away();
    }
    if (plan_.settings.expect != 0) expect_slaves();
    map_all();
    if (plan_.settings.copies != 0) copy_between_slaves();
    supervision_.target = plan_.settings.supervise_target == 4 ? AlState::safeop : AlState::op;
    if (plan_.settings.line_ms != 0) supervision_.line_interval = std::chrono::milliseconds(plan_.settings.line_ms);
    if (!submit(*ctx_, supervision_)) fail("bring-up", "the supervision is refused");
    supervising_ = true;
    cycling_ = true;
    next_cycle_ = osal_.now();
    const auto missing = [this](std::uint32_t n) {
        return clean(n) && !in_op(n) && std::ranges::find(away_, n) == away_.end();
    };
    const auto all = [&] {
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            if (missing(n)) return false;
        return true;
    };
    (void)run_until(osal_.now() + kBringUp, all);
    const bool all_are_right = plan_.settings.expect < 2 || plan_.settings.expect >= 4;
    if (supervision_.target == AlState::op && all_are_right && plan_.settings.process_frames >= 8)
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            if (missing(n))
                fail("bring-up", "not in OP: " + place(static_cast<std::uint16_t>(station_[n] - 0x1000)) + story());
    run_for(50ms);
    for (const auto n : away_)
        if (clean(n)) baseline_.push_back(n);
    for (std::uint32_t n = 0; n < segment_.size(); ++n)
        if (in_op(n) && (wrong_ == 0 || segment_.slave(n).station() != ctx_->slave(wrong_).station_address.value))
            baseline_.push_back(n);
}

// A device without quirks whose EEPROM was not changed.
bool World::clean(std::uint32_t device) const {
    const auto& d = plan_.devices[device];
    return !dirty_[device] && d.quirks.empty();
}

bool World::in_op(std::uint32_t device) {
    return segment_.powered(device) &&
           (segment_.slave(device).registers().get<std::uint16_t>(wire::reg::kAlStatus.address) & 0x1F) == 8;
}

// One copy in each group that has slaves for it, from the next mapping on.
void World::copy_between_slaves() {
    copies_.resize(images_.size());
    for (std::uint8_t g = 0; g < images_.size(); ++g) {
        SlaveToSlave& copy = copies_[g];
        for (const Slave& slave : ctx_->slaves()) {
            if (slave.config.group != g || slave.name().find("rive") != std::string_view::npos) continue;
            if (copy.from_slave == 0 && slave.image.inputs.bits != 0) copy.from_slave = slave.number;
            if (copy.to_slave == 0 && slave.image.outputs.bits != 0) copy.to_slave = slave.number;
        }
        if (copy.from_slave == 0 || copy.to_slave == 0) continue;
        copy.bits = std::min<std::uint32_t>(
            {ctx_->slave(copy.from_slave).image.inputs.bits, ctx_->slave(copy.to_slave).image.outputs.bits, 12});
        ctx_->group(g).config.copies = Borrowed<SlaveToSlave>(&copy, 1);
        (void)map_now(g);
        if (!ctx_->group(g).mapped) fail("bring-up", "a group with a copy between slaves is not mapped" + story());
    }
}

// Devices that were in OP when the faults began must be in OP again, and the cycle must be right.
void World::expect_back() {
    if (supervision_.target != AlState::op || hostile_) return;
    cycling_ = true;
    next_cycle_ = osal_.now();
    const auto back = [this] {
        return std::ranges::all_of(baseline_, [this](std::uint32_t n) { return dirty_[n] || in_op(n); });
    };
    if (!run_until(osal_.now() + kBack, back)) {
        look_around();
        for (const auto n : baseline_)
            if (!dirty_[n] && !in_op(n)) {
                const auto number = static_cast<std::uint16_t>(station_[n] - 0x1000);
                const Slave& slave = ctx_->slave(number);
                std::array<char, 300> text{};
                fail("a supervised slave does not come back",
                     "device " + std::to_string(ids_[n]) + " " + plan_.devices[n].name +
                         (station_[n] == 0 ? " without an address" : ", " + place(number)) + ": " +
                         std::string(to_text(slave.al.state)) + " code " + std::to_string(slave.al.code) + ", " +
                         std::string(describe(slave.error, text)) + story());
            }
    }
    run_for(50ms);
}

void World::finish_requests() {
    const auto waiting = [this]() -> const Slot* {
        for (const auto& slot : slots_)
            if (slot.operation && !kinds()[slot.operation->kind()].stays_busy && slot.operation->request().busy())
                return &slot;
        return nullptr;
    };
    if (run_until(osal_.now() + kCompletes, [&] { return waiting() == nullptr; })) return;
    fail("a request never completes", std::string(kind_name(waiting()->operation->kind())));
}

void World::check_arena() {
    for (auto& slot : slots_) slot.cancel();
    for (auto& write : hostile_writes_) write.request.cancel();
    for (auto& [device, update] : updates_) update.request.cancel();
    supervising_ = false;
    supervision_.cancel();
    (void)watch_mailboxes(*ctx_, Duration{0});
    run_for(20ms);
    cycling_ = false;
    run_for(10s);
    const auto used = master_of(*ctx_)->network.arena().used_bytes();
    if (used != arena_level_)
        fail("the arena does not return to its level",
             std::to_string(used) + " octets are in use, " + std::to_string(arena_level_) + " were");
}

// Switches all devices off and on. Everything must work as at the beginning.
void World::fresh_start() {
    cycling_ = false;
    run_for(10ms);
    for (std::uint32_t n = 0; n < segment_.size(); ++n) segment_.set_power(n, false, osal_.now());
    note_presence(true);
    run_for(10ms);
    for (std::uint32_t n = 0; n < segment_.size(); ++n) segment_.set_power(n, true, osal_.now());
    note_presence(true);
    run_for(20ms);
    wrong_ = 0;
    hostile_ = hostile_registers_ = false;
    updates_.clear();
    if (!expect(*ctx_, {})) fail("expect() is refused", "");
    call_ = "config_init()", call_since_ = osal_.now();
    const auto found = config_init(*ctx_);
    call_ = nullptr;
    std::array<char, 300> text{};
    look_around();
    plan_.settings.expect = 0;
    blame("a fresh start fails", found.error());
    const auto there = std::ranges::count(reachable_, true);
    if (std::ssize(ctx_->slaves()) != there)
        fail("a fresh start fails",
             std::to_string(ctx_->slaves().size()) + " slaves of " + std::to_string(there) + " are found");
    plan_.settings = {.groups = plan_.settings.groups, .frames = plan_.settings.frames};
    for (std::uint8_t g = 0; g < images_.size(); ++g) {
        ctx_->group(g).config = {.start = ctx_->group(g).config.start};
        call_ = "config_map()", call_since_ = osal_.now();
        for (const Slave& slave : ctx_->slaves()) slave.config.group = 0;
        note_presence(true);
        const auto mapped = config_map(*ctx_, images_[g], g);
        call_ = nullptr;
        if (g == 0) blame("a fresh start fails", mapped.error());
        check_bits(g, call_since_);
        on_their_way_[g].clear();
    }
    supervision_.target = AlState::op;
    if (const auto begun = submit(*ctx_, supervision_); !begun)
        fail("a fresh start fails", std::string(describe(begun.error(), text)));
    cycling_ = true;
    next_cycle_ = osal_.now();
    const auto all = [this] {
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            if (clean(n) && !in_op(n)) return false;
        return true;
    };
    if (!run_until(osal_.now() + kBringUp, all)) {
        look_around();
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            if (clean(n) && !in_op(n)) {
                const auto number = static_cast<std::uint16_t>(station_[n] - 0x1000);
                fail("a fresh start fails", place(number) + " is not in OP: " +
                                                std::string(describe(ctx_->slave(number).error, text)) + story());
            }
    }
    run_for(30ms);
}

// The context is destroyed while requests are busy. The requests must end.
void World::close_busy() {
    for (std::uint32_t n = 0; n < kSlots; ++n)
        submit_slot({0, Op::submit, {n, n % static_cast<std::uint32_t>(kinds().size()), 1 + n % 3, n * 7, 0}}, true);
    (void)run_until(osal_.now() + 1ms, [] { return false; });
    ctx_.reset();
    for (const auto& slot : slots_)
        if (slot.operation && slot.operation->request().busy())
            fail("a request is busy though its context is gone", std::string(kind_name(slot.operation->kind())));
}

}  // namespace margay::storm
