// The configuration of margayd: what is accepted, and each error with its file and line.
#include "process/made_eni.hpp"
#include "service/service_fixture.hpp"

namespace margay::process {
namespace {

using ServiceConfigurationTest = ServiceTest;

TEST_F(ServiceConfigurationTest, EachErrorIsNamedByFileAndLine) {
    configure(
        "a.toml",
        "source = \"eth0\"\n"
        "cycle_us = 10\n"
        "state = \"RUN\"\n"
        "end_state = \"OP\"\n"
        "sorce = 1\n"
        "eni = \"nowhere.xml\"\n"
        "tolerate = [\"all\"]\n"
        "socket = { mode = \"0888\", owner = \"no-such-user\", group = \"no-such-group\", path = \"x\", colour = 1 }\n"
        "eoe = [{ position = 1, alias = 2 }, { name = \"a name that is too long\" }]\n"
        "gateway = { listen = \"[nowhere\" }\n"
        "number = 64\n"
        "take_over = \"yes\"\n"
        "priority = 100\n"
        "debug = 3\n");
    configure("b.toml", "[one]\nsource = \"sim:nosuch\"\n\n[two]\n\n[three]\nsource = \"pcap:x.pcap\"\n");
    configure("c.toml", "source = \"sim:demo\"\nstate = \"OP\n");
    configure("d.toml", "x = 1\n");
    configure("e.toml", "");
    configure("g.toml",
              "[six]\nsource = \"sim:demo\"\ngateway = { listen = \"localhost:34980\" }\n"
              "[seven]\nsource = \"sim:demo\"\ngateway = { listen = \"1.2.3.400:5\" }\n"
              "[eight]\nsource = \"sim:demo\"\ngateway = { listen = \"[::1]:0\" }\n");
    configure("f.toml", "[four]\nsource = \"eth0+eth0\"\n[five]\nsource = \"a-name-that-is-too-long\"\n");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 2);
    EXPECT_EQ(ran.out, "");
    for (const std::string text :
         {"a.toml: line 2: 'cycle_us' is 10, it must be from 50 to 1000000",
          "a.toml: line 3: 'state' is \"RUN\", it must",
          "a.toml: line 4: 'end_state' is \"OP\", it must be one of INIT, PREOP, SAFEOP\n",
          "a.toml: line 5: a master has no key 'sorce'; its keys are: source, number, eni, cycle_us, ",
          "a.toml: line 6: ",
          "a.toml: line 7: 'tolerate' has \"missing\", \"other\" and \"unexpected\" only",
          "a.toml: line 8: 'mode' is \"0888\", it must be octal",
          "a.toml: line 8: there is no user 'no-such-user'",
          "a.toml: line 8: there is no group 'no-such-group'",
          "a.toml: line 8: 'path' must begin with '/'",
          "a.toml: line 8: 'socket' has no key 'colour'; its keys are: path, owner",
          "a.toml: line 9: an element of 'eoe' has either `position` or `alias`",
          "a.toml: line 9: 'a name that is too long' is no name of an interface",
          "a.toml: line 10: '[nowhere' is no ADDRESS:PORT",
          "a.toml: line 11: 'number' is 64, it must be from 0 to 63",
          "a.toml: line 12: 'take_over' must be true or false",
          "a.toml: line 13: 'priority' is 100",
          "a.toml: line 14: 'debug' is 3, it must be from 0 to 2",
          "b.toml: line 2: sim:nosuch: ",
          "b.toml: line 4: the master 'two' has no `source`",
          "b.toml: line 7: a recording cannot be run by a service",
          "c.toml: line 2: ",
          "d.toml: line 1: 'x' is no master",
          "e.toml: line ",
          "g.toml: line 3: 'localhost' is no IP address in digits",
          "g.toml: line 6: '1.2.3.400' is no IP address in digits",
          "f.toml: line 2: 'eth0+eth0': both interfaces are the same",
          "f.toml: line 4: 'a-name-that-is-too-long' is no name of an interface"})
        EXPECT_TRUE(contains(ran.err, text)) << text << "\n" << ran.err;
    for (std::size_t at = 0; at < ran.err.size(); at = ran.err.find('\n', at) + 1)
        EXPECT_EQ(ran.err.substr(at, 9), "margayd: ") << ran.err.substr(at, 80);
    // When margayd is started with this configuration, it prints the same messages and serves no master.
    const auto started = shell("margayd; s=$?; ls run; exit $s");
    EXPECT_EQ(started.status, 2);
    EXPECT_TRUE(contains(started.err, "a.toml: line 2:")) << started.err;
}

// Reading a FIFO or a device may never end.
TEST_F(ServiceConfigurationTest, WhatIsNoFileIsNamed) {
    configure("a.toml", "source = \"sim:demo\"\neni = \"fifo\"\n");
    configure("b.toml", "source = \"sim:demo\"\neni = \"/dev/zero\"\n");
    configure("c.toml", "source = \"sim:etc/fifo\"\n");
    configure("d.toml", "source = \"sim:demo,/dev/zero\"\n");
    configure("i.toml", "source = \"sim:etc/fifo.xml#TYPE\"\n");
    configure("j.toml", "source = \"sim:line.toml\"\n");
    configure("k.toml", "source = \"sim:etc/sub/line.toml\"\n");
    const auto ran = shell(
        "mkdir etc/sub; mkfifo etc/fifo.xml etc/sub/line.toml; printf '[[slave]]\nsii = \"etc/fifo\"\n' > line.toml\n"
        "mkfifo etc/fifo etc/e.toml; mkdir etc/f.toml; ln -s /dev/zero etc/g.toml; ln -s nowhere etc/h.toml\n"
        "timeout 30 " +
        std::string(MARGAY_BIN_DIR) + "/margayd --check --config etc");
    EXPECT_EQ(ran.status, 3) << ran.err;
    for (const std::string text : {"a.toml: line 2: etc/fifo: is no file\n", "b.toml: line 2: /dev/zero: is no file\n",
                                   "c.toml: line 1: etc/fifo: is no file\n", "d.toml: line 1: /dev/zero: is no file\n",
                                   "etc/e.toml: is no file\n", "etc/f.toml: is no file\n", "etc/g.toml: is no file\n",
                                   "etc/h.toml: cannot be read: No such file or directory\n",
                                   "i.toml: line 1: sim:etc/fifo.xml#TYPE: 'etc/fifo.xml' is no file\n",
                                   "j.toml: line 1: sim:line.toml: line.toml: line 2: './etc/fifo' is no file\n",
                                   "k.toml: line 1: etc/sub/line.toml: is no file\n"})
        EXPECT_TRUE(contains(ran.err, "margayd: " + (text.starts_with("etc") ? text : "etc/" + text))) << text << "\n"
                                                                                                       << ran.err;
}

// Two gateways cannot use the same port of one address. The address may be written in two ways, or one address may
// stand for all addresses.
TEST_F(ServiceConfigurationTest, GatewaysAreComparedByWhatTheyAreAndNotByTheirText) {
    const auto both = [this](const std::string& one, const std::string& two) {
        configure("a.toml", "source = \"sim:demo\"\ngateway = { listen = \"" + one + "\" }\n");
        configure("b.toml", "source = \"sim:demo\"\ngateway = { listen = \"" + two + "\" }\n");
        const auto ran = shell("margayd --check");
        const bool said = contains(ran.err, "b.toml: line 1: the gateway ") &&
                          contains(ran.err, "is used in etc/a.toml, line 1 already");
        EXPECT_EQ(ran.status, said ? 2 : 0) << ran.err;
        return said;
    };
    EXPECT_TRUE(both("[::1]:5", "[0:0:0:0:0:0:0:1]:5"));
    EXPECT_TRUE(both("127.0.0.1:5", "0.0.0.0:5"));
    EXPECT_TRUE(both("[::]:5", "[::1]:5"));
    EXPECT_FALSE(both("127.0.0.1:5", "127.0.0.2:5"));
    EXPECT_FALSE(both("127.0.0.1:5", "0.0.0.0:6"));
    EXPECT_FALSE(both("[::1]:5", "0.0.0.0:5")) << "a gateway has one family of addresses";
}

TEST_F(ServiceConfigurationTest, MastersHaveNothingInCommon) {
    configure("a.toml", "[one]\nsource = \"ecat7\"\nnumber = 3\n[two]\nsource = \"ecat7\"\nnumber = 3\n");
    configure("one.toml", "source = \"sim:demo\"\nsocket = { path = \"/run/margay/two.sock\" }\n");
    const auto ran = shell("margayd --check --sockets /run/margay");
    EXPECT_EQ(ran.status, 2);
    for (const std::string text :
         {"a.toml: line 5: the interface ecat7 is used in line 2 already",
          "a.toml: line 4: the number 3 is used in line 1 already",
          "one.toml: line 1: the name one is used in etc/a.toml, line 1 already",
          "one.toml: line 1: the socket /run/margay/two.sock is used in etc/a.toml, line 4 already"})
        EXPECT_TRUE(contains(ran.err, text)) << text << "\n" << ran.err;
}

TEST_F(ServiceConfigurationTest, ASocketOrAGatewayThatIsWrittenOtherwiseIsTheSame) {
    std::filesystem::create_directories(folder.path() / "run");
    std::filesystem::create_directory_symlink("run", folder.path() / "link");
    configure("a.toml", "source = \"sim:demo\"\ngateway = { listen = \"127.0.0.1\" }\n");
    for (const std::string tail : {"/run//a.sock", "/run/../run/a.sock", "/link/a.sock"}) {
        const auto path = folder.path().string() + tail;
        configure("b.toml", "source = \"sim:demo\"\nsocket = { path = \"" + path + "\" }\n");
        const auto ran = shell("margayd --check");
        EXPECT_EQ(ran.status, 2) << path;
        EXPECT_TRUE(contains(ran.err, "b.toml: line 1: the socket " + path + " is used in etc/a.toml, line 1 already"))
            << ran.err;
        EXPECT_EQ(shell("margayd --check --sockets other").status, 0) << path;
    }
    configure("b.toml", "source = \"sim:demo\"\ngateway = { listen = \"127.0.0.1:34980\" }\n");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 2);
    EXPECT_TRUE(contains(ran.err, "b.toml: line 1: the gateway 127.0.0.1, port 34980 is used in etc/a.toml"))
        << ran.err;
}

