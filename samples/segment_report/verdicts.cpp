#include "segment_report/verdicts.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"
#include "segment_report/markup.hpp"
#include "wire/al_status_code.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace margay::segment_report {
namespace {

constexpr std::size_t kSentences = 3;  // of the headline, behind the states

class Judge {
  public:
    Judge(const Report& report, const std::vector<Cable>& cables, const std::vector<AlikeGroup>& groups)
        : report_(report), cables_(cables), groups_(groups) {}

    Judgement run() {
        if (!report_.failure.empty()) add(Severity::fault, report_.failure, "slaves");
        for (const auto& missing : report_.missing) add(Severity::fault, missing, "slaves");
        if (report_.origin != Origin::recording && report_.failure.empty()) {
            states();
            cables();
            ring();
            processing();
            eeproms();
            currents();
            image();
            alike();
        }
        cycles();
        clock_log();
        recording();
        if (!report_.messages.empty())
            add(Severity::remark,
                fmt::format("The master has {}, the first: {}", counted(report_.messages.size(), "message"),
                            report_.messages.front()),
                "run");
        auto& verdicts = judgement_.verdicts;
        std::ranges::stable_sort(verdicts, std::greater<>(), &Verdict::severity);
        judgement_.headline = headline();
        return std::move(judgement_);
    }

  private:
    void add(Severity severity, std::string text, std::string_view section) {
        judgement_.verdicts.push_back({severity, std::move(text), std::string(section)});
    }

    // The states of all slaves; empty for no slaves.
    [[nodiscard]] std::string states_text() const {
        std::map<std::string, std::vector<std::uint16_t>> states;
        for (const SlaveState& slave : report_.slaves)
            states[samples::al_text(slave.now)].push_back(slave.facts.position);
        if (states.empty()) return "no slave answers";
        const auto number = counted(report_.slaves.size(), "slave");
        if (states.size() == 1)
            return fmt::format("{}, {}in {}", number, report_.slaves.size() == 1 ? "" : "all ", states.begin()->first);
        std::string text = number + ":";
        for (const auto& [state, positions] : states)
            text += fmt::format("{} {} in {}", text.ends_with(':') ? "" : ",", positions.size(), state);
        return text;
    }

    // Equal texts about several slaves become one verdict.
    class Grouped {
      public:
        void add(std::uint16_t position, std::string words) {
            for (auto& [known, positions] : all_)
                if (known == words) return positions.push_back(position);
            all_.push_back({std::move(words), {position}});
        }
        [[nodiscard]] const auto& all() const { return all_; }

      private:
        std::vector<std::pair<std::string, std::vector<std::uint16_t>>> all_{};
    };
    void add(Severity severity, const Grouped& grouped, std::string_view section) {
        for (const auto& [words, positions] : grouped.all())
            add(severity, capital(slaves_text(positions)) + words, section);
    }

    void states() {
        if (report_.slaves.empty()) return add(Severity::fault, "No slave answers.", "slaves");
        Grouped errors, problems, found, unread;
        for (const SlaveState& slave : report_.slaves) {
            const auto position = slave.facts.position;
            if (slave.now.error) errors.add(position, ": " + state_text(slave.now));
            if (!slave.facts.problem.empty()) problems.add(position, ": " + problem_text(slave.facts));
            if (slave.found && slave.found->error)
                found.add(position, ": found in " + state_text(*slave.found) + " before the scan");
            for (const auto& problem : slave.problems) unread.add(position, ": could not be read: " + problem);
        }
        add(Severity::fault, errors, "slaves");
        add(Severity::fault, problems, "slaves");
        add(Severity::remark, found, "slaves");
        add(Severity::remark, unread, "slaves");
        if (errors.all().empty() && problems.all().empty()) add(Severity::good, "No slave reports an error.", "slaves");
    }

