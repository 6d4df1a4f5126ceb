// margayd on an interface: a segment that appears later, an interface that comes and goes, slaves without power,
// another master, a service that was killed, EoE. The segment is virtual_segment at the other end of a cable.
#include "process/made_eni.hpp"
#include "process/netns.hpp"
#include "service/service_fixture.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cctype>
#include <csignal>
#include <fstream>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

constexpr auto kServicePatience = 60s;

class ServiceOnCable : public ServiceTest {
  protected:
    Cable cable;
    int commands = -1;
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";

    void SetUp() override {
        ServiceTest::SetUp();
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        ASSERT_EQ(::mkfifo(file("commands").c_str(), 0600), 0);
        commands = ::open(file("commands").c_str(), O_RDWR | O_CLOEXEC);
        ASSERT_GE(commands, 0);
    }
    ~ServiceOnCable() override {
        if (commands >= 0) ::close(commands);
    }
    [[nodiscard]] std::string file(const std::string& name) const { return folder.path() / name; }

    [[nodiscard]] std::unique_ptr<Child> segment(const std::string& what = "demo") const {
        auto child = std::make_unique<Child>(
            cable.segment_namespace(), std::vector<std::string>{"/bin/sh", "-c",
                                                                "exec " + bin + "virtual_segment " + Cable::kSegment +
                                                                    " " + what + " < " + file("commands")});
        EXPECT_TRUE(child->says("serving", kServicePatience)) << child->output() << child->errors();
        return child;
    }
    void command(const std::string& text) const {
        const auto line = text + "\n";
        ASSERT_EQ(::write(commands, line.data(), line.size()), static_cast<ssize_t>(line.size()));
    }
    // margayd, with its log on standard output for says(). `by`: a command that starts margayd.
    [[nodiscard]] std::unique_ptr<Child> service(const std::string& by = {}) const {
        const auto command = by + bin + "margayd --config " + file("etc") + " --sockets " + file("run");
        return std::make_unique<Child>(cable.master_namespace(),
                                       std::vector<std::string>{"/bin/sh", "-c", "exec " + command + " 2>&1"});
    }
    static void expect_says(Child& child, const std::string& text) {
        EXPECT_TRUE(child.says(text, kServicePatience)) << "never: " << text << "\n" << child.output();
    }
    [[nodiscard]] std::string slaves() const {
        const auto ran = folder.run(bin + "ethercat slaves --attach run/a.sock");
        EXPECT_EQ(ran.status, 0) << ran.err;
        return ran.out;
    }
    void configure_cable(const std::string& more = {}) const {
        configure("a.toml", "source = \"" + std::string(Cable::kMaster) + "\"\n" + more);
    }
};