TEST_F(ServiceConfigurationTest, WhatIsRightIsListed) {
    configure("line.toml", "[b]\nsource = \"sim:demo\"\nnumber = 1\n[a]\nsource = \"no-such-if\"\n");
    configure("ignored.conf", "nonsense");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.out,
              "a: master 0, source no-such-if, socket run/a.sock\nb: master 1, source sim:demo, socket run/b.sock\n");
    EXPECT_EQ(ran.err, "margayd: warning: etc/line.toml: line 5: there is no interface no-such-if now\n");
}

TEST_F(ServiceConfigurationTest, AnEniIsReadAndItsErrorHasItsLine) {
    configure("a.toml", "source = \"sim:demo\"\neni = \"machine.xml\"\n");
    folder.write("etc/machine.xml", "<EtherCATConfig>\n<Config>\n</Wrong>\n");
    const auto broken = shell("margayd --check");
    EXPECT_EQ(broken.status, 2);
    EXPECT_TRUE(contains(broken.err, "machine.xml: line ")) << broken.err;
    const auto written = folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:demo --write-eni etc/machine.xml");
    ASSERT_EQ(written.status, 0) << written.err;
    EXPECT_EQ(shell("margayd --check").status, 0);
    // cycle_us is the wish of the user; the cycle of the ENI is one.
    configure("a.toml", "source = \"sim:demo\"\neni = \"machine.xml\"\ncycle_us = 2000\n");
    EXPECT_EQ(shell("margayd --check").status, 0);
}

