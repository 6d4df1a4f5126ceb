#include "nic_check/read.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "wire/datagram.hpp"

#include <algorithm>
#include <array>

namespace margay::nic_check {

ProbeFacts probe(const std::string& name, unsigned frames) {
    constexpr auto kPatience = std::chrono::milliseconds(20);
    constexpr auto kPause = std::chrono::milliseconds(1);
    ProbeFacts facts;
    PacketNic nic;
    if (!nic.open(name)) {
        facts.problem = nic.problem();
        return facts;
    }
    LinuxOsal osal;
    std::array<std::byte, 1518> out{};
    std::array<std::byte, 1518> in{};
    for (unsigned n = 0; n < frames; ++n) {
        const auto index = static_cast<std::uint8_t>(n);
        wire::FrameBuilder builder(out, nic.source_mac());
        (void)builder.append(wire::Command::BRD, index, wire::DatagramAddress(0), 1);
        const auto begin = osal.now();
        if (nic.send(builder.finish()) != SendStatus::sent) continue;
        ++facts.sent;
        bool back = false;
        while (!back && osal.now() < begin + kPatience) {
            const auto length = nic.receive(in);
            if (length == 0) {
                osal.wait(begin + kPatience, nic.wait_handle());
                continue;
            }
            wire::DatagramReader reader(Bytes(in).first(std::min(length, in.size())));
            const auto reply = reader.next();
            // Late frames, and frames of another master.
            if (!reply || reply->header.command != wire::Command::BRD || reply->header.index != index) continue;
            back = true;
            if (reply->wkc == 0) {
                ++facts.echoes;
                continue;
            }
            facts.round_trip.record(osal.now() - begin);
            ++facts.returned;
            facts.slaves = reply->wkc;
        }
        osal.wait(osal.now() + kPause, -1);
    }
    return facts;
}

}  // namespace margay::nic_check
