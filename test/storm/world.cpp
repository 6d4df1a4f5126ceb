#include "storm/world.hpp"
#include "sim/library/quirks.hpp"

#include "api/master.hpp"

namespace margay::storm {

using namespace std::chrono_literals;

namespace {

// The longest call of a master: all timeouts of the start-up of slaves that never answer, in sequence.
constexpr Duration kLongestCall = 600s;
constexpr std::uint32_t kMostPollsAtOnce = 2000;
constexpr std::uint32_t kMostPollsAMillisecond = 5000;

}  // namespace

void StormOsal::wait(Time until, WaitHandles) noexcept { world_.wait_in_call(until); }

World::World(const Plan& plan, Reporter reporter)
    : plan_(plan), reporter_(std::move(reporter)), chance_(plan.seed ^ 0x5707A) {
    build();
}

World::~World() {
    for (auto& slot : slots_) slot.operation.reset();
    hostile_writes_.clear();
    updates_.clear();
    supervision_.cancel();
}

void World::fail(std::string rule, const std::string& detail) {
    reporter_({std::move(rule), detail + " (at " + std::to_string(simulated_seconds()) + " s)"});
    std::abort();
}

void World::build() {
    std::map<std::int32_t, std::uint32_t> numbers;
    for (const auto& d : plan_.devices) {
        auto device = sim::make_device(d.name);
        if (!device) fail("bad plan", "no device " + d.name);
        for (const auto& quirk : d.quirks) (void)sim::add_quirk(*device, quirk);
        Spy* spy = nullptr;
        if (device->firmware) {
            auto watched = std::make_unique<Spy>(std::move(device->firmware));
            spy = watched.get();
            device->firmware = std::move(watched);
        }
        const auto number = segment_.add(std::move(*device).assemble());
        spies_.push_back(spy);
        ids_.push_back(d.id);
        numbers[static_cast<std::int32_t>(d.id)] = number;
        const auto port = static_cast<std::uint8_t>(d.port);
        if (d.parent < 0)
            (void)segment_.connect_master({number, 0});
        else if (numbers.contains(d.parent))
            (void)segment_.connect({numbers[d.parent], port}, {number, 0});
    }
    const std::size_t count = segment_.size();
    dirty_.assign(count, false);
    halted_.assign(count, false);
    reachable_.assign(count, false);
    station_.assign(count, 0);
    sent_.resize(count);
    in_ring_.assign(count, false);
    presence_.resize(count);
    const Settings& s = plan_.settings;
    images_.assign(s.groups, std::vector<std::byte>(kImageBytes));
    on_their_way_.resize(s.groups);
    mappings_.resize(s.groups);
    paces_.resize(s.groups);
    choose_group();
    segment_.power_up(osal_.now());
    note_presence(true);
    wire_ = std::make_unique<SimulatedNic>(
        segment_, osal_,
        SimulatedNic::Options{.round_trip = std::chrono::microseconds(s.round_trip_us), .wire_time = s.wire_time != 0});
    nic_ = std::make_unique<ChaosNic>(*wire_, osal_, plan_.seed);
    ctx_ = std::make_unique<RoomyContext>(Limits{.slaves = static_cast<std::uint16_t>(count + 4),
                                                 .tasks = static_cast<std::uint16_t>(s.tasks),
                                                 .frames = static_cast<std::uint16_t>(s.frames),
                                                 .groups = static_cast<std::uint16_t>(s.groups),
                                                 .process_frames = static_cast<std::uint16_t>(s.process_frames)});
    nic_->unmarked = s.unmarked != 0;
    read_what_is_not_there();
    if (const auto ready = init(*ctx_, *nic_, osal_); !ready) fail("init", "refused");
    arena_level_ = master_of(*ctx_)->network.arena().used_bytes();
    shared_memory_.assign(s.groups, std::vector<std::byte>(SharedImage::memory_bytes(kImageBytes, 0)));
    for (auto& memory : shared_memory_) shared_.push_back(std::make_unique<SharedImage>(memory));
    if (s.callback == 0) return;
    ctx_->events().callback = [](const Event& event, void* user) {
        World& world = *static_cast<World*>(user);
        if (event.kind == EventKind::unsupervised) return;  // the end of a supervision must not end the next one
        ++world.events_called_;
        if (world.plan_.settings.callback >= 2) world.meddle(world.events_called_);
    };
    ctx_->events().user = this;
}

// The library calls this in a callback or a hook.
void World::meddle(std::uint32_t number) {
    if (!meddling_) return;
    slots_[number * 7 % kSlots].cancel();
    // A bring-up has more than five events. Without a limit it would start again for ever.
    if (plan_.settings.callback == 3 && number % 5 == 2 && number < 500) supervision_.cancel();
}

// ------------------------------------------------------------------ time

void World::start_steps() {
    Time at = osal_.now();
    for (const auto& step : plan_.steps) {
        at += std::chrono::microseconds(step.after_us);
        (info(step.op).actor == Actor::owner ? owner_steps_ : world_steps_).push_back({at, step});
    }
}

void World::pass(Time until) {
    while (!in_step_ && !world_steps_.empty() && world_steps_.front().at <= until) {
        const Due due = world_steps_.front();
        world_steps_.pop_front();
        osal_.set(due.at);
        in_step_ = true;
        do_step(due.step);
        note_presence(true);
        in_step_ = false;
        if (osal_.woken) break;
    }
    if (std::exchange(osal_.woken, false)) return;
    if (until != kNever) osal_.set(until);
}

// Called while the owner waits in a call of the library.
void World::wait_in_call(Time until) {
    const Time before = osal_.now();
    if (until == kNever && world_steps_.empty())
        fail("a call waits for nothing", std::string(call_ == nullptr ? "the cycle" : call_));
    if (until == kNever) until = world_steps_.front().at;
    pass(until);
    note_presence(false);
    calls_waits_ = osal_.now() > before ? 0 : calls_waits_ + 1;
    if (calls_waits_ > kMostPollsAtOnce) fail("a call loops without progress", call_ == nullptr ? "the cycle" : call_);
    if (call_ != nullptr && osal_.now() - call_since_ > kLongestCall) fail("a call never returns", call_);
}

void World::poll_once() {
    const Time now = osal_.now();
    polls_at_once_ = now == last_poll_ ? polls_at_once_ + 1 : 0;
    if (polls_at_once_ > kMostPollsAtOnce) fail("poll() makes no progress", "its deadline never lies in the future");
    if (now - polls_since_ > 1ms) polls_since_ = now, polls_ = 0;
    if (++polls_ > kMostPollsAMillisecond) fail("poll() asks for too many polls", "5000 in a millisecond");
    last_poll_ = now;
    const auto frames = nic_->sent().frames;
    deadline_ = poll(*ctx_, now);
    check_poll(frames);
    if (late_ > Duration{0} && deadline_ != kNever)
        deadline_ += Duration(static_cast<std::int64_t>(chance_.below(static_cast<std::uint64_t>(late_.count()))));
}

bool World::run_until(Time end, const std::function<bool()>& holds) {
    while (osal_.now() < end) {
        const Time now = osal_.now();
        segment_.advance(now);
        while (!owner_steps_.empty() && owner_steps_.front().at <= now) {
            const Step step = owner_steps_.front().step;
            owner_steps_.pop_front();
            do_step(step);
        }
        if (cycling_ && osal_.now() >= next_cycle_) do_cycle();
        poll_once();
        if (supervising_ && !supervision_.busy()) (void)submit(*ctx_, supervision_);
        note_presence(false);
        drain_told();
        check_states();
        check_ends();
        check_eeproms();
        check_outputs();
        if (holds()) return true;
        Time next = std::min(deadline_, end);
        if (cycling_) next = std::min(next, next_cycle_);
        if (!owner_steps_.empty()) next = std::min(next, owner_steps_.front().at);
        pass(next);
    }
    return holds();
}

void World::keep(std::string_view told) {
    constexpr std::size_t kMostKept = 24;
    if (story_.size() == kMostKept) story_.pop_front();
    story_.push_back(std::to_string(simulated_seconds()) + "  " + std::string(told));
}

std::string World::story() const {
    std::string text;
    for (const auto& line : story_) text += "\n    " + line;
    return text;
}

void World::drain_told() {
    most_slaves_ = std::max(most_slaves_, ctx_->slaves().size());
    std::array<char, 300> text{};
    drain_emergencies();
    while (const auto error = ctx_->errors().take()) {
        if (is_warning(error->code)) fail("a warning takes room of errors", std::string(describe(*error, text)));
        if (error->slave > most_slaves_) fail("an error names no slave", std::string(describe(*error, text)));
        if (describe(*error, text).empty()) fail("an error without words", "");
        keep(describe(*error, text));
    }
    while (const auto event = ctx_->events().take()) {
        if (event->slave > most_slaves_ || event->other > most_slaves_)
            fail("an event names no slave", std::string(describe(*event, text)));
        if (describe(*event, text).empty()) fail("an event without words", "");
        if (event->kind == EventKind::lost) check_lost(event->slave, event->at, "an event says so");
        keep(describe(*event, text));
    }
}

// ------------------------------------------------------------------ the cycle

void World::do_cycle() {
    const Duration period = std::chrono::microseconds(plan_.settings.cycle_us);
    next_cycle_ = std::max(next_cycle_ + period, osal_.now());
    ++counter_;
    look_around();
    show_inputs();
    for (std::uint8_t g = 0; g < images_.size(); ++g) cycle_group(g);
}

void World::cycle_group(std::uint8_t group) {
    if (!ctx_->group(group).mapped) {
        on_their_way_[group].clear();
        return;
    }
    // With overlapped cycles, no thread may send while the group is mapped again.
    if (plan_.settings.in_flight > 1)
        for (const auto& slot : slots_)
            if (slot.operation && slot.operation->request().busy() &&
                (kinds()[slot.operation->kind()].name == "map" || kinds()[slot.operation->kind()].name == "scan"))
                return;
    // A request may have mapped the group since then. Its cycles are counted from the beginning of the new mapping.
    if (std::exchange(mappings_[group], ctx_->group(group).mappings) != ctx_->group(group).mappings)
        on_their_way_[group].clear();
    look_around();
    set_outputs(group);
    const auto mailboxes = look_at_mailboxes(group);
    const ChaosNic::Sent before = nic_->sent();
    const auto sent = send_processdata(*ctx_, group);
    check_budget(group, before);
    note_interval(group);
    note_outputs(group);
    check_copies(group);
    if (sent || sent.error().code != Errc::busy)
        on_their_way_[group].push_back({osal_.now(), reachable_, station_, sent.error().code, mailboxes, mapping()});
    if (on_their_way_[group].size() >= std::max<std::size_t>(ctx_->group(group).config.cycles_in_flight, 1))
        receive_group(group);
}

bool World::mapping() const {
    return std::ranges::any_of(slots_, [](const Slot& slot) {
        return slot.operation && slot.operation->request().busy() && kinds()[slot.operation->kind()].name == "map";
    });
}

void World::receive_group(std::uint8_t group) {
    const Cycle cycle = std::move(on_their_way_[group].front());
    on_their_way_[group].pop_front();
    const Duration patience = std::max<Duration>(std::chrono::microseconds(plan_.settings.cycle_us) / 2,
                                                 std::chrono::microseconds(plan_.settings.round_trip_us) + 200us);
    const auto wkc = receive_processdata(*ctx_, patience, group);
    if (osal_.now() > cycle.sent + patience + 20ms && plan_.settings.in_flight == 1)
        fail("receive_processdata() waits too long", "");
    check_inputs(group, wkc.ok(), cycle);
    check_shared(group);
    check_mailboxes(group, cycle);
}

// ------------------------------------------------------------------ the complete run

void World::run() {
    if (plan_.settings.calm != 0) bring_up();
    start_steps();
    come_back();
    if (plan_.settings.calm == 0) {
        next_cycle_ = osal_.now();
        cycling_ = true;
    }
    while (!world_steps_.empty() || !owner_steps_.empty()) {
        Time end = osal_.now();
        if (!world_steps_.empty()) end = std::max(end, world_steps_.back().at);
        if (!owner_steps_.empty()) end = std::max(end, owner_steps_.back().at);
        (void)run_until(end + 1us, [] { return false; });
    }
    run_for(20ms);
    heal();
    if (plan_.settings.calm != 0) expect_back();
    finish_requests();
    check_arena();
    fresh_start();
    if (plan_.settings.close_busy != 0) close_busy();
}

}  // namespace margay::storm