TEST_F(ServiceConfigurationTest, WhatTheMachineOrTheClocksCannotDoIsAWarning) {
    folder.write("etc/machine.xml", clocked_eni("sim:coupler,drive", 2, std::chrono::milliseconds(2)));
    configure("a.toml",
              "source = \"sim:coupler,drive\"\neni = \"machine.xml\"\ncycle_us = 4000\ncpu = 1023\nspin_us = 4000\n");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 0) << ran.err;
    for (const std::string text :
         {"a.toml: line 4: there is no processor 1023: this machine has ",
          "a.toml: line 5: 'spin_us' is 4000, and a cycle has 4000 µs: a processor does nothing else",
          "a.toml: line 3: the ENI uses clocks in a cycle of 2000 µs: slaves with SYNC0 may refuse a cycle of 4000 µs"})
        EXPECT_TRUE(contains(ran.err, text)) << text << "\n" << ran.err;
}

TEST_F(ServiceConfigurationTest, NamesThatTheSystemDoesNotTakeAreRefused) {
    const std::string source = "source = \"sim:demo\"\n";
    unsigned n = 0;
    for (const std::string name : {"a%d", "a:b", ".", ".."}) {
        configure("eoe.toml", source + "eoe = [{ position = 1, name = \"" + name + "\" }]\n");
        const auto ran = shell("margayd --check");
        EXPECT_TRUE(contains(ran.err, "line 2: '" + name + "' is no name of an interface")) << ran.err;
        n += ran.status == 2 ? 1 : 0;
    }
    EXPECT_EQ(n, 4U);
    std::filesystem::remove(folder.path() / "etc/eoe.toml");
    configure("a.toml", source + "socket = { path = \"/tmp/\" }\n");
    configure("b.toml", source + "socket = { path = \"/tmp/a\\u0000b\" }\n");
    configure("c.toml", "source = \"\"\n");
    configure("d.toml", source + "eni = \"\"\n");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 2);
    for (const std::string text :
         {"a.toml: line 2: 'path' must be the name of a file", "b.toml: line 2: 'path' must be the name of a file",
          "c.toml: line 1: 'source' is empty", "d.toml: line 2: 'eni' is empty"})
        EXPECT_TRUE(contains(ran.err, text)) << text << "\n" << ran.err;
}

