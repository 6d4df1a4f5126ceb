// AttachServer: what clients can see and do, and that no client can disturb the cycle. The tests use virtual time. The
// thread of the owner never waits for a client, and its cycles are counted.
#include "attach/attach_fixture.hpp"
#include "attach/connection.hpp"

#include <sys/stat.h>
#include <sys/syscall.h>

#include <random>

namespace margay::testing_attach {
namespace {

TEST_F(Attach, ShowsWhatTheOwnerKnows) {
    EXPECT_EQ(run({[&] {
                  Client client;
                  ASSERT_EQ(client.connect(path), "");
                  EXPECT_EQ(client.name(), "the line");
                  EXPECT_EQ(slave_count(client), 4);
                  const auto reply = client.call(Operation::slaves, {.from = 2});
                  ASSERT_TRUE(reply.ok()) << reply.text;
                  Reader from(reply.payload);
                  std::uint16_t all = 0;
                  std::uint16_t some = 0;
                  from(all, some);
                  EXPECT_EQ(all, 4);
                  ASSERT_EQ(some, 3);
                  for (std::uint16_t n = 2; n <= 4; ++n) {
                      attach::SlaveFacts facts;
                      from(facts);
                      EXPECT_EQ(facts.number, n);
                      EXPECT_EQ(facts.al.state, AlState::op);
                      EXPECT_EQ(facts.name(), ctx.slave(n).name());
                      EXPECT_EQ(facts.station_address, 0x1000 + n);
                      EXPECT_EQ(facts.identity, ctx.slave(n).identity);
                      EXPECT_EQ(facts.parent, n - 1);
                  }
                  EXPECT_TRUE(from.complete());
              }}),
              0);
}

// The error of a held slave stays, and the facts contain it.
TEST_F(Attach, ShowsThatASlaveIsHeld) {
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .product = 0x1FF}, {.number = 3}, {.number = 4}};
    server.reset();
    ASSERT_TRUE(expect(ctx, expected));
    EXPECT_EQ(config_init(ctx).error().code, Errc::other_slave);
    EXPECT_EQ(config_map(ctx, image).error().code, Errc::other_slave);
    serve({.name = "the line"});
    ASSERT_EQ(ctx.slave(2).error.code, Errc::other_slave);
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        const auto reply = client.call(Operation::slaves, {.from = 2});
        ASSERT_TRUE(reply.ok()) << reply.text;
        Reader from(reply.payload);
        std::uint16_t all = 0;
        std::uint16_t some = 0;
        attach::SlaveFacts facts;
        from(all, some, facts);
        EXPECT_EQ(facts.number, 2);
        EXPECT_EQ(facts.error.code, Errc::other_slave);
        EXPECT_EQ(facts.error.slave, 2);
    }});
}

TEST_F(Attach, ShowsTheProcessImageOfOneCycle) {
    std::vector<std::byte> seen;
    attach::GroupFacts facts;
    EXPECT_EQ(run({[&] {
                  Client client;
                  ASSERT_EQ(client.connect(path), "");
                  const auto reply = client.call(Operation::group, {});
                  Reader from(reply.payload);
                  from(facts, seen);
                  EXPECT_TRUE(from.complete());
              }}),
              0);
    EXPECT_TRUE(facts.mapped);
    EXPECT_EQ(facts.wkc, facts.expected_wkc);
    EXPECT_EQ(facts.output_bytes, ctx.group(0).output_bytes);
    EXPECT_EQ(seen.size(), std::size_t{facts.output_bytes} + facts.input_bytes);
}

