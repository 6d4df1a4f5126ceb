// The part of the page about a recording.
#include "segment_report/page.hpp"

#include "ethercat/analysis_output.hpp"
#include "wire/emergency_code.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

using analyse::Analysis;
using analyse::Moment;

constexpr std::size_t kRows = 200;  // of a table; the whole is in the text, or `ethercat analyse --verbose` prints it

std::string at_text(const Moment& moment) {
    return fmt::format("{:.6f}", static_cast<double>(moment.at.count()) / 1e9);
}
std::string us_text(Duration time) { return fmt::format("{:.1f} µs", static_cast<double>(time.count()) / 1e3); }

std::string name_of(const Analysis& analysis, std::size_t slave) {
    const analyse::Slave& s = analysis.slaves[slave];
    return s.position ? fmt::format("slave {}", *s.position) : fmt::format("station 0x{:04x}", s.station.value_or(0));
}

// A table of the first rows of a list, folded, with a remark about the rest.
template <class T, class Add>
Markup listed(std::string_view id, std::string_view title, std::vector<Table::Column> columns,
              const std::vector<const T*>& items, std::uint64_t left_out, const Add& add) {
    if (items.empty()) return {};
    Table table(std::move(columns));
    for (std::size_t n = 0; n < std::min(items.size(), kRows); ++n) add(table, *items[n]);
    const auto rest = items.size() - std::min(items.size(), kRows) + left_out;
    Markup content = table.markup();
    if (rest != 0)
        content += paragraph(fmt::format("{} more: the command ethercat analyse --verbose prints them.", rest));
    return tag("div", fmt::format("id=\"{}\"", id),
               folded(Markup(title) + " " + tag("small", fmt::to_string(items.size() + left_out)), content,
                      items.size() <= 12));
}

template <class T>
std::vector<const T*> all_of(const std::vector<T>& items) {
    std::vector<const T*> all;
    for (const T& item : items) all.push_back(&item);
    return all;
}

Markup frame_facts(const Recording& recording) {
    const auto& a = recording.analysis;
    const auto& f = a.frames;
    Facts facts;
    facts.add("File", (recording.beside ? Markup(tag("strong", recording.file)) + ", beside this page"
                                        : Markup(recording.file)) +
                          fmt::format(" ({})", counted(recording.octets, "octet")));
    facts.add("Frames", fmt::format("{} of {} in {:.6f} s", counted(f.ethercat, "EtherCAT frame"),
                                    counted(f.packets, "packet"), static_cast<double>(a.duration.count()) / 1e9));
    facts.add("Directions", ethercat::words_of(a.directions));
    if (a.ring) facts.add("NICs", "both NICs of a ring: the copies of a frame are counted as one frame");
    facts.add("Replies",
              fmt::format("{}, {}, {}, {}", counted(f.requests, "request"), counted(f.replies, "reply", "replies"),
                          ethercat::lost_words(a, f.lost), ethercat::late_words(a, f.late)));
    if (f.open != 0)
        facts.add("At the end", counted(f.open, "request whose reply may come behind the end",
                                        "requests whose replies may come behind the end"));
    if (f.cut + f.damaged != 0)
        facts.add("Not analysed", fmt::format("{} cut by the recorder, {} with contradicting lengths",
                                              counted(f.cut, "frame"), f.damaged));
    if (f.longest_trip.count() != 0)
        facts.add("Round trip", fmt::format("{} to {}", us_text(f.shortest_trip), us_text(f.longest_trip)));
    facts.add("Master", a.master.name.empty() ? std::string("not recognised") : a.master.name);
    facts.add("Seen of it", fmt::format("{}", fmt::join(a.master.reasons, "; ")));
    facts.add("Source address", fmt::format("{}", fmt::join(a.master.addresses, ", ")));
    if (!a.others.empty())
        facts.add("Other masters", fmt::format("{} more in this recording: they and their slaves are in the text below",
                                               a.others.size()));
    facts.add("Remark", a.remark);
    return facts.markup();
}

template <class T>
Markup hex_cell(const std::optional<T>& value, int digits) {
    return value ? code(fmt::format("0x{:0{}x}", *value, digits)) : tag("span", "class=\"soft\"", "not seen");
}

Markup slaves_table(const Analysis& analysis) {
    if (analysis.slaves.empty()) return {};
    std::vector<const analyse::Slave*> order = all_of(analysis.slaves);
    std::ranges::stable_sort(order, {}, [](const analyse::Slave* s) { return s->position.value_or(0xFFFF); });
    Table table({{"Pos.", true},
                 {"Station"},
                 {"Name"},
                 {"Last state"},
                 {"Vendor"},
                 {"Product"},
                 {"Revision"},
                 {"Serial"},
                 {"Unanswered", true}});
    for (const analyse::Slave* s : order)
        table.add(
            {s->position ? Markup(fmt::to_string(*s->position)) : "?", hex_cell(s->station, 4), s->name,
             s->state ? badge(s->state->error ? Severity::fault : Severity::good, ethercat::state_words(*s->state))
                      : Markup(),
             hex_cell(s->vendor, 8), hex_cell(s->product, 8), hex_cell(s->revision, 8), hex_cell(s->serial, 8),
             fmt::to_string(s->unanswered)},
            s->state && s->state->error ? "fault" : "");
    return tag("h3", "Slaves in the recording") + table.markup("recorded-slaves");
}

