#include "margayd/companion.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"

#include <margay/margay.hpp>

#include <fmt/format.h>

#include <pthread.h>

#include <utility>

namespace margay::service {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kLook = 50ms;         // without frames
constexpr auto kFramesSoon = 200us;  // while frames are exchanged
constexpr auto kFramesLater = 2ms;   // otherwise: a frame of a slave waits this long at most
constexpr auto kMinute = 60s;
constexpr unsigned kEventsAtMost = 10;  // of the same text in a minute
constexpr auto kOverrunsAgain = 60s;    // and overruns

std::string left_out_text(std::uint64_t cycles) {
    return fmt::format("{} left out, because a cycle came too late or lasted too long",
                       samples::counted(cycles, "cycle was", "cycles were"));
}

Priority priority_of(EventKind kind) {
    switch (kind) {
        case EventKind::state: return Priority::info;
        case EventKind::found:
        case EventKind::recovered:
        case EventKind::right_again:
        case EventKind::slave_count:
        case EventKind::clock_in_sync:
        case EventKind::master_in_sync:
        case EventKind::reference_clock:
        case EventKind::ring_closed:
        case EventKind::unsupervised: return Priority::notice;
        default: return Priority::warning;
    }
}

std::string_view state_name(AlState state) {
    switch (state) {
        case AlState::init: return "INIT";
        case AlState::preop: return "PREOP";
        case AlState::safeop: return "SAFEOP";
        default: return "OP";
    }
}

std::string slaves_text(const Standing& s) {
    const unsigned there = s.slaves - s.elsewhere;
    auto text = fmt::format("{} in {}", samples::counted(there, "slave"), state_name(s.target));
    // This is not an error, because a client of the socket has set their targets.
    if (s.elsewhere != 0) text += fmt::format(", {} in another state that was asked for", s.elsewhere);
    return text;
}

}  // namespace

Companion::Companion(Context& ctx, std::string name, const std::atomic<unsigned>& level)
    : ctx_(ctx), name_(std::move(name)), level_(level), thread_([this] { run(); }) {}

Companion::~Companion() { end(); }

void Companion::end() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
}

void Companion::tell(const Standing& standing) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return;  // at the next call
    told_ = standing;
    is_told_ = true;
}

bool Companion::open_line(Context& ctx, const Slave& slave, const std::string& name) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock || lines_ == nullptr) return false;
    const auto opened = lines_->open(ctx, slave, name);
    notes_.push_back(opened ? Note{Priority::notice, fmt::format("interface {}: slave {} ({})", name, slave.number,
                                                                 samples::words_of_slave(slave.name()))}
                            : Note{Priority::error, opened.problem});
    return true;
}

void Companion::take_lines(std::unique_ptr<samples::EoeLines> lines) {
    const std::lock_guard lock(mutex_);
    lines_ = std::move(lines);
}

std::unique_ptr<samples::EoeLines> Companion::give_lines() {
    const std::lock_guard lock(mutex_);
    return std::move(lines_);
}

void Companion::wait_for(const std::string& reason) {
    {
        const std::lock_guard lock(mutex_);
        is_told_ = false;
        if (reason == waiting_) return;
        waiting_ = reason;
        if (!reason.empty()) status_ = "waits: " + reason;
    }
    if (!reason.empty()) log(Priority::notice, "waiting: " + reason);
}

std::string Companion::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

void Companion::run() {
    log_about(name_);
    (void)::pthread_setname_np(::pthread_self(), "margayd-log");
    std::vector<pollfd> files;
    for (auto look_at = Clock::now(); !stopping_;) {
        files.clear();
        const bool moved = pass_frames(files);
        const bool lines = !files.empty();
        if (Clock::now() >= look_at) {
            look(false);
            look_at = Clock::now() + kLook;
        }
        const auto pause = !lines ? std::chrono::nanoseconds(kLook) : moved ? kFramesSoon : kFramesLater;
        const timespec timeout{0, static_cast<long>(pause.count())};
        (void)::ppoll(files.data(), files.size(), &timeout, nullptr);
    }
    look(true);
}

