// margayd on simulated segments: start, reload, second instance, end, broken output, and ethercat beside it.
#include "gateway/gateway_client.hpp"
#include "service/service_fixture.hpp"

#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

namespace margay::process {
namespace {

TEST_F(ServiceTest, EthercatFindsTheMastersByItself) {
    if (const auto why = no_system(); !why.empty()) GTEST_SKIP() << why;
    configure("line.toml",
              "[second]\nsource = \"sim:drives\"\nnumber = 1\nstate = \"PREOP\"\n\n[first]\nsource = \"sim:demo\"\n");
    const auto ran = system_shell(
        "start; says 'first: all is right: 5 slaves in OP'; says 'second: all is right: 8 slaves in PREOP'\n"
        "ethercat slaves -m 0 && ethercat states -m 1 -p 0 PREOP && ethercat upload -m 1 -p 0 0x1018 1 && "
        "ethercat master && ethercat slaves -m 1 | head -1; ls /run/margay\n"
        "ethercat states -m 1 SAFEOP; ethercat slaves -m 1 -p 0; kill $d; wait $d; echo \"end $?\"; ls /run/margay; "
        "ethercat slaves -m 0\n");
    EXPECT_EQ(ran.status, 0) << ran.err << ran.out << content_of(folder.path() / "log");
    EXPECT_TRUE(ran.out.starts_with("0  0:0  OP  +  EtherCAT coupler\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\nMaster0\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\n0x")) << "the object 0x1018 of a drive\n" << ran.out;
    EXPECT_TRUE(contains(ran.out, "Source: sim:demo")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "Source: sim:drives")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "0  0:0  PREOP  +  Servo drive\nfirst.sock\nsecond.sock\n")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "0  0:0  SAFEOP  +  Servo drive\nend 0\n")) << ran.out;
    // Without the service, the sources of the configuration are opened.
    EXPECT_TRUE(contains(ran.out, "end 0\n0  0:0  PREOP  +  EtherCAT coupler\n")) << ran.out;
}

TEST_F(ServiceTest, AReloadConcernsTheChangedMastersOnly) {
    configure("a.toml", "source = \"sim:demo\"\n");
    configure("b.toml", "source = \"sim:demo\"\nstate = \"PREOP\"\n");
    configure("c.toml", "source = \"sim:coupler,digital_out_8\"\n");
    folder.write("new", "source = \"sim:demo\"\nstate = \"SAFEOP\"\n");
    const auto ran = shell(
        "start; says 'a: all is right'; says 'b: all is right: 5 slaves in PREOP'; says 'c: all is right: 2 slaves'\n"
        "stat -c %i run/a.sock; e a master | grep -c frames\n"
        "cp new etc/b.toml; mv etc/c.toml etc/d.toml; sed -i '1i # a remark' etc/a.toml; kill -HUP $d\n"
        "says 'configuration reloaded: 2 masters started, 3 in all'; says 'b: all is right: 5 slaves in SAFEOP'\n"
        "says 'd: all is right'; stat -c %i run/a.sock; ls run; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto log = content_of(folder.path() / "log");
    const auto first = ran.out.substr(0, ran.out.find('\n'));
    EXPECT_TRUE(contains(ran.out, "\n" + first + "\na.sock\nb.sock\nd.sock\n")) << ran.out;
    EXPECT_TRUE(contains(log, "c: ends, its configuration has changed")) << log;
    EXPECT_FALSE(contains(log, "a: ends")) << log;
    EXPECT_TRUE(contains(log, "c: all slaves in INIT")) << log;
    const auto slaves = log.find("a: 5 slaves found");
    ASSERT_NE(slaves, std::string::npos) << log;
    EXPECT_EQ(log.find("a: 5 slaves found", slaves + 1), std::string::npos) << log;
}

TEST_F(ServiceTest, AReloadWithAFolderOrAFifoKeepsTheMasters) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "start; says 'a: all is right'; mkdir etc/b.toml; kill -HUP $d; says 'etc/b.toml: is no file'\n"
        "says 1 'the masters go on with the old one'; rmdir etc/b.toml; mkfifo etc/c.toml; kill -HUP $d\n"
        "says 'etc/c.toml: is no file'; says 2 'the masters go on with the old one'; e a slaves | wc -l; stop\n");
    const auto log = content_of(folder.path() / "log");
    EXPECT_EQ(ran.status, 0) << ran.err << log;
    EXPECT_EQ(ran.out, "5\n") << ran.err;
    EXPECT_TRUE(log.find("all slaves in INIT") > log.rfind("go on with the old one")) << log;
}

