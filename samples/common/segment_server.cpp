#include "common/segment_server.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"
#include "common/segment_console.hpp"
#include "wire/ethernet.hpp"

#include <fmt/format.h>

#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>

namespace margay::samples {

namespace {

using namespace std::chrono_literals;
constexpr Duration kSilence = 2s;     // a master that sends again after such a pause is reported again
constexpr Duration kStateLook = 5ms;  // interval for the detection of state changes
constexpr Duration kLinkLook = 10ms;  // interval for the detection of cables that are out
// Slaves whose time comes within this interval are served together, because a look at a thousand slaves costs a
// microsecond. They nevertheless get their own times, and the first frame of a burst finds them up to date.
constexpr Duration kStep = 50us;
constexpr unsigned kBurst = 16;  // frames
constexpr std::size_t kMaxMasters = 64;

}  // namespace

SegmentServer::~SegmentServer() {
    if (signals_ >= 0) ::close(signals_);
}

void SegmentServer::say(const std::string& text) {
    print_out("{:12.6f}  {}\n", std::chrono::duration<double>(osal_.now().time_since_epoch()).count(), text);
    flush_out();
}

std::string SegmentServer::open(const std::string& description, const ServerOptions& options) {
    auto loaded = load_segment(description, osal_.now());
    if (!loaded) return loaded.error();
    simulated_ = loaded.take();
    quiet_ = options.quiet;
    if (const auto problem = open_ends(options); !problem.empty()) return problem;
    if (!options.ports.empty())
        if (auto problem = ports_.open(*simulated_, options.ports); !problem.empty()) return problem;
    if (!options.record.empty())
        if (const auto problem = record_to(options.record); !problem.empty()) return problem;
    sigset_t set;
    sigemptyset(&set);
    for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGUSR2}) sigaddset(&set, signal);
    if (sigprocmask(SIG_BLOCK, &set, nullptr) != 0)
        return fmt::format("cannot block signals: {}", std::strerror(errno));
    signals_ = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    if (signals_ < 0) return fmt::format("cannot receive signals: {}", std::strerror(errno));
    states_.resize(simulated_->segment.size());
    for (const auto& name : ports_.names()) say(name);
    say(fmt::format("serving {} on {}", counted(simulated_->segment.size(), "slave"), options.interface));
    return {};
}

std::string SegmentServer::record_to(const std::string& file) {
    const auto epoch = std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch() -
                                                            osal_.now().time_since_epoch());
    if (end_count_ > 1) {
        auto& recorder = ring_recorder_.emplace(*ends_[0].nic, *ends_[1].nic, osal_);
        ends_[0].nic = &recorder.first();
        ends_[1].nic = &recorder.second();
        return recorder.open(file, epoch) ? std::string() : recorder.problem();
    }
    auto& recorder = recorder_.emplace(*ends_[0].nic, osal_);
    ends_[0].nic = &recorder;
    return recorder.open(file, epoch) ? std::string() : recorder.problem();
}

// Opens one interface, or two with '+' between their names. A ring without a second interface is served with its second
// cable removed.
std::string SegmentServer::open_ends(const ServerOptions& options) {
    const auto plus = options.interface.find('+');
    ends_[0].name = options.interface.substr(0, plus);
    end_count_ = plus == std::string::npos ? 1 : 2;
    const bool ring = simulated_->segment.master_link(1);
    if (end_count_ == 2) {
        ends_[1].name = options.interface.substr(plus + 1);
        if (ends_[1].name.find('+') != std::string::npos)
            return fmt::format("'{}': a ring has two ends, and these are more than two interfaces", options.interface);
        if (ends_[0].name.empty() || ends_[1].name.empty())
            return fmt::format("'{}': the name of an interface is missing beside '+'", options.interface);
        if (ends_[0].name == ends_[1].name)
            return fmt::format("'{}': both interfaces are the same, a ring needs two", options.interface);
        if (!ring) return "the segment has one end: two interfaces need a description with 'ring'";
    } else if (ring) {
        simulated_->segment.set_master_cable(1, false);
        say("the cable at the second end of the ring is out: no second interface is given (IFNAME+IFNAME)");
    }
    for (End& end : std::span(ends_).first(end_count_)) {
        if (options.tap) {
            if (auto problem = end.tap.open(end.name); !problem.empty()) return problem;
            end.nic = &end.tap;
        } else {
            if (!end.packet.open(end.name, PacketNic::Side::segment)) return std::string(end.packet.problem());
            end.nic = &end.packet;
        }
    }
    return {};
}

// At a port without a link a slave returns the frames to the other side of the ring.
void SegmentServer::look_at_links() {
    for (unsigned n = 0; n < end_count_; ++n) {
        const bool linked = ends_[n].nic->link_state() != LinkState::down;
        if (linked == ends_[n].linked) continue;
        ends_[n].linked = linked;
        simulated_->segment.set_master_cable(n, linked);
        say(fmt::format("{}: the cable is {}", ends_[n].name, linked ? "plugged in" : "out"));
    }
}

