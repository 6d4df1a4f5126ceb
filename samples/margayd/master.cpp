#include "margayd/master.hpp"

#include "common/counted.hpp"
#include "common/listen_address.hpp"
#include "common/slave_report.hpp"
#include "common/xml_files.hpp"
#include "margayd/log.hpp"

#include <fmt/format.h>

#include <pthread.h>
#include <sys/stat.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <system_error>
#include <utility>

namespace margay::service {
namespace {

using namespace std::chrono_literals;

constexpr Duration kTryAgain = 500ms;      // between two looks at a segment that cannot be scanned
constexpr Duration kEndPatience = 3s;      // for the slaves to reach the end state
constexpr std::size_t kMoreImage = 65536;  // octets for slaves that no ENI describes

Limits limits() { return {.slaves = 1024, .process_frames = 64, .events = 1024}; }

bool is_left_behind(const std::string& socket) {
    struct stat found {};
    return ::lstat(socket.c_str(), &found) == 0 && S_ISSOCK(found.st_mode);
}

}  // namespace

Master::Master(samples::MasterConfiguration configuration, std::string socket)
    : configuration_(std::move(configuration)), socket_(std::move(socket)), debug_level_(configuration_.debug) {}

Master::~Master() {
    stop();
    if (thread_.joinable()) thread_.join();
    if (ctx_ != nullptr) (void)take_ownership(*ctx_);  // the owner has ended
}

std::string Master::open() {
    std::promise<std::string> opened;
    auto result = opened.get_future();
    thread_ = std::thread([this, &opened] { run(opened); });
    return result.get();
}

void Master::begin() {
    begun_ = true;
    begun_.notify_all();
}

void Master::stop() {
    stopping_ = true;
    begin();
    if (source_ != nullptr) source_->osal().wake();
}

void Master::set_debug_level(unsigned level) {
    configuration_.debug = level;
    debug_level_ = level;
}

std::string Master::status() const { return companion_ == nullptr ? std::string() : companion_->status(); }

// ------------------------------------------------------------------ the thread

void Master::run(std::promise<std::string>& opened) {
    log_about(configuration_.name);
    (void)::pthread_setname_np(::pthread_self(), "margayd-cycle");
    std::string problem;
    try {
        problem = open_here();
    } catch (const std::exception& exception) {
        problem = exception.what();
    }
    const bool open = problem.empty();
    opened.set_value(std::move(problem));  // `opened` may not exist after this call
    try {
        if (open) begun_.wait(false);
        if (open && !stopping_) work();
    } catch (const std::exception& exception) {
        log(Priority::error, fmt::format("ends: {}", exception.what()));
        failed_ = true;
    }
    note_left_slaves();
    attach_.reset();
    if (companion_ != nullptr) companion_->end();
}

std::string Master::open_here() {
    if (!configuration_.eni_text.empty()) {
        auto read = files::read_eni(configuration_.eni_text);
        if (!read) return fmt::format("{}: {}", configuration_.eni.string(), files::to_text(read.problem));
        eni_ = std::move(*read);
    }
    plan_ = samples::plan_cycles(eni_ ? &*eni_ : nullptr, std::chrono::microseconds(configuration_.cycle_us));
    if (!plan_.error.empty()) return plan_.error;
    if (plan_.clock) {
        // The same part of the limit as the default: an error within it corrects the phase.
        plan_.clock->phase.limit_ns = configuration_.in_sync_us * 1000U;
        plan_.clock->phase.outlier_ns = plan_.clock->phase.limit_ns / 4 * 3;
    }
    auto source = samples::open_source(configuration_.source, {.real_time = true, .wait_for_interfaces = true});
    if (!source) return source.error();
    source_ = source.take();
    ctx_ = std::make_unique<HostContext>(source_->limits(samples::with_room(limits(), eni_ ? &*eni_ : nullptr)));
    if (const auto ready = source_->begin(*ctx_); !ready) return samples::sentence(ready.error());
    companion_ = std::make_unique<Companion>(*ctx_, configuration_.name, debug_level_);
    // A socket that no process serves. The margayd of this socket was killed, and the slaves may still be in the states
    // of that time.
    const bool left_behind = is_left_behind(socket_);
    const auto& s = configuration_.socket;
    attach_ = std::make_unique<AttachServer>(*ctx_, socket_,
                                             AttachSettings{.name = configuration_.source,
                                                            .mode = s.mode,
                                                            .owner = s.owner,
                                                            .group = s.group,
                                                            .read_only = s.read_only,
                                                            .scan = AttachScan::search,
                                                            .debug_level = &debug_level_,
                                                            .clients = s.clients});
    if (!attach_->error().empty()) return attach_->error();
    is_ours_ = left_behind;
    read_left_slaves();
    return open_gateway();
}

// The file beside the socket has the source, and says whether all its slaves are in SAFEOP, the end state. If it does
// not say so, some slaves did not answer at the end and are in any state. By this file, the next master of this source
// knows the slaves as its own.
std::filesystem::path Master::left_file() const { return socket_ + ".left"; }

void Master::note_left_slaves() const {
    // A master that has configured no slaves leaves them in the states that the previous master has left.
    const bool in_safeop =
        brought_up_ ? is_left_well_ && configuration_.end_state == AlState::safeop : was_left_in_safeop_;
    const bool in_any_state = brought_up_ ? !is_left_well_ : is_ours_;
    if (!in_safeop && !in_any_state) return;
    std::ofstream(left_file()) << configuration_.source << (in_safeop ? "\nSAFEOP\n" : "\n");
}

void Master::read_left_slaves() {
    std::ifstream file(left_file());
    std::string source;
    std::string state;
    if (!std::getline(file, source) || source != configuration_.source) return;
    if (std::getline(file, state))
        was_left_in_safeop_ = true;
    else
        is_ours_ = true;
}

std::string Master::open_gateway() {
    const auto where = samples::parse_listen_address(configuration_.gateway, MailboxGatewaySettings::kPort);
    if (!where) return {};  // no gateway is wanted
    gateway_ = std::make_unique<MailboxGateway>(
        *ctx_, MailboxGatewaySettings{.address = where->address,
                                      .port = where->port,
                                      .read_only = configuration_.gateway_read_only,
                                      .name = "Margay EtherCAT master " + configuration_.name});
    if (!gateway_->error().empty()) return gateway_->error();
    log(Priority::notice, "mailbox gateway at " + to_text(samples::ListenAddress{where->address, gateway_->port()}));
    return {};
}

void Master::work() {
    while (await_segment()) {
        if (!bring_up()) {
            companion_->wait_for("the segment cannot be scanned");
            pause(kTryAgain);
            continue;
        }
        cycle();
        end_supervision();
        close_eoe();
        if (stopping_) break;
        keep_targets();
        log(Priority::notice, why_scanned_ + ": the segment is scanned again");
    }
    leave();
}

void Master::pause(Duration time) {
    Osal& osal = source_->osal();
    const Time until = osal.now() + time;
    for (Time now = osal.now(); now < until && !stopping_; now = osal.now())
        osal.wait(std::min(poll(*ctx_, now), until), source_->wait_handles());
}

// ------------------------------------------------------------------ bring-up

bool Master::await_segment() {
    while (!stopping_) {
        const auto reason = obstacle();
        if (reason.empty()) return true;
        companion_->wait_for(reason);
        pause(kTryAgain);
    }
    return false;
}

std::string Master::obstacle() {
    if (auto missing = source_->look_for_interfaces(); !missing.empty()) return missing;
    const bool second_link = source_->second() != nullptr && source_->second()->link_state() != LinkState::down;
    if (source_->nic().link_state() == LinkState::down && !second_link)
        return "the interface has no link: the cable is not plugged in, or the first slave has no power";
    std::array<std::byte, 2> al_status{};
    const auto slaves = exchange_datagram(*ctx_, DatagramCommand::brd, 0, 0x0130, al_status);
    if (!slaves) return slaves.error().code == Errc::no_frame ? "no slave answers" : samples::sentence(slaves.error());
    if (*slaves == 0) return "no slave answers";
    const auto has = [&](AlState state) {
        return (std::to_integer<unsigned>(al_status[0]) & static_cast<unsigned>(state)) != 0;
    };
    const bool as_left = (was_left_in_safeop_ || configuration_.end_state == AlState::safeop) && !has(AlState::op);
    if (is_ours_ || as_left || configuration_.take_over || (!has(AlState::safeop) && !has(AlState::op))) return {};
    return fmt::format(
        "slaves of this segment are in SAFEOP or OP ({}): another master may be running them. With "
        "take_over = true they are scanned nevertheless",
        samples::counted(*slaves, "slave answers", "slaves answer"));
}

// Without its clock no slave with SYNC signals leaves PREOP. Frames of the measurement may be lost, or the slave with
// the reference clock has no power yet: then the cycle has a place for its time, and look_at_clocks() measures again.
void Master::set_clocks() {
    constexpr int kMostTries = 10;
    late_clocks_.reset();
    for (int n = 0; n < kMostTries && !stopping_; ++n) {
        const auto done = configdc(*ctx_, *eni_->clocks);
        if (done || done.error().code == Errc::not_in_sync) return;
        (void)readstate(*ctx_);  // shows whether a slave is lost, or a frame
    }
    late_clocks_ = *eni_->clocks;
    const auto slaves = ctx_->slaves();
    const auto with_sync =
        std::ranges::find_if(slaves, [](const Slave& s) { return s.config.dc().source != SyncSettings::Source::none; });
    if (late_clocks_->reference == 0 && with_sync != slaves.end()) late_clocks_->reference = with_sync->number;
    ctx_->group(late_clocks_->group).config.dc_reference = late_clocks_->reference;
    next_measurement_ = {};
}

bool Master::bring_up() {
    if (eni_)
        if (const auto applied = files::apply(*ctx_, *eni_); !applied) return false;
    (void)tolerate(*ctx_, {.other_slaves = configuration_.tolerate_other,
                           .unexpected_slaves = configuration_.tolerate_unexpected,
                           .missing_slaves = configuration_.tolerate_missing});
    is_ours_ = true;  // the scan brings all slaves to INIT
    companion_->forget_strangers();
    const auto found = config_init(*ctx_);
    if (!found && ctx_->slaves().empty()) return false;
    brought_up_ = true;
    std::error_code none;
    std::filesystem::remove(left_file(), none);
    const auto present = std::ranges::count_if(ctx_->slaves(), [](const Slave& s) { return s.ring_position != 0; });
    log(Priority::notice, samples::counted(static_cast<std::uint64_t>(present), "slave") + " found");
    // The errors of these calls are in errors() too, and the companion writes them: what fails for one slave does not
    // keep the others from work.
    if (eni_) {
        for (const files::Remark& remark : files::remarks_after_scan(*ctx_, *eni_))
            log(Priority::warning, fmt::format("{}: {}", configuration_.eni.string(), to_text(remark)));
        if (const auto told = files::check_modules(*ctx_, *eni_); !told)
            log(Priority::error, samples::sentence(told.error()));
    }
    if (eni_ && eni_->clocks) set_clocks();
    // The PDOs of slaves in INIT cannot be read, because they have no mailbox. The supervision takes them to INIT.
    if (configuration_.state < AlState::safeop) (void)set_target(*ctx_, 0, AlState::preop);
    restore_targets(Exchange::no);  // these slaves are not started
    map_groups();
    if (configuration_.eoe) open_eoe();
    supervise_.target = configuration_.state;
    const auto begun = submit(*ctx_, supervise_);
    if (!begun) log(Priority::error, "no supervision: " + samples::sentence(begun.error()));
    (void)poll(*ctx_, source_->osal().now());  // it begins: the target of all slaves is no longer PREOP
    if (begun) restore_targets(Exchange::yes);
    return begun.ok();
}

// A scan forgets the states that clients have set. A client that works at a slave in PREOP does not expect the slave in
// OP because of another slave.
void Master::keep_targets() {
    std::erase_if(kept_targets_, [this](const KeptTarget& kept) { return find_kept(kept) != nullptr; });
    for (const Slave& slave : ctx_->slaves())
        if (slave.target != AlState::none && slave.target != AlState::boot)
            kept_targets_.push_back({slave.number, slave.ring_position, slave.alias, slave.identity, slave.target});
}

// The same device at the same place, or else the only one with its alias or serial number.
const Slave* Master::find_kept(const KeptTarget& kept) const {
    const Slave* found = nullptr;
    unsigned equal = 0;
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.ring_position == 0 || slave.identity != kept.identity || slave.alias != kept.alias) continue;
        if (slave.ring_position == kept.ring_position) return &slave;
        found = &slave;
        ++equal;
    }
    const bool has_name = kept.alias != 0 || kept.identity.serial != 0;
    return has_name && equal == 1 ? found : nullptr;
}

