#include "ethercat/standalone.hpp"

#include "common/program.hpp"
#include "common/segment_look.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "ethercat/session_eeprom.hpp"
#include "wire/esc.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::ethercat {

namespace reg = wire::reg;

Problem problem_of(Context& ctx, const Error& error) {
    if (error.slave == 0) return {samples::sentence(error)};
    const auto position = ctx.slave(error.slave).ring_position;
    // The list of expected slaves is counted from 0, as the positions are.
    const auto words = samples::sentence_without_slave(error);
    return {.text = position == 0 ? fmt::format("configured slave {}: {}", error.slave - 1, words)
                                  : fmt::format("position {}: {}", position - 1, words),
            .aborted = error.code == Errc::sdo_abort};
}

StandaloneSession::~StandaloneSession() { (void)close(); }

// ------------------------------------------------------------------ opening and scanning

Answer<> StandaloneSession::open() {
    if (ctx_ != nullptr) return {};
    if (failure_) return *failure_;
    auto done = open_source();
    if (!done) failure_ = done.problem();
    return done;
}

Answer<> StandaloneSession::open_source() {
    if (closed_) return Problem{"the segment is closed", samples::exit_code::kSystem};
    if (!settings_.eni.empty()) eni_ = samples::load_eni(settings_.eni);
    if (!eni_.error.empty()) return Problem{eni_.error, samples::exit_code::kSystem};
    auto opened = samples::open_source(settings_.source, settings_.options);
    if (!opened) return Problem{opened.error(), samples::exit_code::kSystem};
    source_ = opened.take();
    // In virtual time there is no other master.
    const bool look = !source_->virtual_time() && !settings_.take_over;
    const auto refusal = look ? samples::scan_refusal(*source_) : std::string();
    refused_ = !refusal.empty();
    if (refused_) return Problem{refusal};
    if (settings_.note_states)
        found_states_ = samples::look_at_states(source_->nic(), source_->osal(), source_->second());
    auto ctx = std::make_unique<HostContext>(
        source_->limits(samples::with_room({.slaves = 2048, .process_frames = 256}, eni())));
    const auto ready = source_->begin(*ctx);
    if (!ready) return problem_of(*ctx, ready.error());
    ctx_ = std::move(ctx);
    const auto found = scan();
    if (found) return {};
    ctx_.reset();  // its errors repeat this problem
    return found.problem();
}

Answer<std::uint16_t> StandaloneSession::scan() {
    mapped_ = clocks_measured_ = false;
    sii_.clear();
    const auto found = samples::scan_by(*ctx_, eni());
    if (!found && found.error().slave == 0) return problem_of(*ctx_, found.error());
    bool told = found.ok();
    while (const auto error = ctx_->errors().take()) {
        told |= *error == found.error();
        note(problem_of(*ctx_, *error).text);
    }
    if (!told) note(problem_of(*ctx_, found.error()).text);
    return static_cast<std::uint16_t>(
        std::ranges::count_if(ctx_->slaves(), [](const Slave& slave) { return slave.ring_position != 0; }));
}

Answer<std::uint16_t> StandaloneSession::number_of(std::uint16_t position) {
    const auto ready = open();
    if (!ready) return ready.problem();
    for (const Slave& slave : ctx_->slaves())
        if (slave.ring_position == position + 1U) return slave.number;
    return Problem{fmt::format("there is no slave at position {}", position)};
}

std::uint16_t StandaloneSession::position_of(std::uint16_t number) {
    return static_cast<std::uint16_t>(ctx_->slave(number).ring_position - 1U);
}

Answer<RescanFacts> StandaloneSession::rescan() {
    const bool first = ctx_ == nullptr;
    const auto ready = open();
    if (!ready) return ready.problem();
    if (first) return RescanFacts{.slaves = static_cast<std::uint16_t>(slaves()->size())};
    const auto found = scan();
    if (!found) return found.problem();
    return RescanFacts{.slaves = *found};
}

Answer<> StandaloneSession::set_debug_level(unsigned level) {
    if (ctx_ != nullptr) return Problem{"the level of messages must be set before the segment is opened"};
    silent_ = level == 0;
    settings_.options.trace |= level >= 2;
    return {};
}

// ------------------------------------------------------------------ facts