    void cables() {
        bool good = true;
        for (const Cable& cable : cables_) {
            auto name = cable_text(cable);
            name.front() = static_cast<char>(name.front() == 'c' ? 'C' : name.front());
            if (!cable.known) {
                good = false;
                add(Severity::remark, name + ": the error counters could not be read.", "cables");
            }
            if (cable.health == Health::good || cable.broken) continue;  // a broken ring has a verdict of its own
            good = false;
            add(cable.health == Health::bad ? Severity::fault : Severity::remark,
                name + ": " + findings_text(cable) + ".", "cables");
        }
        for (const LooseEnd& loose : loose_ends(report_, cables_)) {
            good = false;
            add(loose.health == Health::bad ? Severity::fault : Severity::remark,
                capital(end_text(loose.end)) + " has no link, and has counted " + loose.text +
                    ": if a device belongs there, check its supply and the cable.",
                "cables");
        }
        if (good && !cables_.empty())
            add(Severity::good,
                fmt::format("No error was counted on {}.", cables_.size() == 1
                                                               ? std::string("the cable")
                                                               : fmt::format("the {} cables", cables_.size())),
                "cables");
    }

    static std::string capital(std::string text) {
        if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 32);
        return text;
    }

    void ring() {
        const auto state = ring_of(report_);
        if (state.whole()) return add(Severity::good, "The ring is closed.", "topology");
        if (state.behind && !state.before.slave && state.before.port == kUnknownEnd)
            add(Severity::fault, fmt::format("The ring is broken before slave {}.", *state.behind), "topology");
        else if (state.behind)
            add(Severity::fault,
                fmt::format("The ring is broken between {} and slave {}.",
                            state.before.slave ? fmt::format("slave {}", *state.before.slave) : "the master",
                            *state.behind),
                "topology");
        if (state.unconnected)
            add(Severity::fault, "The ring is not closed: no slave has a link to the NIC at the end of the ring.",
                "topology");
    }

    void processing() {
        Grouped frames, pdi;
        // Damaged frames are not processed either: the verdict is that of the cable.
        const bool damaged = std::ranges::any_of(cables_, [](const Cable& cable) { return cable.damaged() != 0; });
        for (const SlaveState& slave : report_.slaves) {
            if (!slave.counters) continue;
            if (slave.counters->processing_unit != 0 && !damaged)
                frames.add(slave.facts.position,
                           ": frames came that could not be processed: damaged before, or no EtherCAT frames.");
            if (slave.counters->pdi != 0)
                pdi.add(slave.facts.position, ": errors were counted between the ESC and its processor (PDI).");
        }
        add(Severity::remark, frames, "cables");
        add(Severity::remark, pdi, "cables");
    }

    void eeproms() {
        std::size_t good = 0;
        for (const SlaveState& slave : report_.slaves) {
            const EepromContent& eeprom = slave.eeprom;
            good += eeprom.findings.empty() && eeprom.problem.empty() ? 1 : 0;
            const auto who = fmt::format("The EEPROM of slave {}", slave.facts.position);
            if (eeprom.checksum_wrong)
                add(Severity::fault, who + " has a wrong checksum: the ESC has not loaded its configuration.",
                    "eeprom");
            else if (!eeprom.findings.empty())
                add(Severity::remark, fmt::format("{}: {}", who, counted(eeprom.findings.size(), "finding")) + ".",
                    "eeprom");
        }
        if (good == report_.slaves.size() && good != 0)
            add(Severity::good, "The EEPROMs are readable and their checksums are right.", "eeprom");
    }

