#include "analyse/analyser.hpp"

#include "analyse/names.hpp"

namespace margay::analyse {

void forget_losses(Analysis& analysis) {
    analysis.losses_known = false;
    analysis.frames.lost = analysis.frames.open = 0;
    for (auto& cyclic : analysis.cyclic) cyclic.lost = 0;
}

namespace {

// Deletes the values that a tap between slaves falsifies: such a tap shows each frame twice, first with the working
// counters of some slaves and then with the working counters of all slaves.
void forget_counters(Analysis& analysis) {
    analysis.passes_twice = true;
    analysis.shortfalls = {};
    analysis.ring_sizes = {};
    analysis.frames.late = 0;
    for (auto& slave : analysis.slaves) slave.unanswered = 0;
    for (auto& cyclic : analysis.cyclic) {
        cyclic.late = 0;
        cyclic.intervals = {};
        for (auto& datagram : cyclic.datagrams) datagram.wkcs.clear();
    }
}

}  // namespace

Analyser::Analyser()
    : slaves_(analysis_),
      states_(analysis_, slaves_),
      mail_(analysis_, slaves_),
      cycles_(analysis_),
      clocks_(analysis_, slaves_),
      manners_(analysis_),
      exchanges_(
          analysis_.frames, [this](const KeptFrame& request) { sent(request); },
          [this](const Exchanged& e, std::size_t) { datagram(e); },
          [this](const KeptFrame& request, bool answered, bool late) {
              cycles_.frame(request, answered, late);
              if (!request.bytes.empty()) manners_.frame(request.bytes);
          }) {}

void Analyser::packet(Moment when, Bytes packet, std::size_t length_on_wire) {
    auto& counts = analysis_.frames;
    ++counts.packets;
    const auto frame = finder_.find(packet);
    if (!frame) return;
    if (!is_of_datagrams(frame->bytes)) {
        ++counts.other_types;
        return;
    }
    if (packet.size() < length_on_wire) {
        ++counts.cut;
        return;
    }
    if (!has_datagrams(frame->bytes)) {
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

void Analyser::sent(const KeptFrame& request) {
    cycles_.sent(request);
    const auto directions = exchanges_.directions();
    if (directions == Directions::requests_only || directions == Directions::replies_only) return;
    Exchanges::datagrams_of(request, [this](const Exchanged& e, std::size_t) { mail_.note_sent(e); });
}

void Analyser::datagram(const Exchanged& e) {
    auto* slave = wire::is_logical(e.header.command) ? nullptr : slaves_.find(e);
    cycles_.datagram(e);
    if (wire::is_logical(e.header.command)) return;
    slave = slaves_.look(e, slave);
    states_.look(e, slave);
    clocks_.look(e, slave);
    manners_.datagram(e);
    mail_.look(e, slave);
    if (slave == nullptr) return;
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
    if (analysis_.directions == Directions::requests_only || analysis_.directions == Directions::replies_only)
        forget_losses(analysis_);
    if (exchanges_.passes_twice()) forget_counters(analysis_);
    clocks_.finish();
    manners_.finish();
    for (const auto& track : slaves_.all()) name_slave(slaves_.facts(track), track);
    slaves_.finish();
    return std::move(analysis_);
}

}  // namespace margay::analyse