Answer<MasterFacts> StandaloneSession::master() {
    const auto all = slaves();
    if (!all) return all.problem();
    const auto& statistics = ctx_->statistics();
    MasterFacts facts{.source = settings_.source,
                      .slaves = static_cast<std::uint16_t>(all->size()),
                      .frames_sent = statistics.frames_sent,
                      .frames_received = statistics.frames_received,
                      .bytes_on_wire = statistics.bytes_on_wire,
                      .frames_lost = statistics.lost};
    const auto add = [&](Nic& nic, std::string name) {
        facts.devices.push_back(
            {.name = std::move(name), .mac = nic.source_mac(), .link = nic.link_state() != LinkState::down});
    };
    const auto plus = settings_.source.starts_with("sim:") ? std::string::npos : settings_.source.find('+');
    add(source_->nic(), settings_.source.substr(0, plus));
    if (source_->second() != nullptr)
        add(*source_->second(), plus == std::string::npos ? settings_.source : settings_.source.substr(plus + 1));
    return facts;
}

Answer<std::vector<SlaveFacts>> StandaloneSession::slaves() {
    const auto ready = open();
    if (!ready) return ready.problem();
    std::vector<SlaveFacts> all;
    for (const Slave& s : ctx_->slaves()) {
        if (s.ring_position == 0) continue;
        SlaveFacts facts{.position = position_of(s.number),
                         .alias = s.alias,
                         .station_address = s.station_address.value,
                         .name = samples::words_of_slave(s.name()),
                         .identity = s.identity,
                         .al = s.al,
                         .problem = s.error.code == Errc::none ? std::string() : problem_of(*ctx_, s.error).text,
                         .dl = s.dl,
                         .ports = s.ports,
                         .parent_port = s.parent_port,
                         .entry_port = s.entry_port,
                         .mailbox = s.mailbox,
                         .boot_mailbox = s.boot_mailbox,
                         .coe_details = s.coe_details,
                         .ebus_current_ma = s.ebus_current_ma};
        if (s.parent != 0) facts.parent = position_of(s.parent);
        for (unsigned port = 0; port < facts.ports.size(); ++port) {
            facts.signal[port] = (s.dl_status & wire::dl_status::communication(port)) != 0;
            auto& neighbour = facts.ports[port].neighbour;
            if (neighbour != 0) neighbour = ctx_->slave(neighbour).ring_position;
        }
        all.push_back(std::move(facts));
    }
    std::ranges::sort(all, {}, &SlaveFacts::position);
    return all;
}

Answer<const files::EsiDevice*> StandaloneSession::sii_of(std::uint16_t number) {
    if (const auto known = sii_.find(number); known != sii_.end()) return &known->second;
    SessionEeprom eeprom(*this, position_of(number));
    const auto content = samples::read_used_part(eeprom, samples::no_progress());
    if (!content.error.empty()) return eeprom.problem(content.error);
    auto described = files::describe_sii(content.octets);
    if (!described)
        return Problem{fmt::format("position {}: its SII: {}", position_of(number), to_text(described.problem))};
    return &sii_.emplace(number, std::move(*described)).first->second;
}

Answer<SlaveTexts> StandaloneSession::texts(std::uint16_t position) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto sii = sii_of(*number);
    if (!sii) return sii.problem();
    const auto& device = **sii;
    return SlaveTexts{.order = device.type,
                      .group = device.group,
                      .name = device.name,
                      .enable_safeop = device.safeop_configuration,
                      .no_lrw = device.no_lrw};
}

Answer<ClockFacts> StandaloneSession::clock(std::uint16_t position) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    if (!clocks_measured_) {
        clocks_measured_ = true;
        // Only the delays are needed, not synchronous clocks.
        ClockSettings settings;
        settings.burst_frames = 0;
        settings.settle = Duration{0};
        settings.limit_ns = INT32_MAX;
        settings.timeout = std::chrono::milliseconds(100);
        const auto done = configdc(*ctx_, settings);
        if (!done && done.error().code != Errc::no_clock && done.error().code != Errc::not_in_sync)
            note("the clocks: " + problem_of(*ctx_, done.error()).text);
    }
    const auto& known = slave_clock(*ctx_, *number);
    ClockFacts facts{.runs = known.kind == ClockKind::bits32 || known.kind == ClockKind::bits64,
                     .reference = reference_clock(*ctx_) == *number,
                     .measured = known.kind != ClockKind::none && known.kind != ClockKind::unknown,
                     .delay_ns = known.delay_ns};
    if (!facts.measured) return facts;
    std::array<std::byte, reg::kPortReceiveTime.length> octets{};
    const auto read = read_register(*ctx_, *number, reg::kPortReceiveTime.address, octets);
    if (!read) return problem_of(*ctx_, read.error());
    for (std::size_t port = 0; port < facts.receive_ns.size(); ++port)
        facts.receive_ns[port] = load_le<std::uint32_t>(octets, 4 * port);
    return facts;
}

