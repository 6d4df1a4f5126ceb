#include "oshw/pcap/ring_recorder.hpp"

#include <array>

namespace margay {

Result<> PcapRingRecorder::open(const std::string& path, Duration epoch) {
    epoch_ = epoch;
    constexpr std::array<std::string_view, 2> kNames{"first NIC", "second NIC"};
    return file_.open(path, kNames);
}

void PcapRingRecorder::write(const PacketOrigin& origin, std::span<const std::byte> frame) noexcept {
    file_.write(origin, clock_.now().time_since_epoch() + epoch_, frame);
}

// A busy NIC gets the same frame again later, so a frame with the status "busy" is not recorded.
SendStatus PcapRingRecorder::End::send(std::span<const std::byte> frame) noexcept {
    using Direction = PacketOrigin::Direction;
    const auto status = inner().send(frame);
    if (status != SendStatus::busy)
        recorder_.write({number_, status == SendStatus::sent ? Direction::sent : Direction::refused}, frame);
    return status;
}

std::size_t PcapRingRecorder::End::receive(std::span<std::byte> into) noexcept {
    const auto length = inner().receive(into);
    if (length != 0) recorder_.write({number_, PacketOrigin::Direction::received}, into.first(length));
    return length;
}

}  // namespace margay
