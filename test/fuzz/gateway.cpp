// Random octets from two clients of the mailbox gateway to the objects of the master and to the slaves of a simulated
// segment: a device with CoE, one with SoE and one with VoE. The first octet of each piece contains the client that
// sends the piece and the length of the piece. Each reply must be one frame with one complete message. All requests
// must end within their timeouts. Afterwards, a correct upload must get its correct reply.
#include "client_input.hpp"
#include "gateway/router.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/segment.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <array>
#include <memory>

using namespace margay;
using namespace std::chrono_literals;
using fuzzing::require;

namespace {

struct Receiver final : gateway::Client {
    bool send(gateway::Octets frame, gateway::Moment) override {
        require(gateway::frame_bytes(frame) == frame.size());
        const auto messages = gateway::messages_of(frame);
        require(messages.size() == 1 && messages[0].complete);
        ++replies;
        last = messages[0];
        return true;
    }
    [[nodiscard]] bool takes_replies() const override { return true; }
    // Passes the complete frames of a stream to the router and keeps the rest. Returns false when a frame is wrong.
    bool take(gateway::Router& router, Bytes octets, gateway::Moment now) {
        in.insert(in.end(), octets.begin(), octets.end());
        while (router.has_room(*this)) {
            const auto bytes = gateway::frame_bytes(in);
            if (!bytes) return false;
            if (*bytes == 0 || in.size() < *bytes) return true;
            auto messages = gateway::messages_of(Bytes(in).first(*bytes));
            in.erase(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(*bytes));
            sent += messages.size();
            for (auto& mail : messages) router.receive(*this, std::move(mail), now);
        }
        return true;
    }
    gateway::Octets in{};
    gateway::Mail last{};
    std::size_t sent = 0;
    std::size_t replies = 0;
};

struct World {
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    HostContext ctx{Limits{.slaves = 8}};

    World() {
        for (const char* name : {"odd_device", "soe_drive", "voe_device"}) {
            const auto n = segment.add(sim::make_device(name).value().assemble());
            require(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
        segment.power_up(osal.now());
        osal.advance(1ms);
        require(init(ctx, wire, osal).ok());
        require(config_init(ctx).ok());
    }
    [[nodiscard]] gateway::Moment moment() {
        return gateway::Moment(std::chrono::duration_cast<gateway::Moment::duration>(osal.now().time_since_epoch()));
    }
    void step(gateway::Router& router) {
        router.step(moment());
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 1ms), -1);
        segment.advance(osal.now());
    }
    // Continues until the router has no requests of the clients. This must not take longer than the timeouts.
    template <class... C>
    void finish(gateway::Router& router, const C&... clients) {
        for (const Time end = osal.now() + 10s; (router.uses(clients) || ...);) {
            require(osal.now() < end);
            step(router);
        }
    }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static World world;
    gateway::Router router(world.ctx, {.waiting = 4, .reply_timeout = 20ms});
    std::array<Receiver, 2> clients;
    for (auto& client : clients) router.add(client);
    const auto octets = std::as_bytes(std::span(data, size));
    for (std::size_t at = 0; at < size;) {
        const std::size_t head = data[at++];
        const auto piece = octets.subspan(at, std::min<std::size_t>(head >> 1, size - at));
        at += piece.size();
        Receiver& client = clients[head & 1];
        if (!client.take(router, piece, world.moment())) {
            // The server ends such a connection.
            router.remove(client);
            client.in.clear();
            router.add(client);
        }
        world.step(router);
    }
    world.finish(router, clients[0], clients[1]);
    for (auto& client : clients) router.remove(client);

    Receiver good;
    router.add(good);
    namespace coe = wire::coe;
    gateway::Octets upload(coe::kSdoBytes);
    coe::store_header(upload, {.service = coe::Service::sdo_request});
    coe::SdoLayout::command::store(upload, coe::sdo::command(coe::request::kUpload));
    coe::SdoLayout::index::store(upload, 0x1018);
    coe::SdoLayout::subindex::store(upload, 1);
    // The device may still be busy with a slow object.
    for (int tries = 0; tries < 200; ++tries) {
        router.receive(good, {.header = {.address = 0x1001, .type = MailboxType::coe, .counter = 5}, .data = upload},
                       world.moment());
        world.finish(router, good);
        if (good.last.header.type == MailboxType::coe) break;
    }
    require(good.last.header.type == MailboxType::coe && good.last.header.address == 0x1001 &&
            good.last.header.counter == 5);
    require(load_le<std::uint32_t>(good.last.data, coe::SdoLayout::expedited_data) == sim::kVendorId);
    router.remove(good);
    return 0;
}
