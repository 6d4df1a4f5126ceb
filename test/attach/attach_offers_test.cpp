// What an application offers to clients beside facts and requests to slaves: a rescan, the level of messages, and its
// EoE ports. Also the answer to a client of another version.
#include "attach/attach_fixture.hpp"

namespace margay::testing_attach {
namespace {

class AttachOffers : public Attach {
  protected:
    struct Rescan {
        attach::Reply reply{};
        attach::RescanFacts facts{};
    };
    static Rescan rescan(Client& client) {
        Rescan got{.reply = client.call(Operation::rescan, {})};
        Reader from(got.reply.payload);
        if (got.reply.ok()) {
            from(got.facts);
            EXPECT_TRUE(from.complete());
        }
        return got;
    }
    // Executes a rescan beside the cycle. Returns the number of cycles with an error.
    int run_rescan(Rescan& got) {
        return run({[&] {
            Client client;
            ASSERT_EQ(client.connect(path), "");
            got = rescan(client);
        }});
    }
    void supervise() {
        ASSERT_TRUE(submit(ctx, supervision));
        for (int n = 0; n < 50; ++n) (void)cycle();
    }
    SuperviseRequest supervision{};
};

// ------------------------------------------------------------------ rescan

TEST_F(AttachOffers, ARescanIsRefusedUnlessTheApplicationAllowsIt) {
    Rescan got;
    EXPECT_EQ(run_rescan(got), 0);
    EXPECT_EQ(got.reply.status, Status::refused);
    EXPECT_EQ(got.reply.text, "the application does not let other programs scan its segment");
    serve({.read_only = true, .scan = AttachScan::whole});
    EXPECT_EQ(run_rescan(got), 0);
    EXPECT_EQ(got.reply.text, "the application allows reading only");
}

TEST_F(AttachOffers, ARescanBesideTheCycleComparesAndDisturbsNothing) {
    for (const auto allowed : {AttachScan::search, AttachScan::whole}) {
        serve({.scan = allowed});
        const auto mappings = ctx.group(0).mappings;
        const auto scanned = ctx.slave(4).name();
        Rescan got;
        EXPECT_EQ(run_rescan(got), 0) << "of " << cycles;
        ASSERT_TRUE(got.reply.ok()) << got.reply.text;
        EXPECT_FALSE(got.facts.whole);
        EXPECT_EQ(got.facts.slaves, 4);
        EXPECT_EQ(got.facts.missing, 0);
        EXPECT_EQ(got.facts.unused, 0);
        EXPECT_TRUE(ctx.group(0).mapped);
        EXPECT_EQ(ctx.group(0).mappings, mappings);
        EXPECT_EQ(ctx.slave(4).name(), scanned);
        expect_all_in(AlState::op);
    }
}

// A supervision is active, and four clients request only rescans.
TEST_F(AttachOffers, ClientsThatRescanAgainAndAgainLoseNoCycle) {
    serve({.scan = AttachScan::whole});
    supervise();
    std::atomic<int> well{0};
    const auto hammer = [&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        for (int n = 0; n < 10; ++n) well += rescan(client).facts.slaves == 4 ? 1 : 0;
    };
    EXPECT_EQ(run({hammer, hammer, hammer, hammer}), 0) << "of " << cycles;
    EXPECT_EQ(well, 40);
    expect_all_in(AlState::op);
    EXPECT_TRUE(supervision.busy());
    supervision.cancel();
}

// The supervision brings a lost slave back while clients ask for rescans, which need the whole segment.
TEST_F(AttachOffers, RescansDoNotKeepTheSupervisionFromItsWork) {
    serve({.scan = AttachScan::search});
    supervise();
    segment.set_power(3, false, osal.now());
    for (int n = 0; n < 200; ++n) (void)cycle();
    Rescan got;
    (void)run_rescan(got);
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_EQ(got.facts.slaves, 3);
    EXPECT_EQ(got.facts.missing, 1);
    segment.set_power(3, true, osal.now());
    std::atomic<bool> back{false};
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        for (int n = 0; n < 10'000 && !back; ++n) {
            (void)rescan(client);
            const auto reply = client.call(Operation::slaves, {.from = 4});
            Reader from(reply.payload);
            std::uint16_t all = 0;
            std::uint16_t some = 0;
            attach::SlaveFacts facts;
            from(all, some, facts);
            back = facts.number == 4 && facts.al.state == AlState::op && facts.takes_part;
        }
    }});
    EXPECT_TRUE(back);
    supervision.cancel();
}