TEST_F(Attach, RegistersSiiAndObjectsByTheRequestQueue) {
    EXPECT_EQ(run({[&] {
                  Client client;
                  ASSERT_EQ(client.connect(path), "");
                  const auto state = client.call(Operation::read_registers, {.slave = 4, .index = 0x0130, .bytes = 2});
                  ASSERT_TRUE(state.ok()) << state.text;
                  EXPECT_EQ(load_le<std::uint16_t>(state.payload) & 0x0FU, 8U);
                  const auto sii = client.call(Operation::read_sii, {.slave = 4, .from = 8, .bytes = 8});
                  ASSERT_TRUE(sii.ok());
                  const auto object =
                      client.call(Operation::sdo_upload, {.slave = 4, .index = 0x1018, .subindex = 2, .bytes = 64});
                  ASSERT_TRUE(object.ok());
                  ASSERT_EQ(object.payload.size(), 4U);
                  EXPECT_EQ(load_le<std::uint32_t>(object.payload), load_le<std::uint32_t>(sii.payload, 4));
                  const auto missing = client.call(Operation::sdo_upload, {.slave = 4, .index = 0x5FFF, .bytes = 64});
                  EXPECT_EQ(missing.status, Status::failed);
                  EXPECT_EQ(missing.error.code, Errc::sdo_abort);
                  const auto nobody = client.call(Operation::read_registers, {.slave = 9, .bytes = 2});
                  EXPECT_EQ(nobody.error.code, Errc::unknown_slave);
              }}),
              0);
}

TEST_F(Attach, FourClientsHammerAndNoCycleIsLost) {
    std::atomic<int> answers{0};
    const auto hammer = [&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        for (int n = 0; n < 25; ++n) {
            for (const auto operation : {Operation::master, Operation::slaves, Operation::group, Operation::events})
                answers += client.call(operation, {}).ok() ? 1 : 0;
            answers += client.call(Operation::read_registers, {.slave = 1, .bytes = 64}).ok() ? 1 : 0;
            answers += client.call(Operation::sdo_upload, {.slave = 4, .index = 0x1008, .bytes = 64}).ok() ? 1 : 0;
        }
    };
    EXPECT_EQ(run({hammer, hammer, hammer, hammer}), 0) << "of " << cycles;
    EXPECT_EQ(answers, 4 * 25 * 6);
    EXPECT_EQ(server->counts().requests, 600U);
}

TEST_F(Attach, EventsComeInTheirOrderAndTheCallbackOfTheApplicationStays) {
    int mine = 0;
    server.reset();
    ctx.events().user = &mine;
    ctx.events().callback = [](const Event&, void* user) { ++*static_cast<int*>(user); };
    serve({});
    SuperviseRequest supervise;
    ASSERT_TRUE(submit(ctx, supervise));
    segment.set_power(3, false, osal.now());
    for (int n = 0; n < 200; ++n) (void)cycle();
    EXPECT_GT(mine, 0);
    std::uint32_t count = 0;
    std::uint64_t last = 0;
    bool lost = false;
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        const auto reply = client.call(Operation::events, {});
        Reader from(reply.payload);
        std::uint32_t dropped = 0;
        from(last, dropped, count);
        for (std::uint32_t n = 0; n < count; ++n) {
            attach::EventFacts event;
            from(event);
            EXPECT_EQ(event.number, n + 1U);
            lost |= event.kind == EventKind::lost && event.slave == 4 && !event.text.empty();
        }
        EXPECT_TRUE(from.complete());
    }});
    EXPECT_TRUE(lost);
    EXPECT_EQ(last, static_cast<std::uint64_t>(mine));
    supervise.cancel();
}

// One server replaces another server, also a server that does not serve. The new server exists before the old server
// ends.
TEST_F(Attach, ServersEndInAnyOrder) {
    int mine = 0;
    server.reset();
    ctx.events().user = &mine;
    ctx.events().callback = [](const Event&, void* user) { ++*static_cast<int*>(user); };
    auto first = std::make_unique<AttachServer>(ctx, folder + "/no/such/folder.sock");
    EXPECT_NE(first->error(), "");
    auto middle = std::make_unique<AttachServer>(ctx, folder + "/middle.sock");
    server = std::make_unique<AttachServer>(ctx, path);
    const auto exchange = [&] {
        for (int n = 0; n < 20; ++n) (void)cycle();
    };
    SuperviseRequest supervise;
    ASSERT_TRUE(submit(ctx, supervise));
    first.reset();
    exchange();
    segment.set_power(3, false, osal.now());
    middle.reset();
    for (int n = 0; n < 200; ++n) (void)cycle();
    EXPECT_GT(mine, 0);
    std::uint64_t last = 0;
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        const auto reply = client.call(Operation::events, {});
        Reader(reply.payload)(last);
    }});
    EXPECT_EQ(last, static_cast<std::uint64_t>(mine));
    server.reset();
    EXPECT_EQ(ctx.events().user, &mine);
    supervise.cancel();
}

