// The mailbox gateway (ETG.8200): tools reach the mailboxes of the slaves over UDP and TCP while the application runs,
// for example a commissioning tool for drives. For hosted systems (target margay_gateway).
//
//     margay::HostContext ctx;
//     …                                                 // init()
//     margay::MailboxGateway gateway(ctx);              // 127.0.0.1, port 34980, UDP and TCP
//     if (!gateway.error().empty()) …                   // not served; the master works without it
//     …                                                 // the cycle runs
//
// A datagram or a stream has EtherCAT frames of type 5: the frame header (2 octets), then mailbox messages. The address
// in the mailbox header is the station address of the slave that gets the message; 0 is the master, which answers CoE
// by its own object dictionary (ETG.1510, read only). A reply has the address, the counter and the priority of the
// message that it answers. The gateway answers a message that cannot be routed, or that no slave answers in time, by a
// mailbox error reply. src/gateway/README.md has the rules of each protocol, the error codes, and the parts of the
// standard that are missing.
//
// The gateway has a thread of its own. The cycle never waits for it: the thread only submits requests (request.hpp),
// and poll() executes them between the cycles like requests of any thread, after the same checks: nothing goes to a
// slave that is lost, below PREOP, or was away and not identified since. A message of a client has no other effect on
// the application. MailboxGatewaySettings bounds the memory of the gateway.
//
// Access. The protocol has no authentication: every program that reaches the port can write what the application could
// write by the mailbox. So by default only this machine reaches it. `read_only` refuses everything that may change
// a slave.
#pragma once

#include <margay/context.hpp>
#include <margay/slave.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace margay {

struct MailboxGatewaySettings {
    static constexpr std::uint16_t kPort = 34980;  // 0x88A4, registered for EtherCAT

    std::string address = "127.0.0.1";  // in digits, IPv4 or IPv6; "0.0.0.0" and "::" are all interfaces
    std::uint16_t port = kPort;         // of UDP and TCP; 0: any free one, see MailboxGateway::port()
    bool udp = true;
    bool tcp = true;
    bool read_only = false;    // refuse everything that may change a slave
    std::size_t clients = 8;   // TCP connections and senders of UDP together, 1 to 16
    std::size_t waiting = 16;  // messages of one client that wait for their turn, 1 to 256
    // How long a message may wait for its turn, and then for the reply of the slave. 10 ms to 1 min.
    std::chrono::milliseconds reply_timeout{3000};
    // How long the next message of a transfer (segments, packets of a file) may take, so that no message of another
    // client to this protocol of the slave comes before it. 1 ms to 1 min.
    std::chrono::milliseconds pause_in_transfer{500};
    // Values of the object dictionary of the master.
    std::string name = "Margay EtherCAT master";  // 0x1008
    Identity identity{};                          // 0x1018
};

// The counters of the gateway, for tests and for diagnosis: `malformed` increases when a client is faulty.
struct MailboxGatewayCounts {
    std::uint64_t clients = 0;   // TCP connections, and senders of UDP that were new
    std::uint64_t refused = 0;   // clients beyond MailboxGatewaySettings::clients
    std::uint64_t messages = 0;  // mailbox messages from clients
    std::uint64_t replies = 0;   // to clients, error replies included
    std::uint64_t errors = 0;    // error replies, also from slaves
    // Datagrams that were dropped, and connections that were closed, because of malformed messages.
    std::uint64_t malformed = 0;
    std::uint64_t stalled = 0;  // connections that were closed: a frame was not whole, or the replies not read, in 10 s
    std::uint64_t lost = 0;     // replies that the system did not accept, or whose client had closed its connection
};

class MailboxGateway {
  public:
    // Binds the ports and starts the thread. Create it after init() and before the thread gets a processor of its own:
    // the thread of the gateway inherits the processors, but not the real-time priority. Allocates memory; not for the
    // cycle. `ctx` must outlive the gateway.
    explicit MailboxGateway(Context& ctx, MailboxGatewaySettings settings = {});
    // Ends all connections; busy requests of clients end as canceled. Call it in the thread that owns the context.
    ~MailboxGateway();
    MailboxGateway(const MailboxGateway&) = delete;
    MailboxGateway& operator=(const MailboxGateway&) = delete;

    // The reason why the gateway does not serve its port, as a sentence. Empty: it serves the port.
    [[nodiscard]] const std::string& error() const;
    // The port of UDP and TCP.
    [[nodiscard]] std::uint16_t port() const;
    // Callable from any thread.
    [[nodiscard]] MailboxGatewayCounts counts() const;

  private:
    class Loop;
    std::unique_ptr<Loop> loop_;
};

}  // namespace margay