TEST_F(ServiceConfigurationTest, NothingToRunAndWrongArguments) {
    const auto none = shell("margayd");
    EXPECT_EQ(none.status, 2);
    EXPECT_TRUE(contains(none.err, "no master is described in etc (files *.toml)")) << none.err;
    const auto missing = shell("margayd --config nowhere");
    EXPECT_EQ(missing.status, 3);
    EXPECT_TRUE(contains(missing.err, "nowhere: cannot be read: No such file or directory")) << missing.err;
    for (const auto& [arguments, message] :
         {std::pair{"--nope", "there is no option '--nope'; see margayd --help"},
          std::pair{"x", "unexpected argument 'x'"}, std::pair{"--check=1", "--check takes no value"},
          std::pair{"--config", "--config needs a value: FOLDER"}}) {
        const auto ran = folder.run(std::string(MARGAY_BIN_DIR) + "/margayd " + arguments);
        EXPECT_EQ(ran.status, 2) << arguments;
        EXPECT_TRUE(contains(ran.err, message)) << ran.err;
    }
}

TEST_F(ServiceConfigurationTest, WhatCannotStartOrContradictsItselfIsRefused) {
    const std::string source = "source = \"sim:demo\"\n";
    configure("a.toml", source + "socket = { path = \"/" + std::string(200, 'x') + "\" }\n");
    configure("b.toml", source + "eoe = [{ position = 1, name = \"lo\" }, { position = 1, name = \"x1\" }]\n");
    configure("c.toml", source + "state = \"PREOP\"\nend_state = \"SAFEOP\"\n");
    configure("d.toml", source + "socket = { path = \"\" }\n");
    configure("e.toml", source + "state = \"INIT\"\n");
    configure("f.toml", "[f]\n" + source + "eoe = [\n  { position = 1, name = \"twice\" },\n" +
                            "  { position = 2, name = \"twice\" },\n]\n[g]\n" + source +
                            "eoe = [{ alias = 3, name = \"twice\" }]\n");
    const auto ran = shell("margayd --check");
    EXPECT_EQ(ran.status, 2);
    for (const std::string text :
         {"f.toml: line 5: the interface twice is used in line 4 already",
          "f.toml: line 9: the interface twice is used in line 4 already",
          "a.toml: line 1: the path of the socket has more than 107 octets: /xxx",
          "b.toml: line 2: 'lo' is the interface of the machine itself",
          "b.toml: line 2: a second element of 'eoe' for the same slave",
          "c.toml: line 3: 'end_state' is above 'state': the end of the service would raise slaves",
          "d.toml: line 2: 'path' must begin with '/'"})
        EXPECT_TRUE(contains(ran.err, text)) << text << "\n" << ran.err;
    EXPECT_FALSE(contains(ran.err, "e.toml")) << ran.err;
}

}  // namespace
}  // namespace margay::process