bool SegmentServer::run() {
    Time next_look = quiet_ ? kNever : osal_.now();
    Time next_links = end_count_ > 1 ? osal_.now() : kNever;
    while (!output_lost()) {
        const Time now = osal_.now();
        simulated_->switch_on_late(now);
        simulated_->segment.advance(now);
        if (now >= next_look) {
            print_states();
            next_look = now + kStateLook;
        }
        if (now >= next_links) {
            look_at_links();
            next_links = now + kLinkLook;
        }
        files_.assign({{ends_[0].nic->wait_handle(), POLLIN, 0},
                       {end_count_ > 1 ? ends_[1].nic->wait_handle() : -1, POLLIN, 0},
                       {signals_, POLLIN, 0},
                       {commands_open_ ? STDIN_FILENO : -1, POLLIN, 0}});
        ports_.add_files(files_);
        const Time next = std::min({std::max(simulated_->segment.next_event(), now + kStep), next_look, next_links});
        const Duration wait = std::clamp<Duration>(next - osal_.now(), 0ns, 100ms);
        const timespec timeout{0, static_cast<long>(wait.count())};
        if (::ppoll(files_.data(), files_.size(), &timeout, nullptr) < 0 && errno != EINTR) {
            (void)fail(fmt::format("waiting failed: {}", std::strerror(errno)));
            return false;
        }
        for (unsigned n = 0; n < end_count_; ++n)
            if (files_[n].revents != 0) serve(n);
        ports_.serve(osal_.now());
        if (files_[2].revents != 0 && handle_signal()) break;
        if (files_[3].revents != 0 && read_commands()) break;
    }
    say(fmt::format("{} answered, {} lost in the segment", counted(answered_, "frame"), lost_));
    if (ring_recorder_ && !ring_recorder_->close()) {
        (void)fail(ring_recorder_->problem());
        return false;
    }
    if (recorder_ && !recorder_->close()) {
        (void)fail(recorder_->problem());
        return false;
    }
    return true;
}

void SegmentServer::serve(unsigned port) {
    std::array<std::byte, 1600> buffer;
    // The frames that wait have come together: the programs of the slaves do not run between them, or the replies to
    // the last frames of a cycle would wait for the programs. A frame that a master has sent after a reply comes later:
    // where both share a processor, the master runs during send(). The clocks of the slaves have advanced during this
    // time.
    constexpr Duration kTogether = 10us;
    Time now = osal_.now();
    Time processed = now;
    for (unsigned n = 1; const auto size = ends_[port].nic->receive(buffer); ++n) {
        const Time received = osal_.now();
        if (n % kBurst == 0 || received - processed >= kTogether) now = received;
        const auto frame = MutableBytes(buffer).first(size);
        if (size < wire::kEthernetHeaderBytes) continue;
        look(frame);
        const auto passage = simulated_->segment.process(frame, now, port);
        processed = osal_.now();
        if (!passage.returned || passage.master_port >= end_count_) {
            ++lost_;
            continue;
        }
        Nic& out = *ends_[passage.master_port].nic;
        if (out.send(frame) == SendStatus::sent)
            ++answered_;
        else
            say(fmt::format("an answer could not be sent: {}", std::strerror(out.last_error())));
    }
}

void SegmentServer::look(std::span<const std::byte> frame) {
    if (quiet_) return;
    MacAddress source;
    for (std::size_t i = 0; i < source.size(); ++i)
        source[i] = std::to_integer<std::uint8_t>(frame[wire::kSourceMacOffset + i]);
    const Time now = osal_.now();
    const auto known = masters_.find(source);
    if (known != masters_.end() && now - known->second < kSilence) {
        known->second = now;
        return;
    }
    if (masters_.size() >= kMaxMasters) masters_.clear();
    masters_[source] = now;
    const bool ethercat = wire::load_ether_type(frame) == wire::kEtherTypeEtherCat;
    say(fmt::format("frames from {:02x}{}", fmt::join(source, ":"), ethercat ? "" : ", but not EtherCAT"));
}

void SegmentServer::print_states() {
    for (std::uint32_t n = 0; n < states_.size(); ++n) {
        auto state = simulated_->segment.powered(n) ? state_of(simulated_->segment.slave(n)) : std::string("off");
        if (state == states_[n]) continue;
        if (!states_[n].empty()) say(fmt::format("slave {} ({}): {}", n + 1, simulated_->names[n], state));
        states_[n] = std::move(state);
    }
}

// Returns true when the server must end.
bool SegmentServer::read_commands() {
    std::array<char, 512> buffer;
    const auto size = ::read(STDIN_FILENO, buffer.data(), buffer.size());
    if (size <= 0) {
        commands_open_ = false;  // standard input is closed; the server continues
        return false;
    }
    pending_.append(buffer.data(), static_cast<std::size_t>(size));
    for (auto end = pending_.find('\n'); end != std::string::npos; end = pending_.find('\n')) {
        const auto command = pending_.substr(0, end);
        pending_.erase(0, end + 1);
        if (command == "quit") return true;
        if (const auto answer = execute(*simulated_, command, osal_.now()); !answer.empty()) say(answer);
    }
    return false;
}

bool SegmentServer::handle_signal() {
    signalfd_siginfo info{};
    if (::read(signals_, &info, sizeof info) != sizeof info) return false;
    if (info.ssi_signo == SIGUSR1)
        say(execute(*simulated_, fmt::format("break {}", simulated_->segment.size()), osal_.now()));
    else if (info.ssi_signo == SIGUSR2)
        say(execute(*simulated_, "heal all", osal_.now()));
    else
        return true;
    return false;
}

}  // namespace margay::samples
