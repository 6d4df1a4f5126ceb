// A master with two NICs on a ring of simulated slaves, in virtual time.
#pragma once

#include "mailbox/stack_slave.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"
#include "sim/process_data.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/redundancy.hpp>

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace margay {

using namespace std::chrono_literals;

// Passes the calls on to another NIC.
class ForwardingNic : public Nic {
  public:
    explicit ForwardingNic(Nic& nic) : nic_(nic) {}
    SendStatus send(std::span<const std::byte> frame) noexcept override { return nic_.send(frame); }
    std::size_t receive(std::span<std::byte> into) noexcept override { return nic_.receive(into); }
    LinkState link_state() noexcept override { return nic_.link_state(); }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  protected:
    Nic& nic_;
};

// Calls a function before each frame that a NIC sends, so that a test can break a cable between the two copies of a
// frame.
class HookedNic final : public ForwardingNic {
  public:
    HookedNic(Nic& nic, Osal& osal) : ForwardingNic(nic), osal_(osal) {}
    std::function<void()> before_send;
    std::function<void(std::span<const std::byte>)> sees_frame;
    bool tells_link = true;   // false: accepts every frame, and the link state is unknown
    Duration sees_after{};    // notices a lost link so much later, and accepts all frames until then
    unsigned link_reads = 0;  // calls of link_state()
    bool deaf = false;        // sends, and its replies never arrive: one direction of its cable is broken
    unsigned refused = 0;     // so many of the next frames are not accepted
    SendStatus refusal = SendStatus::busy;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (before_send) before_send();
        if (sees_frame) sees_frame(frame);
        if (refused != 0) {
            --refused;
            return refusal;
        }
        const bool sees = sees_link();
        const SendStatus status = nic_.send(frame);
        return status == SendStatus::failed && (!tells_link || !sees) ? SendStatus::sent : status;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        std::size_t length = nic_.receive(into);
        while (deaf && length != 0) length = nic_.receive(into);
        return length;
    }
    LinkState link_state() noexcept override {
        ++link_reads;
        if (!tells_link) return LinkState::unknown;
        return sees_link() ? nic_.link_state() : LinkState::up;
    }

  private:
    bool sees_link() noexcept {
        if (nic_.link_state() != LinkState::down)
            lost_at_ = kNever;
        else if (lost_at_ == kNever)
            lost_at_ = osal_.now();
        return lost_at_ == kNever || osal_.now() - lost_at_ >= sees_after;
    }

    Osal& osal_;
    Time lost_at_ = kNever;
};

struct RingBus {
    VirtualOsal osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> wires[2];
    std::unique_ptr<HookedNic> nics[2];
    std::unique_ptr<HostContext> ctx;
    std::vector<std::byte> image = std::vector<std::byte>(4096);
    SuperviseRequest supervision;
    std::vector<sim::PortRef> ring_cables;  // from the first NIC to the second one; one end of each
    std::vector<sim::PortRef> branch_cables;
    std::vector<std::uint16_t> numbers;  // slave numbers by place in the segment; empty: the same order
    Duration later[2]{};                 // delay of the received frames of each NIC
    std::uint64_t frames = 0;            // sent by both NICs
    std::function<void(std::uint64_t)> on_frame;
    std::uint8_t counter = 0;

    static sim::Device io_device() {
        auto device = sim::device_from_sii(io_image(16, 16));
        device.chip = sim::junction();
        return device;
    }
    std::uint32_t add(sim::Device device) { return segment.add(std::move(device).assemble()); }
    // Adds a slave to the ring, behind the last slave. The first slave is connected to the first NIC.
    std::uint32_t add_to_ring(sim::Device device = io_device()) {
        const std::uint32_t n = add(std::move(device));
        EXPECT_TRUE(ring_cables.empty() ? segment.connect_master({n, 0}) : segment.connect({last_, 1}, {n, 0}));
        ring_cables.push_back({n, 0});
        return last_ = n;
    }
    std::uint32_t add_behind(std::uint32_t parent, std::uint8_t port, sim::Device device = io_device()) {
        const std::uint32_t n = add(std::move(device));
        EXPECT_TRUE(segment.connect({parent, port}, {n, 0}));
        branch_cables.push_back({n, 0});
        return n;
    }
    void close_ring() {
        EXPECT_TRUE(segment.connect_master({last_, 1}, 1));
        ring_cables.push_back({last_, 1});
    }
    // 20 slaves: 14 in the ring, and a branch of three behind two of them.
    void build_tree() {
        for (unsigned n = 0; n < 14; ++n) {
            const std::uint32_t at = add_to_ring();
            if (n != 3 && n != 9) continue;
            const std::uint32_t one = add_behind(at, 3);
            const std::uint32_t two = add_behind(one, 1);
            (void)add_behind(two, 1);
        }
        close_ring();
    }
    void build_line(unsigned slaves) {
        for (unsigned n = 0; n < slaves; ++n) (void)add_to_ring();
        close_ring();
    }
    void plug(const SimulatedNic::Options& options = {}) {
        segment.power_up(osal.now());
        for (unsigned n = 0; n < 2; ++n) {
            SimulatedNic::Options own = options;
            own.master_port = n;
            own.round_trip += later[n];
            own.mac[5] = static_cast<std::uint8_t>(own.mac[5] + n);
            wires[n] = std::make_unique<SimulatedNic>(segment, osal, own);
            nics[n] = std::make_unique<HookedNic>(*wires[n], osal);
            nics[n]->before_send = [this] {
                if (on_frame) on_frame(frames);
                ++frames;
            };
        }
        wires[0]->set_other_end(wires[1].get());
        wires[1]->set_other_end(wires[0].get());
    }
    static Limits limits() { return {.slaves = 32, .redundancy = true}; }
    Result<> begin(const Limits& with = limits()) {
        if (!wires[0]) plug();
        ctx = std::make_unique<HostContext>(with);
        return init_redundant(*ctx, *nics[0], *nics[1], osal);
    }
    void start() {
        ASSERT_TRUE(begin().ok());
        const auto found = config_init(*ctx);
        ASSERT_TRUE(found.ok()) << words(found.error());
        ASSERT_EQ(*found, segment.size());
    }
    // Maps the group. Then the supervision brings all slaves to OP.
    void run() {
        const auto mapped = config_map(*ctx, image);
        ASSERT_TRUE(mapped.ok()) << words(mapped.error());
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(until_all_in_op()) << joined(events());
        (void)events();
    }
    void cable(sim::PortRef end, bool intact) { segment.set_cable(end, intact); }

