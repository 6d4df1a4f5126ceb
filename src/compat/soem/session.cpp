#include "compat/soem/session.hpp"

#include "compat/soem/inbox.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <set>
#include <thread>

namespace margay::soem {
namespace {

std::mutex sessions_mutex;

bool wants_virtual_time() {
    const char* const time = std::getenv("MARGAY_SIM_TIME");
    return time != nullptr && std::string_view(time) == "virtual";
}

}  // namespace

void say(const std::string& text) { std::fprintf(stderr, "margay: %s\n", text.c_str()); }

void say_once(const std::string& text) {
    static std::mutex mutex;
    static auto* const said = new std::set<std::string>;  // threads may use it while the process ends
    const std::lock_guard<std::mutex> guard(mutex);
    if (said->insert(text).second) say(text);
}

std::unique_ptr<Session> Session::open(const std::string& source, const Limits& limits) {
    auto opened = hosted::open_source(source, {.real_time = !wants_virtual_time()});
    if (!opened) {
        say(source + ": " + opened.error());
        return nullptr;
    }
    std::unique_ptr<hosted::Source> owned = opened.take();
    const Limits owned_limits = owned->limits(limits);
    std::unique_ptr<Session> session(new Session(std::move(owned), owned_limits));
    const auto begun = session->source_->begin(session->context_);
    if (!begun) {
        say(source + ": the master does not begin");
        return nullptr;
    }
    // Each poll sends the queued datagrams, and does not wait for the next cycle. A program reads inputs between its
    // own calls while its other threads poll.
    for (std::size_t n = 0; n < limits.groups; ++n) {
        GroupConfiguration& config = session->context_.group(n).config;
        config.acyclic_bytes = 0;
        config.hold_inputs = true;
    }
    session->inbox_ = std::make_unique<Inbox>(session->context_);
    return session;
}

Session::Session(std::unique_ptr<hosted::Source> source, const Limits& limits)
    : source_(std::move(source)), context_(limits), shown_(limits.slaves + 1U) {
    for (std::size_t group = 0; group < facts_.size(); ++group) {
        facts_[group].context = &context_;
        facts_[group].session = this;
        facts_[group].group = static_cast<std::uint8_t>(group);
    }
}

Session::~Session() {
    static_cast<void>(take_ownership(context_));
    inbox_.reset();
}

void Session::change_owner() {
    static_cast<void>(take_ownership(context_));
    owner_ = calling_thread();
}

void Session::find_missing(const Error& of_cycle) {
    constexpr Duration kPause = std::chrono::milliseconds(5);
    if (of_cycle.code != Errc::working_counter || of_cycle.detail == Error::kOthersFresh) return;
    const Time begin = now();
    if (closing() || (!states_.busy() && begin < states_at_)) return;
    // If there is no room for the request, a later cycle tries again.
    if (!states_.busy()) (void)submit(context_, states_);
    states_at_ = later(begin, kPause);
    (void)poll(context_, begin);
}

// One poll under the lock. Returns until when nothing is due.
Time Session::poll_once(Request* request, Time until, bool& over) {
    const Guard guard(*this);
    over = request != nullptr && !request->busy();
    if (over) return Time{};
    const Time begin = now();
    const Time next = std::min(poll(context_, begin), source_->next_arrival());
    if (request != nullptr && (begin >= until || closing())) request->cancel();
    over = request != nullptr && !request->busy();
    // Another thread moves the virtual clock too, therefore only with the lock.
    if (!over && virtual_time()) source_->osal().wait(std::min(next, now() + std::chrono::milliseconds(1)), -1);
    return next;
}

void Session::wait_for_work(Time until) {
    if (virtual_time()) return;
    source_->osal().wait(until, source_->wait_handles());
}

// A request that fails because the slave was away is executed again after a reading of the states. The reading finds a
// slave that is present again, and compares its identity.
Result<> Session::run(Request& request, Between* between, Duration limit) {
    const auto done = run_once(request, between, limit);
    const bool was_away = done.error().code == Errc::identity_unread || done.error().code == Errc::missing_slave;
    if (done || !was_away || !is_answered()) return done;
    ReadStateRequest states;
    (void)run_once(states, nullptr, limit);
    return run_once(request, between, limit);
}

void Session::note_lost(const std::vector<std::uint16_t>& slaves) {
    const Guard guard(*this);
    lost_.insert(slaves.begin(), slaves.end());
}

void Session::forget_lost(std::uint16_t asked) {
    const Guard guard(*this);
    if (asked == 0)
        lost_.clear();
    else
        lost_.erase(asked);
}

// The lost slaves that are present again in SAFEOP or OP. Slaves in another state are removed from the list of lost
// slaves.
std::vector<std::uint16_t> Session::back_of_lost(std::uint16_t asked) {
    const Guard guard(*this);
    std::vector<std::uint16_t> back;
    std::erase_if(lost_, [&](std::uint16_t number) {
        if (number > context_.slaves().size()) return true;
        if (asked != 0 && number != asked) return false;
        const AlState state = slave(number).al.state;
        const bool exchanges = state == AlState::safeop || state == AlState::op;
        if (exchanges) back.push_back(number);
        return !exchanges && state != AlState::none;
    });
    return back;
}

// Whether an FMMU of the slave is active, or the slave needs none. No value: it is unknown.
std::optional<bool> Session::is_mapped(std::uint16_t number) {
    constexpr std::uint16_t kFirstFmmu = 0x0600;
    constexpr std::size_t kFmmuBytes = 16;
    constexpr std::size_t kActive = 12;
    std::array<std::byte, 16 * kFmmuBytes> fmmus{};
    std::uint16_t station = 0;
    std::size_t count = 0;
    {
        const Guard guard(*this);
        const Slave& found = slave(number);
        if (found.image.inputs.bits == 0 && found.image.outputs.bits == 0) return true;
        station = found.station_address.value;
        count = std::min<std::size_t>(found.dl.fmmus, 16);
    }
    const auto octets = std::span(fmmus).first(count * kFmmuBytes);
    const auto address = address_of(station, kFirstFmmu);
    if (exchange(DatagramCommand::fprd, address, octets, std::chrono::milliseconds(6)) != 1) return std::nullopt;
    bool any = false;
    for (std::size_t n = 0; n < count; ++n) any |= (fmmus[n * kFmmuBytes + kActive] & std::byte{1}) != std::byte{0};
    return any;
}

bool Session::settle_lost(std::uint16_t asked) {
    bool all = true;
    for (const std::uint16_t number : back_of_lost(asked)) {
        const auto mapped = is_mapped(number);
        bool done = mapped.has_value();
        if (mapped == false) {
            WriteStateRequest down;
            down.slave = number;
            down.wanted = AlState::init;
            done = run(down).ok();
        }
        all = all && done;
        if (done) forget_lost(number);
    }
    return all;
}

void Session::watch(unsigned watchers) {
    watchers_ = watchers;
    static_cast<void>(watch_mailboxes(context_, watchers == 0 ? Duration{0} : std::chrono::milliseconds(1)));
}

void Session::begin_watch() {
    const Guard guard(*this);
    watch(watchers_ + 1);
}

void Session::end_watch() {
    const Guard guard(*this);
    watch(watchers_ - 1);
}

void Session::watch_always() {
    const Guard guard(*this);
    if (!handles_mail_) watch(watchers_ + 1);
    handles_mail_ = true;
}

int Session::answers(Duration timeout) {
    std::array<std::byte, 1> octet{};
    return exchange(DatagramCommand::brd, 0, octet, timeout);
}

Result<> Session::run_once(Request& request, Between* between, Duration limit) {
    const Time until = limit > Duration{0} ? later(now(), limit) : kNever;
    {
        const Guard guard(*this);
        if (closing()) return Error{.code = Errc::canceled};
        const auto submitted = submit(context_, request);
        if (!submitted) return submitted;
    }
    // Another thread may receive the frame that this one waits for, therefore no wait is long.
    constexpr Duration kLook = std::chrono::milliseconds(1);
    for (bool over = false;;) {
        const Time next = poll_once(&request, until, over);
        if (between != nullptr) between->run();
        if (over) break;
        wait_for_work(std::min({next, until, now() + kLook}));
    }
    return request.state() == RequestState::error ? Result<>(request.error()) : Result<>();
}

void Session::pause_until(Time until, const Flight* flight) {
    constexpr Duration kLook = std::chrono::milliseconds(1);
    while (now() < until && !closing() && (flight == nullptr || !flight->over())) {
        bool over = false;
        const Time next = poll_once(nullptr, kNever, over);
        wait_for_work(std::min({next, until, now() + kLook}));
    }
}

void Session::poll_now() {
    const Guard guard(*this);
    static_cast<void>(poll(context_, now()));
}

bool Session::launch(Flight& flight) {
    const Guard guard(*this);
    const bool sent = !closing() && std::ranges::all_of(flight.datagrams, [this](DatagramRequest& one) {
        return submit(context_, one).ok();
    });
    if (!sent)  // no part of the frame is sent
        for (DatagramRequest& one : flight.datagrams) one.cancel();
    static_cast<void>(poll(context_, now()));
    return sent;
}

void Session::land(Flight& flight) {
    const Guard guard(*this);
    for (DatagramRequest& one : flight.datagrams) one.cancel();
}

bool Session::link_is_down() {
    const Guard guard(*this);  // a simulated segment switches slaves on meanwhile
    const auto is_down = [](Nic* nic) { return nic == nullptr || nic->link_state() == LinkState::down; };
    return is_down(&source_->nic()) && is_down(source_->second());
}

// Sends again each EC_TIMEOUTRET, and the reply to any of the last sendings is the result. Counts how often it sends,
// and not the time: a thread that the system has kept waiting has not waited for a frame.
int Session::exchange(DatagramCommand command, std::uint32_t address, std::span<std::byte> data, Duration timeout,
                      bool again) {
    constexpr Duration kLeast = std::chrono::microseconds(100);
    constexpr Duration kFrame = std::chrono::milliseconds(2);  // EC_TIMEOUTRET
    std::array<Sending, kMostSendings> sendings;
    const Sending* answered = nullptr;
    std::size_t next = 0;
    for (Duration left = std::max(timeout, kLeast); answered == nullptr && left > Duration{0} && !closing();) {
        Sending& sending = sendings[next];
        next = (next + 1) % sendings.size();
        if (!begin(sending, command, address, data, again)) break;
        const Duration wait = again ? std::min(left, kFrame) : left;
        answered = await_one(sendings, later(now(), wait));
        left -= wait;
    }
    const Guard guard(*this);
    for (Sending& one : sendings) one.request.cancel();
    if (answered == nullptr) return -1;
    std::ranges::copy(answered->data, data.begin());
    return answered->request.wkc;
}

bool Session::begin(Sending& sending, DatagramCommand command, std::uint32_t address, std::span<const std::byte> data,
                    bool again) {
    const Guard guard(*this);
    DatagramRequest& request = sending.request;
    request.cancel();  // the oldest sending, when there are more of them than places
    sending.data.assign(data.begin(), data.end());
    request.command = command;
    request.adp = static_cast<std::uint16_t>(address);
    request.ado = static_cast<std::uint16_t>(address >> 16);
    request.logical = {address};
    request.data = sending.data;
    request.repeat = again;
    return !closing() && submit(context_, request);
}

// A sending whose reply has arrived; null: no reply has arrived before the timeout.
const Session::Sending* Session::await_one(std::span<const Sending> sendings, Time until) {
    constexpr Duration kLook = std::chrono::milliseconds(1);
    for (;;) {
        const bool waited = now() >= until || closing();
        bool over = false;
        const Time next = poll_once(nullptr, kNever, over);
        {
            const Guard guard(*this);
            const auto success = [](const Sending& one) { return one.request.state() == RequestState::success; };
            const auto found = std::ranges::find_if(sendings, success);
            if (found != sendings.end()) return &*found;
        }
        if (waited) return nullptr;
        wait_for_work(std::min({next, until, now() + kLook}));
    }
}

constinit std::array<Sessions::Place, Sessions::kMost> Sessions::places_;

Sessions::Pinned::Pinned(int place, const void* owner) {
    const auto index = index_of(place);
    if (index >= kMost) return;
    place_ = &places_[index];
    place_->users.fetch_add(1);  // before the owner is compared: end() looks in the other order
    if (place_->owner.load() == owner)
        session_ = place_->session;
    else
        leave(*place_);
}

// The last call that leaves a session without an owner ends it.
void Sessions::leave(Place& place) {
    if (place.users.fetch_sub(1) != 1 || place.owner.load() != nullptr) return;
    const std::lock_guard<std::mutex> guard(sessions_mutex);
    if (place.owner.load() == nullptr) end(place);
}

int Sessions::add(std::unique_ptr<Session> session, const void* owner) {
    const std::lock_guard<std::mutex> guard(sessions_mutex);
    for (Place& place : places_) {
        if (place.owner.load() != nullptr) continue;
        if (place.session != nullptr) end(place);
        if (place.session != nullptr) continue;
        session->lock_ = &place.lock;
        for (Session::GroupFacts& facts : session->facts_) facts.lock = &place.lock;
        place.lock.lock();  // with_lock() sees both or none
        place.facts = session->facts_.data();
        place.session = session.release();
        place.owner.store(owner);
        place.lock.unlock();
        return number_of(place);
    }
    return -1;
}

// Destroys a session without an owner, unless calls have pinned it.
void Sessions::end(Place& place) {
    if (place.users.load() != 0) return;
    delete place.session;
    place.session = nullptr;
}

void Sessions::remove(int place, const void* owner) {
    const auto index = index_of(place);
    if (index >= kMost || owner == nullptr) return;
    Place& found = places_[index];
    {
        found.lock.lock();
        const bool mine = found.owner.load() == owner;
        if (mine) {
            found.session->closing_ = true;
            found.owner.store(nullptr);
        }
        found.lock.unlock();
        if (!mine) return;
    }
    // The calls of other threads return at once. A hook that closes the session of its own call would wait for itself,
    // so in this case that call ends the session.
    constexpr int kMostWaits = 2000;
    for (int n = 0; n < kMostWaits && found.users.load() != 0; ++n)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const std::lock_guard<std::mutex> guard(sessions_mutex);
    if (found.owner.load() == nullptr) end(found);
}

int Sessions::sleep(std::uint32_t microseconds) {
    for (Place& place : places_) {
        const void* const owner = place.owner.load();
        if (owner == nullptr) continue;
        const Pinned session(number_of(place), owner);
        if (session == nullptr || !session->virtual_time()) continue;
        session->pause(std::chrono::microseconds(microseconds));
        return 0;
    }
    timespec left{};
    left.tv_sec = static_cast<time_t>(microseconds / 1000000);
    left.tv_nsec = static_cast<long>(microseconds % 1000000) * 1000;
    return clock_nanosleep(CLOCK_MONOTONIC, 0, &left, nullptr) == 0 ? 0 : -1;
}

}  // namespace margay::soem
