#include "subdevice_check/bench.hpp"

#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "wire/al_status_code.hpp"
#include "wire/datagram.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLook = 1ms;
constexpr Duration kClockStarts = 70ms;  // SYNC0 begins within this time after its activation
constexpr Duration kSettled = 20ms;      // a status that does not change within this time stays

bool exchanges_process_data(AlState state) { return state == AlState::safeop || state == AlState::op; }

}  // namespace

std::string state_text(AlState state) { return std::string(margay::to_text(state)); }

std::string status_text(const AlStatus& status) {
    std::string text = state_text(status.state);
    if (status.error) text += " + ERROR";
    if (status.error || status.code != 0)
        text += fmt::format(", AL status code 0x{:04x} ({})", status.code, wire::al_status_text(status.code));
    return text;
}

bool refuses_cycle(const AlStatus& status) {
    const auto code = static_cast<wire::AlStatusCode>(status.code);
    return status.error && (code == wire::AlStatusCode::invalid_dc_sync_cycle_time ||
                            code == wire::AlStatusCode::invalid_dc_sync0_cycle_time);
}

Bench::Bench(Context& ctx, Osal& osal, WaitHandles nics, std::uint16_t number)
    : ctx_(ctx), osal_(osal), nics_(nics), number_(number), cycle_(ctx, number) {
    // A lost frame is an error of the line here, because a repeated access could have an effect twice.
    ctx_.link_settings().sendings = 1;
    find_areas();
}

const Slave& Bench::slave() const { return ctx_.slave(number_); }

bool Bench::has(std::uint16_t protocol) const {
    return slave().mailbox.present() && (slave().mailbox.protocols & protocol) != 0;
}

void Bench::begin(CheckResult& result, std::string_view clause) {
    result_ = &result;
    clause_ = clause;
}

void Bench::add(Severity severity, std::string text, std::string_view clause) {
    if (severity == Severity::error) result_->outcome = Outcome::failed;
    result_->findings.push_back({severity, std::move(text), std::string(clause.empty() ? clause_ : clause)});
}

// ------------------------------------------------------------------ registers

void Bench::check_line(const Error& error) const {
    if (stop_asked()) throw NotJudged{"the program was stopped"};
    if (error.code != Errc::working_counter) throw LineFault{sentence(error)};
}

// Waits for the end of a request. False: working counter 0.
bool Bench::finish(Request& request, const Result<>& submitted) {
    if (!submitted) check_line(submitted.error());
    while (request.busy()) progress(kNever, &request);
    if (request.state() == RequestState::error) check_line(request.error());
    return request.state() == RequestState::success;
}

bool Bench::try_read(std::uint16_t address, MutableBytes into) {
    RegisterReadRequest request;
    request.slave = number_;
    request.address = address;
    request.data = into;
    return finish(request, submit(ctx_, request));
}

bool Bench::try_write(std::uint16_t address, Bytes data) {
    RegisterWriteRequest request;
    request.slave = number_;
    request.address = address;
    request.data = data;
    return finish(request, submit(ctx_, request));
}

void Bench::read_octets(std::uint16_t address, MutableBytes into) {
    if (!try_read(address, into)) skip(fmt::format("the slave does not answer at register 0x{:04x}", address));
}

void Bench::write_octets(std::uint16_t address, Bytes data) {
    if (!try_write(address, data)) skip(fmt::format("the slave does not accept register 0x{:04x}", address));
}

void Bench::stuck(const std::string& why) {
    if (!told_stuck_) fail(why);
    told_stuck_ = true;
    skip(why);
}

void Bench::request(unsigned al_control) {
    std::array<std::byte, 2> octets{};
    store_le<std::uint16_t>(octets, 0, static_cast<std::uint16_t>(al_control));
    // AL control can be written again after the slave has read it.
    const Time until = now() + 1s;
    bool accepted = try_write(reg::kAlControl.address, octets);
    while (!accepted && now() < until) {
        wait(kLook);
        accepted = try_write(reg::kAlControl.address, octets);
    }
    if (!accepted) stuck("the slave does not accept AL control 0x0120: it has not read the last request");
}

void Bench::write_sync_manager(unsigned n, const wire::SyncManager& setting) {
    std::array<std::byte, reg::kSyncManagerStride> octets{};
    wire::store_sync_manager(octets, setting);
    // Start and length can be changed only while the SyncManager is off.
    write<std::uint8_t>(static_cast<std::uint16_t>(reg::sync_manager(n).address + 6), 0);
    write_octets(reg::sync_manager(n).address, octets);
}