    // nullptr: a device without process data of this kind.
    sim::ProcessDataFirmware* io(std::size_t number) {
        return segment.slave(static_cast<std::uint32_t>(number - 1)).firmware()->process_data();
    }
    // The slave at a place of the segment.
    [[nodiscard]] std::uint16_t number_at(std::size_t place) const {
        return numbers.empty() ? static_cast<std::uint16_t>(place + 1) : numbers[place];
    }
    // Every device with power provides a new value, and every slave gets new outputs: the counter and the slave number.
    void show_values() {
        ++counter;
        for (std::size_t place = 0; place < ctx->slaves().size(); ++place) {
            auto* const device = io(place + 1);
            if (device == nullptr) continue;
            auto inputs = device->inputs();
            if (inputs.size() >= 2 && segment.powered(static_cast<std::uint32_t>(place))) {
                inputs[0] = static_cast<std::byte>(counter);
                inputs[1] = mark_of_inputs(place);
                device->poke();
            }
            auto outputs = ctx->slave(number_at(place)).image.outputs.bytes;
            if (outputs.size() < 2) continue;
            outputs[0] = static_cast<std::byte>(counter);
            outputs[1] = mark_of_outputs(place);
        }
    }
    static std::byte mark_of_inputs(std::size_t place) { return static_cast<std::byte>(place + 1); }
    static std::byte mark_of_outputs(std::size_t place) { return static_cast<std::byte>(0x81 + place); }
    // Sends and receives, one millisecond later.
    void exchange() {
        osal.advance(1ms);
        const auto sent = send_processdata(*ctx);
        wkc = sent ? receive_processdata(*ctx, 500us) : Result<std::uint32_t>(sent.error());
    }
    // A cycle in which every device provides a new value. Returns the number of slaves whose inputs are not new, or
    // whose device has not received the new outputs. Absent slaves count.
    unsigned cycle() {
        show_values();
        exchange();
        const std::size_t count = ctx->slaves().size();
        (void)poll(*ctx, osal.now());
        segment.advance(osal.now());
        unsigned stale = 0;
        for (std::size_t n = 1; n <= count; ++n) {
            auto* const device = io(n);
            if (device == nullptr) continue;
            const auto seen = ctx->slave(n).image.inputs.bytes;
            const bool in =
                seen.size() >= 2 && seen[0] == static_cast<std::byte>(counter) && seen[1] == mark_of_inputs(n - 1);
            const auto got = device->outputs();
            const bool out =
                got.size() >= 2 && got[0] == static_cast<std::byte>(counter) && got[1] == mark_of_outputs(n - 1);
            if (!in || !out || !inputs_fresh(*ctx, static_cast<std::uint16_t>(n))) ++stale;
        }
        return stale;
    }
    // Cycles in which some inputs were stale.
    unsigned stale_cycles(unsigned cycles) {
        unsigned stale = 0;
        for (unsigned n = 0; n < cycles; ++n) stale += cycle() != 0 ? 1 : 0;
        return stale;
    }
    bool all_in_op() {
        for (const Slave& slave : ctx->slaves())
            if (slave.al != AlStatus{AlState::op, false, 0}) return false;
        return wkc.ok();
    }
    bool until_all_in_op(unsigned most = 4000) {
        for (unsigned n = 0; n < most; ++n) {
            (void)cycle();
            if (all_in_op()) return true;
        }
        return false;
    }
    RedundancyStatus status() { return redundancy(*ctx); }
    std::vector<std::string> events() {
        std::vector<std::string> all;
        while (const auto event = ctx->events().take()) {
            std::array<char, 256> text{};
            all.emplace_back(describe(*event, text));
        }
        return all;
    }
    static std::string joined(const std::vector<std::string>& all) {
        std::string text;
        for (const auto& one : all) text += one + "\n";
        return text;
    }
    static std::string words(const Error& error) {
        std::array<char, 400> text{};
        return std::string(describe(error, text));
    }
    Result<std::uint32_t> wkc = 0U;

  private:
    std::uint32_t last_ = 0;
};

}  // namespace margay