// A client of the socket may request another state than the state of the configuration.
TEST_F(ServiceTest, SlavesInAnotherStateThatWasAskedForAreCounted) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "start; says 'a: all is right: 5 slaves in OP'; e a states -p 4 PREOP\n"
        "says 'a: all is right: 4 slaves in OP, 1 in another state that was asked for'; e a states -p 4 OP\n"
        "says 2 'a: all is right: 5 slaves in OP$'; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
}

TEST_F(ServiceTest, TheMailboxGatewayOfAMaster) {
    using namespace testing_gateway;
    configure("a.toml", "source = \"sim:drives\"\ngateway = { listen = \"127.0.0.1:0\" }\n");
    configure("b.toml", "source = \"sim:demo\"\ngateway = { listen = \"127.0.0.1:0\", read_only = true }\n");
    const std::string program = std::string(MARGAY_BIN_DIR) + "/margayd";
    const auto ran = shell(program + " --config etc --sockets run >out 2>>log & d=$!; echo $d >pid\n" +
                           "says 'a: all is right'; says 'b: all is right'\n");
    const auto process = std::stoi(content_of(folder.path() / "pid"));
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
    const auto log = content_of(folder.path() / "log");
    const auto port_of = [&](const std::string& master) {
        const std::string words = master + ": mailbox gateway at 127.0.0.1, port ";
        const auto at = log.find(words);
        return at == std::string::npos ? 0UL : std::stoul(log.substr(at + words.size()));
    };
    for (const char* master : {"a", "b"}) {
        const auto port = static_cast<std::uint16_t>(port_of(master));
        ASSERT_NE(port, 0) << log;
        for (const Over over : {Over::udp, Over::tcp}) {
            GatewayClient client(port, over);
            EXPECT_EQ(upload(client, 0, 0x1018, 0), octets({4}));
        }
    }
    GatewayClient drives(static_cast<std::uint16_t>(port_of("a")), Over::udp);
    EXPECT_EQ(upload(drives, 0x1001, 0x1018, 1), octets({0x47, 0x4D, 0, 0}));
    ASSERT_EQ(::kill(process, SIGTERM), 0);
    EXPECT_EQ(shell("d=" + std::to_string(process) + "; says 'b: .*INIT'; says 'a: .*INIT'").status, 0);
    std::filesystem::create_directories(folder.path() / "wrong");
    folder.write("wrong/c.toml", "source = \"sim:demo\"\ngateway = { listen = \"192.0.2.1\" }\n");
    const auto refused = shell(program + " --config wrong --sockets run");
    EXPECT_NE(refused.status, 0);
    EXPECT_TRUE(contains(refused.err, "192.0.2.1:34980 (TCP): cannot be bound")) << refused.err;
}

TEST_F(ServiceTest, AFaultyNewConfigurationIsRefused) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "start; says 'a: all is right'; echo 'nonsense = 1' >> etc/a.toml; kill -HUP $d\n"
        "says 'the new configuration is refused: the masters go on with the old one'\n"
        "e a slaves -p 0; rm etc/a.toml; kill -HUP $d; says 2 'the new configuration is refused'; e a slaves -p 1; "
        "stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "0  0:0  OP  +  EtherCAT coupler\n1  0:1  OP  +")) << ran.out;
    EXPECT_TRUE(contains(content_of(folder.path() / "log"), "a.toml: line 2: a master has no key 'nonsense'"));
}

