// ethercat attached to a running application: the same output as on a segment of its own, what the application allows,
// and what it refuses.
#include "attach/facts.hpp"
#include "attach/socket_address.hpp"
#include "ethercat/ethercat_fixture.hpp"
#include "process/made_eni.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <thread>

namespace margay::process {
namespace {

class EthercatAttach : public EthercatTest {
  protected:
    const std::string simple_io = std::string(MARGAY_BIN_DIR) + "/simple_io";

    // Executes the commands while simple_io runs the segment. Its cycle goes on until the last command has ended.
    [[nodiscard]] Ran attached(const std::string& commands, const std::string& segment = "sim:demo") const {
        return folder.run("unset MARGAY_MASTER0\nrm -f io.txt\n" + simple_io + " " + segment +
                          " --cycles 100000000 --period 2000 --attach s.sock > io.txt 2>&1 &\nio=$!\n"
                          "n=0; until grep -qs 'all slaves in OP' io.txt; do sleep 0.05; n=$((n+1)); "
                          "[ $n -lt 1200 ] || { cat io.txt >&2; kill $io; exit 98; }; done\n"
                          "e() { " +
                          program + " \"$@\" --attach s.sock; }\n" + commands +
                          "\nresult=$?\nkill $io; wait $io\n[ ! -e s.sock ] || echo 'the socket is still there' >&2\n"
                          "exit $result");
    }
    [[nodiscard]] Ran own(const std::string& commands, const std::string& segment = "sim:demo") const {
        return folder.run("e() { " + program + " \"$@\" --source " + segment + "; }\n" + commands);
    }
};

TEST_F(EthercatAttach, CommandsPrintTheSameAsOnASegmentOfTheirOwn) {
    // A command suggests another simulated segment only when it opens a simulated segment itself. The hint is removed
    // before the comparison.
    const std::string commands =
        "without_hint() { sed 's/; --source sim:drives has slaves with one//'; }\n"
        "e slaves | sed 's/OP/PREOP/; s/PREPREOP/PREOP/'\n"
        "e pdos\n"
        "e cstruct\n"
        "e config --verbose | sed 's/SAFEOP/X/; s/OP/X/'\n"
        "e sdos -p 3 2>&1 | without_hint\n"
        "e upload -p 3 -t uint32 0x1018 1 2>&1 | without_hint\n"
        "e sii_read -p 2 --verbose\n"
        "e reg_read -p 1 -t uint16 0x10\n"
        "e crc\n"
        "e upload -p 3 0x5fff 0 2>&1 | without_hint\n"
        "e upload -p 99 0x1018 1 2>&1\n"
        "e upload -p 0 0x1018 1 2>&1 | without_hint\n"
        "e graph | sed 's/nOP/nPREOP/'\n";
    const auto alone = own(commands);
    const auto there = attached(commands + "true");
    EXPECT_EQ(there.status, 0) << there.err;
    EXPECT_EQ(there.err, "");
    EXPECT_EQ(there.out, alone.out);
    EXPECT_TRUE(contains(there.out, "EtherCAT coupler")) << there.out;
}

const std::string evil = "\x1B[31mred\x07\n";

// The slave of serve_octets() after a firmware was written: the slave is gone, or it is another device. `refuses`: the
// application refuses the requests, so nothing is written.
enum class After : std::uint8_t { refuses, gone, other };

attach::SlaveFacts slave_of(AlState state, bool written, After after) {
    attach::SlaveFacts slave{.number = 1, .ring_position = 1};
    if (after == After::refuses) {
        std::ranges::copy(evil, slave.name_text.begin());
        slave.name_bytes = static_cast<std::uint8_t>(evil.size());
        return slave;
    }
    slave.identity = {.vendor = 1, .product = 2};
    slave.al.state = state;
    slave.target = state;
    if (written && after == After::gone) slave.ring_position = 0;
    if (written && after == After::other) {
        slave.identity.product = 3;
        slave.error = {.code = Errc::other_slave, .step = Step::identify, .slave = 1};
    }
    return slave;
}

// An application that speaks the protocol and has one slave. With After::refuses it refuses each request except the
// greeting and the table of slaves. It ends after `requests` requests.
void serve_requests(int fd, unsigned requests, After after) {
    auto state = AlState::op;
    bool written = false;
    std::array<std::byte, attach::Header::kBytes> header{};
    for (;
         requests != 0 && ::recv(fd, header.data(), header.size(), MSG_WAITALL) == static_cast<ssize_t>(header.size());
         --requests) {
        const auto request = attach::Header::load(header);
        std::vector<std::byte> payload(request.bytes);
        (void)::recv(fd, payload.data(), payload.size(), MSG_WAITALL);
        const auto operation = static_cast<attach::Operation>(request.what);
        attach::Header answer{.number = request.number};
        std::vector<std::byte> octets(4096);
        attach::Writer into(octets);
        if (operation == attach::Operation::hello) {
            into(attach::kMagic, attach::kProtocolVersion, evil, evil, false, std::uint32_t{1024});
        } else if (operation == attach::Operation::slaves) {
            into(std::uint16_t{1}, std::uint16_t{1}, slave_of(state, written, after));
        } else if (after != After::refuses && operation == attach::Operation::read_registers &&
                   load_le<std::uint16_t>(payload, 2) == 0x0130) {
            into(static_cast<std::uint16_t>(state), std::uint16_t{0}, std::uint16_t{0});
        } else if (after != After::refuses &&
                   (operation == attach::Operation::read_registers || operation == attach::Operation::read_sii)) {
            into(std::uint8_t{0x5A});  // fewer octets than asked
        } else if (after != After::refuses) {
            written |= operation == attach::Operation::foe_write;
            if (operation == attach::Operation::set_target) state = written ? AlState::op : AlState::boot;
        } else {
            answer.what = static_cast<std::uint16_t>(attach::Status::refused);
            into(evil);
        }
        answer.bytes = static_cast<std::uint32_t>(into.written().size());
        answer.store(header);
        (void)::send(fd, header.data(), header.size(), MSG_NOSIGNAL);
        (void)::send(fd, into.written().data(), into.written().size(), MSG_NOSIGNAL);
    }
}

void serve_octets(int listener, unsigned connections, After after = After::refuses) {
    for (; connections != 0; --connections) {
        const int fd = ::accept(listener, nullptr, nullptr);
        serve_requests(fd, UINT_MAX, after);
        ::close(fd);
    }
}

TEST_F(EthercatAttach, TextsOfAnotherProgramHaveNoControlCharacters) {
    attach::SocketAddress address;
    ASSERT_EQ(address.set(folder.path() / "s.sock"), "");
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(listener, 4), 0);
    std::thread server([&] { serve_octets(listener, 2); });
    const auto slaves = folder.run(program + " slaves --attach s.sock");
    const auto refused = folder.run(program + " reg_read 0 2 --attach s.sock");
    server.join();
    ::close(listener);
    EXPECT_EQ(slaves.out, "0  0:0  NONE  +  ?[31mred??\n") << slaves.err;
    EXPECT_EQ(refused.err, "ethercat: ?[31mred??\n") << refused.out;
}

TEST_F(EthercatAttach, AFileThatIsWrittenIsSaidToBeWritten) {
    for (const auto& [after, text] :
         {std::pair(After::other, "came back as another one: 0x00000001:0x00000003, revision 0x00000000; it was "),
          std::pair(After::gone, "did not come back: it is not there")}) {
        const std::string socket = after == After::gone ? "gone.sock" : "other.sock";
        attach::SocketAddress address;
        ASSERT_EQ(address.set(folder.path() / socket), "");
        const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
        ASSERT_EQ(::listen(listener, 4), 0);
        std::thread server([&, after = after] { serve_octets(listener, 1, after); });
        const auto ran = folder.run("echo x > f\n" + program + " foe_write --boot f --attach " + socket);
        server.join();
        ::close(listener);
        EXPECT_EQ(ran.status, 1);
        EXPECT_TRUE(contains(ran.err, std::string("the file was written, but the slave of position 0 ") + text))
            << ran.err;
    }
}

TEST_F(EthercatAttach, AnswersWithTooFewOctetsAreRefused) {
    attach::SocketAddress address;
    ASSERT_EQ(address.set(folder.path() / "s.sock"), "");
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(listener, 4), 0);
    std::thread server([&] { serve_octets(listener, 3, After::other); });
    for (const std::string command : {"reg_read -p 0 0 2", "reg_read -p 0 -t uint16 0x10", "sii_read -p 0"}) {
        const auto ran = folder.run(program + " " + command + " --attach s.sock");
        EXPECT_EQ(ran.status, 3) << command << ": the fault is of the other program and not of a slave";
        EXPECT_EQ(ran.out, "") << command;
        EXPECT_EQ(ran.err, "ethercat: s.sock: the answer is not complete\n") << command;
    }
    server.join();
    ::close(listener);
}