TEST_F(Attach, ReadOnlyRefusesWhatChangesASlave) {
    serve({.read_only = true});
    EXPECT_EQ(run({[&] {
                  Client client;
                  ASSERT_EQ(client.connect(path), "");
                  EXPECT_TRUE(client.read_only());
                  for (const auto operation : {Operation::set_target, Operation::write_registers, Operation::write_sii,
                                               Operation::sdo_download, Operation::foe_write, Operation::soe_write,
                                               Operation::eoe_set_ip, Operation::rescan, Operation::set_debug_level}) {
                      const auto reply = client.call(operation, {.slave = 1, .state = AlState::init});
                      EXPECT_EQ(reply.status, Status::refused);
                      EXPECT_EQ(reply.text, "the application allows reading only");
                  }
                  EXPECT_EQ(slave_count(client), 4);
              }}),
              0);
}

TEST_F(Attach, AnotherTargetIsReachedBesideTheCycle) {
    SuperviseRequest supervise;
    ASSERT_TRUE(submit(ctx, supervise));
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        EXPECT_TRUE(client.call(Operation::set_target, {.slave = 4, .state = AlState::safeop}).ok());
    }});
    for (int n = 0; n < 500 && ctx.slave(4).al.state != AlState::safeop; ++n) (void)cycle();
    EXPECT_EQ(ctx.slave(4).al.state, AlState::safeop);
    supervise.cancel();
}

// ------------------------------------------------------------------ the socket

