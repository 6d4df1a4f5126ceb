#include "analyse/analyser.hpp"

#include "analyse/names.hpp"
#include "analyse/ring_copies.hpp"
#include "oshw/pcap/packet_reader.hpp"

namespace margay::analyse {

Analyser::Analyser()
    : slaves_(analysis_),
      states_(analysis_, slaves_),
      mail_(analysis_, slaves_),
      cycles_(analysis_),
      clocks_(analysis_, slaves_),
      manners_(analysis_),
      exchanges_(
          analysis_.frames, [this](const Exchanged& e, std::size_t) { datagram(e); },
          [this](const KeptFrame& request, bool answered, bool late) {
              cycles_.frame(request, answered, late);
              if (!request.bytes.empty()) manners_.frame(request.bytes);
          }) {}

void Analyser::packet(Moment when, Bytes packet, std::size_t length_on_wire) {
    auto& counts = analysis_.frames;
    ++counts.packets;
    const auto frame = finder_.find(packet);
    if (!frame) return;
    if (wire::load_frame_header(frame->bytes.subspan(wire::kEthernetHeaderBytes)).type != wire::kFrameTypeDatagrams) {
        ++counts.other_types;
        return;
    }
    if (packet.size() < length_on_wire) {
        ++counts.cut;
        return;
    }
    wire::DatagramReader reader(frame->bytes);
    std::size_t datagrams = 0;
    while (reader.next()) ++datagrams;
    // Masters announce more octets than their datagrams have; slaves and we accept them.
    if (datagrams == 0 || (reader.fault() != wire::FrameFault::none && reader.fault() != wire::FrameFault::trailing)) {
        ++counts.damaged;
        return;
    }
    if (!any_) analysis_.begin = when.at;
    if (any_ && when.at < last_.at && steps_back_++ == 0) first_step_back_ = when.frame;
    any_ = true;
    last_ = when;
    ++counts.ethercat;
    if (frame->vlan) ++counts.vlan;
    if (frame->udp) ++counts.udp;
    exchanges_.take(when, frame->bytes);
}

void Analyser::datagram(const Exchanged& e) {
    auto* slave = wire::is_logical(e.header.command) ? nullptr : slaves_.find(e);
    cycles_.datagram(e);
    if (wire::is_logical(e.header.command)) return;
    slaves_.look(e, slave);
    states_.look(e, slave);
    clocks_.look(e, slave);
    manners_.datagram(e);
    if (slave == nullptr) return;
    mail_.look(e, slave);
    if (e.answered && e.wkc == 0 && !MailWatch::is_look(e, slave)) {
        auto& facts = slaves_.facts(*slave);
        if (facts.unanswered++ == 0) facts.first_unanswered = e.at;
    }
}

Analysis Analyser::finish() {
    exchanges_.finish(last_.at);
    analysis_.directions = exchanges_.directions();
    analysis_.duration = last_.at - analysis_.begin;
    mail_.finish(last_);
    cycles_.finish();
    clocks_.finish();
    manners_.finish();
    if (steps_back_ != 0)
        analysis_.remark = "the packets are not in order of time (" + std::to_string(steps_back_) +
                           (steps_back_ == 1 ? " time" : " times") + ", first at packet #" +
                           std::to_string(first_step_back_) +
                           "): replies and times may be wrong; put them in order, as reordercap does";
    for (const auto& track : slaves_.all()) name_slave(slaves_.facts(track), track);
    return std::move(analysis_);
}

Analysis analyse_file(const std::string& path) {
    PacketReader reader;
    Analyser analyser;
    const auto opened = reader.open(path);
    const auto take = [&](Moment when, Bytes packet, std::size_t length) { analyser.packet(when, packet, length); };
    RingCopies ring(take);
    const auto origins = opened.ok() ? read_packet_origins(path) : std::vector<PacketOrigin>();
    const bool is_ring = RingCopies::is_ring(origins);
    while (const auto packet = reader.next()) {
        const Moment when{packet->number, packet->at};
        if (is_ring && packet->number <= origins.size())
            ring.packet(origins[packet->number - 1], when, packet->bytes, packet->length_on_wire);
        else
            take(when, packet->bytes, packet->length_on_wire);
    }
    ring.finish();
    auto analysis = analyser.finish();
    analysis.frames.packets += ring.merged();
    if (!reader.problem().empty())
        analysis.problem = reader.problem();
    else if (!opened.ok())
        analysis.problem = "it cannot be read";
    else if (analysis.frames.ethercat == 0)
        analysis.problem = analysis.frames.cut != 0
                               ? "every EtherCAT frame was cut by the recorder; record with full length"
                               : "it holds no EtherCAT frame";
    if (const auto cut = reader.cut_off(); !cut.empty())
        analysis.remark = analysis.remark.empty() ? cut : cut + "; " + analysis.remark;
    analysis.ring = is_ring;
    return analysis;
}

}  // namespace margay::analyse