TEST_F(EthercatAttach, AnApplicationThatEndsBeforeItsAnswerIsASystemError) {
    attach::SocketAddress address;
    ASSERT_EQ(address.set(folder.path() / "s.sock"), "");
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(listener, address.pointer(), address.bytes()), 0);
    ASSERT_EQ(::listen(listener, 4), 0);
    const std::vector<std::string> commands{"slaves", "reg_read -p 0 0 2", "sii_read -p 0", "alias -p 0 1"};
    std::thread server([&] {
        for (std::size_t n = 0; n < commands.size(); ++n) {
            const int fd = ::accept(listener, nullptr, nullptr);
            serve_requests(fd, 1 + n % 2, After::other);  // only the greeting, or also the table of slaves
            ::close(fd);
        }
    });
    for (const auto& command : commands) {
        const auto ran = folder.run(program + " " + command + " --attach s.sock");
        EXPECT_EQ(ran.status, 3) << command;
        EXPECT_EQ(ran.out, "") << command;
        EXPECT_EQ(ran.err, "ethercat: the application has ended the connection\n") << command;
    }
    server.join();
    ::close(listener);
}

TEST_F(EthercatAttach, ObjectsOfADriveAreTheSame) {
    const std::string commands =
        "e pdos -p 0\n"
        "e upload -p 0 0x1018 1\n"
        "e upload -p 0 0x1008 0\n"
        "e sdos -p 0\n"
        "e xml -p 0 2>&1\n";
    const auto alone = own(commands, "sim:drives");
    const auto there = attached(commands, "sim:drives");
    EXPECT_EQ(there.err, alone.err);
    EXPECT_EQ(there.out, alone.out);
    EXPECT_TRUE(contains(there.out, "0x1018")) << there.out;
    EXPECT_TRUE(contains(there.out, "<Index>#x6081</Index>")) << "the ESI has the dictionary";
    const auto written = attached("e download -p 0 0x6081 0 1234 && e upload -p 0 0x6081 0", "sim:drives");
    EXPECT_EQ(written.status, 0) << written.err;
    EXPECT_EQ(written.out, "0x000004d2 1234\n");
}

