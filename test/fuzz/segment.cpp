// A segment receives random octets as frames. The frames can write the registers in any way: overlapping SyncManagers,
// FMMUs beyond the memory, SII and clock registers. The input is a sequence of frames. Each frame follows two octets
// with its length. The segment has a coupler, a terminal, a device with mailbox and program, a device with all features
// switched off, and a second master port.
#include "sim/segment.hpp"
#include "sim/devices.hpp"
#include "wire/sii_writer.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace {

using namespace margay;

void require(bool what) {
    if (!what) std::abort();
}

std::unique_ptr<sim::Segment> make_segment() {
    auto segment = std::make_unique<sim::Segment>();
    auto odd = sim::make_device("digital_out_8").value();
    odd.chip.features = 0x0E01;  // no bit operation of FMMUs, no LRW, no combined read and write
    odd.chip.fmmus = 16;
    odd.chip.sync_managers = 16;
    odd.chip.dc = sim::DcUnit::bits32;
    odd.chip.sii.emulated = true;
    odd.chip.ram_kib = 60;
    segment->add(sim::make_device("coupler").value().assemble());
    segment->add(sim::make_device("digital_in_16").value().assemble());
    segment->add(sim::make_device("pulse_axis").value().assemble());
    segment->add(std::move(odd).assemble());
    require(segment->connect_master({0, 0}));
    require(segment->connect({0, 1}, {1, 0}));
    require(segment->connect({1, 1}, {2, 0}));
    require(segment->connect({0, 2}, {3, 0}));
    require(segment->connect_master({2, 1}, 1));
    segment->power_up(Time{});
    return segment;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const auto segment = make_segment();
    // The state after power-up, so that the result of an input does not depend on earlier inputs.
    static Time now{};
    for (std::uint32_t n = 0; n < segment->size(); ++n) {
        segment->set_power(n, false, now);
        segment->set_power(n, true, now);
    }
    std::array<std::byte, 1600> frame{};
    while (size >= 2) {
        const auto length =
            std::min<std::size_t>({std::size_t{data[0]} | std::size_t{data[1]} << 8, size - 2, frame.size()});
        std::memcpy(frame.data(), data + 2, length);
        data += 2 + length;
        size -= 2 + length;
        now += std::chrono::microseconds(500);
        const auto passage = segment->process(MutableBytes(frame).first(length), now, length & 1);
        require(!passage.returned || passage.master_port < 2);
    }
    // After any writes the segment still works: all slaves exist, and time passes.
    now += std::chrono::milliseconds(200);
    segment->advance(now);
    for (std::uint32_t n = 0; n < segment->size(); ++n) (void)segment->slave(n).peek(0, 0x1000);
    return 0;
}