    // The E-bus current by the EEPROMs: a supply is negative there. It serves the slaves behind it on E-bus, up to the
    // next supply.
    void currents() {
        struct Supply {
            int gives_ma = 0;
            int takes_ma = 0;
        };
        std::map<std::uint16_t, Supply> supplies;          // by position
        std::map<std::uint16_t, std::uint16_t> served_by;  // position of the supply
        for (const SlaveState& slave : report_.slaves) {
            const SlaveFacts& s = slave.facts;
            if (s.ebus_current_ma < 0) {
                supplies[s.position].gives_ma = -s.ebus_current_ma;
                served_by[s.position] = s.position;
            } else if (s.parent && s.ports[s.entry_port].type == PortType::ebus && served_by.contains(*s.parent)) {
                served_by[s.position] = served_by[*s.parent];
                supplies[served_by[s.position]].takes_ma += s.ebus_current_ma;
            }
        }
        for (const auto& [position, supply] : supplies)
            if (supply.takes_ma > supply.gives_ma)
                add(Severity::remark,
                    fmt::format(
                        "E-bus: the slaves behind slave {} take {} mA, and it supplies {} mA, by their EEPROMs.",
                        position, supply.takes_ma, supply.gives_ma),
                    "slaves");
    }

    void image() {
        if (!report_.domains_problem.empty())
            add(Severity::fault, "The process data could not be mapped: " + report_.domains_problem, "image");
        for (const DomainFacts& domain : report_.domains)
            if (domain.wkc != domain.expected_wkc)
                add(Severity::fault,
                    fmt::format("Group {} has working counter {} in place of {}: not all slaves exchange process data.",
                                domain.index, domain.wkc, domain.expected_wkc),
                    "image");
    }

    void alike() {
        for (const AlikeGroup& group : groups_) {
            const auto device = group.count(Difference::Kind::device);
            const auto settings = group.count(Difference::Kind::setting);
            if (device + settings == 0) continue;
            std::string what;
            if (device != 0) what = "revision, firmware or EEPROM";
            if (settings != 0)
                what += fmt::format("{}{}", what.empty() ? "" : " and in ", counted(settings, "setting"));
            add(Severity::remark,
                fmt::format("{} ({}) are of the same product and differ in {}.", capital(slaves_text(group.positions)),
                            group.name, what),
                "alike");
        }
    }

    void cycles() {
        cycle_log();
        if (!report_.cycles) return;
        if (!report_.cycles->problem.empty()) add(Severity::fault, report_.cycles->problem, "cycles");
        const auto& figures = report_.cycles->figures;
        if (figures.cycles == 0) return;
        const auto all = counted(figures.cycles, "cycle");
        if (figures.no_frame + figures.wrong_wkc == 0)
            return add(Severity::good, fmt::format("{} with all frames and the expected working counter.", all),
                       "cycles");
        add(Severity::fault,
            fmt::format("Of {}, {} lacked frames and {} had a wrong working counter.", all, figures.no_frame,
                        figures.wrong_wkc),
            "cycles");
    }

    // The verdict about skipped cycles and lost frames of the application.
    void cycle_log() {
        if (!report_.cycle_log) return;
        const auto& figures = *report_.cycle_log;
        const auto all = counted(figures.cycles, "cycle");
        if (figures.no_frame + figures.wrong_wkc != 0)
            add(Severity::fault,
                fmt::format("Of {} of the application, {} lacked frames and {} had a wrong working counter.", all,
                            figures.no_frame, figures.wrong_wkc),
                "cycles");
        if (figures.overruns != 0)
            add(Severity::remark,
                fmt::format("Of {} of the application, {} began a period late or later.", all, figures.overruns),
                "cycles");
        if (figures.no_frame + figures.wrong_wkc + figures.overruns == 0 && figures.cycles != 0)
            add(Severity::good,
                fmt::format("{} of the application in time, with all frames and the expected working counter.", all),
                "cycles");
    }

    // The verdict about the log of the master's clock, after its start phase.
    void clock_log() {
        if (!report_.clock_log || !report_.clock_log->tells_sync) return;
        const auto& log = *report_.clock_log;
        const auto all = counted(log.times_s.size(), "line");
        if (log.first_in_sync == 0)
            return add(Severity::fault, fmt::format("In none of {} of the log are the clocks in sync.", all),
                       "clocklog");
        if (log.out_of_sync == 0)
            return add(Severity::good,
                       fmt::format("The clocks of the log are in sync from line {} on.", log.first_in_sync),
                       "clocklog");
        add(Severity::fault,
            fmt::format("The clocks of the log were in sync from line {} on, but not in {} behind it, first in line {} "
                        "(DCMErrorCode {}).",
                        log.first_in_sync, counted(log.out_of_sync, "line"), log.first_out, log.first_code),
            "clocklog");
    }

