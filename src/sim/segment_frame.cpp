// Segment: processing of a frame. Each datagram is processed in all slaves before the next datagram. Each slave sees
// the datagrams in the same order as on a real wire, and slaves influence each other only through the frame, so the
// result is the same as if each slave processed the whole frame in turn.
#include "sim/segment.hpp"

#include <algorithm>
#include <cstring>

namespace margay::sim {

namespace {

using wire::Command;
using Layout = wire::DatagramLayout;

constexpr std::uint16_t kEtherTypeVlan = 0x8100;
constexpr std::uint16_t kEtherTypeIpv4 = 0x0800;
constexpr std::uint16_t kUdpPort = 0x88A4;
constexpr std::uint16_t kCirculating = 0x4000;
constexpr std::uint16_t kMore = 0x8000;

std::uint16_t load_be16(Bytes from, std::size_t at) {
    return static_cast<std::uint16_t>((std::to_integer<unsigned>(from[at]) << 8) |
                                      std::to_integer<unsigned>(from[at + 1]));
}

// Offset of the EtherCAT frame header: after the Ethernet header, a VLAN tag, or IPv4 and UDP. 0: not an EtherCAT
// frame.
std::size_t find_ethercat(MutableBytes frame) {
    std::size_t at = wire::kEthernetHeaderBytes;
    if (frame.size() < at) return 0;
    auto type = load_be16(frame, at - 2);
    if (type == kEtherTypeVlan && frame.size() >= at + 4) {
        at += 4;
        type = load_be16(frame, at - 2);
    }
    if (type == kEtherTypeIpv4 && frame.size() >= at + 28) {
        constexpr std::byte kIpv4NoOptions{0x45};
        constexpr std::byte kUdp{17};
        if (frame[at] != kIpv4NoOptions || frame[at + 9] != kUdp || load_be16(frame, at + 22) != kUdpPort) return 0;
        frame[at + 26] = frame[at + 27] = std::byte{0};  // the slaves change the data, so the checksum would be wrong
        at += 28;
    } else if (type != wire::kEtherTypeEtherCat) {
        return 0;
    }
    if (frame.size() < at + wire::kFrameHeaderBytes) return 0;
    return wire::load_frame_header(Bytes(frame).subspan(at)).type == wire::kFrameTypeDatagrams ? at : 0;
}

void add_wkc(MutableBytes frame, std::size_t at, unsigned by) {
    store_le(frame, at, static_cast<std::uint16_t>(load_le<std::uint16_t>(frame, at) + by));
}

}  // namespace

struct Segment::Frame {
    MutableBytes bytes;
    Route& route;
    std::uint32_t visits;  // number of processing units that receive the frame undamaged
    Time start;
    Duration duration;
    bool well_formed = true;
    bool destroyed = false;
    FaultKind fault = FaultKind::none;
    std::size_t fault_hop = 0;
};

Segment::Passage Segment::process(MutableBytes bytes, Time now, unsigned master_port, Duration duration) {
    advance(now);
    auto& way = route(master_port);
    Frame frame{bytes, way, static_cast<std::uint32_t>(way.visits.size()), now, duration};
    Passage passage;
    if (way.hops.empty()) return passage;
    if (noisy_ || next_fault_.kind != FaultKind::none) pick_fault(frame);

    const auto at = find_ethercat(bytes);
    if (at != 0) {
        run_datagrams(frame);
        end_frame(frame);
    } else {
        for (const auto& visit : way.visits)
            if ((slave(visit.slave).dl_control() & 1) != 0) frame.destroyed = true;
    }
    passage.changed = frame.visits != 0;
    if (at != 0 && passage.changed && bytes.size() > wire::kSourceMacOffset)
        bytes[wire::kSourceMacOffset] |= wire::kPassedEscBit;
    if (frame.fault == FaultKind::corruption) count_errors(frame);
    passage.returned = way.returns && !frame.destroyed && frame.fault == FaultKind::none;
    passage.master_port = way.exit_port;
    passage.at = now + way.exit_offset;
    if (way.knocks && frame.fault == FaultKind::none && !frame.destroyed) {
        update_ports(way.knocks_at.slave, false, way.knocks_at.port);
        topology_changed();
    }
    return passage;
}

// ESCs ignore the length in the frame header. They use the lengths and "more" bits of the datagrams.
void Segment::run_datagrams(Frame& frame) {
    const auto bytes = frame.bytes;
    std::size_t offset = find_ethercat(bytes) + wire::kFrameHeaderBytes;
    for (bool more = true; more;) {
        if (offset + wire::kDatagramOverheadBytes > bytes.size()) break;
        const auto word = Layout::length_and_flags::load(Bytes(bytes).subspan(offset));
        const std::size_t length = word & 0x07FF;
        if (offset + wire::kDatagramOverheadBytes + length > bytes.size()) break;
        more = (word & kMore) != 0;
        if (frame.route.circulating_at < frame.visits) {
            if ((word & kCirculating) != 0) {
                frame.destroyed = true;
                frame.visits = frame.route.circulating_at;
            } else {
                store_le(bytes, offset + 6, static_cast<std::uint16_t>(word | kCirculating));
            }
        }
        run(frame, offset);
        offset += wire::kDatagramOverheadBytes + length;
        if (!more) return;
    }
    frame.well_formed = false;
}

void Segment::run(Frame& frame, std::size_t offset) {
    const auto header = frame.bytes.subspan(offset);
    const auto command = Layout::command::load(header);
    const auto address = wire::DatagramAddress(Layout::address::load(header));
    const auto& route = frame.route;
    switch (command) {
        case Command::APRD:
        case Command::APWR:
        case Command::APRW: {
            const std::uint32_t first = static_cast<std::uint16_t>(-address.adp());
            for (std::uint32_t v = first; v < frame.visits; v += 0x10000)
                physical(frame, v, offset, command != Command::APWR, command != Command::APRD, false);
            break;
        }
        case Command::FPRD:
        case Command::FPWR:
        case Command::FPRW:
            for (std::uint32_t v = 0; v < frame.visits; ++v)
                if (route.station[v] == address.adp() || (route.aliases && route.alias[v] == address.adp()))
                    physical(frame, v, offset, command != Command::FPWR, command != Command::FPRD, false);
            break;
        case Command::BRD:
        case Command::BWR:
        case Command::BRW:
            for (std::uint32_t v = 0; v < frame.visits; ++v)
                physical(frame, v, offset, command != Command::BWR, command != Command::BRD, true);
            break;
        case Command::LRD: logical(frame, offset, true, false); break;
        case Command::LWR: logical(frame, offset, false, true); break;
        case Command::LRW: logical(frame, offset, true, true); break;
        case Command::ARMW: multiple_write(frame, offset, true); break;
        case Command::FRMW: multiple_write(frame, offset, false); break;
        case Command::NOP: break;
    }
    if (wire::counts_position(command)) store_le(header, 2, static_cast<std::uint16_t>(address.adp() + frame.visits));
    if (route.any_irq != 0) {
        auto irq = Layout::irq::load(header);
        for (std::uint32_t v = 0; v < frame.visits; ++v) irq = static_cast<std::uint16_t>(irq | route.irq[v]);
        Layout::irq::store(header, irq);
    }
}

// One slave, by its physical memory. A read adds 1 to the working counter, a write adds 1, both together add 3
// (ETG.1000.4 table "Working counter increment").
void Segment::physical(Frame& frame, std::uint32_t visit, std::size_t offset, bool read, bool write, bool merge) {
    const auto bytes = frame.bytes;
    const auto ado = load_le<std::uint16_t>(bytes, offset + 4);
    const std::size_t length = load_le<std::uint16_t>(bytes, offset + 6) & 0x07FF;
    const auto data = bytes.subspan(offset + wire::kDatagramHeaderBytes, length);
    auto& esc = *frame.route.esc[visit];
    const Time at = frame.start + frame.route.visits[visit].offset;
    if (read && write && (esc.description().features & wire::features::kReadWriteNotSupported) != 0) return;

    unsigned count = 0;
    if (!write && !merge) {
        count = esc.ecat_read(ado, data, at) ? 1 : 0;
    } else if (!read) {
        count = esc.ecat_write(ado, data, at) ? 1 : 0;
    } else {
        std::array<std::byte, 2048> out;
        const auto own = MutableBytes(out).first(length);
        if (merge)
            std::fill(own.begin(), own.end(), std::byte{0});
        else
            std::copy(data.begin(), data.end(), own.begin());
        // 0x0108: offset from the read address to the write address of APRW and FPRW.
        const auto behind = merge ? std::uint16_t{0} : esc.read_write_offset();
        const bool was_read = esc.ecat_read(ado, own, at);
        const bool was_written = write && esc.ecat_write(static_cast<std::uint16_t>(ado + behind), data, at);
        if (was_read)
            for (std::size_t i = 0; i < length; ++i) data[i] = merge ? data[i] | own[i] : own[i];
        count = (was_read ? 1u : 0u) + (was_written ? 2u : 0u);
    }
    if (count != 0) add_wkc(bytes, offset + wire::kDatagramHeaderBytes + length, count);
    touch(frame, visit);
}

void Segment::logical(Frame& frame, std::size_t offset, bool read, bool write) {
    const auto bytes = frame.bytes;
    const auto address = load_le<std::uint32_t>(bytes, offset + 2);
    const std::size_t length = load_le<std::uint16_t>(bytes, offset + 6) & 0x07FF;
    if (length == 0) return;
    const auto data = bytes.subspan(offset + wire::kDatagramHeaderBytes, length);
    const auto last =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(std::uint64_t{address} + length - 1, UINT32_MAX));
    const auto* firsts = frame.route.logical_first.data();
    const auto* lasts = frame.route.logical_last.data();
    const auto meant = [&](std::uint32_t v) {
        return lasts[v] >= address && firsts[v] <= last && firsts[v] <= lasts[v];
    };
    constexpr std::uint32_t kAhead = 3;  // number of slaves whose memory is prefetched before it is needed
    for (std::uint32_t v = 0; v < frame.visits; ++v) {
        if (v + 2 * kAhead < frame.visits && meant(v + 2 * kAhead)) frame.route.esc[v + 2 * kAhead]->fetch_state();
        if (v + kAhead < frame.visits && meant(v + kAhead)) frame.route.esc[v + kAhead]->fetch_buffers();
        if (!meant(v)) continue;
        const auto count =
            frame.route.esc[v]->ecat_logical(read, write, address, data, frame.start + frame.route.visits[v].offset);
        if (count != 0) add_wkc(bytes, offset + wire::kDatagramHeaderBytes + length, count);
        touch(frame, v);
    }
}