bool Companion::pass_frames(std::vector<pollfd>& files) {
    std::vector<samples::EoeLines::Ended> ended;
    bool moved = false;
    {
        const std::lock_guard lock(mutex_);
        if (lines_ == nullptr) return false;
        moved = lines_->pass();
        ended = lines_->end_deleted();
        lines_->add_files(files);
        // A line whose slave accepts no frame now may still receive frames from it.
        if (files.empty() && !lines_->empty()) files.push_back({-1, 0, 0});
    }
    for (const auto& [what, counters] : ended) {
        log(Priority::warning, what);
        log(Priority::info, counters);
    }
    return moved;
}

void Companion::look(bool last) {
    report_events();
    report_errors();
    forget_repeated();
    Standing now;
    std::vector<Note> notes;
    {
        const std::lock_guard lock(mutex_);
        notes.swap(notes_);
    }
    for (const Note& note : notes) log(note.priority, note.text);
    {
        const std::lock_guard lock(mutex_);
        if (!is_told_ || last) return;
        now = told_;
    }
    report_standing(now);
}

void Companion::report_events() {
    while (const auto event = ctx_.events().take()) {
        // The master ends its supervision itself, before a scan and at the end.
        if (event->kind == EventKind::unsupervised && event->error.code == Errc::canceled) continue;
        say(priority_of(event->kind), samples::sentence(*event), kEventsAtMost);
        if (event->kind == EventKind::stranger || event->kind == EventKind::other_slave) strangers_ = Clock::now();
    }
}

// An error is repeated when a start-up is repeated.
void Companion::report_errors() {
    while (const auto error = ctx_.errors().take()) say(Priority::warning, samples::sentence(*error), 1);
    while (const auto odd = ctx_.warnings().take()) say(Priority::notice, samples::sentence(*odd), 1);
}

void Companion::say(Priority priority, const std::string& text, unsigned most) {
    const unsigned level = level_;
    if (level == debug_level::kNone) return;
    if (level >= debug_level::kAll) return log(priority, text);
    Said& said = said_.try_emplace(text, Said{.since = Clock::now(), .priority = priority}).first->second;
    if (++said.times > most)
        ++said.silent;
    else
        log(priority, text);
}

void Companion::forget_repeated() {
    const auto now = Clock::now();
    std::erase_if(said_, [&](const auto& one) {
        const Said& said = one.second;
        if (now - said.since < kMinute) return false;
        if (said.silent != 0) log(said.priority, fmt::format("{} ({} more times in a minute)", one.first, said.silent));
        return true;
    });
}

// Called once for each Standing that the owner has passed on.
void Companion::report_frames(const Standing& now) {
    const auto before = std::exchange(frames_, now.link);
    if (level_ < debug_level::kAll || now.link.frames_sent == before.frames_sent) return;
    log(Priority::debug, fmt::format("frames: {} sent, {} received, {} lost, {}; since the start: {} sent, {} lost",
                                     now.link.frames_sent - before.frames_sent,
                                     now.link.frames_received - before.frames_received, now.link.lost - before.lost,
                                     samples::counted(now.link.datagrams_sent - before.datagrams_sent, "datagram"),
                                     now.link.frames_sent, now.link.lost));
}

void Companion::report_standing(const Standing& now) {
    report_frames(now);
    const bool right = now.wrong.code == Errc::none;
    if (!right && now.settles) return;
    const auto text = right ? slaves_text(now) : samples::sentence(now.wrong);
    const bool silent = level_ == debug_level::kNone;
    if (right && (!was_right_ || text != right_) && !silent)
        log(Priority::notice, "all is right: " + text);  // or after a scan
    if (right) right_ = text;
    const bool differs = was_right_ || last_wrong_.code != now.wrong.code || last_wrong_.slave != now.wrong.slave;
    if (!right && differs && !silent) log(Priority::notice, "not all is right: " + text);
    was_right_ = right;
    last_wrong_ = now.wrong;
    const auto at = Clock::now();
    if (now.overruns < overruns_) overruns_ = 0;  // a new cycle after a scan
    if (!silent && now.overruns > overruns_ && at - overruns_reported_ > kOverrunsAgain) {
        log(Priority::warning, left_out_text(now.overruns - overruns_));
        overruns_ = now.overruns;
        overruns_reported_ = at;
    }
    const std::lock_guard lock(mutex_);
    status_ = text;
    waiting_.clear();
}

}  // namespace margay::service