    // The findings about each master in the recording.
    void recording() {
        if (!report_.recording) return;
        const auto& first = report_.recording->analysis;
        if (first.others.empty()) return recording_of(first, "");
        recording_of(first, words_of_master(1, first));
        for (std::size_t n = 0; n < first.others.size(); ++n)
            recording_of(first.others[n], words_of_master(n + 2, first.others[n]));
    }
    static std::string words_of_master(std::size_t number, const analyse::Analysis& analysis) {
        return fmt::format("Master {} ({}): ", number, fmt::join(analysis.master.addresses, ", "));
    }

    void recording_of(const analyse::Analysis& analysis, const std::string& of) {
        const bool only = report_.origin == Origin::recording;
        if (!analysis.problem.empty())
            return add(only ? Severity::fault : Severity::remark, of + "The recording: " + analysis.problem,
                       "recording");
        if (analysis.frames.lost != 0)
            add(analysis.frames.dropped == 0 ? Severity::fault : Severity::remark,
                fmt::format("{}{} of {} in the recording did not come back{}.", of, analysis.frames.lost,
                            counted(analysis.frames.requests, "frame"),
                            analysis.frames.dropped == 0
                                ? ""
                                : fmt::format(", or are among the {} that the recorder has dropped",
                                              counted(analysis.frames.dropped, "packet"))),
                "recording");
        if (!only) return;
        if (!analysis.remark.empty())
            add(Severity::remark, of + "The recording: " + analysis.remark + ".", "recording");
        if (const auto unread = analysis.frames.cut + analysis.frames.damaged; unread != 0)
            add(Severity::remark, of + counted(unread, "frame was", "frames were") + " cut or damaged and not read.",
                "recording");
        if (analysis.slaves.empty() && analysis.frames.answered != 0)
            add(Severity::remark, of + "Slaves answer, and the recording does not show which.", "recording");
        else if (analysis.slaves.empty())
            add(Severity::fault, of + "No slave answers in the recording.", "recording");
        recording_states(analysis, of);
        recorded_oddities(analysis, of);
        const auto& f = analysis.frames;
        if (f.requests != 0 && f.lost + f.open + f.late == 0 && f.replies >= f.requests + f.unasked)
            add(Severity::good,
                of + (analysis.frames.requests == 1
                          ? "The request has its reply."
                          : fmt::format("All {} requests have their replies.", analysis.frames.requests)),
                "recording");
    }

    void recorded_oddities(const analyse::Analysis& analysis, const std::string& of) {
        if (analysis.frames.late != 0)
            add(Severity::remark,
                of + counted(analysis.frames.late, "reply", "replies") +
                    " came behind the next request with the same process data.",
                "recording");
        if (!analysis.shortfalls.items.empty())
            add(Severity::remark,
                fmt::format("{}Working counters fell short {}.", of,
                            counted(analysis.shortfalls.items.size() + analysis.shortfalls.left_out, "time")),
                "shortfalls");
        if (!analysis.emergencies.items.empty())
            add(Severity::remark,
                fmt::format(
                    "{}{}.", of,
                    counted(analysis.emergencies.items.size() + analysis.emergencies.left_out, "emergency message")),
                "emergencies");
        const auto refused = std::ranges::count_if(analysis.conversations.items, [](const auto& c) {
            return c.outcome == analyse::Outcome::refused || c.outcome == analyse::Outcome::unanswered;
        });
        if (refused != 0)
            add(Severity::remark,
                fmt::format(
                    "{}{} refused or not answered.", of,
                    counted(static_cast<std::uint64_t>(refused), "mailbox request was", "mailbox requests were")),
                "mail");
    }