// ARMW, FRMW: the addressed slave reads, all other slaves write the data that passes them.
void Segment::multiple_write(Frame& frame, std::size_t offset, bool by_position) {
    const auto adp = load_le<std::uint16_t>(frame.bytes, offset + 2);
    const auto& route = frame.route;
    for (std::uint32_t v = 0; v < frame.visits; ++v) {
        const bool meant = by_position ? static_cast<std::uint16_t>(adp + v) == 0
                                       : route.station[v] == adp || (route.aliases && route.alias[v] == adp);
        physical(frame, v, offset, meant, !meant, false);
    }
}

void Segment::touch(Frame& frame, std::uint32_t visit) {
    if (frame.route.esc[visit]->newly_pending()) touched_.push_back(visit);
}

void Segment::end_frame(Frame& frame) {
    for (const auto v : touched_) {
        auto& esc = *frame.route.esc[v];
        const Time passed = frame.start + frame.route.visits[v].offset;
        FrameEnd end{frame.well_formed, passed + frame.duration, passed, {}};
        // The receive times may be latched by these writes.
        for (unsigned p = 0; p < kMaxPorts && esc.register_writes_pending(); ++p) {
            const auto offset = frame.route.ports[v][p];
            end.ports[p] = offset < Duration::zero() ? kNever : frame.start + offset;
        }
        esc.frame_end(end);
        next_event_ = std::min(next_event_, esc.next_event());
        if (frame.route.configuration[v] != esc.configuration()) note_change(frame.route.visits[v].slave);
    }
    touched_.clear();
    if (!frame.well_formed)
        for (std::uint32_t v = 0; v < frame.visits; ++v) slave(frame.route.visits[v].slave).count_processing_error();
}

