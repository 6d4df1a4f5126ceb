// Makes a running master visible to other programs, for example `ethercat`: states, slaves, process data, statistics,
// events, and access to registers, SII and mailboxes, over a Unix socket. For hosted systems (target margay_attach).
//
//     margay::HostContext ctx;
//     …                                                 // init()
//     margay::AttachServer server(ctx, "/run/margay/line1.sock", {.name = "eth0"});
//     if (!server.error().empty()) …                    // not served; the master works without it
//     …                                                 // the cycle runs
//
// The server has a thread of its own. The cycle never waits for it: the thread only submits requests (request.hpp), at
// most one for each client, and poll() executes them between the cycles like requests of any thread. A message of a
// client has no other effect on the application. The server closes the connection of a client that sends malformed or
// too long messages, floods, is too slow or goes away. AttachSettings bounds the memory of the server.
//
// Cost. Clients that read facts cost the cycle nothing. The datagrams of requests to slaves (registers, SII, mailboxes,
// states) travel in the frames of the cycle, if the application does not say otherwise: then building and reading the
// frames takes longer, about 1000 instructions a cycle with four clients that ask without a pause. With
// GroupConfiguration::acyclic_bytes = 0, poll() sends these datagrams in frames of their own between the cycles, and
// the same clients cost 130 to 200 instructions a cycle. Use this value where the time of a cycle must not vary.
//
// Access. Every program that may write to the socket can do what the application could do by requests: change states,
// write objects and registers. The file permissions of the socket select these programs. `read_only` refuses every
// request that writes. `rescan` and `debug` are refused unless the application allows them (AttachSettings::scan,
// debug_level).
#pragma once

#include <margay/context.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace margay {

// The effect of the `rescan` of a client. With each value, the process data of a mapped group goes on.
enum class AttachScan : std::uint8_t {
    refused,  // no effect: the client gets a sentence that reports this
    // The same as recover_slave(ctx, 0): reads the states of all slaves and the ring, and finds lost slaves. The facts
    // of the slaves that answer, their states and the process data stay. Slaves that are not in the table are counted
    // and not used.
    search,
    // While no group is mapped and no supervision is busy, the same as config_init(): all slaves go through INIT to
    // PREOP, and the numbers, hooks and configurations of the slaves start again. Otherwise as `search`. For an
    // application that keeps no slave number and sets no hook between its calls of poll().
    whole,
};

struct AttachSettings {
    std::string name{};      // what clients show as the source, for example the name of the interface
    unsigned mode = 0600;    // permissions of the socket: with 0660 the group may connect
    std::string owner{};     // name of the user that owns the socket; empty: the user of the process
    std::string group{};     // name of its group; empty: the group of the process
    bool read_only = false;  // refuse everything that changes a slave or the application
    AttachScan scan = AttachScan::refused;
    // The `debug` of a client stores a level here: 0 no messages, 1 errors and warnings, 2 more. The application reads
    // the level, and the server writes it in its own thread. The variable must outlive the server. nullptr: `debug` is
    // refused.
    std::atomic<unsigned>* debug_level = nullptr;
    std::size_t clients = 8;  // connections at the same time, 1 to 32; others get an error and are closed
    std::size_t transfer_bytes = std::size_t{16} << 20;  // the largest file or object; at most twice as much memory for
                                                         // each client
};

// The counters of the server, for tests and for diagnosis: `malformed` increases when a client is faulty.
struct AttachCounts {
    std::uint64_t accepted = 0;   // connections
    std::uint64_t refused = 0;    // connections beyond AttachSettings::clients
    std::uint64_t requests = 0;   // messages that were executed
    std::uint64_t malformed = 0;  // connections that were closed because of malformed messages
    std::uint64_t stalled = 0;    // connections that were closed in the middle of a message, after 10 s
};

class AttachServer {
  public:
    // Binds the socket and starts the thread. Call it after init(), in the thread that owns the context: it observes
    // EventQueue::callback (a callback that was set before is called too; one that the application sets later replaces
    // it, and then clients see no events). A socket that an ended program has left behind is replaced. A socket that
    // another program serves is an error(). Create the server before the thread gets a processor of its own: the
    // server's thread inherits the processors, but not the real-time priority. Allocates memory; not for the cycle.
    // `ctx` must outlive the server.
    AttachServer(Context& ctx, std::string path, AttachSettings settings = {});
    // Ends all connections and removes the socket; busy requests of clients end as canceled. Call it in the thread that
    // owns the context.
    ~AttachServer();
    AttachServer(const AttachServer&) = delete;
    AttachServer& operator=(const AttachServer&) = delete;

    // The reason why the socket is not served, as a sentence; empty: it is served.
    [[nodiscard]] const std::string& error() const;
    [[nodiscard]] const std::string& path() const;
    // Callable from any thread.
    [[nodiscard]] AttachCounts counts() const;

  private:
    class Loop;
    std::unique_ptr<Loop> loop_;
};

}  // namespace margay