// A slave in INIT has no mailbox to ask for its PDOs: it goes back to INIT when it has its place in the image.
void Master::restore_targets(Exchange exchange) {
    std::erase_if(kept_targets_, [&](const KeptTarget& kept) {
        const bool begins = exchange == Exchange::no;
        if (begins ? kept.target >= AlState::safeop : kept.target == AlState::preop) return false;
        const bool ends = !begins || kept.target == AlState::preop;
        const Slave* const same = find_kept(kept);
        const auto state = samples::al_text({.state = kept.target});
        if (same == nullptr) {
            if (ends)
                log(Priority::warning,
                    fmt::format("slave {} before the scan, which a client has set to {}, is not found again",
                                kept.number, state));
            return false;  // the next scan may find it
        }
        const auto set = set_target(*ctx_, same->number, ends ? kept.target : AlState::preop);
        if (!set)
            log(Priority::warning, samples::sentence(set.error()));
        else if (ends)
            log(Priority::notice,
                fmt::format("slave {} ({}) is kept in {}: a client has set it", same->number, same->name(), state));
        return ends;
    });
}

void Master::map_groups() {
    image_.assign(kMoreImage + (eni_ ? eni_->image_bytes : 0), std::byte{0});
    std::size_t used = 0;
    for (std::size_t n = 0; n < plan_.every.size(); ++n) {
        const auto mapped = config_map(*ctx_, std::span(image_).subspan(used), static_cast<std::uint8_t>(n));
        const Group& group = ctx_->group(static_cast<std::uint8_t>(n));
        used += group.image.size();
        if (group.mapped)
            log(Priority::info,
                fmt::format("{} out, {} in, {} in each cycle of {} µs", samples::counted(group.output_bytes, "octet"),
                            group.input_bytes, samples::counted(group.frames, "frame"),
                            plan_.period * plan_.every[n] / 1us));
        else if (!mapped)
            log(Priority::error, "no process data: " + samples::sentence(mapped.error()));
    }
}

