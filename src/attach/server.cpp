// The thread of an AttachServer: reads messages, submits their requests, and sends the answers.
#include <margay/attach/server.hpp>

#include "api/master.hpp"
#include "api/queue.hpp"
#include "attach/connection.hpp"
#include "attach/event_log.hpp"
#include "attach/listener.hpp"
#include "attach/service_thread.hpp"

#include <margay/version.hpp>

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;
using attach::Connection;
using attach::Octets;
using attach::Status;

constexpr auto kStall = Connection::kSlow;  // a message must go on within this time
constexpr auto kOwnerSilent = 3s;           // the same time as in wait()
constexpr auto kProgressEvery = 100ms;
constexpr std::uint32_t kHighestLevel = 2;

Octets text_payload(std::string text) {
    Octets out(4 + text.size());
    attach::Writer into(out);
    into(text);
    return out;
}

}  // namespace

class AttachServer::Loop {
  public:
    Loop(Context& ctx, std::string path, AttachSettings settings)
        : ctx_(ctx), path_(std::move(path)), settings_(std::move(settings)), events_(ctx) {}
    ~Loop() { stop(); }
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    void start();
    [[nodiscard]] const std::string& error() const { return error_; }
    [[nodiscard]] const std::string& path() const { return path_; }
    [[nodiscard]] AttachCounts counts() const {
        return {.accepted = accepted_,
                .refused = refused_,
                .requests = requests_,
                .malformed = malformed_,
                .stalled = stalled_};
    }

  private:
    void stop();
    void run();
    void wait();
    void accept();
    bool make_room();
    void serve(Connection& client, short revents);
    void take_message(Connection& client);
    void hello(Connection& client);
    [[nodiscard]] std::string set_debug_level(std::uint32_t level);
    void begin(Connection& client, attach::Operation operation, attach::Arguments arguments);
    void look_after(Connection& client);
    void end_job(Connection& client);
    void drop(Connection& client);
    [[nodiscard]] timespec patience() const;

    Context& ctx_;
    std::string path_;
    AttachSettings settings_;
    std::string error_{};
    attach::Listener listener_{};
    attach::Moment now_{};
    attach::EventLog events_;
    std::vector<std::unique_ptr<Connection>> clients_{};
    std::vector<pollfd> polled_{};
    std::atomic<std::uint64_t> accepted_{0}, refused_{0}, requests_{0}, malformed_{0}, stalled_{0};
    attach::ServiceThread thread_{};
};

// ------------------------------------------------------------------ begin and end

void AttachServer::Loop::start() {
    error_ = master_of(ctx_) == nullptr ? path_ + ": there is no master yet: create the server after init()"
                                        : listener_.open(path_, settings_);
    if (!error_.empty()) return;
    if (const auto failed = thread_.start("margay-attach", [this] { run(); }); !failed.empty())
        error_ = path_ + ": " + failed;
}

// The jobs end in the calling thread, which owns the context.
void AttachServer::Loop::stop() {
    thread_.stop();
    clients_.clear();
}

// ------------------------------------------------------------------ the loop

// The state of a request is checked often in its first milliseconds, because most requests end in this time.
timespec AttachServer::Loop::patience() const {
    std::chrono::nanoseconds time = 250ms;
    for (const auto& client : clients_) {
        if (client->job == nullptr) continue;
        time = std::min<std::chrono::nanoseconds>(time, now_ - client->begun < 50ms ? 200us : 2ms);
    }
    return {.tv_sec = 0, .tv_nsec = time.count()};
}

void AttachServer::Loop::wait() {
    polled_.clear();
    polled_.push_back({thread_.wake_fd(), POLLIN, 0});
    polled_.push_back({listener_.fd(), POLLIN, 0});
    for (const auto& client : clients_) {
        const short events =
            static_cast<short>((client->listens() ? POLLIN : 0) | (client->has_output() ? POLLOUT : 0));
        polled_.push_back({client->fd(), static_cast<short>(events | POLLRDHUP), 0});
    }
    const timespec time = patience();
    if (::ppoll(polled_.data(), polled_.size(), &time, nullptr) < 0)
        for (auto& each : polled_) each.revents = 0;
    now_ = std::chrono::steady_clock::now();
}