wire::SyncManager Bench::read_sync_manager(unsigned n) {
    std::array<std::byte, reg::kSyncManagerStride> octets{};
    read_octets(reg::sync_manager(n).address, octets);
    return wire::load_sync_manager(octets);
}

std::uint8_t Bench::sync_manager_status(unsigned n) {
    return read<std::uint8_t>(
        static_cast<std::uint16_t>(reg::sync_manager(n).address + wire::SyncManagerLayout::status::offset));
}

void Bench::wait(Duration time) {
    const Time until = osal_.now() + time;
    while (osal_.now() < until) progress(until);
}

// Sends the frames that are due, and waits for the next event, at most until this time.
void Bench::progress(Time until, const Request* awaited) {
    if (stop_asked()) throw NotJudged{"the program was stopped"};
    const Time frame = cycle_.step(osal_.now());
    if (const auto fault = cycle_.line_fault()) throw LineFault{sentence(*fault)};
    const Time next = poll(ctx_, osal_.now());
    // If poll() has just ended the last request, no event would end the wait.
    if (awaited != nullptr && !awaited->busy()) return;
    osal_.wait(std::min({next, until, frame}), nics_);
}

// ------------------------------------------------------------------ states

AlStatus Bench::al_status() {
    std::array<std::byte, 6> octets{};
    read_octets(reg::kAlStatus.address, octets);
    const auto word = load_le<std::uint16_t>(octets, 0);
    return {static_cast<AlState>(word & wire::al::kStateMask), (word & wire::al::kErrorIndication) != 0,
            load_le<std::uint16_t>(octets, 4)};
}

Duration Bench::patience(AlState to) {
    switch (to) {
        case AlState::preop:
        case AlState::boot: return 3s;
        case AlState::safeop:
        case AlState::op: return 10s;
        default: return 5s;
    }
}

AlStatus Bench::go(AlState state, bool with_process_data) {
    const bool cyclic = with_process_data && exchanges_process_data(state);
    std::optional<CycleRun> frames;
    if (cyclic) frames.emplace(cycle_, areas_, now(), period_);
    if (cyclic && state == AlState::op && uses_clock()) wait(kClockStarts);
    request(static_cast<unsigned>(state));
    const Time until = now() + patience(state);
    for (;;) {
        if (cyclic) wait(period_);
        const auto status = al_status();
        if (status.state == state || status.error || now() >= until) return status;
        if (!cyclic) wait(kLook);
    }
}

AlStatus Bench::refused() {
    auto status = al_status();
    if (status.error) return status;
    const auto state = status.state;
    Time until = now() + patience(AlState::preop);
    bool left = false;
    const auto look = [&] {
        status = al_status();
        if (!left && status.state != state) until = now() + kSettled;
        left = left || status.state != state;
        return status.error || now() >= until;
    };
    // In OP with process data in each period, so that neither watchdog nor missed frames end OP.
    if (state == AlState::op) {
        (void)run(until - now(), look);
    } else {
        while (!look()) wait(kLook);
    }
    return status;
}

AlStatus Bench::unchanged() {
    auto status = al_status();
    Time settled = now() + kSettled;
    const Time until = now() + 500ms;
    const auto look = [&] {
        const auto next = al_status();
        if (next != status) settled = now() + kSettled;
        status = next;
        return status.error || now() >= settled || now() >= until;
    };
    if (status.state == AlState::op && !status.error) (void)run(until - now(), look);
    while (now() < settled && now() < until && !status.error) {
        wait(kLook);
        (void)look();
    }
    return status;
}

void Bench::reset() {
    const auto frames = frames_in(al_status().state);  // the watchdog must not end OP before the slave does
    request(static_cast<unsigned>(AlState::init) | (emulation() ? 0U : wire::al::kErrorAcknowledge));
    const Time until = now() + patience(AlState::init);
    auto status = al_status();
    while ((status.state != AlState::init || status.error) && now() < until) {
        wait(kLook);
        status = al_status();
    }
    if (status.state != AlState::init || status.error)
        stuck(fmt::format("the slave does not go to INIT: it is in {}", status_text(status)));
    const wire::SyncManager off{};
    const unsigned managers = std::min<unsigned>(slave().dl.sync_managers, 8);
    for (unsigned n = 0; n < managers; ++n) write_sync_manager(n, off);
    std::array<std::byte, 1> octet{};
    (void)try_write(reg::kSyncActivation.address, octet);
    write<std::uint16_t>(reg::kWatchdogDivider.address, 0x09C2);
    write<std::uint16_t>(reg::kProcessDataWatchdogTime.address, 1000);
    give_eeprom(false);
}

void Bench::enter(AlState state) {
    while (!try_to_enter(state)) {
    }
}