// The mailbox of a slave in INIT is closed, so its PDOs are not known. The one-line form shows no PDOs.
TEST_F(EthercatAttach, ASlaveInInitHidesNoConfiguration) {
    const auto ran = attached(
        "e states -p 1 INIT; e config; echo \"rc $?\"; e config --json >c.json; echo \"json $?\"; e config -v; "
        "echo \"rc $?\"",
        "sim:drive,drive,drive");
    EXPECT_TRUE(contains(ran.out, "  0  OP\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "  1  INIT\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "  2  OP\nrc 0\njson 0\n")) << ran.out;
    EXPECT_TRUE(contains(content_of(folder.path() / "c.json"), "\"error\": \"position 1: "));
    EXPECT_TRUE(contains(ran.out, "Attached slave: 1 (INIT)\nSM: could not be read\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "Attached slave: 2 (OP)\nSM2, Dir: Output")) << ran.out;
    EXPECT_TRUE(ran.out.ends_with("rc 1\n")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "position 1: ")) << ran.err;
}

// The ENI expects a coupler, and a group of two drives. The alias of the first drive identifies the group.
TEST_F(EthercatAttach, AHotConnectGroupThatIsAwayIsNotMissing) {
    const std::string coupler = "[[slave]]\ndevice = \"coupler\"\n";
    folder.write("away.toml", coupler);
    folder.write("there.toml", coupler + "[[slave]]\ndevice = \"drive\"\nalias = 5\n[[slave]]\ndevice = \"drive\"\n");
    folder.write("group.xml", process::eni_with_group(folder.path() / "there.toml", 3, 5, 2));
    const std::string configured = "5:0  0x00004d47/0x00005402  -  -\n5:1  0x00004d47/0x00005402  -  -\n";
    const auto ran = attached("e rescan -v && e rescan --json && e config -a 5", "sim:away.toml --eni group.xml");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.err, "");
    EXPECT_TRUE(contains(ran.out, "\"missing\": 0")) << ran.out;
    EXPECT_TRUE(ran.out.ends_with(configured)) << ran.out;
    EXPECT_EQ(out("sim:away.toml", "config -a 5 --eni group.xml"), configured);
}