TEST_F(ServiceTest, ASecondServiceIsRefusedAndTheFirstGoesOn) {
    configure("a.toml", "[a]\nsource = \"sim:demo\"\n[b]\nsource = \"sim:demo\"\n");
    const auto ran = shell(
        "start; says 'a: all is right'; says 'b: all is right'\n"
        "margayd 2>second; echo \"second $?\"; rm -f run/b.sock; margayd 2>third; echo \"third $?\"; e a slaves -p 0; "
        "stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "second 3\nthird 3\n0  0:0  OP  +  EtherCAT coupler\n")) << ran.out;
    const auto second = content_of(folder.path() / "second");
    EXPECT_TRUE(contains(second, "a: does not start: run/a.sock: another program serves this socket")) << second;
    // The second margayd has not accessed any segment, although one of its sockets was free.
    EXPECT_FALSE(contains(content_of(folder.path() / "third"), "found")) << content_of(folder.path() / "third");
}

// Another program uses the socket of the new master for a moment.
TEST_F(ServiceTest, AMasterThatCannotStartAtAReloadIsTriedAgain) {
    configure("a.toml", "source = \"sim:demo\"\n");
    folder.write("b", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "mkdir other; cp b other/b.toml; start; says 'a: all is right'\n" + std::string(MARGAY_BIN_DIR) +
        "/margayd --config other --sockets run 2>second & s=$!\n"
        "until grep -q 'b: all is right' second; do sleep 0.05; done\n"
        "cp b etc/b.toml; kill -HUP $d; says 'b: does not start: run/b.sock: another program serves this socket'\n"
        "says '0 of 1 master started, 1 in all; the others are tried again every 5 s'; sleep 6; kill $s; wait $s\n"
        "says 'b: starts now'; says 'b: all is right'; grep -c 'does not start' log; e b slaves -p 0; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.out, "1\n0  0:0  OP  +  EtherCAT coupler\n") << "the same reason is written once";
}

TEST_F(ServiceTest, TheSocketHasTheWantedOwnerAndPermissions) {
    if (::getuid() != 0) GTEST_SKIP() << "only root can give a file to another user";
    configure("a.toml",
              "[a]\nsource = \"sim:demo\"\nsocket = { owner = \"nobody\", group = \"daemon\", mode = \"0620\" }\n"
              "[b]\nsource = \"sim:demo\"\n"
              "[c]\nsource = \"sim:demo\"\nsocket = { read_only = true }\n");
    const auto ran = shell(
        "start; says 'a: all is right'; says 'b: all is right'; says 'c: all is right'\n"
        "stat -c '%U %G %a' run/a.sock run/b.sock; e c states PREOP; echo \"refused $?\"; e c slaves -p 0; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(ran.out.starts_with("nobody daemon 620\nroot root 660\nrefused 1\n0  0:0  OP")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "the application allows reading only")) << ran.err;
}

TEST_F(ServiceTest, AFullDiskOrAClosedStreamDoesNotStopIt) {
    configure("a.toml", "source = \"sim:drives\"\n");
    const std::string wait =
        " & d=$!; n=0; until e a slaves -p 0 2>/dev/null | grep -q OP; do sleep 0.05; n=$((n+1)); "
        "[ $n -lt 1200 ] || exit 97; done; e a upload -p 0 -t uint32 0x1018 1; stop";
    for (const std::string streams : {"2>/dev/full", "2>&-", "<&- >&- 2>&-", "2>&1 | true"}) {
        const auto ran =
            shell("m=" + std::string(MARGAY_BIN_DIR) + "/margayd\n" +
                  (contains(streams, "|") ? "mkfifo pipe; true < pipe & $m --config etc --sockets run 2>pipe"
                                          : "$m --config etc --sockets run " + streams) +
                  wait);
        EXPECT_EQ(ran.status, 0) << streams << "\n" << ran.err;
        EXPECT_TRUE(contains(ran.out, "0x")) << streams << ran.out;
    }
    EXPECT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/margayd --help > /dev/full").status, 3);
}

TEST_F(ServiceTest, ALogThatNobodyReadsKeepsNothingWaiting) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "mkfifo pipe; exec 5<>pipe\n"
        "fill() { dd if=/dev/zero of=pipe oflag=nonblock bs=1024 count=4096 2>/dev/null; }\n"
        "empty() { dd if=pipe iflag=nonblock bs=65536 count=64 2>/dev/null | tr -d '\\0'; }\n"
        "fill; " +
        std::string(MARGAY_BIN_DIR) +
        "/margayd --config etc --sockets run 2>pipe & d=$!\n"
        "n=0; until e a slaves 2>/dev/null | grep -c OP | grep -q 5; do sleep 0.05; n=$((n+1)); "
        "[ $n -lt 1200 ] || exit 97; done\n"
        "echo 'x = 1' >etc/b.toml; kill -HUP $d; sleep 1.5; e a slaves | wc -l; rm etc/b.toml; empty; kill -HUP $d\n"
        "n=0; until empty >>read; grep -q 'configuration reloaded' read; do sleep 0.05; n=$((n+1)); "
        "[ $n -lt 1200 ] || exit 96; done; cat read; fill; kill $d\n"
        "(n=0; while kill -0 $d; do sleep 0.1; n=$((n+1)); [ $n -lt 600 ] || kill -9 $d; done) 2>/dev/null & k=$!\n"
        "wait $d; echo \"end $?\"; kill $k\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(ran.out.starts_with("5\nmargayd: ")) << ran.out;
    EXPECT_TRUE(contains(ran.out, " lines of the log are lost: nothing has read them in time\nmargayd: ")) << ran.out;
    EXPECT_FALSE(contains(ran.out, "is refused")) << ran.out;
    EXPECT_TRUE(ran.out.ends_with("end 0\n")) << ran.out;
}

TEST_F(ServiceTest, TheJournalGetsPriorities) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto ran = shell(
        "export JOURNAL_STREAM=$(stat -c %d:%i log)\nstart; says 'a: all is right'; echo 'x = 1' > etc/b.toml; kill "
        "-HUP $d\n"
        "says 'is refused'; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto log = content_of(folder.path() / "log");
    EXPECT_TRUE(log.starts_with("<")) << log;
    EXPECT_TRUE(contains(log, "\n<5>a: 5 slaves found\n") || log.starts_with("<5>a: 5 slaves found\n")) << log;
    EXPECT_TRUE(contains(log, "\n<3>etc/b.toml: line 1: 'x' is no master")) << log;
    EXPECT_TRUE(contains(log, "\n<5>ends\n")) << log;
    EXPECT_FALSE(contains(log, "margayd: ")) << log;
}

TEST_F(ServiceTest, TheManagerOfServicesIsTold) {
    configure("a.toml", "source = \"sim:demo\"\n");
    const auto path = (folder.path() / "notify").string();
    const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    ASSERT_LT(path.size(), sizeof address.sun_path);
    path.copy(address.sun_path, path.size());
    ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const auto ran =
        shell("export NOTIFY_SOCKET=" + path +
              "\nstart; says 'a: all is right'; sleep 1.2; kill -HUP $d; says 'configuration reloaded'; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    std::string all;
    std::array<char, 1024> message{};
    for (ssize_t n = 0; (n = ::recv(fd, message.data(), message.size(), MSG_DONTWAIT)) > 0;)
        all += std::string(message.data(), static_cast<std::size_t>(n)) + "|";
    ::close(fd);
    EXPECT_TRUE(all.starts_with("READY=1|")) << all;
    EXPECT_TRUE(contains(all, "STATUS=a: 5 slaves in OP|")) << all;
    const auto reloading = all.find("|RELOADING=1\nMONOTONIC_USEC=");
    ASSERT_NE(reloading, std::string::npos) << all;
    EXPECT_NE(all.find("|READY=1|", reloading), std::string::npos) << all;
    EXPECT_TRUE(contains(all, "|STOPPING=1|")) << all;
}

TEST_F(ServiceTest, AnEniSaysWhatIsExpected) {
    const auto written = folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:demo --write-eni etc/machine.xml");
    ASSERT_EQ(written.status, 0) << written.err;
    configure("right.toml", "source = \"sim:demo\"\neni = \"machine.xml\"\n");
    configure("wrong.toml", "source = \"sim:coupler,digital_in_8,digital_in_8\"\neni = \"machine.xml\"\n");
    const auto ran = shell(
        "start; says 'right: all is right: 5 slaves in OP'; says 'wrong: not all is right'; e wrong slaves; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
    const auto log = content_of(folder.path() / "log");
    EXPECT_TRUE(contains(ran.out, "0  0:0  OP    +  EtherCAT coupler\n")) << ran.out << log;
    EXPECT_TRUE(contains(log, "wrong: all slaves that answer in INIT: 3\n")) << log;
    EXPECT_FALSE(contains(ran.out, "2  0:2  OP")) << "another slave than the expected one gets no outputs\n" << ran.out;
}

TEST_F(ServiceTest, EndsInTheStateOfTheConfiguration) {
    configure("a.toml", "source = \"sim:demo\"\nend_state = \"PREOP\"\n");
    const auto ran = shell("start; says 'a: all is right'; kill -INT $d; wait $d");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(content_of(folder.path() / "log"), "a: all slaves in PREOP\nmargayd: ends\n"))
        << content_of(folder.path() / "log");
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "run/a.sock"));
}

}  // namespace
}  // namespace margay::process