TEST_F(ServiceOnCable, WaitsForTheSegmentAndKeepsItUp) {
    configure_cable();
    auto margayd = service();
    expect_says(*margayd, "margayd: a: waiting: no slave answers\n");
    EXPECT_EQ(slaves(), "");
    for (const std::string what : {"states OP", "alias 5", "crc reset"}) {
        const auto none = folder.run(bin + "ethercat " + what + " --attach run/a.sock");
        EXPECT_EQ(none.status, 1) << what << ": nothing was done";
        EXPECT_TRUE(contains(none.err, ": master 0 has no slave\n")) << none.err;
    }
    auto demo = segment();
    expect_says(*margayd, "a: 5 slaves found");
    expect_says(*margayd, "a: all is right: 5 slaves in OP");

    // In the namespace of the interface, `master` shows the interface of the service.
    Child there(cable.master_namespace(), {bin + "ethercat", "master", "--attach", file("run/a.sock")});
    EXPECT_EQ(there.wait(kServicePatience), 0) << there.errors();
    EXPECT_TRUE(contains(there.output(), "    Main: ") && contains(there.output(), "      Link: UP\n"))
        << there.output();
    const auto elsewhere = folder.run(bin + "ethercat master --attach run/a.sock");
    EXPECT_TRUE(contains(elsewhere.out, "  Ethernet devices:\n  Frames: ")) << elsewhere.out;

    command("power off 3");
    expect_says(*margayd, "a: not all is right: slave 3");
    // After lost frames, margayd compares the identity of each slave again. Until then the slave has an error.
    const auto others_go_on = [&] {
        return contains(folder.run(bin + "ethercat slaves --attach run/a.sock").out, "1  0:1  OP  +");
    };
    for (int n = 0; n < 1200 && !others_go_on(); ++n) std::this_thread::sleep_for(50ms);
    EXPECT_TRUE(others_go_on()) << margayd->output();
    command("power on 3");
    EXPECT_TRUE(demo->says("slave 3", kServicePatience));
    const auto right_again = [&] {
        const auto log = margayd->output();
        const auto wrong = log.find("not all is right: slave 3");
        return log.find("all is right: 5 slaves in OP", wrong + 20) != std::string::npos;
    };
    for (int n = 0; n < 1200 && !right_again(); ++n) std::this_thread::sleep_for(50ms);
    EXPECT_TRUE(right_again()) << margayd->output();

    // The whole segment loses its power: its process ends, and another process with the same slaves starts.
    const auto before = margayd->output().size();  // on a busy machine, frames were late before as well
    demo.reset();
    expect_says(*margayd, "no frame");
    demo = segment();
    // The states that the service shows are old until the service has read them again.
    const auto up_again = [&] {
        const auto log = margayd->output();
        const auto lost = log.find("slave 5: lost", before);
        return lost != std::string::npos && log.find("slave 5: recovered, in OP", lost) != std::string::npos;
    };
    for (int n = 0; n < 1200 && !up_again(); ++n) std::this_thread::sleep_for(50ms);
    EXPECT_TRUE(up_again()) << margayd->output();
    EXPECT_TRUE(contains(slaves(), "4  0:4  OP  +"));

    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_TRUE(demo->says("slave 1 (coupler): INIT", kServicePatience)) << demo->output();
    EXPECT_TRUE(contains(margayd->output(), "a: all slaves in INIT\nmargayd: ends\n")) << margayd->output();
}

