#include "ethercat/analysis_output.hpp"

#include "wire/al_status_code.hpp"
#include "wire/emergency_code.hpp"
#include "wire/text.hpp"

#include <nlohmann/json.hpp>

namespace margay::ethercat {
namespace {

using analyse::Analysis;
using Json = nlohmann::ordered_json;

Json json_of(const analyse::Moment& m) { return {{"frame", m.frame}, {"time_ns", m.at.count()}}; }

template <class T>
Json json_of(const std::optional<T>& value) {
    return value ? Json(*value) : Json(nullptr);
}

Json json_of(const analyse::Deviation& d) {
    if (d.count == 0) return nullptr;
    return {{"count", d.count},       {"first_ns", d.first_ns}, {"last_ns", d.last_ns},
            {"least_ns", d.least_ns}, {"most_ns", d.most_ns},   {"largest_at", json_of(d.largest_at)}};
}

Json lost_json(const Analysis& a, std::uint64_t lost) { return a.losses_known ? Json(lost) : Json(nullptr); }

Json late_json(const Analysis& a, std::uint64_t late) { return late_known(a) ? Json(late) : Json(nullptr); }

Json frames_json(const Analysis& a) {
    const auto& f = a.frames;
    return {{"packets", f.packets},
            {"ethercat", f.ethercat},
            {"requests", f.requests},
            {"replies", f.replies},
            {"lost", lost_json(a, f.lost)},
            {"late", late_json(a, f.late)},
            {"open", f.open},
            {"unasked", f.unasked},
            {"vlan", f.vlan},
            {"udp", f.udp},
            {"other_types", f.other_types},
            {"cut", f.cut},
            {"dropped", f.dropped},
            {"damaged", f.damaged},
            {"shortest_trip_ns", f.shortest_trip.count()},
            {"longest_trip_ns", f.longest_trip.count()},
            {"longest_trip_at", json_of(f.longest_trip_at)}};
}

Json pdos_json(const analyse::Slave& s) {
    auto all = Json::array();
    for (const auto& pdo : s.pdos) {
        auto entries = Json::array();
        for (const auto& e : pdo.entries)
            entries.push_back({{"index", e.index}, {"subindex", e.subindex}, {"bits", e.bits}, {"name", e.name}});
        all.push_back({{"index", pdo.index},
                       {"sync_manager", pdo.sync_manager >= 0 ? Json(pdo.sync_manager) : Json(nullptr)},
                       {"direction", pdo.input ? "input" : "output"},
                       {"name", pdo.name},
                       {"entries", std::move(entries)}});
    }
    return all;
}

Json slave_json(std::size_t number, const analyse::Slave& s) {
    Json mail = Json::object();
    for (const auto& [type, counts] : s.mail)
        mail[std::string(wire::to_text(type))] = {{"sent", counts.sent},
                                                  {"received", counts.received},
                                                  {"sent_octets", counts.sent_bytes},
                                                  {"received_octets", counts.received_bytes},
                                                  {"errors", counts.errors}};
    const auto& c = s.clock;
    Json clock = nullptr;
    if (c.seen())
        clock = {{"offset_ns", json_of(c.offset_ns)},
                 {"delay_ns", json_of(c.delay_ns)},
                 {"activation", json_of(c.activation)},
                 {"start_ns", json_of(c.start_ns)},
                 {"sync0_cycle_ns", json_of(c.sync0_cycle_ns)},
                 {"sync1_cycle_ns", json_of(c.sync1_cycle_ns)},
                 {"deviation", json_of(c.deviation)}};
    return {{"slave", number},
            {"position", json_of(s.position)},
            {"station", json_of(s.station)},
            {"alias", json_of(s.alias)},
            {"vendor", json_of(s.vendor)},
            {"product", json_of(s.product)},
            {"revision", json_of(s.revision)},
            {"serial", json_of(s.serial)},
            {"name", s.name},
            {"order", s.order},
            {"state", s.state ? Json(state_words(*s.state)) : Json(nullptr)},
            {"sii_octets", s.sii_octets},
            {"unanswered", s.unanswered},
            {"mail", std::move(mail)},
            {"clock", std::move(clock)},
            {"pdos_by", s.pdos.empty() ? Json(nullptr) : Json(s.pdos_by_coe ? "coe" : "sii")},
            {"pdos", pdos_json(s)}};
}

Json state_json(const analyse::StateEvent& e) {
    Json out{{"at", json_of(e.when)},
             {"slave", json_of(e.slave)},
             {"kind", e.requested ? "requested" : "reported"},
             {"state", state_words(e.status)}};
    if (e.requested) out["acknowledge"] = e.acknowledge;
    if (e.status.code != 0) {
        out["code"] = e.status.code;
        out["code_text"] = wire::al_status_text(e.status.code);
    }
    return out;
}

Json conversation_json(const analyse::Conversation& c) {
    Json out{{"begin", json_of(c.begin)},
             {"end", json_of(c.end)},
             {"slave", c.slave},
             {"action", key_of(c.action)},
             {"text", words_of(c)},
             {"index", c.index_known ? Json(c.index) : Json(nullptr)},
             {"subindex", c.subindex},
             {"complete", c.complete},
             {"name", c.name},
             {"octets", c.bytes},
             {"data", octet_list(c.data)},
             {"outcome", words_of(c.outcome)}};
    if (c.outcome == analyse::Outcome::refused) {
        out["code"] = c.code;
        out["reason"] = c.reason;
    }
    if (c.action == analyse::Action::soe_read || c.action == analyse::Action::soe_write) out["elements"] = c.elements;
    if (c.late) out["late"] = true;  // answered after the next request
    return out;
}

Json intervals_json(const analyse::Intervals& i) {
    return {{"count", i.count},
            {"median_ns", i.median.count()},
            {"mean_ns", i.mean_ns},
            {"deviation_ns", i.deviation_ns},
            {"least_ns", i.least.count()},
            {"low_1_ns", i.low_1.count()},
            {"high_99_ns", i.high_99.count()},
            {"most_ns", i.most.count()},
            {"most_at", json_of(i.most_at)},
            {"late", i.late},
            {"pauses", i.pauses}};
}

Json cyclic_json(const Analysis& a, const analyse::CyclicFrame& c) {
    auto datagrams = Json::array();
    for (const auto& d : c.datagrams) {
        auto wkcs = Json::array();
        for (const auto& [wkc, count] : d.wkcs) wkcs.push_back({{"wkc", wkc}, {"count", count}});
        if (a.passes_twice) wkcs = nullptr;
        datagrams.push_back({{"command", wire::to_text(d.command)},
                             {"address", d.address},
                             {"length", d.length},
                             {"working_counters", std::move(wkcs)}});
    }
    return {{"first", json_of(c.first)},
            {"last", json_of(c.last)},
            {"count", c.count},
            {"lost", lost_json(a, c.lost)},
            {"late", late_json(a, c.late)},
            {"overlapping", c.overlapping},
            {"datagrams", std::move(datagrams)},
            {"intervals", a.passes_twice ? Json(nullptr) : intervals_json(c.intervals)}};
}

template <class T, class Convert>
void put(Json& out, const std::string& name, const analyse::Bounded<T>& list, const Convert& convert) {
    auto all = Json::array();
    for (const auto& item : list.items) all.push_back(convert(item));
    out[name] = std::move(all);
    if (list.left_out != 0) out[name + "_left_out"] = list.left_out;
}

}  // namespace

Json analysis_json(const Analysis& a) {
    Json out{{"duration_ns", a.duration.count()},
             {"directions", words_of(a.directions)},
             {"ring", a.ring},
             {"passes_twice", a.passes_twice},
             {"interface", json_of(a.interface)},
             {"remark", a.remark},
             {"frames", frames_json(a)},
             {"master",
              {{"name", a.master.name.empty() ? "unknown" : a.master.name},
               {"reasons", a.master.reasons},
               {"addresses", a.master.addresses}}}};
    auto slaves = Json::array();
    for (std::size_t i = 0; i < a.slaves.size(); ++i) slaves.push_back(slave_json(i, a.slaves[i]));
    out["slaves"] = std::move(slaves);
    out["slaves_left_out"] = a.slaves_left_out;
    put(out, "ring_sizes", a.ring_sizes, [](const auto& r) {
        return Json{{"at", json_of(r.when)}, {"slaves", r.slaves}};
    });
    put(out, "states", a.states, state_json);
    put(out, "conversations", a.conversations, conversation_json);
    put(out, "emergencies", a.emergencies, [](const auto& e) {
        return Json{{"at", json_of(e.when)},
                    {"slave", e.slave},
                    {"code", e.code},
                    {"text", wire::emergency_text(e.code)},
                    {"error_register", e.error_register},
                    {"data", octet_list({e.data.begin(), e.data.end()})}};
    });
    auto cyclic = Json::array();
    for (const auto& c : a.cyclic) cyclic.push_back(cyclic_json(a, c));
    out["cyclic"] = std::move(cyclic);
    out["cyclic_left_out"] = a.cyclic_left_out;
    put(out, "shortfalls", a.shortfalls, [](const auto& s) {
        return Json{{"begin", json_of(s.begin)}, {"end", s.end ? json_of(*s.end) : Json(nullptr)},
                    {"cyclic", s.cyclic_frame},  {"datagram", s.datagram},
                    {"expected", s.expected},    {"least", s.least},
                    {"frames", s.frames}};
    });
    const auto& r = a.reference;
    out["reference_clock"] = r.readings == 0 ? Json(nullptr)
                                             : Json{{"slave", json_of(r.slave)},
                                                    {"readings", r.readings},
                                                    {"first_ns", r.first_ns},
                                                    {"last_ns", r.last_ns},
                                                    {"drift_ppm", json_of(r.drift_ppm)},
                                                    {"drift_within_ppm", r.drift_within_ppm}};
    out["worst_deviation"] = json_of(a.worst_deviation);
    auto others = Json::array();
    for (const auto& other : a.others) others.push_back(analysis_json(other));
    out["other_masters"] = std::move(others);
    return out;
}

}  // namespace margay::ethercat