// Without a supervision, only a rescan finds a slave that was away.
TEST_F(AttachOffers, ARescanFindsASlaveThatIsBack) {
    serve({.scan = AttachScan::search});
    segment.set_power(3, false, osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    Rescan got;
    (void)run_rescan(got);
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_EQ(got.facts.slaves, 3);
    EXPECT_EQ(got.facts.missing, 1);
    EXPECT_EQ(ctx.slave(4).al.state, AlState::none);
    segment.set_power(3, true, osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    (void)run_rescan(got);
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_EQ(got.facts.slaves, 4);
    EXPECT_EQ(got.facts.missing, 0);
    EXPECT_EQ(ctx.slave(4).al.state, AlState::init);
}

TEST_F(AttachOffers, ASlaveThatWasAddedIsCountedAndNotUsed) {
    serve({.scan = AttachScan::whole});
    plug("digital_in_8");
    segment.set_power(4, true, osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    Rescan got;
    EXPECT_EQ(run_rescan(got), 0);
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_FALSE(got.facts.whole);
    EXPECT_EQ(got.facts.slaves, 4);
    EXPECT_EQ(got.facts.unused, 1);
    EXPECT_EQ(ctx.slaves().size(), 4U);
}

// While no process data is exchanged, the application may allow a scan of the whole segment.
class AttachIdle : public AttachOffers {
  protected:
    void SetUp() override {
        plug_line({"coupler", "digital_in_8", "digital_out_8"});
        switch_on();
        ASSERT_TRUE(bring_up());
    }
    void idle() {
        for (const Time end = osal.now() + 1ms; osal.now() < end;)
            osal.wait(std::min(poll(ctx, osal.now()), end), wire.wait_handle());
    }
    Rescan run_idle() {
        std::atomic<bool> over{false};
        Rescan got;
        std::thread client([&] {
            Client one;
            EXPECT_EQ(one.connect(path), "");
            got = rescan(one);
            over = true;
        });
        while (!over) {
            idle();
            std::this_thread::yield();
        }
        client.join();
        return got;
    }
};

TEST_F(AttachIdle, IsScannedAsAWholeWhereTheApplicationAllowsIt) {
    serve({.scan = AttachScan::search});
    plug("digital_in_8");
    segment.set_power(3, true, osal.now());
    for (int n = 0; n < 20; ++n) idle();
    auto got = run_idle();
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_FALSE(got.facts.whole);
    EXPECT_EQ(got.facts.unused, 1);
    EXPECT_EQ(ctx.slaves().size(), 3U);
    serve({.scan = AttachScan::whole});
    got = run_idle();
    ASSERT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_TRUE(got.facts.whole);
    EXPECT_EQ(got.facts.slaves, 4);
    EXPECT_EQ(got.facts.unused, 0);
    EXPECT_EQ(ctx.slaves().size(), 4U);
    expect_all_in(AlState::preop);
    // With a supervision, which keeps the slaves, the rescan is a comparison again.
    ASSERT_TRUE(submit(ctx, supervision));
    for (int n = 0; n < 20; ++n) idle();
    got = run_idle();
    EXPECT_TRUE(got.reply.ok()) << words(got.reply.error);
    EXPECT_FALSE(got.facts.whole);
    EXPECT_EQ(got.facts.slaves, 4);
    supervision.cancel();
}

TEST_F(AttachIdle, ASegmentWithoutSlavesIsAnErrorInWords) {
    serve({.scan = AttachScan::whole});
    segment.disconnect({0, 0});
    const auto got = run_idle();
    EXPECT_EQ(got.reply.status, Status::failed);
    EXPECT_NE(got.reply.error.code, Errc::none);
    EXPECT_EQ(got.reply.error.slave, 0);
}

class AttachUnscanned : public AttachIdle {
  protected:
    void SetUp() override {
        plug_line({"coupler"});
        switch_on();
        ASSERT_TRUE(init(ctx, wire, osal));
    }
};

TEST_F(AttachUnscanned, TheFirstScanIsTheApplicationsOwn) {
    serve({.scan = AttachScan::search});
    const auto got = run_idle();
    EXPECT_EQ(got.reply.status, Status::refused);
    EXPECT_EQ(got.reply.text, "the application has not scanned its segment yet");
    serve({.scan = AttachScan::whole});
    EXPECT_EQ(run_idle().facts.slaves, 1);
}

// ------------------------------------------------------------------ level of messages

TEST_F(AttachOffers, TheLevelOfMessagesIsTheApplications) {
    const auto set = [&](std::uint32_t level) {
        attach::Reply reply;
        EXPECT_EQ(run({[&] {
                      Client client;
                      ASSERT_EQ(client.connect(path), "");
                      reply = client.call(Operation::set_debug_level, {.from = level});
                  }}),
                  0);
        return reply;
    };
    auto reply = set(1);
    EXPECT_EQ(reply.status, Status::refused);
    EXPECT_EQ(reply.text, "the application has no messages with a level");
    std::atomic<unsigned> level{1};
    serve({.debug_level = &level});
    for (const unsigned wanted : {2U, 0U, 1U}) {
        EXPECT_TRUE(set(wanted).ok());
        EXPECT_EQ(level, wanted);
    }
    for (const std::uint32_t wanted : {3U, 256U, 0xFFFF'FFFFU}) {
        reply = set(wanted);
        EXPECT_EQ(reply.status, Status::refused);
        EXPECT_EQ(reply.text, "the level " + std::to_string(wanted) + " is wanted, and the levels are 0, 1 and 2");
        EXPECT_EQ(level, 1U);
    }
    serve({.read_only = true, .debug_level = &level});
    EXPECT_EQ(set(2).text, "the application allows reading only");
    EXPECT_EQ(level, 1U);
}

// ------------------------------------------------------------------ EoE

class AttachEoe : public AttachOffers {
  protected:
    void SetUp() override {
        plug_line({"coupler", "eoe_gateway", "digital_in_8", "eoe_gateway"});
        switch_on();
        ASSERT_TRUE(bring_up());
        ASSERT_TRUE(config_map(ctx, image));
        ASSERT_TRUE(reach(ctx, AlState::op, 5s));
        serve({});
    }
    std::vector<attach::EoePortFacts> ports() {
        std::vector<attach::EoePortFacts> all;
        EXPECT_EQ(run({[&] {
                      Client client;
                      ASSERT_EQ(client.connect(path), "");
                      const auto reply = client.call(Operation::eoe_ports, {});
                      ASSERT_TRUE(reply.ok()) << reply.text;
                      Reader from(reply.payload);
                      std::uint32_t count = 0;
                      std::uint16_t some = 0;
                      from(count, some);
                      EXPECT_EQ(count, some);
                      for (; some != 0; --some) from(all.emplace_back());
                      EXPECT_TRUE(from.complete());
                  }}),
                  0);
        std::ranges::sort(all, {}, &attach::EoePortFacts::slave);
        return all;
    }
};

TEST_F(AttachEoe, APortHasTheSizeForWhichTheServerMakesRoom) {
    std::array<std::byte, 256> octets{};
    attach::Writer into(octets);
    into(attach::EoePortFacts{});
    EXPECT_EQ(into.written().size(), attach::EoePortFacts::kOctets);
}

TEST_F(AttachEoe, ThePortsOfTheApplicationAreShownWithTheirCounters) {
    EXPECT_TRUE(ports().empty());
    EoePortMemory<4, 4> memory{};
    EoePort second(memory);
    second.slave = 4;
    second.set_interface_name("eoe0s3");
    ASSERT_TRUE(submit(ctx, second));
    EoePortMemory<4, 4> more{};
    EoePort first(more);
    first.slave = 2;
    ASSERT_TRUE(submit(ctx, first));
    const std::vector<std::byte> frame(100);
    EXPECT_TRUE(second.send(frame));
    EXPECT_TRUE(second.send(frame));
    EXPECT_FALSE(second.send(std::span(frame).first(5)));
    for (int n = 0; n < 100; ++n) (void)cycle();
    auto all = ports();
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].slave, 2);
    EXPECT_EQ(all[0].name(), "");
    EXPECT_TRUE(all[0].open);
    EXPECT_EQ(all[0].counted.sent, 0U);
    EXPECT_EQ(all[1].slave, 4);
    EXPECT_EQ(all[1].name(), "eoe0s3");
    EXPECT_TRUE(all[1].open);
    EXPECT_EQ(all[1].counted.sent, 2U);
    EXPECT_EQ(all[1].counted.sent_octets, 200U);
    EXPECT_EQ(all[1].counted.refused, 1U);
    // When the slave is lost, the port exists, but it is not open.
    segment.set_power(3, false, osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    ASSERT_TRUE(readstate(ctx));
    std::vector<attach::EoePortFacts> after;
    (void)run({[&] {
        Client client;
        ASSERT_EQ(client.connect(path), "");
        const auto reply = client.call(Operation::eoe_ports, {});
        Reader from(reply.payload);
        std::uint32_t count = 0;
        std::uint16_t some = 0;
        from(count, some);
        for (; some != 0; --some) from(after.emplace_back());
        EXPECT_TRUE(from.complete());
    }});
    ASSERT_EQ(after.size(), 2U);
    for (const auto& port : after) EXPECT_EQ(port.open, port.slave == 2);
    first.cancel();
    second.cancel();
}

// ------------------------------------------------------------------ other versions

// The parts that no version may change: the `hello` of a client, octet by octet, and the answer that every client can
// read.
TEST_F(AttachOffers, AnotherVersionIsToldSoInBothDirections) {
    // A client of version 1, and a client of a future version, whose hello has more than two numbers.
    for (const std::uint32_t version : {1U, 77U}) {
        const std::size_t extra = version == 77 ? 5 : 0;
        std::vector<std::byte> hello(20 + extra);
        attach::Writer into(hello);
        into(static_cast<std::uint32_t>(8 + extra), std::uint32_t{1}, std::uint16_t{0}, std::uint16_t{0}, 'M', 'R', 'G',
             'Y', version);
        Raw other(path);
        ASSERT_TRUE(other.send(hello));
        std::array<std::byte, 12> header{};
        ASSERT_TRUE(other.receive(header));
        const auto answer = attach::Header::load(header);
        EXPECT_EQ(answer.number, 1U);
        EXPECT_EQ(answer.what, 2) << "refused";
        std::vector<std::byte> text(answer.bytes);
        ASSERT_TRUE(other.receive(text));
        std::string words;
        Reader from(text);
        from(words);
        EXPECT_TRUE(from.complete());
        EXPECT_EQ(words,
                  "the server speaks version 3 of the protocol, and the client version " + std::to_string(version));
    }
    EXPECT_EQ(server->counts().malformed, 0U);
    // A server of version 1. Its answer to the hello of this client is known octet by octet.
    const std::string old = folder + "/old.sock";
    attach::SocketAddress address;
    ASSERT_EQ(address.set(old), "");
    const int listener = ::socket(AF_UNIX, SOCK_STREAM, 0);
    ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(listener, 1), 0);
    std::vector<std::byte> heard(20);
    std::thread one([&] {
        const int fd = ::accept(listener, nullptr, nullptr);
        EXPECT_EQ(::recv(fd, heard.data(), heard.size(), MSG_WAITALL), 20);
        const std::string words = "the server speaks version 1 of the protocol, and the client version 3";
        std::vector<std::byte> answer(12 + 4 + words.size());
        attach::Writer into(answer);
        into(static_cast<std::uint32_t>(4 + words.size()), std::uint32_t{1}, std::uint16_t{2}, std::uint16_t{0}, words);
        EXPECT_EQ(::send(fd, answer.data(), answer.size(), MSG_NOSIGNAL), static_cast<ssize_t>(answer.size()));
        ::close(fd);
    });
    Client client;
    EXPECT_EQ(client.connect(old), old + ": the server speaks version 1 of the protocol, and the client version 3");
    one.join();
    ::close(listener);
    ::unlink(old.c_str());
    std::vector<std::byte> expected(20);
    attach::Writer into(expected);
    into(std::uint32_t{8}, std::uint32_t{1}, std::uint32_t{0}, 'M', 'R', 'G', 'Y', std::uint32_t{3});
    EXPECT_EQ(heard, expected);
}

// Clients send the new messages with every possible mistake.
TEST_F(AttachOffers, MalformedMessagesEndTheirOwnConnectionOnly) {
    std::atomic<unsigned> level{1};
    serve({.scan = AttachScan::whole, .debug_level = &level});
    constexpr Operation kNew[] = {Operation::eoe_ports, Operation::rescan, Operation::set_debug_level};
    EXPECT_EQ(run({[&] {
                  Client good;
                  ASSERT_EQ(good.connect(path), "");
                  std::array<std::byte, 64> arguments{};
                  attach::Writer into(arguments);
                  into(Arguments{.from = 2, .bytes = 0xFFFF'FFFF});
                  const auto whole = static_cast<std::uint32_t>(into.written().size());
                  unsigned sent = 0;
                  for (const auto operation : kNew) {
                      for (const std::uint32_t bytes : {0U, 1U, whole - 1, whole + 1}) {
                          Raw wrong(path);
                          ASSERT_TRUE(wrong.hello());
                          EXPECT_TRUE(wrong.message(operation, bytes, Bytes(arguments).first(bytes)));
                          EXPECT_TRUE(wrong.ended());
                          ++sent;
                      }
                      Raw vast(path);  // longer than any message except a file
                      ASSERT_TRUE(vast.hello());
                      EXPECT_TRUE(vast.message(operation, 0x0010'0000, {}));
                      EXPECT_TRUE(vast.ended());
                      ++sent;
                      Raw gone(path);  // does not wait for its answer
                      ASSERT_TRUE(gone.hello());
                      EXPECT_TRUE(gone.message(operation, whole, into.written()));
                  }
                  EXPECT_EQ(server->counts().malformed, sent);
                  EXPECT_EQ(slave_count(good), 4);
              }}),
              0);
    expect_all_in(AlState::op);
}

}  // namespace
}  // namespace margay::testing_attach
