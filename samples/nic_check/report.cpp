#include "nic_check/findings.hpp"

#include "common/counted.hpp"
#include "common/json_text.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace margay::nic_check {
namespace {

constexpr double kSlow_us = 200;  // the slowest of 100 round trips, of an interface that is good for 1 ms

double microseconds(Duration time) { return static_cast<double>(time.count()) / 1e3; }

std::string times(const DurationHistogram& h) {
    return fmt::format("min {:.1f}, median {:.1f}, 99 % {:.1f}, max {:.1f} µs", microseconds(h.min()),
                       microseconds(h.quantile(0.5)), microseconds(h.quantile(0.99)), microseconds(h.max()));
}

// A bar for each power of two.
std::string bars(const DurationHistogram& histogram) {
    struct Bar {
        Duration from{};
        std::uint64_t count = 0;
    };
    std::vector<Bar> all;
    for (std::size_t n = 0; n < DurationHistogram::kBuckets; n += 16) {
        Bar bar{histogram.bucket(n).from};
        for (std::size_t k = n; k < n + 16; ++k) bar.count += histogram.bucket(k).count;
        if (bar.count != 0 || !all.empty()) all.push_back(bar);
    }
    while (!all.empty() && all.back().count == 0) all.pop_back();
    std::string text;
    for (const auto& bar : all)
        text += fmt::format("  from {:>9.1f} µs {:>7} {}\n", microseconds(bar.from), bar.count,
                            std::string(static_cast<std::size_t>(50 * bar.count / histogram.count()), '#'));
    return text;
}

std::size_t count(const std::vector<Finding>& findings, Verdict verdict) {
    return static_cast<std::size_t>(
        std::count_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.verdict == verdict; }));
}

}  // namespace

std::vector<Finding> judge_probe(const ProbeFacts& facts) {
    const auto say = [](Verdict verdict, std::string text) {
        return std::vector<Finding>{{verdict, "round trip", std::move(text), {}}};
    };
    if (!facts.problem.empty()) return say(Verdict::not_known, facts.problem);
    if (facts.sent == 0) return say(Verdict::not_known, "no frame could be sent");
    if (facts.returned == 0 && facts.echoes > 0)
        return say(Verdict::not_known, "the frames come back without having passed a slave (a loop or a mirror port)");
    if (facts.returned == 0) return say(Verdict::not_known, "no slave answers");
    const auto text = samples::counted(facts.slaves, "slave") + "; " + times(facts.round_trip);
    if (facts.returned < facts.sent) {
        const auto lost = facts.sent - facts.returned;
        return say(Verdict::better,
                   fmt::format("{} of {} {} lost: check cables and connectors; {}", lost,
                               samples::counted(facts.sent, "frame"), lost == 1 ? "was" : "were", text));
    }
    if (microseconds(facts.round_trip.quantile(0.99)) > kSlow_us)
        return say(Verdict::better, text + ": too long for a cycle of 1 ms; the findings above say why");
    return say(Verdict::good, text);
}

std::vector<Finding> judge(const Facts& facts) {
    auto all = judge_interface(facts.interface);
    for (auto& finding : judge_machine(facts.machine)) all.push_back(std::move(finding));
    if (facts.probe)
        for (auto& finding : judge_probe(*facts.probe)) all.push_back(std::move(finding));
    return all;
}

std::string_view to_text(Verdict verdict) {
    switch (verdict) {
        case Verdict::good: return "good";
        case Verdict::better: return "could be better";
        case Verdict::not_known: return "not known";
    }
    return "unknown";
}

std::string findings_text(const Facts& facts, const std::vector<Finding>& findings) {
    std::string text = fmt::format("{}: {} good, {} could be better, {} not known\n", facts.interface.name,
                                   count(findings, Verdict::good), count(findings, Verdict::better),
                                   count(findings, Verdict::not_known));
    for (const auto verdict : {Verdict::better, Verdict::not_known, Verdict::good}) {
        if (count(findings, verdict) == 0) continue;
        text += fmt::format("\n{}\n", to_text(verdict));
        for (const auto& finding : findings) {
            if (finding.verdict != verdict) continue;
            text += fmt::format("  {}: {}\n", finding.subject, finding.text);
            if (!finding.command.empty()) text += fmt::format("      {}\n", finding.command);
        }
    }
    if (facts.probe && facts.probe->returned > 0) text += "\nround trips\n" + bars(facts.probe->round_trip);
    return text;
}

std::string findings_json(const Facts& facts, const std::vector<Finding>& findings) {
    nlohmann::ordered_json all;
    all["interface"] = facts.interface.name;
    all["counts"] = {{"good", count(findings, Verdict::good)},
                     {"could be better", count(findings, Verdict::better)},
                     {"not known", count(findings, Verdict::not_known)}};
    all["findings"] = nlohmann::ordered_json::array();
    for (const auto& finding : findings) {
        nlohmann::ordered_json one{
            {"verdict", to_text(finding.verdict)}, {"subject", finding.subject}, {"text", finding.text}};
        if (!finding.command.empty()) one["command"] = finding.command;
        all["findings"].push_back(std::move(one));
    }
    if (facts.probe) {
        const auto& p = *facts.probe;
        nlohmann::ordered_json histogram = nlohmann::ordered_json::array();
        for (std::size_t n = 0; n < DurationHistogram::kBuckets; ++n)
            if (const auto bucket = p.round_trip.bucket(n); bucket.count > 0)
                histogram.push_back(
                    {{"from_ns", bucket.from.count()}, {"to_ns", bucket.to.count()}, {"count", bucket.count}});
        all["probe"] = {
            {"sent", p.sent}, {"returned", p.returned}, {"slaves", p.slaves}, {"histogram", std::move(histogram)}};
    }
    // Names of interrupts and kernels are octets of any kind.
    return samples::json_text(all);
}

}  // namespace margay::nic_check