Markup cyclic_table(const Analysis& analysis) {
    if (analysis.cyclic.empty()) return {};
    Table table({{"Process data frame"},
                 {"Frames", true},
                 {"Lost", true},
                 {"Late", true},
                 {"Cycle", true},
                 {"98 % within"},
                 {"All within"},
                 {"Working counters"}});
    for (std::size_t n = 0; n < analysis.cyclic.size(); ++n) {
        const auto& c = analysis.cyclic[n];
        const auto cycle = [&](std::string text) { return c.intervals.count != 0 ? text : "not told"; };
        std::string counters;
        for (const auto& datagram : c.datagrams)
            for (const auto& [wkc, count] : datagram.wkcs)
                counters += fmt::format("{}{} ({})", counters.empty() ? "" : ", ", wkc, counted(count, "time"));
        table.add({fmt::format("kind {}, {}", n, counted(c.datagrams.size(), "datagram")), fmt::to_string(c.count),
                   analysis.losses_known ? fmt::to_string(c.lost) : "not known",
                   !ethercat::late_known(analysis) ? "not known"
                   : c.overlapping                 ? "overlapping"
                                                   : fmt::to_string(c.late),
                   cycle(us_text(c.intervals.median)),
                   cycle(us_text(c.intervals.low_1) + " to " + us_text(c.intervals.high_99)),
                   cycle(us_text(c.intervals.least) + " to " + us_text(c.intervals.most)),
                   analysis.passes_twice ? "not told" : counters},
                  c.lost != 0 ? "fault" : "");
    }
    return tag("h3", "Process data") + table.markup();
}

Markup event_lists(const Analysis& a) {
    Markup content = listed<analyse::StateEvent>(
        "states", "AL states", {{"Time, s", true}, {"Frame", true}, {"Slave"}, {"What"}}, all_of(a.states.items),
        a.states.left_out, [&](Table& table, const analyse::StateEvent& e) {
            table.add({at_text(e.when), fmt::to_string(e.when.frame), e.slave ? name_of(a, *e.slave) : "all slaves",
                       (e.requested ? "requested: " : "is in ") + state_text(e.status)},
                      !e.requested && e.status.error ? "fault" : "");
        });
    content += listed<analyse::Shortfall>(
        "shortfalls", "Working counters that fell short",
        {{"Time, s", true},
         {"Frame", true},
         {"Datagram"},
         {"Least", true},
         {"Expected", true},
         {"Frames", true},
         {"Until"}},
        all_of(a.shortfalls.items), a.shortfalls.left_out, [&](Table& table, const analyse::Shortfall& s) {
            table.add({at_text(s.begin), fmt::to_string(s.begin.frame),
                       fmt::format("kind {}, datagram {}", s.cyclic_frame, s.datagram), fmt::to_string(s.least),
                       fmt::to_string(s.expected), fmt::to_string(s.frames),
                       s.end ? at_text(*s.end) + " s" : "the end"});
        });
    content += listed<analyse::Emergency>(
        "emergencies", "Emergencies", {{"Time, s", true}, {"Frame", true}, {"Slave"}, {"Code"}, {"Meaning"}},
        all_of(a.emergencies.items), a.emergencies.left_out, [&](Table& table, const analyse::Emergency& e) {
            table.add({at_text(e.when), fmt::to_string(e.when.frame), name_of(a, e.slave),
                       code(fmt::format("0x{:04x}", e.code)), wire::emergency_text(e.code)});
        });
    std::vector<const analyse::Conversation*> faulty;
    for (const auto& c : a.conversations.items)
        if (c.outcome == analyse::Outcome::refused || c.outcome == analyse::Outcome::unanswered) faulty.push_back(&c);
    return content +
           listed<analyse::Conversation>("mail", "Mailbox requests that were refused or not answered",
                                         {{"Time, s", true}, {"Frame", true}, {"Slave"}, {"Request"}, {"Outcome"}},
                                         faulty, 0, [&](Table& table, const analyse::Conversation& c) {
                                             table.add({at_text(c.begin), fmt::to_string(c.begin.frame),
                                                        name_of(a, c.slave), ethercat::words_of(c),
                                                        c.outcome == analyse::Outcome::refused
                                                            ? fmt::format("refused, 0x{:08x}: {}", c.code, c.reason)
                                                            : std::string(ethercat::words_of(c.outcome))});
                                         });
}

}  // namespace

Markup recording_section(const Report& report) {
    if (!report.recording) return {};
    const auto& analysis = report.recording->analysis;
    Markup content;
    if (!analysis.problem.empty()) content += paragraph(tag("span", "class=\"fault-text\"", analysis.problem));
    content += frame_facts(*report.recording);
    if (report.origin == Origin::recording) content += slaves_table(analysis);
    content += cyclic_table(analysis) + event_lists(analysis);
    return content + tag("div", "class=\"screen\"",
                         folded("The whole analysis as text, as the command ethercat analyse prints it",
                                tag("pre", ethercat::analysis_text(analysis, false))));
}

}  // namespace margay::segment_report
