// The program mailbox_gateway: a tool of another process reads objects of simulated slaves over UDP and TCP.
#include <places.hpp>

#include "gateway/gateway_client.hpp"
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <signal.h>

namespace margay::process {
namespace {

const std::string kGateway = std::string(MARGAY_BIN_DIR) + "/mailbox_gateway";

TEST(MailboxGatewayProgram, ServesASimulatedSegment) {
    using namespace testing_gateway;
    const ShellFolder folder;
    // Starts the program, and waits until it listens.
    const auto begun = folder.run("'" + kGateway +
                                  "' sim:drives --listen 127.0.0.1:0 >log 2>&1 & echo $! >pid\n"
                                  "for n in $(seq 400); do grep -q listening log && exit 0; sleep 0.05; done; exit 1");
    const auto log = content_of(folder.path() / "log");
    const auto process = std::stoi(content_of(folder.path() / "pid"));
    const auto at = log.find("listening at 127.0.0.1, port ");
    if (begun.status == 0 && at != std::string::npos) {
        EXPECT_TRUE(contains(log, "0x1001: slave 1 (")) << log;
        const auto port = static_cast<std::uint16_t>(std::stoul(log.substr(at + 29)));
        for (const Over over : {Over::udp, Over::tcp}) {
            GatewayClient client(port, over);
            EXPECT_EQ(upload(client, 0, 0x1018, 0), octets({4}));
            EXPECT_EQ(upload(client, 0x1001, 0x1018, 1), octets({0x47, 0x4D, 0, 0}));
        }
    } else {
        ADD_FAILURE() << log;
    }
    ASSERT_EQ(::kill(process, SIGTERM), 0);
    (void)folder.run("for n in $(seq 400); do grep -q ' clients, ' log && exit 0; sleep 0.05; done");
    EXPECT_TRUE(contains(content_of(folder.path() / "log"), "2 clients, 4 messages, 4 replies, 0 of them errors\n"))
        << content_of(folder.path() / "log");
}

TEST(MailboxGatewayProgram, WrongAddressesAreRefusedInWords) {
    const ShellFolder folder;
    const auto ran = [&](const std::string& listen) { return folder.run(kGateway + " sim:drives --listen " + listen); };
    for (const char* wrong : {"127.0.0.1:x", "[::1", "[::1]x", "127.0.0.1:70000", "127.0.0.1:"}) {
        EXPECT_EQ(ran(wrong).status, 2) << wrong;
        EXPECT_TRUE(contains(folder.run(kGateway + " sim:drives --listen " + wrong).err, "is not ADDRESS:PORT"))
            << wrong;
    }
    const auto nowhere = ran("192.0.2.1:34980");
    EXPECT_EQ(nowhere.status, 3);
    EXPECT_TRUE(contains(nowhere.err, "192.0.2.1:34980 (TCP): cannot be bound")) << nowhere.err;
    EXPECT_TRUE(contains(ran("localhost:34980").err, "localhost: is no IP address in digits"));
    for (const char* number : {"34980", "0:34980", "1.2.3:34980"}) {  // incomplete addresses are refused
        EXPECT_EQ(ran(number).status, 2) << number;
        EXPECT_TRUE(contains(ran(number).err, ": is no IP address in digits")) << number << ": " << ran(number).err;
    }
}

}  // namespace
}  // namespace margay::process
