#include "ethercat/analysis_output.hpp"

#include "common/counted.hpp"
#include "wire/al_status_code.hpp"
#include "wire/emergency_code.hpp"
#include "wire/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

namespace margay::ethercat {
namespace {

using analyse::Analysis;
using analyse::Moment;
using samples::counted;

constexpr std::size_t kShown = 200;  // entries of a list without --verbose

std::string seconds(Duration at) { return fmt::format("{:.6f} s", static_cast<double>(at.count()) / 1e9); }
std::string micro(double ns) { return fmt::format("{:.1f} us", ns / 1e3); }
std::string micro(Duration d) { return micro(static_cast<double>(d.count())); }
std::string when(const Moment& m) { return fmt::format("{:>14} #{:<8}", seconds(m.at), m.frame); }
std::string place(const Moment& m) { return fmt::format("{} (frame {})", seconds(m.at), m.frame); }

std::string slave_name(const Analysis& a, std::size_t number) {
    const auto& s = a.slaves[number];
    if (s.position) return fmt::format("slave {}", *s.position);
    return fmt::format("station 0x{:04x}", s.station.value_or(0));
}

// The first `kShown` entries of a list, by `line`.
template <class T>
std::string list_text(std::string_view title, const analyse::Bounded<T>& list, bool verbose,
                      const std::function<std::string(const T&)>& line) {
    if (list.items.empty()) return {};
    std::string text = fmt::format("\n{} ({})\n", title, list.items.size() + list.left_out);
    const auto shown = verbose ? list.items.size() : std::min(list.items.size(), kShown);
    for (std::size_t i = 0; i < shown; ++i) text += "  " + line(list.items[i]) + "\n";
    if (shown < list.items.size())
        text += fmt::format("  … {} more; --verbose shows them\n", list.items.size() - shown);
    if (list.left_out != 0) text += fmt::format("  {} more are beyond the limit of the list\n", list.left_out);
    return text;
}

std::string frames_text(const Analysis& a) {
    const auto& f = a.frames;
    std::string text = fmt::format("Recording\n  {}, {} in {}\n  {}\n  {}, {}, {}, {}\n", counted(f.packets, "packet"),
                                   counted(f.ethercat, "EtherCAT frame"), seconds(a.duration), words_of(a.directions),
                                   counted(f.requests, "request"), counted(f.replies, "reply", "replies"),
                                   lost_words(a, f.lost), late_words(a, f.late));
    const auto count = [&](std::uint64_t n, std::string_view one, std::string_view many) {
        if (n != 0) text += "  " + counted(n, one, many) + "\n";
    };
    if (a.ring) text += "  both NICs of a ring: the copies of a frame are counted as one frame\n";
    count(f.open, "request shortly before the end, whose reply may come behind it",
          "requests shortly before the end, whose replies may come behind it");
    count(f.unasked, "reply without a request", "replies without a request");
    count(f.vlan, "frame in a VLAN tag", "frames in VLAN tags");
    count(f.udp, "frame in UDP", "frames in UDP");
    count(f.other_types, "EtherCAT frame without datagrams (mailbox gateway or network variables)",
          "EtherCAT frames without datagrams (mailbox gateway or network variables)");
    count(f.cut, "EtherCAT frame that the recorder has cut; it is not analysed",
          "EtherCAT frames that the recorder has cut; they are not analysed");
    count(f.damaged, "EtherCAT frame with lengths that contradict each other; it is not analysed",
          "EtherCAT frames with lengths that contradict each other; they are not analysed");
    if (f.longest_trip.count() != 0)
        text += fmt::format("  round trip {} to {}, the longest at {}\n", micro(f.shortest_trip), micro(f.longest_trip),
                            place(f.longest_trip_at));
    if (!a.remark.empty()) text += "  " + a.remark + "\n";
    return text;
}

std::string master_text(const Analysis& a) {
    std::string text = fmt::format("\nMaster\n  {}\n", a.master.name.empty() ? "unknown" : a.master.name);
    for (const auto& reason : a.master.reasons) text += "    " + reason + "\n";
    if (!a.master.addresses.empty()) text += fmt::format("  source address {}\n", fmt::join(a.master.addresses, ", "));
    return text;
}

std::string deviation_text(const analyse::Deviation& d) {
    return fmt::format("{} to {} ns, last {} ns, {}, largest at {}", d.least_ns, d.most_ns, d.last_ns,
                       counted(d.count, "reading"), place(d.largest_at));
}

std::string clock_text(const analyse::Clock& c) {
    std::string text;
    if (c.offset_ns) text += fmt::format("      offset {} ns (0x0920)\n", *c.offset_ns);
    if (c.delay_ns) text += fmt::format("      delay {} ns (0x0928)\n", *c.delay_ns);
    if (c.activation) text += fmt::format("      SYNC activation 0x{:02x} (0x0981)\n", *c.activation);
    if (c.start_ns) text += fmt::format("      start time {} ns (0x0990)\n", *c.start_ns);
    if (c.sync0_cycle_ns) text += fmt::format("      SYNC0 cycle {} ns (0x09A0)\n", *c.sync0_cycle_ns);
    if (c.sync1_cycle_ns) text += fmt::format("      SYNC1 cycle {} ns (0x09A4)\n", *c.sync1_cycle_ns);
    if (c.deviation.count != 0) text += "      deviation " + deviation_text(c.deviation) + " (0x092C)\n";
    return text.empty() ? text : "    distributed clock\n" + text;
}

std::string pdos_text(const analyse::Slave& s) {
    if (s.pdos.empty()) return {};
    std::string text = s.pdos_by_coe ? "    PDOs assigned, by CoE\n" : "    PDOs of the SII\n";
    for (const auto& pdo : s.pdos) {
        text += fmt::format("      {} 0x{:04x}{}{}\n", pdo.input ? "TxPDO" : "RxPDO", pdo.index,
                            pdo.sync_manager >= 0 ? fmt::format(" SM{}", pdo.sync_manager) : std::string(),
                            pdo.name.empty() ? std::string() : fmt::format(" \"{}\"", pdo.name));
        for (const auto& e : pdo.entries)
            text += fmt::format("        0x{:04x}:{:02x} {:>3} bit {}\n", e.index, e.subindex, e.bits,
                                e.index == 0 && e.name.empty() ? "Gap"
                                : e.name.empty()               ? ""
                                                               : "\"" + e.name + "\"");
    }
    return text;
}

std::string slave_text(const Analysis& a, std::size_t number) {
    const auto& s = a.slaves[number];
    const auto hex = [](const auto& value, int digits) {
        return value ? fmt::format("0x{:0{}x}", *value, digits) : std::string("not seen");
    };
    std::string text = fmt::format("  {}: station {}, alias {}", slave_name(a, number), hex(s.station, 4),
                                   s.alias ? fmt::to_string(*s.alias) : std::string("not seen"));
    if (!s.name.empty()) text += fmt::format(", \"{}\"", s.name);
    if (!s.order.empty() && s.order != s.name) text += fmt::format(" ({})", s.order);
    text += fmt::format("\n    vendor {}, product {}, revision {}, serial {}\n", hex(s.vendor, 8), hex(s.product, 8),
                        hex(s.revision, 8), hex(s.serial, 8));
    if (!s.position && s.station)
        for (std::size_t n = 0; n < a.slaves.size(); ++n)
            if (a.slaves[n].position && a.slaves[n].station == s.station)
                text += fmt::format("    perhaps {}, to which a scan has given the same address\n", slave_name(a, n));
    if (s.state) text += fmt::format("    last AL state {}\n", state_words(*s.state));
    if (s.sii_octets != 0) text += fmt::format("    {} of the SII\n", counted(s.sii_octets, "octet"));
    for (const auto& [type, mail] : s.mail) {
        text +=
            fmt::format("    {}: {} sent ({}), {} received ({})", wire::to_text(type), counted(mail.sent, "message"),
                        counted(mail.sent_bytes, "octet"), mail.received, counted(mail.received_bytes, "octet"));
        text += mail.errors != 0 ? ", " + counted(mail.errors, "error") + "\n" : "\n";
    }
    if (s.unanswered != 0)
        text += fmt::format("    {} without an answer, the first at {}\n", counted(s.unanswered, "datagram"),
                            place(s.first_unanswered));
    return text + clock_text(s.clock) + pdos_text(s);
}

std::string slaves_text(const Analysis& a) {
    std::string text = fmt::format("\nSlaves ({})\n", a.slaves.size() + a.slaves_left_out);
    std::vector<std::size_t> order(a.slaves.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    // Slaves without a known position behind the others.
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return a.slaves[i].position.value_or(0xFFFF); });
    for (const auto i : order) text += slave_text(a, i);
    if (a.slaves.empty()) text += "  no slave was addressed by a position or a station address and has answered\n";
    if (a.slaves_left_out != 0) text += "  more datagrams are to slaves beyond the limit\n";
    return text;
}

std::string kind_late_words(const Analysis& a, const analyse::CyclicFrame& kind) {
    return kind.overlapping ? "several on the wire at a time" : late_words(a, kind.late);
}

std::string cyclic_text(const Analysis& a) {
    if (a.cyclic.empty()) return {};
    std::string text = "\nProcess data and distributed time\n";
    for (std::size_t n = 0; n < a.cyclic.size(); ++n) {
        const auto& c = a.cyclic[n];
        const auto& i = c.intervals;
        text += fmt::format("  kind {}: {} from {} to {}, {}, {}\n", n, counted(c.count, "frame"), seconds(c.first.at),
                            seconds(c.last.at), lost_words(a, c.lost), kind_late_words(a, c));
        if (i.count != 0)
            text += fmt::format(
                "    cycle {} (mean {}), jitter: standard deviation {}, 98 % within {} to {}, all within {} to {}\n"
                "    the longest interval at {}; {} longer than 1.5 cycles; {} of more than a "
                "second\n",
                micro(i.median), micro(i.mean_ns), micro(i.deviation_ns), micro(i.low_1), micro(i.high_99),
                micro(i.least), micro(i.most), place(i.most_at), counted(i.late, "interval"),
                counted(i.pauses, "pause"));
        for (const auto& d : c.datagrams) {
            text += fmt::format("    {} ", wire::to_text(d.command));
            text += wire::is_logical(d.command) ? fmt::format("0x{:08x}", d.address)
                                                : fmt::format("0x{:04x} 0x{:04x}", d.address & 0xFFFF, d.address >> 16);
            text += fmt::format(", {}, working counter", counted(d.length, "octet"));
            if (a.passes_twice) text += " not told";
            for (const auto& [wkc, count] : d.wkcs) text += fmt::format(" {} ({})", wkc, counted(count, "time"));
            text += "\n";
        }
    }
    if (a.cyclic_left_out != 0)
        text += "  " + counted(a.cyclic_left_out, "frame of another kind", "frames of other kinds") + "\n";
    return text;
}

std::string reference_text(const Analysis& a) {
    const auto& r = a.reference;
    std::string text;
    if (r.readings != 0) {
        text += fmt::format("\nReference clock\n  {}, {} of the system time\n",
                            r.slave ? slave_name(a, *r.slave) : std::string("unknown slave"),
                            counted(r.readings, "reading"));
        if (r.drift_ppm)
            text += fmt::format("  drift {:+.1f} ppm against the clock of the recorder, within {:.1f} ppm\n",
                                *r.drift_ppm, r.drift_within_ppm);
    }
    if (a.worst_deviation.count != 0)
        text += "\nDeviations of all slaves, combined\n  " + deviation_text(a.worst_deviation) + "\n";
    return text;
}

std::string state_line(const Analysis& a, const analyse::StateEvent& e) {
    const auto who = e.slave ? slave_name(a, *e.slave) : std::string("all slaves");
    if (e.requested)
        return fmt::format("{} {}: {} requested{}", when(e.when), who, state_words(e.status),
                           e.acknowledge ? ", error acknowledged" : "");
    auto text = fmt::format("{} {}: is in {}", when(e.when), who, state_words(e.status));
    if (e.status.code != 0)
        text += fmt::format(", AL status code 0x{:04x}: {}", e.status.code, wire::al_status_text(e.status.code));
    return text;
}

std::string conversation_line(const Analysis& a, const analyse::Conversation& c) {
    auto text = fmt::format("{} {}: {}", when(c.begin), slave_name(a, c.slave), words_of(c));
    using analyse::Action;
    const bool value = c.action != Action::object_list && c.action != Action::object_description &&
                       c.action != Action::entry_description && c.action != Action::foe_read &&
                       c.action != Action::foe_write;
    if (c.bytes != 0 && value) text += fmt::format(" = {}{}", octet_list(c.data), c.bytes > c.data.size() ? " …" : "");
    if (c.bytes != 0) text += fmt::format(" ({})", counted(c.bytes, "octet"));
    if (value && !c.complete && c.bytes != 0 && c.bytes <= 8) {
        std::uint64_t number = 0;
        for (std::size_t i = 0; i < c.data.size(); ++i) number |= std::to_integer<std::uint64_t>(c.data[i]) << (8 * i);
        text += fmt::format(" 0x{:0{}x} {}", number, c.data.size() * 2, number);
    }
    if (c.late) text += ", answered after the next request";
    switch (c.outcome) {
        case analyse::Outcome::done: return text;
        case analyse::Outcome::refused: return text + fmt::format(": refused, 0x{:08x}: {}", c.code, c.reason);
        case analyse::Outcome::unanswered: return text + ": no answer before the next conversation";
        case analyse::Outcome::unfinished: return text + ": not finished in the recording";
    }
    return text;
}

std::string emergency_line(const Analysis& a, const analyse::Emergency& e) {
    return fmt::format("{} {}: emergency 0x{:04x}: {}; error register 0x{:02x}, data {}", when(e.when),
                       slave_name(a, e.slave), e.code, wire::emergency_text(e.code), e.error_register,
                       octet_list({e.data.begin(), e.data.end()}));
}

std::string shortfall_line(const analyse::Shortfall& s) {
    return fmt::format("{} kind {}, datagram {}: {} (least) in place of {}, {}, {}", when(s.begin), s.cyclic_frame,
                       s.datagram, s.least, s.expected, counted(s.frames, "frame"),
                       s.end ? "until " + place(*s.end) : std::string("until the end"));
}

std::string master_analysis(const Analysis& a, bool verbose) {
    auto text = frames_text(a) + master_text(a) + slaves_text(a);
    text += list_text<analyse::RingSize>("Slaves in the ring", a.ring_sizes, verbose, [](const auto& r) {
        return fmt::format("{} {}", when(r.when), counted(r.slaves, "slave"));
    });
    text +=
        list_text<analyse::StateEvent>("AL states", a.states, verbose, [&](const auto& e) { return state_line(a, e); });
    text += list_text<analyse::Conversation>("Mailbox conversations", a.conversations, verbose,
                                             [&](const auto& c) { return conversation_line(a, c); });
    text += list_text<analyse::Emergency>("Emergencies", a.emergencies, verbose,
                                          [&](const auto& e) { return emergency_line(a, e); });
    text += cyclic_text(a);
    text += list_text<analyse::Shortfall>("Working counters that fell short", a.shortfalls, verbose, shortfall_line);
    return text + reference_text(a);
}

std::string master_title(const Analysis& a, std::size_t number, std::size_t all) {
    auto text =
        fmt::format("==== Master {} of {}: source address {}", number, all, fmt::join(a.master.addresses, ", "));
    if (a.interface) text += fmt::format(", interface {} of the file", *a.interface);
    return text + "\n\n";
}

}  // namespace

std::string analysis_text(const Analysis& a, bool verbose) {
    if (a.others.empty()) return master_analysis(a, verbose);
    const auto all = a.others.size() + 1;
    auto text = fmt::format("{} masters in one recording, each with its own slaves below\n\n", all) +
                master_title(a, 1, all) + master_analysis(a, verbose);
    for (std::size_t n = 2; const auto& other : a.others)
        text += "\n" + master_title(other, n++, all) + master_analysis(other, verbose);
    return text;
}

}  // namespace margay::ethercat
