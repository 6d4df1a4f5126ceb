#include "segment_report/page.hpp"

#include "segment_report/picture.hpp"
#include "segment_report/style.hpp"

#include <fmt/format.h>

namespace margay::segment_report {
namespace {

std::string_view style_of(Severity severity) {
    return severity == Severity::fault ? "fault" : severity == Severity::remark ? "remark" : "good-badge";
}

struct Part {
    std::string_view id;
    std::string_view title;
    Markup content;
};

Markup summary(const Judgement& judgement) {
    constexpr std::size_t kShown = 12;
    const auto item = [](const Verdict& verdict) {
        return tag("li", badge(verdict.severity, to_text(verdict.severity)) +
                             tag("span", Markup(verdict.text) + " " +
                                             tag("a", attribute("href", "#" + verdict.section), "details"))) +
               Markup::raw("\n");
    };
    Markup shown, rest;
    std::size_t number = 0, left = 0;
    for (const Verdict& verdict : judgement.verdicts) {
        const bool show = ++number <= kShown || verdict.severity == Severity::good;
        (show ? shown : rest) += item(verdict);
        left += show ? 0 : 1;
    }
    Markup all = tag("ul", "class=\"verdicts\"", shown);
    if (left != 0) all += folded(fmt::format("{} more", left), tag("ul", "class=\"verdicts\"", rest));
    return all;
}

Markup topology_section(const Report& report, const std::vector<Cable>& cables) {
    if (report.slaves.empty()) return {};
    return topology_picture(report, cables) +
           tag("p", "class=\"legend\"",
               "A box is a slave: its position, AL state, name, and alias or order code. The small numbers at a line "
               "are ports. A thick line is E-bus. Solid green: nothing was counted. Dashed: interruptions, or up to "
               "nine errors. Dotted red: ten errors or more. ✕ damaged frames, ~ errors of the physical layer, "
               "⚡ interruptions.");
}

std::string_view origin_text(Origin origin) {
    switch (origin) {
        case Origin::segment: return "read from the segment";
        case Origin::application: return "read from a running application";
        case Origin::recording: return "read from a recording alone";
    }
    return "";
}

std::vector<Part> parts_of(const Report& report, const std::vector<Cable>& cables,
                           const std::vector<AlikeGroup>& groups) {
    std::vector<Part> parts;
    const auto add = [&](std::string_view id, std::string_view title, Markup content) {
        if (!content.empty()) parts.push_back({id, title, std::move(content)});
    };
    add("segment", "Topology", topology_section(report, cables));
    add("slaves", "Slaves", slaves_section(report));
    add("cables", "Cables and error counters", cables_section(report, cables));
    add("image", "Process image", image_section(report));
    add("alike", "Differences between alike devices", alike_section(report, groups));
    add("eeprom", "EEPROM", eeprom_section(report));
    add("clocks", "Distributed clocks", clocks_section(report));
    add("cycles", "Cycles", cycles_section(report));
    add("clocklog", "Log of the master's clock", clock_log_section(report));
    add("recording", "Recording", recording_section(report));
    add("machine", "Machine and interface", machine_section(report));
    add("run", "How this report was made", run_section(report));
    return parts;
}

}  // namespace

Markup section(std::string_view id, std::string_view title, const Markup& content) {
    return tag("section", fmt::format("id=\"{}\"", id), tag("h2", title) + Markup::raw("\n") + content) +
           Markup::raw("\n");
}

Markup badge(Severity severity, std::string_view text) {
    return tag("span", fmt::format("class=\"badge {}\"", style_of(severity)), text);
}

Markup slave_link(std::uint16_t position) {
    return tag("a", fmt::format("href=\"#slave{}\"", position), fmt::to_string(position));
}

Page write_page(const Report& report) {
    const auto cables = report.slaves.empty() ? std::vector<Cable>() : cables_of(report);
    const auto groups = find_differences(report);
    const auto judgement = judge(report, cables, groups);
    const auto parts = parts_of(report, cables, groups);
    Markup links, sections;
    for (const Part& part : parts) {
        links += tag("a", fmt::format("href=\"#{}\"", part.id), part.title) + Markup::raw("\n");
        sections += section(part.id, part.title, part.content);
    }
    const Markup head =
        Markup::raw(
            "<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
            "'unsafe-inline'\"/>\n") +
        tag("title", "EtherCAT segment report: " + report.source) + tag("style", Markup::raw(std::string(kStyle)));
    Markup body = tag("h1", "EtherCAT segment report") +
                  tag("p", "class=\"sub\"",
                      code(report.source) + fmt::format(", {}, {}", origin_text(report.origin), report.begun));
    body +=
        tag("p", fmt::format("id=\"headline\" class=\"headline {}\"", style_of(judgement.worst())), judgement.headline);
    body += summary(judgement) + tag("nav", links) + sections;
    body += tag("footer", fmt::format("Made by segment_report of Margay {}. Slaves are named by their position in the "
                                      "ring; the first is 0. The page needs no network.",
                                      report.version));
    const auto page = tag("html", "lang=\"en\"", tag("head", head) + Markup::raw("\n") + tag("body", body));
    return {"<!DOCTYPE html>\n" + page.html() + "\n", judgement.headline, judgement.worst()};
}

}  // namespace margay::segment_report
