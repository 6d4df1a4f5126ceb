#include "network/cycle_time.hpp"

#include <algorithm>

namespace margay {

void set_time_standby(ProcessGroup& group, StationAddress standby) {
    if (group.overlap.sets > 1) return;
    for (PreparedReading& reading : group.readings)
        if (reading.into == &group.dc_time) reading.standby = standby.value;
}

TimeSource time_source(const ProcessGroup& group) {
    for (const PreparedFrame& frame : group.prepared) {
        for (const PreparedReading& reading : frame.readings) {
            if (reading.into != &group.dc_time) continue;
            const Bytes head = Bytes(frame.bytes).subspan(reading.offset);
            return {wire::DatagramLayout::command::load(head), load_le<std::uint16_t>(head, 2)};
        }
    }
    return {};
}

bool redirect_time(ProcessGroup& group, const Slave* reference, std::uint64_t about_ns) {
    if (group.overlap.sets > 1) return false;
    for (const PreparedFrame& frame : group.prepared)
        if (frame.slot != nullptr) return false;
    const TimeSource source =
        reference == nullptr ? TimeSource{} : time_source_of(group.slaves, *reference, group.by_position);
    for (PreparedFrame& frame : group.prepared) {
        for (const PreparedReading& reading : frame.readings) {
            if (reading.into != &group.dc_time) continue;
            const MutableBytes head = MutableBytes(frame.bytes).subspan(reading.offset);
            wire::DatagramLayout::command::store(head, source.command);
            if (reference != nullptr) store_le<std::uint16_t>(head, 2, source.address);
            store_le<std::uint32_t>(head, wire::kDatagramHeaderBytes, static_cast<std::uint32_t>(about_ns));
        }
    }
    if (reference != nullptr) group.dc_reference = reference->number;
    group.dc_time.value = 0;  // the next time does not follow the last one
    group.dc_time.slaves = 0;
    return true;
}

// Calls `use` with the reading of the time and with the first octet of its datagram.
template <class Use>
static void with_time(ProcessGroup& group, Use use) {
    for (PreparedReading& reading : group.readings)
        if (reading.into == &group.dc_time && !group.prepared.empty())
            use(reading, MutableBytes(group.prepared.front().bytes).subspan(reading.offset));
}

SentTime sent_time(ProcessGroup& group) {
    SentTime sent;
    with_time(group, [&sent](const PreparedReading& reading, MutableBytes head) {
        sent.command = wire::DatagramLayout::command::load(head);
        std::ranges::copy(head.subspan(SentTime::kAddress, sent.address.size()), sent.address.begin());
        std::ranges::copy(head.subspan(wire::kDatagramHeaderBytes, reading.bytes), sent.data.begin());
        sent.standby = reading.standby;
        sent.known = true;
    });
    return sent;
}

void send_time_as(ProcessGroup& group, const SentTime& sent) {
    if (!sent.known) return;
    with_time(group, [&sent](PreparedReading& reading, MutableBytes head) {
        wire::DatagramLayout::command::store(head, sent.command);
        std::ranges::copy(sent.address, head.subspan(SentTime::kAddress).begin());
        std::ranges::copy(std::span(sent.data).first(reading.bytes), head.subspan(wire::kDatagramHeaderBytes).begin());
        reading.standby = sent.standby;
    });
}

}  // namespace margay