void AttachServer::Loop::run() {
    now_ = std::chrono::steady_clock::now();
    while (!thread_.stopping()) {
        wait();
        events_.collect();
        for (std::size_t n = 0; n < clients_.size(); ++n) serve(*clients_[n], polled_[n + 2].revents);
        // A closed connection whose request is still busy keeps its place until the request is over.
        std::erase_if(clients_, [](const auto& client) { return client->closed() && client->job == nullptr; });
        if ((polled_[1].revents & POLLIN) != 0) accept();
    }
}

bool AttachServer::Loop::make_room() {
    if (clients_.size() < settings_.clients) return true;
    const auto n = attach::who_gives_way(clients_, now_);
    if (n == clients_.size()) return false;
    if (clients_[n]->in_message()) ++stalled_;
    clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(n));
    return true;
}

void AttachServer::Loop::accept() {
    const int fd = ::accept4(listener_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
        // Without free descriptors the connection stays in the queue, so wait before the next attempt.
        if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS)
            std::this_thread::sleep_for(10ms);
        return;
    }
    auto client = std::make_unique<Connection>(fd, settings_.transfer_bytes, now_);
    if (make_room()) {
        ++accepted_;
        clients_.push_back(std::move(client));
        return;
    }
    ++refused_;
    client->answer(Status::refused,
                   text_payload("all " + std::to_string(settings_.clients) + " connections are in use"), now_);
    (void)client->send(now_);
}

// ------------------------------------------------------------------ a client

void AttachServer::Loop::drop(Connection& client) {
    client.close();
    if (client.job != nullptr) client.job->request().cancel();
}

void AttachServer::Loop::serve(Connection& client, short revents) {
    if (client.job != nullptr) look_after(client);
    if (client.closed()) return;
    if ((revents & (POLLRDHUP | POLLHUP | POLLERR | POLLNVAL)) != 0 && (revents & POLLIN) == 0) return drop(client);
    if (client.listens() && (revents & POLLIN) != 0) {
        switch (client.receive(now_)) {
            case Connection::Came::nothing: break;
            case Connection::Came::message: take_message(client); break;
            case Connection::Came::wrong: ++malformed_; return drop(client);
            case Connection::Came::gone: return drop(client);
        }
    }
    if (client.has_output() && !client.send(now_)) return drop(client);
    const bool waits_for_client = client.has_output() || (client.in_message() && client.job == nullptr);
    if (waits_for_client && now_ - client.moved() > kStall) {
        ++stalled_;
        drop(client);
    }
}

void AttachServer::Loop::hello(Connection& client) {
    attach::Reader from(client.payload());
    std::uint32_t magic = 0;
    std::uint32_t version = 0;
    from(magic, version);
    // The message of another version may contain more than its two numbers.
    const bool well = version == attach::kProtocolVersion ? from.complete() : from.ok();
    if (!well || magic != attach::kMagic) {
        ++malformed_;
        return drop(client);
    }
    client.forget_message();
    if (version != attach::kProtocolVersion)
        return client.answer(Status::refused,
                             text_payload("the server speaks version " + std::to_string(attach::kProtocolVersion) +
                                          " of the protocol, and the client version " + std::to_string(version)),
                             now_);
    client.greeted = true;
    Octets out(256 + settings_.name.size());
    attach::Writer into(out);
    into(attach::kMagic, attach::kProtocolVersion, std::string(MARGAY_VERSION_TEXT), settings_.name,
         settings_.read_only, static_cast<std::uint32_t>(settings_.transfer_bytes));
    out.resize(into.written().size());
    client.answer(Status::done, std::move(out), now_);
}

