#include "common/outer_ports.hpp"

#include <fmt/format.h>

#include <array>

namespace margay::samples {

void OuterPorts::Port::arrived(Bytes frame, Time) {
    if (tap.send(frame) != SendStatus::sent) ++dropped;
}

std::string OuterPorts::open(SimulatedSegment& segment, const std::string& prefix) {
    segment_ = &segment;
    for (std::uint32_t n = 0; n < segment.segment.size(); ++n) {
        auto* const device = segment.segment.slave(n).ethernet();
        if (device == nullptr) continue;
        auto& port = *ports_.emplace_back(std::make_unique<Port>());
        const auto name = fmt::format("{}{}", prefix, n);
        if (auto problem = port.tap.open(name); !problem.empty()) return problem;
        port.device = device;
        port.slave = n;
        device->connect(&port);
        names_.push_back(fmt::format("port of slave {} ({}): {}", n + 1, segment.names[n], name));
    }
    return ports_.empty() ? "no slave of the segment has an Ethernet port (EoE)" : std::string();
}

void OuterPorts::add_files(std::vector<pollfd>& files) const {
    for (const auto& port : ports_)
        if (port->device->has_room()) files.push_back({port->tap.wait_handle(), POLLIN, 0});
}

void OuterPorts::serve(Time now) {
    std::array<std::byte, 2048> buffer;
    for (const auto& port : ports_) {
        bool any = false;
        while (port->device->has_room()) {
            const auto size = port->tap.receive(buffer);
            if (size == 0) break;
            if (!port->device->put(Bytes(buffer).first(size))) ++port->dropped;
            any = true;
        }
        if (any) segment_->segment.interrupt(port->slave, now);
    }
}

std::uint64_t OuterPorts::dropped() const {
    std::uint64_t all = 0;
    for (const auto& port : ports_) all += port->dropped;
    return all;
}

}  // namespace margay::samples