// ------------------------------------------------------------------ the end

void Master::end_supervision() {
    measure_clocks_.cancel();
    supervise_.cancel();
    const auto busy = [this] { return supervise_.busy() || measure_clocks_.busy(); };
    for (const Time until = source_->osal().now() + 2s; busy() && source_->osal().now() < until;) {
        (void)poll(*ctx_, source_->osal().now());
        source_->osal().wait(source_->osal().now() + 1ms, source_->wait_handles());
    }
}

void Master::leave() {
    if (!brought_up_) return;
    const auto is_there = [this](const Slave& slave) {
        return slave.al.state == AlState::none || (slave.al.state == configuration_.end_state && !slave.al.error);
    };
    const auto state = samples::al_text({.state = configuration_.end_state});
    Osal& osal = source_->osal();
    const Time until = osal.now() + kEndPatience;
    auto asked = writestate(*ctx_, 0, configuration_.end_state);
    auto read = readstate(*ctx_);
    const auto are_there = [&] { return read && std::ranges::all_of(ctx_->slaves(), is_there); };
    while (!are_there() && osal.now() < until) {
        osal.wait(osal.now() + 10ms, -1);
        if (!asked) asked = writestate(*ctx_, 0, configuration_.end_state);  // frames may have been lost
        read = readstate(*ctx_);
    }
    is_left_well_ =
        std::ranges::all_of(ctx_->slaves(), [](const Slave& s) { return s.al.state != AlState::none || !s.seen; }) &&
        are_there();
    if (are_there()) {
        const auto gone = std::ranges::count(ctx_->slaves(), AlState::none, [](const Slave& s) { return s.al.state; });
        const auto there = static_cast<std::ptrdiff_t>(ctx_->slaves().size()) - gone;
        log(Priority::notice, gone == 0    ? "all slaves in " + state
                              : there == 0 ? std::string("no slave answers any more")
                                           : fmt::format("all slaves that answer in {}: {}", state, there));
        return;
    }
    for (const Slave& slave : ctx_->slaves())
        if (!is_there(slave))
            log(Priority::warning, fmt::format("slave {} ({}) is left in {}, not in {}", slave.number, slave.name(),
                                               samples::al_text(slave.al), state));
    if (!read) log(Priority::warning, "the states of the slaves cannot be read: " + samples::sentence(read.error()));
    if (!asked)
        log(Priority::warning, "the slaves were not all brought to " + state + ": " + samples::sentence(asked.error()));
}

}  // namespace margay::service