// False: the slave needs the clock, which is active at the next try.
bool Bench::try_to_enter(AlState state) {
    reset();
    if (state == AlState::init) return true;
    const auto step = [this](AlState to) {
        const auto status = go(to);
        if (status.state == to && !status.error) return true;
        if (wants_clock(status)) return false;
        if (no_cycle_suits(status)) skip_without_cycle(status);
        stuck(fmt::format("the slave does not go to {}: it is in {}", state_text(to), status_text(status)));
    };
    configure_mailboxes(state == AlState::boot);
    give_eeprom(true);
    if (!step(state == AlState::boot ? AlState::boot : AlState::preop)) return false;
    if (mailbox_started_) mailbox_started_();
    if (state == AlState::preop || state == AlState::boot) return true;
    configure_process_data();
    return step(AlState::safeop) && (state != AlState::op || step(AlState::op));
}

bool Bench::wants_clock(const AlStatus& status) {
    if (!activate_clock_ || !status.error) return false;
    const auto code = static_cast<wire::AlStatusCode>(status.code);
    const bool cycle = refuses_cycle(status);
    const bool off =
        code == wire::AlStatusCode::invalid_dc_sync_configuration || code == wire::AlStatusCode::no_sync_error;
    if (uses_clock() ? !cycle || clock_attempts_ == most_attempts_ : !cycle && !off) return false;
    ++clock_attempts_;
    return true;
}

bool Bench::no_cycle_suits(const AlStatus& status) const {
    return uses_clock() && most_attempts_ > 1 && clock_attempts_ == most_attempts_ && refuses_cycle(status);
}

void Bench::skip_without_cycle(const AlStatus& status) {
    skip(fmt::format("not judged: the slave refuses each cycle of SYNC0 that was tried ({})", status_text(status)));
}

void Bench::configure_mailboxes(bool boot) {
    const auto& s = slave();
    const auto& box = boot ? s.boot_mailbox : s.mailbox;
    if (!box.present()) return;
    const auto control = [&](unsigned n, SmType type, std::uint8_t otherwise) {
        return n < s.sm_count && s.sync_managers[n].type == type ? s.sync_managers[n].control : otherwise;
    };
    write_sync_manager(0, {box.out_start, box.out_bytes, control(0, SmType::mailbox_out, 0x26), 1});
    write_sync_manager(1, {box.in_start, box.in_bytes, control(1, SmType::mailbox_in, 0x22), 1});
}

void Bench::configure_process_data() {
    if (find_lengths_) find_lengths_();
    for (const auto& area : areas_) write_sync_manager(area.sync_manager, area.setting);
    if (uses_clock()) period_ = activate_clock_(clock_attempts_ - 1);
}

void Bench::give_eeprom(bool to_pdi) {
    if (!to_pdi) write<std::uint8_t>(reg::kSiiConfig.address, wire::sii_config::kForceEcat);
    write<std::uint8_t>(reg::kSiiConfig.address, to_pdi ? wire::sii_config::kOfferedToPdi : std::uint8_t{0});
}

// ------------------------------------------------------------------ process data

void Bench::find_areas() {
    const auto& s = slave();
    for (std::uint8_t n = 0; n < s.sm_count; ++n) {
        const auto& info = s.sync_managers[n];
        if (info.type != SmType::outputs && info.type != SmType::inputs) continue;
        const bool on = info.length_bytes != 0;
        areas_.push_back({n,
                          info.type == SmType::outputs,
                          {info.start, info.length_bytes, info.control, on ? std::uint8_t{1} : std::uint8_t{0}}});
    }
}

const ProcessArea* Bench::area(bool outputs) const {
    for (const auto& area : areas_)
        if (area.outputs == outputs && area.setting.length_bytes != 0) return &area;
    return nullptr;
}

void Bench::set_area_length(std::uint8_t sync_manager, std::uint16_t bytes) {
    for (auto& area : areas_) {
        if (area.sync_manager != sync_manager) continue;
        area.setting.length_bytes = bytes;
        area.setting.activate = bytes != 0 ? 1 : 0;
    }
}

std::optional<CycleRun> Bench::frames_in(AlState state) {
    std::optional<CycleRun> frames;
    if (state == AlState::op) frames.emplace(cycle_, areas_, now(), period_);
    return frames;
}

bool Bench::run(Duration time, const std::function<bool()>& done, Duration period) {
    const CycleRun frames(cycle_, areas_, now(), period);
    const Time until = now() + time;
    while (now() < until) {
        wait(period);
        if (done && done()) return true;
    }
    return false;
}

}  // namespace margay::samples::conformance