// --- Loss and corruption ---

void Segment::pick_fault(Frame& frame) {
    const auto& hops = frame.route.hops;
    const auto strike = [&](FaultKind kind, std::size_t hop) {
        frame.fault = kind;
        frame.fault_hop = hop;
        if (hop < hops.size()) frame.visits = std::min(frame.visits, hops[hop].visits_before);
    };
    if (next_fault_.kind != FaultKind::none) {
        for (std::size_t h = 0; h < hops.size(); ++h) {
            if (hops[h].at != next_fault_.end) continue;
            strike(next_fault_.kind, h);
            next_fault_ = {};
            return;
        }
    }
    const auto chance = [&] {  // xorshift64*
        random_ ^= random_ >> 12;
        random_ ^= random_ << 25;
        random_ ^= random_ >> 27;
        return static_cast<double>((random_ * 0x2545F4914F6CDD1Du) >> 11) * 0x1.0p-53;
    };
    const double dice = chance();
    if (dice >= noise_.lost + noise_.corrupted) return;
    // Selects one of the cables on the path, including the cable back to the master.
    const auto hop = std::min(static_cast<std::size_t>(chance() * static_cast<double>(hops.size() + 1)), hops.size());
    strike(dice < noise_.lost ? FaultKind::loss : FaultKind::corruption, hop);
}

// The first port that receives the damaged frame counts it as invalid; all later ports count a forwarded error.
void Segment::count_errors(const Frame& frame) {
    const auto& hops = frame.route.hops;
    for (auto h = frame.fault_hop; h < hops.size(); ++h)
        slave(hops[h].at.slave).count_rx_error(hops[h].at.port, h != frame.fault_hop);
    for (auto v = frame.visits; v < frame.route.visits.size(); ++v)
        slave(frame.route.visits[v].slave).count_processing_error();
}

}  // namespace margay::sim