    void recording_states(const analyse::Analysis& analysis, const std::string& of) {
        for (const analyse::Slave& slave : analysis.slaves)
            if (slave.state && slave.state->error)
                add(Severity::fault,
                    fmt::format("{}{} ends in {}.", of,
                                slave.position ? fmt::format("Slave {}", *slave.position)
                                               : fmt::format("Station 0x{:04x}", slave.station.value_or(0)),
                                state_text(*slave.state)),
                    "states");
    }

    // The frames, the time and the slaves of all masters.
    [[nodiscard]] std::string recorded_text() const {
        const auto& first = report_.recording->analysis;
        std::uint64_t frames = first.frames.ethercat;
        std::size_t slaves = first.slaves.size();
        auto end = first.begin + first.duration;
        auto begin = first.begin;
        for (const auto& other : first.others) {
            frames += other.frames.ethercat;
            slaves += other.slaves.size();
            begin = std::min(begin, other.begin);
            end = std::max(end, other.begin + other.duration);
        }
        auto text = fmt::format("{} in {:.3f} s, {} seen", counted(frames, "frame"),
                                static_cast<double>((end - begin).count()) / 1e9, counted(slaves, "slave"));
        if (!first.others.empty()) text += fmt::format(", {} masters", first.others.size() + 1);
        return text;
    }

    [[nodiscard]] std::string headline() const {
        std::string text;
        if (!report_.failure.empty()) return "The segment could not be read: " + report_.failure;
        if (report_.origin == Origin::recording)
            text = recorded_text();
        else
            text = states_text();
        std::vector<const Cable*> worst;
        for (const Cable& cable : cables_)
            if (cable.damaged() != 0) worst.push_back(&cable);
        std::ranges::stable_sort(worst, std::greater<>(), [](const Cable* cable) { return cable->damaged(); });
        for (std::size_t n = 0; n < std::min(worst.size(), kSentences); ++n)
            text += fmt::format("; {} damaged {}{}", cable_text(*worst[n]), worst[n]->may_be_more() ? "at least " : "",
                                counted(worst[n]->damaged(), "frame"));
        const auto faults =
            static_cast<std::size_t>(std::ranges::count(judgement_.verdicts, Severity::fault, &Verdict::severity));
        const auto remarks =
            static_cast<std::size_t>(std::ranges::count(judgement_.verdicts, Severity::remark, &Verdict::severity));
        if (faults + remarks == 0) return text + "; nothing is wrong.";
        if (faults != 0) text += "; " + counted(faults, "fault");
        if (remarks != 0) text += (faults != 0 ? " and " : "; ") + counted(remarks, "point") + " to look at";
        return text + ".";
    }

    const Report& report_;
    const std::vector<Cable>& cables_;
    const std::vector<AlikeGroup>& groups_;
    Judgement judgement_{};
};

}  // namespace

Severity Judgement::worst() const {
    auto worst = Severity::good;
    for (const Verdict& verdict : verdicts) worst = std::max(worst, verdict.severity);
    return worst;
}

Judgement judge(const Report& report, const std::vector<Cable>& cables, const std::vector<AlikeGroup>& groups) {
    return Judge(report, cables, groups).run();
}

std::string problem_text(const SlaveFacts& slave) {
    const auto prefix = fmt::format("position {}: ", slave.position);
    return slave.problem.starts_with(prefix) ? slave.problem.substr(prefix.size()) : slave.problem;
}

std::string_view to_text(Severity severity) {
    switch (severity) {
        case Severity::good: return "good";
        case Severity::remark: return "look at it";
        case Severity::fault: return "fault";
    }
    return "?";
}

std::string state_text(const AlStatus& status) {
    auto text = samples::al_text(status);
    if (status.state == AlState::none) text = "no known state";
    if (status.code != 0)
        text += fmt::format(", AL status code 0x{:04x}: {}", status.code, wire::al_status_text(status.code));
    return text;
}

}  // namespace margay::segment_report