TEST_F(EthercatAttach, ShowsTheProcessDataAndChangesStates) {
    const auto ran = attached(
        "e master && e domains && e data | wc -c && e states -p 3 PREOP && e slaves -p 3 && e states -p 3 OP && "
        "e slaves -p 3");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "Source: sim:demo\n  Phase: Operation\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "Domain0")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "3  0:3  PREOP  +")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "3  0:3  OP  +")) << ran.out;
}

TEST_F(EthercatAttach, ErrorCountersAreReset) {
    folder.write("errors.toml",
                 "[[slave]]\ndevice = \"digital_io_16\"\nerrors = [[1, 20, 6]]\n[[slave]]\n"
                 "device = \"digital_io_16\"\nerrors = [[0, 7, 2]]\n");
    const auto ran = attached("e crc --json >before.txt && e crc reset && e crc --json >after.txt", "sim:errors.toml");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto counters = [](unsigned crc, unsigned lost) {
        return "\"crc\": " + std::to_string(crc) + ",\n              \"phy\": 0,\n              \"forwarded\": 0,\n" +
               "              \"lost_links\": " + std::to_string(lost) + ",";
    };
    const auto before = content_of(folder.path() / "before.txt"), after = content_of(folder.path() / "after.txt");
    EXPECT_TRUE(contains(before, counters(20, 6)) && contains(before, counters(7, 2))) << before;
    EXPECT_TRUE(contains(after, counters(0, 0))) << after;
    EXPECT_FALSE(contains(after, counters(20, 6)) || contains(after, counters(7, 2))) << after;
}

TEST_F(EthercatAttach, ARescanComparesTheSlavesAndTheProcessDataGoesOn) {
    const auto ran = attached("e rescan && e rescan --verbose && e rescan --json && e slaves -p 3");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(ran.out.starts_with("5 slaves; compared with those of the application, whose process data goes on\n"))
        << "without --verbose nothing is printed\n"
        << ran.out;
    EXPECT_TRUE(contains(ran.out,
                         "\"master\": 0,\n      \"slaves\": 5,\n      \"scanned\": false,\n      \"missing\": 0,\n"
                         "      \"unused\": 0\n"))
        << ran.out;
    EXPECT_TRUE(ran.out.ends_with("3  0:3  OP  +  4-channel analogue input\n")) << ran.out;
    EXPECT_EQ(ran.err, "");
    const auto alone = own("e rescan --verbose && e rescan --json");
    EXPECT_TRUE(alone.out.starts_with("5 slaves\n")) << alone.out;
    EXPECT_TRUE(contains(alone.out, "\"scanned\": true")) << alone.out;
}

TEST_F(EthercatAttach, AnApplicationWithoutEoeHasNoPorts) {
    const std::string head = "Interface  Slave  State  RxBytes  RxRate  TxBytes  TxRate  Dropped\n";
    const auto ran = attached("e eoe && e eoe --json", "sim:eoe");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(ran.out.starts_with(head + "{")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\"interfaces\": []")) << ran.out;
}

TEST_F(EthercatAttach, WhatTheApplicationDoesNotAllowIsRefused) {
    const auto ran = attached("e debug 1; [ $? = 1 ] && e debug 2 --json; [ $? = 1 ] && e debug 3; [ $? = 2 ]");
    EXPECT_EQ(ran.status, 0) << ran.out << ran.err;
    EXPECT_TRUE(ran.err.starts_with("ethercat: the application has no messages with a level\n")) << ran.err;
    EXPECT_TRUE(contains(ran.out, "\"error\": \"the application has no messages with a level\"")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "LEVEL: '3' is no whole number from 0 to 2")) << ran.err;
    const auto both = folder.run(program + " slaves --attach s.sock --source sim:demo");
    EXPECT_EQ(both.status, 2);
    EXPECT_TRUE(contains(both.err, "--source is not for a running application")) << both.err;
    const auto nobody = folder.run(program + " slaves --attach s.sock");
    EXPECT_EQ(nobody.status, 3) << nobody.err;
    EXPECT_TRUE(contains(nobody.err, "s.sock: no application can be reached")) << nobody.err;
}

}  // namespace
}  // namespace margay::process