TEST_F(Attach, TheSocketIsForItsOwnerOnly) {
    struct stat found {};
    ASSERT_EQ(::stat(path.c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 0777U, 0600U);
    serve({.mode = 0660});
    ASSERT_EQ(::stat(path.c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 0777U, 0660U);
}

TEST_F(Attach, ASocketThatIsServedIsNotReplacedAndOneThatWasLeftBehindIs) {
    AttachServer second(ctx, path);
    EXPECT_NE(second.error().find("another program serves this socket"), std::string::npos) << second.error();
    const std::string left = folder + "/left.sock";
    attach::SocketAddress address;
    ASSERT_EQ(address.set(left), "");
    const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
    ASSERT_EQ(::bind(fd, address.pointer(), address.bytes()), 0);
    ::close(fd);
    EXPECT_EQ(AttachServer(ctx, left).error(), "");
    AttachServer nobody(ctx, folder + "/user.sock", {.owner = "no-such-user"});
    EXPECT_NE(nobody.error().find("there is no user 'no-such-user'"), std::string::npos) << nobody.error();
    EXPECT_NE(::access((folder + "/user.sock").c_str(), F_OK), 0) << "no socket that nobody serves";
    AttachServer nowhere(ctx, folder + "/no/such/folder.sock");
    EXPECT_NE(nowhere.error().find("cannot be bound"), std::string::npos) << nowhere.error();
    EXPECT_EQ(AttachServer(ctx, "").error(), "the path of the socket is empty");
    const std::string longest(107, 'a');
    EXPECT_EQ(AttachServer(ctx, longest + 'a').error(),
              longest + "a: the path has 108 octets, and the path of a socket has at most 107");
}

TEST_F(Attach, AServerBeforeInitIsAnError) {
    HostContext none({.slaves = 4});
    const std::string early = folder + "/early.sock";
    EXPECT_EQ(AttachServer(none, early).error(), early + ": there is no master yet: create the server after init()");
    EXPECT_NE(::access(early.c_str(), F_OK), 0) << "no socket";
}

// A program has given its socket to other users. After a crash it can replace the socket.
TEST_F(Attach, ASocketThatWasLeftBehindMayHaveAnyMode) {
    if (::getuid() != 0) GTEST_SKIP() << "only root can act as another user";
    ASSERT_EQ(::chmod(folder.c_str(), 0777), 0);
    std::thread([&] {
        constexpr long kNobody = 65534;
        // The system call changes the user of this thread and of the threads that it starts. The process stays root.
        ASSERT_EQ(::syscall(SYS_setresuid, kNobody, kNobody, kNobody), 0);
        const std::string left = folder + "/left.sock";
        attach::SocketAddress address;
        ASSERT_EQ(address.set(left), "");
        const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
        ASSERT_EQ(::bind(fd, address.pointer(), address.bytes()), 0);
        ASSERT_EQ(::chmod(left.c_str(), 0), 0);
        ASSERT_EQ(::listen(fd, 1), 0);
        EXPECT_EQ(AttachServer(ctx, left).error(), left + ": another program serves this socket");
        struct stat found {};
        ASSERT_EQ(::stat(left.c_str(), &found), 0);
        EXPECT_EQ(found.st_mode & 0777U, 0U) << "as it was";
        ::close(fd);
        EXPECT_EQ(AttachServer(ctx, left).error(), "");
        EXPECT_EQ(AttachServer(ctx, path).error(),
                  path + ": is a socket that does not let this user in; whether a program serves it is unknown");
    }).join();
}

TEST_F(Attach, AnOwnerThatDoesNotPollIsToldAndTheServerEnds) {
    std::thread client([&] {
        Client one;
        ASSERT_EQ(one.connect(path), "");
        EXPECT_EQ(one.call(Operation::master, {}).error.code, Errc::not_polled);
    });
    client.join();
    Client other;
    ASSERT_EQ(other.connect(path), "");
    std::thread waits([&] { EXPECT_FALSE(other.call(Operation::master, {}).ok()); });
    while (server->counts().requests < 2) std::this_thread::yield();
    server.reset();  // with a request in its queue
    waits.join();
}

// A program is stopped, for example by a debugger. The kernel accepts the connection, but no answer comes.
TEST_F(Attach, AClientThatIsNotAnsweredIsAskedWhetherItWaits) {
    const std::string silent = folder + "/silent.sock";
    attach::SocketAddress address;
    ASSERT_EQ(address.set(silent), "");
    const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
    ASSERT_EQ(::bind(fd, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(fd, 1), 0);
    Client client;
    int asked = 0;
    client.when_silent([&](std::chrono::seconds since) {
        EXPECT_GE(since.count(), asked + 1);
        return ++asked < 2;
    });
    EXPECT_EQ(client.connect(silent), silent + ": the application has not answered");
    EXPECT_EQ(asked, 2);
    // The connection has ended. The client does not read a late answer, and sends no other request.
    EXPECT_EQ(client.call(Operation::master, {}).text, "the application has not answered");
    EXPECT_EQ(asked, 2);
    const int accepted = ::accept(fd, nullptr, nullptr);
    const timeval most{.tv_sec = 10, .tv_usec = 0};
    ASSERT_EQ(::setsockopt(accepted, SOL_SOCKET, SO_RCVTIMEO, &most, sizeof(most)), 0);
    std::array<std::byte, 20> hello{};
    EXPECT_EQ(::recv(accepted, hello.data(), hello.size(), MSG_WAITALL), 20);
    EXPECT_EQ(::recv(accepted, hello.data(), hello.size(), 0), 0) << "the connection is still open, or has more";
    ::close(accepted);
    ::close(fd);
    ::unlink(silent.c_str());
}

// ------------------------------------------------------------------ hostile clients

// A stopped application, for which other clients already wait.
TEST(AttachClient, AnApplicationThatTakesNoConnectionIsNotWaitedForWithoutAWord) {
    std::string folder = "/tmp/margay-attach-XXXXXX";
    ASSERT_NE(::mkdtemp(folder.data()), nullptr);
    const std::string path = folder + "/s.sock";
    attach::SocketAddress address;
    ASSERT_EQ(address.set(path), "");
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(listener, 0), 0);
    std::vector<int> others;
    bool full = false;
    for (int n = 0; n < 100 && !full; ++n) {
        others.push_back(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
        full = ::connect(others.back(), address.pointer(), address.bytes()) != 0;
    }
    ASSERT_TRUE(full);
    Client client;
    int asked = 0;
    client.when_silent([&](std::chrono::seconds) { return ++asked < 3; });
    EXPECT_EQ(client.connect(path), path + ": the application has not answered");
    EXPECT_EQ(asked, 3);
    const auto later = client.call(Operation::master, {});
    EXPECT_EQ(later.text, "the application has not answered");
    EXPECT_TRUE(later.broken);
    // A place becomes free while the client waits.
    Client patient;
    patient.when_silent([&](std::chrono::seconds) {
        if (++asked == 5) ::close(::accept(listener, nullptr, nullptr));
        return asked < 6;  // one second later: connected, and no message is sent
    });
    const auto said = patient.connect(path);
    EXPECT_TRUE(said.ends_with("the application has not answered")) << said;
    EXPECT_EQ(asked, 6);
    for (const int fd : others) ::close(fd);
    ::close(listener);
    ::unlink(path.c_str());
    ::rmdir(folder.c_str());
}

TEST_F(Attach, WhatIsMalformedEndsItsOwnConnectionOnly) {
    EXPECT_EQ(run({[&] {
                  Client good;
                  ASSERT_EQ(good.connect(path), "");
                  std::vector<std::byte> noise(4096, std::byte{0xA5});
                  {
                      Raw http(path);
                      const std::string text = "GET / HTTP/1.1\r\n\r\n";
                      EXPECT_TRUE(http.send(std::as_bytes(std::span(text))));
                      EXPECT_TRUE(http.ended());
                      Raw unasked(path);  // an operation before hello
                      EXPECT_TRUE(unasked.message(Operation::master, 0, {}));
                      EXPECT_TRUE(unasked.ended());
                      Raw promises(path);  // announces 4 GiB and sends nothing of it
                      EXPECT_TRUE(promises.hello());
                      EXPECT_TRUE(promises.message(Operation::foe_write, 0xFFFF'FFFF, {}));
                      EXPECT_TRUE(promises.ended());
                      Raw unknown(path);
                      EXPECT_TRUE(unknown.hello());
                      EXPECT_TRUE(unknown.message(Operation::end, 0, {}));
                      EXPECT_TRUE(unknown.ended());
                      Raw lies(path);  // wrong lengths inside the payload
                      EXPECT_TRUE(lies.hello());
                      EXPECT_TRUE(lies.message(Operation::sdo_upload, 4096, noise));
                      EXPECT_TRUE(lies.ended());
                  }
                  EXPECT_EQ(server->counts().malformed, 5U);
                  EXPECT_EQ(slave_count(good), 4);
              }}),
              0);
}

TEST_F(Attach, RandomOctetsHaveNoEffect) {
    EXPECT_EQ(run({[&] {
                  std::minstd_rand numbers(7);
                  std::vector<std::byte> octets(200);
                  for (int n = 0; n < 100; ++n) {
                      Raw raw(path);
                      if (n % 4 != 0) (void)raw.hello();
                      for (auto& octet : octets) octet = static_cast<std::byte>(numbers());
                      const auto bytes = static_cast<std::uint32_t>(numbers() % octets.size());
                      // Only reading operations, because random valid messages must not write.
                      (void)raw.message(static_cast<Operation>(numbers() % 6), bytes, std::span(octets).first(bytes));
                      if (n % 3 == 0) (void)raw.send(octets);
                  }
                  Client good;
                  while (!good.connect(path).empty()) std::this_thread::yield();
                  EXPECT_EQ(slave_count(good), 4);
              }}),
              0);
}

TEST_F(Attach, AClientThatFloodsAndDoesNotReadWaitsForItself) {
    EXPECT_EQ(run({[&] {
                  Raw flood(path);
                  ASSERT_TRUE(flood.hello());
                  std::array<std::byte, 64> arguments{};
                  attach::Writer into(arguments);
                  into(Arguments{});
                  const auto bytes = static_cast<std::uint32_t>(into.written().size());
                  int sent = 0;
                  while (sent < 100'000 && flood.message(Operation::group, bytes, into.written())) ++sent;
                  EXPECT_LT(sent, 100'000) << "the server reads on without answering";
                  Client good;
                  ASSERT_EQ(good.connect(path), "");
                  for (int n = 0; n < 20; ++n) EXPECT_EQ(slave_count(good), 4);
              }}),
              0);
}

TEST_F(Attach, AClientThatGoesAwayInTheMiddleCancelsItsRequest) {
    EXPECT_EQ(run({[&] {
                  std::array<std::byte, 64> arguments{};
                  attach::Writer into(arguments);
                  into(Arguments{.slave = 4, .index = 0x1008, .bytes = 64});
                  const auto bytes = static_cast<std::uint32_t>(into.written().size());
                  for (int n = 0; n < 50; ++n) {
                      Raw gone(path);
                      if (!gone.hello()) continue;  // all places are in use for a moment
                      EXPECT_TRUE(gone.message(Operation::sdo_upload, bytes, into.written()));
                      Raw half(path);
                      if (half.hello()) {
                          EXPECT_TRUE(half.message(Operation::sdo_upload, bytes, Bytes(arguments).first(5)));
                      }
                  }
                  Client good;
                  while (!good.connect(path).empty()) std::this_thread::yield();
                  EXPECT_EQ(slave_count(good), 4);
              }}),
              0);
}

TEST_F(Attach, MoreClientsThanPlacesAreToldSo) {
    serve({.clients = 2});
    EXPECT_EQ(run({[&] {
                  Client first;
                  Client second;
                  Client third;
                  ASSERT_EQ(first.connect(path), "");
                  ASSERT_EQ(second.connect(path), "");
                  EXPECT_NE(third.connect(path).find("all 2 connections are in use"), std::string::npos);
                  EXPECT_EQ(slave_count(first), 4);
              }}),
              0);
    EXPECT_EQ(server->counts().refused, 1U);
}

// When a server is full: which client loses its place to a new client, and when.
TEST(AttachPlaces, AreOfThoseWhoUseThem) {
    using attach::Connection;
    const attach::Moment begin{100s};
    std::vector<std::unique_ptr<Connection>> clients;
    std::vector<int> ends;
    for (int n = 0; n < 3; ++n) {
        int pair[2];
        ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
        ends.push_back(pair[1]);
        clients.push_back(std::make_unique<Connection>(pair[0], 4096, begin + 1s * n));
    }
    const auto octet = [&](std::size_t n, attach::Moment at) {
        EXPECT_EQ(::send(ends[n], "\10", 1, MSG_NOSIGNAL), 1);
        EXPECT_EQ(clients[n]->receive(at), Connection::Came::nothing);
    };
    EXPECT_EQ(attach::who_gives_way(clients, begin + 4900ms), 3u);
    EXPECT_EQ(attach::who_gives_way(clients, begin + 5s), 0u);
    // The oldest client has a request, so it keeps its place. The server tries the next client.
    std::string refusal;
    clients[0]->job = attach::make_job(Operation::master, {}, {}, refusal);
    ASSERT_NE(clients[0]->job, nullptr) << refusal;
    EXPECT_EQ(attach::who_gives_way(clients, begin + 5900ms), 3u);
    EXPECT_EQ(attach::who_gives_way(clients, begin + 6s), 1u);
    // A client that sends a message octet by octet keeps its place for 10 s, even if the last octet has just arrived.
    for (int n = 0; n < 9; ++n) octet(1, begin + 6s + 1s * n);
    octet(2, begin + 15s);
    EXPECT_EQ(attach::who_gives_way(clients, begin + 16s), 3u);
    octet(1, begin + 16s);
    EXPECT_EQ(attach::who_gives_way(clients, begin + 16001ms), 1u);
    for (const int end : ends) ::close(end);
}

TEST_F(Attach, ATransferBeyondTheLimitIsRefused) {
    serve({.transfer_bytes = 1000});
    EXPECT_EQ(run({[&] {
                  Client client;
                  ASSERT_EQ(client.connect(path), "");
                  const auto reply = client.call(Operation::sdo_upload, {.slave = 4, .index = 0x1008, .bytes = 1001});
                  EXPECT_EQ(reply.text, "1001 octets are wanted, and the server transfers at most 1000");
              }}),
              0);
}

}  // namespace
}  // namespace margay::testing_attach