void AttachServer::Loop::take_message(Connection& client) {
    const auto operation = client.operation();
    if (operation == attach::Operation::hello) return hello(client);
    attach::Arguments arguments;
    attach::Reader from(client.payload());
    from(arguments);
    if (!from.complete()) {
        ++malformed_;
        return drop(client);
    }
    client.forget_message();
    ++requests_;
    if (operation == attach::Operation::events) return client.answer(Status::done, events_.after(arguments.from), now_);
    if (settings_.read_only && attach::writes(operation))
        return client.answer(Status::refused, text_payload("the application allows reading only"), now_);
    if (operation == attach::Operation::set_debug_level) {
        const auto refusal = set_debug_level(arguments.from);
        if (!refusal.empty()) return client.answer(Status::refused, text_payload(refusal), now_);
        return client.answer(Status::done, {}, now_);
    }
    begin(client, operation, std::move(arguments));
}

// Returns the reason of a refusal; empty: the level was set.
std::string AttachServer::Loop::set_debug_level(std::uint32_t level) {
    if (settings_.debug_level == nullptr) return "the application has no messages with a level";
    if (level > kHighestLevel)
        return "the level " + std::to_string(level) + " is wanted, and the levels are 0, 1 and 2";
    settings_.debug_level->store(level, std::memory_order_relaxed);
    return {};
}

void AttachServer::Loop::begin(Connection& client, attach::Operation operation, attach::Arguments arguments) {
    std::string refusal;
    auto job = attach::make_job(operation, std::move(arguments), settings_, refusal);
    if (job == nullptr) return client.answer(Status::refused, text_payload(refusal), now_);
    client.job = std::move(job);
    client.begun = client.reported = now_;
    client.reported_octets = 0;
    client.unpolled = false;
    if (!submit(ctx_, client.job->request())) end_job(client);
}

void AttachServer::Loop::look_after(Connection& client) {
    Request& request = client.job->request();
    if (!request.busy()) return end_job(client);
    if (!client.unpolled && now_ - client.begun > kOwnerSilent && !RequestAccess::accepted(request)) {
        client.unpolled = true;
        request.cancel();  // ends the request at once, unless the owner accepts it at this moment
        if (!request.busy()) return end_job(client);
    }
    const auto [done, total] = client.job->progress();
    if (client.closed() || client.has_output() || now_ - client.reported < kProgressEvery ||
        done == client.reported_octets)
        return;
    client.reported = now_;
    client.reported_octets = done;
    Octets out(16);
    attach::Writer into(out);
    into(static_cast<std::uint64_t>(done), static_cast<std::uint64_t>(total));
    client.answer(Status::progress, std::move(out), now_);
}

void AttachServer::Loop::end_job(Connection& client) {
    if (client.has_output()) return;  // a progress message is being sent: the answer is sent after it
    const auto job = std::move(client.job);
    if (job->request().state() == RequestState::success) {
        const auto refusal = job->refusal();
        if (!refusal.empty()) return client.answer(Status::refused, text_payload(refusal), now_);
        return client.answer(Status::done, job->answer(), now_);
    }
    Error error = job->request().error();
    if (client.unpolled) error.code = Errc::not_polled;
    if (error.code == Errc::none) error.code = Errc::wrong_state;  // submit() has refused it before init()
    const std::string text = job->slave_text();
    Octets out(64 + text.size());
    attach::Writer into(out);
    into(error, text);
    out.resize(into.written().size());
    client.answer(Status::failed, std::move(out), now_);
}

// ------------------------------------------------------------------ AttachServer

AttachServer::AttachServer(Context& ctx, std::string path, AttachSettings settings)
    : loop_(std::make_unique<Loop>(ctx, std::move(path), std::move(settings))) {
    loop_->start();
}
AttachServer::~AttachServer() = default;
const std::string& AttachServer::error() const { return loop_->error(); }
const std::string& AttachServer::path() const { return loop_->path(); }
AttachCounts AttachServer::counts() const { return loop_->counts(); }

}  // namespace margay