// States that were read before the silence are no answer.
TEST_F(ServiceOnCable, ASilentSegmentIsInNoState) {
    configure_cable("cycle_us = 20000\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    EXPECT_EQ(folder.run(bin + "ethercat states OP --attach run/a.sock").status, 0);
    command("break 1");
    expect_says(*margayd, "a: not all is right: ");
    std::this_thread::sleep_for(2s);
    const auto states = folder.run(bin + "ethercat states OP --attach run/a.sock");
    EXPECT_EQ(states.status, 1) << states.out << states.err;
    EXPECT_NE(states.err, "");
    EXPECT_NE(folder.run(bin + "ethercat slaves --attach run/a.sock").err, "") << "a warning";
    command("heal all");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

// margayd cannot bring silent slaves to INIT, but no other master uses them. margayd brings the slaves up when they
// answer again, after a reload and after a new start.
TEST_F(ServiceOnCable, SlavesThatDidNotAnswerAtTheEndAreItsOwn) {
    configure_cable("cycle_us = 20000\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    command("break 1");
    expect_says(*margayd, "a: not all is right: ");
    configure_cable("cycle_us = 21000\n");
    margayd->send(SIGHUP);
    expect_says(*margayd, "a: slave 1 (EtherCAT coupler) is left in OP, not in INIT");
    expect_says(*margayd, "configuration reloaded: 1 master started");
    margayd->terminate();  // the new master has found no slave, and knows only what the old master knew
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    margayd = service();
    expect_says(*margayd, "a: waiting: no slave answers");
    command("heal all");
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    EXPECT_FALSE(contains(margayd->output(), "another master")) << margayd->output();
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_EQ(folder.run("ls run").out, "") << "nothing is left: all slaves are in INIT";
}

// After a killed margayd, the next margayd finds no slave and ends. The third margayd still knows the slaves as its
// own.
TEST_F(ServiceOnCable, SlavesOfAKilledServiceAreItsOwnAlsoAfterOneThatFoundNone) {
    configure_cable("cycle_us = 20000\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    margayd->send(SIGKILL);
    (void)margayd->wait(kServicePatience);
    command("break 1");
    margayd = service();
    expect_says(*margayd, "a: waiting: no slave answers");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    margayd = service();
    expect_says(*margayd, "a: waiting: no slave answers");
    command("heal all");
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    EXPECT_FALSE(contains(margayd->output(), "another master")) << margayd->output();
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

TEST_F(ServiceOnCable, SlavesThatWereLeftInSafeopAreItsOwnAlsoWithAnotherEndState) {
    configure_cable("cycle_us = 20000\nend_state = \"SAFEOP\"\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    configure_cable("cycle_us = 20000\nstate = \"SAFEOP\"\n");
    margayd->send(SIGHUP);
    expect_says(*margayd, "a: all slaves in SAFEOP");
    expect_says(*margayd, "a: all is right: 5 slaves in SAFEOP");
    EXPECT_FALSE(contains(margayd->output(), "another master")) << margayd->output();
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_EQ(folder.run("ls run").out, "") << "nothing is left: all slaves are in INIT";
}

// Like `systemctl stop` and `systemctl start`: the folder of the sockets is deleted with all marks.
TEST_F(ServiceOnCable, AStopAndAStartNeedNoHand) {
    auto demo = segment();
    for (const std::string end : {"INIT", "SAFEOP"}) {
        configure_cable("cycle_us = 20000\nend_state = \"" + end + "\"\n");
        for (int start = 0; start < 2; ++start) {
            auto margayd = service();
            expect_says(*margayd, "a: all is right: 5 slaves in OP");
            margayd->terminate();
            EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
            EXPECT_TRUE(contains(margayd->output(), "a: all slaves in " + end + "\n")) << margayd->output();
            ASSERT_EQ(folder.run("rm -r run").status, 0);
        }
    }
}

// No frame comes back at the end of margayd, for 0.3 s: far less than the time limit at the end.
TEST_F(ServiceOnCable, AnOutageAtTheEndLeavesNoSlaveInOp) {
    configure_cable("cycle_us = 20000\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    command("drop 1");
    std::this_thread::sleep_for(100ms);
    margayd->terminate();
    std::this_thread::sleep_for(300ms);
    command("drop 0");
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_TRUE(contains(margayd->output(), "a: all slaves in INIT\nmargayd: ends\n")) << margayd->output();
}

// A client removes the outputs of slave 2, and the segment is mapped without these outputs. After a loss of power the
// slave has the outputs again.
TEST_F(ServiceOnCable, ASlaveThatComesBackWithOtherPdosLeadsToANewScan) {
    configure_cable("cycle_us = 20000\n");
    auto drives = segment("drives");
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 8 slaves in OP");
    const auto ethercat = [&](const std::string& words) {
        return folder.run(bin + "ethercat " + words + " --attach run/a.sock").status;
    };
    const auto right_after = [&](const std::string& text, std::size_t from) {
        const auto at = margayd->output().find(text, from);
        return at != std::string::npos &&
               margayd->output().find("a: all is right: 8 slaves in OP", at) != std::string::npos;
    };
    ASSERT_EQ(ethercat("states PREOP -p 1"), 0);
    ASSERT_EQ(ethercat("download -p 1 -t uint8 0x1c12 0 0"), 0);
    (void)ethercat("states OP -p 1");  // the slave does not fit the image before the scan
    for (int n = 0; n < 1200 && !right_after("scanned again", 0); ++n) std::this_thread::sleep_for(50ms);
    ASSERT_TRUE(right_after("scanned again", 0)) << margayd->output();
    const auto from = margayd->output().size();
    command("power off 2");
    std::this_thread::sleep_for(500ms);
    command("power on 2");
    for (int n = 0; n < 1200 && !right_after("scanned again", from); ++n) std::this_thread::sleep_for(50ms);
    EXPECT_TRUE(right_after("scanned again", from)) << margayd->output();
}

TEST_F(ServiceOnCable, AnInterfaceMayBeMissingOffOrRemoved) {
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link del ") + Cable::kMaster));
    configure_cable();
    auto margayd = service();
    expect_says(*margayd, std::string("a: waiting: there is no interface \"") + Cable::kMaster + "\"");
    const auto add = [&] {
        // Both ends are new. The end of the master is down: margayd sets it up.
        ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link add ") + Cable::kMaster +
                                                           " type veth peer name " + Cable::kSegment + " netns " +
                                                           cable.segment_namespace()));
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("link set ") + Cable::kSegment + " up"));
    };
    add();
    auto demo = segment();
    expect_says(*margayd, "a: all is right: 5 slaves in OP");
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link del ") + Cable::kMaster));
    expect_says(*margayd, "a: not all is right: ");
    demo.reset();
    add();
    demo = segment();
    // While the segment is silent, `slaves` ends with an error.
    const auto up_again = [&] {
        return contains(folder.run(bin + "ethercat slaves --attach run/a.sock").out, "4  0:4  OP  +");
    };
    for (int n = 0; n < 1200 && !up_again(); ++n) std::this_thread::sleep_for(50ms);
    EXPECT_TRUE(up_again()) << margayd->output();
    // After some seconds the error that is reported is not the error of the interface.
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link del ") + Cable::kMaster));
    std::this_thread::sleep_for(4s);
    demo.reset();
    add();
    demo = segment();
    EXPECT_TRUE(demo->says("slave 5 (setting): OP", kServicePatience)) << demo->output() << margayd->output();
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

TEST_F(ServiceOnCable, SlavesThatAreAddedAreScannedWithoutAnEni) {
    configure_cable("state = \"PREOP\"\n");
    auto demo = segment();
    command("break 3");
    EXPECT_TRUE(demo->says("slave 3 is broken", kServicePatience)) << demo->output();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 2 slaves in PREOP");
    command("heal 3");
    expect_says(*margayd, "slaves were added or exchanged: the segment is scanned again");
    expect_says(*margayd, "a: all is right: 5 slaves in PREOP");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

// The slave before the clocks is in OP meanwhile, and stays in OP.
TEST_F(ServiceOnCable, TheClocksAreMeasuredWhenTheReferenceClockGetsItsPower) {
    folder.write("etc/machine.xml", clocked_eni("sim:coupler,drive,drive", 3, 10ms, 2));
    configure_cable("eni = \"machine.xml\"\n");
    auto line = segment("coupler,drive,drive");
    command("power off 2");
    EXPECT_TRUE(line->says("slave 2 ", kServicePatience)) << line->output();
    auto margayd = service();
    expect_says(*margayd, "a: slave 2: synchronising the clocks: the slave is missing");
    expect_says(*margayd, "a: slave 1: SAFEOP to OP");
    command("power on 2");
    expect_says(*margayd, "a: all is right: 3 slaves in OP");
    EXPECT_FALSE(contains(margayd->output(), "a: slave 1: OP to ")) << margayd->output();
    EXPECT_FALSE(contains(margayd->output(), "configdc()")) << margayd->output();
    EXPECT_EQ(folder.run(bin + "ethercat reg_read -p 2 -t uint8 0x0981 --attach run/a.sock").out, "0x03 3\n");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

TEST_F(ServiceOnCable, SlavesInInitAreMappedBeforeAndHaveNoError) {
    configure_cable("state = \"INIT\"\n");
    auto demo = segment();
    auto margayd = service();
    expect_says(*margayd, "a: all is right: 5 slaves in INIT");
    EXPECT_FALSE(contains(margayd->output(), "not possible")) << margayd->output();
    EXPECT_FALSE(contains(margayd->output(), "asked for")) << "nobody has asked: " << margayd->output();
    EXPECT_FALSE(contains(slaves(), "  E  ")) << slaves();
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

TEST_F(ServiceOnCable, LeavesASegmentToItsMasterAndTakesBackItsOwn) {
    configure_cable();
    auto demo = segment();
    {
        Child other(cable.master_namespace(),
                    {bin + "simple_io", Cable::kMaster, "--cycles", "100000000", "--period", "2000"});
        ASSERT_TRUE(other.says("all slaves in OP", kServicePatience)) << other.output() << other.errors();
        auto margayd = service();
        expect_says(*margayd,
                    "slaves of this segment are in SAFEOP or OP (5 slaves answer): another master may be running");
        EXPECT_FALSE(other.ended());
        EXPECT_FALSE(contains(margayd->output(), "slaves found")) << margayd->output();
        other.terminate();
        EXPECT_GE(other.wait(kServicePatience), 0) << other.errors();  // 1 if it has missed a cycle
        expect_says(*margayd, "a: all is right: 5 slaves in OP");
        // The destructor kills margayd: the slaves stay in OP or SAFEOP, and the socket stays.
    }
    EXPECT_TRUE(std::filesystem::exists(file("run/a.sock")));
    auto again = service();
    expect_says(*again, "a: all is right: 5 slaves in OP");
    EXPECT_FALSE(contains(again->output(), "another master")) << again->output();
    again->terminate();
    EXPECT_EQ(again->wait(kServicePatience), 0) << again->output();
}

TEST_F(ServiceOnCable, SlavesWithEoeGetInterfaces) {
    if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "no TAP devices here: /dev/net/tun is missing";
    configure_cable("state = \"PREOP\"\neoe = [{ position = 1, name = \"gw-of-line\" }]\n");
    auto gateways = segment("eoe --ports gw");
    auto margayd = service();
    expect_says(*margayd, "a: interface gw-of-line: slave 2 (Gateway with EoE)");
    expect_says(*margayd, "a: all is right");
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "addr add 192.168.78.1/24 dev gw-of-line"));
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), "addr add 192.168.78.2/24 dev gw1"));
    // The kernel at the other end refuses the connection, so frames have passed in both directions.
    Cable::inside(cable.master_namespace(), [] {
        const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        const timeval patience{20, 0};
        ASSERT_EQ(::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience), 0);
        sockaddr_in to{};
        to.sin_family = AF_INET;
        to.sin_port = htons(5);
        ASSERT_EQ(::inet_pton(AF_INET, "192.168.78.2", &to.sin_addr), 1);
        EXPECT_NE(::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
        EXPECT_EQ(errno, ECONNREFUSED) << std::strerror(errno);
        ::close(fd);
    });
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_TRUE(contains(margayd->output(), "a: gw-of-line: to the slave ")) << margayd->output();
    std::string gone;
    EXPECT_FALSE(run("ip -n " + cable.master_namespace() + " link show gw-of-line", &gone)) << gone;
}

// With an ENI. Without an ENI, the slaves of a scan have their interfaces from the start.
TEST_F(ServiceOnCable, ASlaveThatComesLaterGetsItsInterface) {
    if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "no TAP devices here: /dev/net/tun is missing";
    ASSERT_EQ(folder.run(bin + "slaveinfo sim:eoe --write-eni etc/machine.xml").status, 0);
    configure_cable("state = \"PREOP\"\neni = \"machine.xml\"\neoe = true\n");
    auto gateways = segment("eoe");
    command("power off 3");
    EXPECT_TRUE(gateways->says("slave 3 is off", kServicePatience)) << gateways->output();
    auto margayd = service();
    expect_says(*margayd, "a: interface eoe0s1: slave 2 (Gateway with EoE)");
    expect_says(*margayd, "a: not all is right: slave 3");
    EXPECT_FALSE(contains(margayd->output(), "interface eoe0s2")) << margayd->output();
    command("power on 3");
    expect_says(*margayd, "a: interface eoe0s2: slave 3 (Gateway with EoE)");
    EXPECT_TRUE(cable.ip(cable.master_namespace(), "link show eoe0s2"));
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_TRUE(contains(margayd->output(), "a: eoe0s2: to the slave ")) << margayd->output();
}

// The slave does not leave INIT at the start: its mailbox is closed when margayd opens the interfaces, and when margayd
// looks for late slaves.
TEST_F(ServiceOnCable, ASlaveInInitGetsItsInterfaceWhenItIsInPreop) {
    if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "no TAP devices here: /dev/net/tun is missing";
    ASSERT_EQ(folder.run(bin + "slaveinfo sim:eoe --write-eni etc/machine.xml").status, 0);
    configure_cable("state = \"PREOP\"\neni = \"machine.xml\"\neoe = true\n");
    auto gateways = segment("eoe");
    command("hang 3");
    EXPECT_TRUE(gateways->says("the firmware of slave 3 hangs", kServicePatience)) << gateways->output();
    auto margayd = service();
    expect_says(*margayd, "a: interface eoe0s1: slave 2 (Gateway with EoE)");
    expect_says(*margayd, "a: not all is right: slave 3");
    EXPECT_FALSE(contains(margayd->output(), "interface eoe0s2")) << margayd->output();
    command("power off 3");
    EXPECT_TRUE(gateways->says("slave 3 is off", kServicePatience)) << gateways->output();
    command("power on 3");
    expect_says(*margayd, "a: interface eoe0s2: slave 3 (Gateway with EoE)");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
}

// As systemd starts margayd by the unit: a user without root rights, and only these capabilities.
TEST_F(ServiceOnCable, TheCapabilitiesOfTheUnitAreEnough) {
    if (folder.run("command -v setpriv").status != 0) GTEST_SKIP() << "setpriv is not installed";
    const auto unit = content_of(std::string(MARGAY_SOURCE_DIR) + "/samples/margayd/install/margayd.service.in");
    const std::string key = "\nCapabilityBoundingSet=CAP_";
    auto words = unit.substr(unit.find(key) + key.size());
    words.resize(words.find('\n'));
    std::string capabilities = "-all,+";
    for (std::size_t at = 0; at < words.size(); ++at)
        if (words.compare(at, 5, " CAP_") == 0) {
            capabilities += ",+";
            at += 4;
        } else {
            capabilities += static_cast<char>(std::tolower(words[at]));
        }
    EXPECT_EQ(capabilities, "-all,+net_raw,+net_admin,+chown");
    const std::string by =
        "setpriv --reuid=nobody --regid=nogroup --clear-groups --no-new-privs --bounding-set=" + capabilities +
        " --inh-caps=" + capabilities + " --ambient-caps=" + capabilities + " ";
    const auto ready = folder.run("chmod 755 . && mkdir run && chown nobody run && " + by + bin + "margayd --version");
    if (ready.status != 0) GTEST_SKIP() << "the user nobody cannot execute programs of this folder: " << ready.err;
    ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("link set ") + Cable::kMaster + " down"));
    // systemd permits all users to write to this device. Some containers do not.
    const bool eoe = folder.run("setpriv --reuid=nobody --clear-groups test -w /dev/net/tun").status == 0;
    configure_cable(std::string(eoe ? "eoe = true\n" : "") +
                    "socket = { owner = \"daemon\", group = \"daemon\", mode = \"0620\" }\n");
    auto gateways = segment("eoe --ports gw");
    auto margayd = service(by);
    if (eoe) expect_says(*margayd, "a: interface eoe0s1: slave 2 (Gateway with EoE)");
    expect_says(*margayd, "a: all is right");
    EXPECT_EQ(folder.run("stat -c '%U %G %a' run/a.sock").out, "daemon daemon 620\n");
    margayd->terminate();
    EXPECT_EQ(margayd->wait(kServicePatience), 0) << margayd->output();
    EXPECT_FALSE(contains(margayd->output(), "ermi")) << "nothing was not permitted\n" << margayd->output();
    EXPECT_FALSE(std::filesystem::exists(file("run/a.sock")));
}

}  // namespace
}  // namespace margay::process
