// A master with mapped slaves that exchange process data. The slaves are simulated during bring-up; then another NIC
// replaces them.
#pragma once

#include "osal/linux/linux_osal.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <array>
#include <memory>
#include <utility>
#include <vector>

namespace margay::bench {

// The cable, which can be switched to another NIC.
class SwitchNic final : public Nic {
  public:
    Nic* to = nullptr;
    std::vector<std::byte> last;  // the last frame that was sent while keep_last is set
    bool keep_last = false;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (keep_last) last.assign(frame.begin(), frame.end());
        return to->send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override { return to->receive(into); }
    Time next_arrival() const noexcept override { return to->next_arrival(); }
    int wait_handle() const noexcept override { return to->wait_handle(); }
};

// Returns virtual time at first, and the time of the system after `live` is set.
class SwitchOsal final : public Osal {
  public:
    SwitchOsal() : Osal(ThreadIdentity::thread_pointer) {}
    VirtualOsal simulated;
    LinuxOsal real;
    bool live = false;
    Time now() noexcept override { return live ? real.now() : simulated.now(); }
    void wait(Time until, WaitHandles handle) noexcept override {
        live ? real.wait(until, handle) : simulated.wait(until, handle);
    }
    void wake() noexcept override { live ? real.wake() : simulated.wake(); }
};

struct MappedBus {
    SwitchOsal osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> simulated;
    SwitchNic nic;
    std::unique_ptr<HostContext> ctx;
    std::array<std::byte, 16384> image{};

    // Builds a number of equal slaves in SAFEOP that already exchange process data.
    [[nodiscard]] bool build(std::uint32_t slaves, std::uint32_t output_bytes, std::uint32_t input_bytes) {
        for (std::uint32_t n = 0; n < slaves; ++n) {
            auto device = sim::device_from_sii(io_image(output_bytes * 8, input_bytes * 8));
            device.chip = sim::ip_core();
            device.chip.ram_kib = 16;
            segment.add(std::move(device).assemble());
            if (!(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}))) return false;
        }
        segment.power_up(osal.now());
        simulated = std::make_unique<SimulatedNic>(segment, osal);
        nic.to = simulated.get();
        nic.keep_last = true;
        ctx = std::make_unique<HostContext>(Limits{.slaves = 200, .process_frames = 32});
        if (!init(*ctx, nic, osal) || !config_init(*ctx) || !config_map(*ctx, image)) return false;
        if (!send_processdata(*ctx) || !receive_processdata(*ctx, std::chrono::milliseconds(10))) return false;
        nic.keep_last = false;
        return true;
    }

    // From this call on, frames go to `other`, in real time.
    void plug_over(Nic& other) {
        nic.to = &other;
        osal.live = true;
    }
};

}  // namespace margay::bench