// ------------------------------------------------------------------ states

Answer<> StandaloneSession::set_states(std::span<const std::uint16_t> positions, AlState state) {
    std::vector<std::uint16_t> numbers;
    for (const auto position : positions) {
        const auto number = number_of(position);
        if (!number) return number.problem();
        numbers.push_back(*number);
    }
    keep_states_ = true;
    if (state == AlState::safeop || state == AlState::op) return reach_with_process_data(numbers, state);
    std::string problems;
    for (const auto number : numbers) {
        StateRequest request;
        request.slave = number;
        request.wanted = state;
        const auto begun = submit(*ctx_, request);
        const auto done = begun ? wait(*ctx_, request) : begun;
        if (!done) problems += (problems.empty() ? "" : "; ") + problem_of(*ctx_, done.error()).text;
    }
    if (!problems.empty()) return Problem{problems};
    return {};
}

Answer<> StandaloneSession::reach_with_process_data(std::span<const std::uint16_t> numbers, AlState state) {
    // The other slaves keep their states.
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.ring_position == 0 || std::ranges::find(numbers, slave.number) != numbers.end()) continue;
        const auto held = set_target(*ctx_, slave.number, AlState::preop);
        if (!held) return problem_of(*ctx_, held.error());
    }
    const auto ready = map();
    if (!ready) return ready.problem();
    const samples::PaceOptions options{};
    const auto plan = options.plan(eni());
    if (!plan.error.empty()) return Problem{settings_.eni + ": " + plan.error};
    samples::CyclePace pace(*source_, *ctx_, options, plan);
    const auto reached = bring_to(state, pace);
    if (!reached) return problem_of(*ctx_, reached.error());
    return {};
}

// ------------------------------------------------------------------ the end

void StandaloneSession::wait_until(Time end) {
    Osal& osal = source_->osal();
    constexpr Duration kLook = std::chrono::milliseconds(100);  // for signals
    while (osal.now() < end && !samples::stop_asked()) {
        const Time next = poll(*ctx_, osal.now());
        osal.wait(std::min({next, end, osal.now() + kLook}), source_->wait_handles());
    }
}

void StandaloneSession::pause(std::chrono::milliseconds time) {
    const auto ready = open();
    if (!ready) return;
    const Time end = source_->osal().now() + time;
    constexpr Duration kCycle = std::chrono::milliseconds(1);
    while (mapped_ && source_->osal().now() < end && !samples::stop_asked()) {
        const Time next = std::min(end, source_->osal().now() + kCycle);
        exchange();
        if (!follows_clock()) wait_until(next);
    }
    wait_until(end);
}

std::vector<std::string> StandaloneSession::messages() {
    if (ctx_ != nullptr) {
        while (const auto error = ctx_->errors().take()) notes_.push_back(problem_of(*ctx_, *error).text);
        while (const auto warning = ctx_->warnings().take()) notes_.push_back(problem_of(*ctx_, *warning).text);
    }
    auto all = std::move(notes_);
    notes_.clear();
    if (silent_) all.clear();
    return all;
}

Answer<> StandaloneSession::close() {
    if (closed_) return {};
    closed_ = true;
    Answer<> result;
    if (ctx_ != nullptr && mapped_ && !keep_states_) {
        const auto back = writestate(*ctx_, 0, AlState::preop);
        if (!back) result = problem_of(*ctx_, back.error());
        (void)statecheck(*ctx_, 0, AlState::preop, std::chrono::seconds(3));
    }
    pace_.reset();
    ctx_.reset();
    if (source_ == nullptr) return result;
    if (const auto repeated = source_->repeated_answers(); !repeated.empty()) samples::warn(repeated);
    const auto remark = source_->finish();
    if (remark.empty()) return result;
    return Problem{remark, source_->recording_lost() ? samples::exit_code::kSystem : samples::exit_code::kSegment};
}

}  // namespace margay::ethercat
