// Random octets from a client of an AttachServer, through a socket, in pieces of any size. The messages become
// requests, which are executed on a simulated segment. The first octet selects whether the client has sent the hello
// message, and the settings of the server. The server must not accept a message above the limits. A client must be able
// to read each answer. The master must still send process data afterwards.
#include "attach/client.hpp"
#include "attach/connection.hpp"
#include "client_input.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/segment.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <string>

using namespace margay;
using namespace std::chrono_literals;
using attach::Connection;
using fuzzing::require;

namespace {

constexpr std::size_t kMostTransfer = 4096;
constexpr std::size_t kMostMessage = attach::Header::kBytes + 128 * 1024 + kMostTransfer;

struct World {
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    HostContext ctx{Limits{.slaves = 8}};
    std::array<std::byte, 256> image{};
    EoePortMemory<1, 1, 1> memory{};
    EoePort port{memory};
    SuperviseRequest supervision{};

    World() {
        for (const char* name : {"coupler", "digital_out_8", "eoe_gateway", "odd_device"}) {
            const auto n = segment.add(sim::make_device(name).value().assemble());
            require(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
        segment.power_up(osal.now());
        osal.advance(1ms);
        require(init(ctx, wire, osal).ok());
        require(config_init(ctx).ok());
        require(config_map(ctx, image).ok());
        port.slave = 3;
        port.set_interface_name("eoe0s2");
        require(submit(ctx, port).ok());
    }
    void cycle() {
        require(send_processdata(ctx).ok());
        (void)receive_processdata(ctx, 500us);
        for (const Time end = osal.now() + 1ms; osal.now() < end;)
            osal.wait(std::min(poll(ctx, osal.now()), end), wire.wait_handle());
    }
    // Returns true when the request ended before it was cancelled.
    bool run(Request& request) {
        for (int n = 0; n < 300 && request.busy(); ++n) cycle();
        const bool over = !request.busy();
        request.cancel();
        while (request.busy()) cycle();
        return over;
    }
};

template <class T>
void require_complete(Bytes answer, T value) {
    attach::Reader from(answer);
    from(value);
    require(from.complete());
}

// Reads an answer as a client does. Only the operations below have answers that are checked.
void read_answer(attach::Operation operation, Bytes answer) {
    using attach::Operation;
    switch (operation) {
        case Operation::master: return require_complete(answer, attach::MasterFacts{});
        case Operation::rescan: return require_complete(answer, attach::RescanFacts{});
        case Operation::object_description: return require_complete(answer, attach::ObjectFacts{});
        case Operation::entry_description: return require_complete(answer, attach::EntryFacts{});
        case Operation::eoe_ports: {
            attach::Reader from(answer);
            std::uint32_t count = 0;
            std::uint16_t some = 0;
            from(count, some);
            for (attach::EoePortFacts port; some != 0; --some) {
                from(port);
                require(port.name() == "eoe0s2");
            }
            return require(from.complete() && count == 1);
        }
        default: return;
    }
}

// Executes a message as the server does.
void take(World& world, Connection& client, const AttachSettings& settings) {
    const auto operation = client.operation();
    require(operation < attach::Operation::end);
    require(client.payload().size() + attach::Header::kBytes <= kMostMessage);
    if (operation == attach::Operation::hello) {
        client.greeted = true;
        return client.forget_message();
    }
    require(client.greeted);
    attach::Arguments arguments;
    attach::Reader from(client.payload());
    from(arguments);
    const bool whole = from.complete();
    require(!whole || arguments.name.size() + arguments.data.size() <= client.payload().size());
    client.forget_message();
    if (!whole || operation == attach::Operation::events || operation == attach::Operation::set_debug_level) return;
    if (settings.read_only && attach::writes(operation)) return;
    std::string refusal;
    const auto job = attach::make_job(operation, std::move(arguments), settings, refusal);
    require((job == nullptr) == !refusal.empty());
    if (job == nullptr || !submit(world.ctx, job->request())) return;
    if (!world.run(job->request()) || job->request().state() != RequestState::success) return;
    if (!job->refusal().empty()) return;
    const auto answer = job->answer();
    require(answer.size() <= std::size_t{1} << 20);
    read_answer(operation, answer);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    fuzzing::Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    const auto world = std::make_unique<World>();
    const AttachSettings settings{.read_only = (what & 2) != 0,
                                  .scan = static_cast<AttachScan>((what >> 2) % 3),
                                  .transfer_bytes = kMostTransfer};
    if ((what & 16) != 0) require(submit(world->ctx, world->supervision).ok());
    int ends[2];
    require(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
    {
        Connection client(ends[0], settings.transfer_bytes, {});
        client.greeted = (what & 1) != 0;
        bool wrong = false;
        for (int messages = 0; !input.empty() && !wrong && messages < 8;) {
            const Bytes piece = input.take(input.octet() + 1);
            require(::send(ends[1], piece.data(), piece.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
                    static_cast<ssize_t>(piece.size()));
            for (;;) {
                const auto came = client.receive({});
                wrong = came == Connection::Came::wrong;
                if (came != Connection::Came::message) break;
                take(*world, client, settings);
                ++messages;
            }
        }
    }
    ::close(ends[1]);
    world->port.cancel();
    const bool mapped = world->ctx.group(0).mapped;
    require(mapped);
    for (int n = 0; n < 3; ++n) world->cycle();
    return 0;
}
