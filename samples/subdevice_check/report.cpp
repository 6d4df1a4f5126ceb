#include "subdevice_check/report.hpp"

#include "common/counted.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace margay::samples::conformance {
namespace {

std::string check_text(const CheckResult& check) {
    std::string text = fmt::format("{:<14} {:<26} {}\n", to_text(check.outcome), check.name, check.what);
    if (!check.reason.empty()) text += fmt::format("               {}\n", check.reason);
    for (const auto& finding : check.findings)
        text += fmt::format("               {}: {}\n               {:{}}  ({})\n", to_text(finding.severity),
                            finding.text, "", to_text(finding.severity).size(), finding.clause);
    return text;
}

// Where no rule was tried: each reason, and the number of its checks. A count alone looks like a device without a
// fault.
std::string nothing_text(const Report& report) {
    if (report.count(Outcome::not_applicable) != report.checks.size()) return {};
    std::vector<std::pair<std::string_view, unsigned>> reasons;
    for (const auto& check : report.checks) {
        const auto known = std::ranges::find(reasons, check.reason, [](const auto& reason) { return reason.first; });
        if (known == reasons.end()) {
            reasons.emplace_back(check.reason, 1U);
        } else {
            ++known->second;
        }
    }
    std::string text = "Nothing was checked, so nothing is known about the device:\n";
    for (const auto& [reason, checks] : reasons)
        text += fmt::format("    {} ({})\n", reason, samples::counted(checks, "check"));
    return text;
}

}  // namespace

std::size_t Report::count(Severity severity) const {
    std::size_t count = 0;
    for (const auto& check : checks)
        for (const auto& finding : check.findings) count += finding.severity == severity ? 1U : 0U;
    return count;
}

std::size_t Report::count(Outcome outcome) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(checks, [&](const CheckResult& check) { return check.outcome == outcome; }));
}

std::string_view to_text(Severity severity) { return severity == Severity::error ? "error" : "remark"; }

std::string_view to_text(Outcome outcome) {
    switch (outcome) {
        case Outcome::passed: return "passed";
        case Outcome::failed: return "failed";
        case Outcome::not_applicable: return "not applicable";
        case Outcome::broken_off: return "broken off";
    }
    return "unknown";
}

std::string report_text(const Report& report, bool all) {
    std::string text = fmt::format("slave {}: {}, vendor 0x{:08x}, product 0x{:08x}, revision 0x{:08x}\n\n",
                                   report.number, report.device, report.vendor, report.product, report.revision);
    bool any = false;
    for (const auto& check : report.checks) {
        if (!all && check.findings.empty() && check.outcome != Outcome::broken_off) continue;
        text += check_text(check);
        any = true;
    }
    if (any) text += "\n";
    const auto broken_off = report.count(Outcome::broken_off);
    text += fmt::format("{}: {} passed, {} failed, {} not applicable{}; {}, {}\n",
                        samples::counted(report.checks.size(), "check"), report.count(Outcome::passed),
                        report.count(Outcome::failed), report.count(Outcome::not_applicable),
                        broken_off == 0 ? std::string() : fmt::format(", {} broken off", broken_off),
                        samples::counted(report.count(Severity::error), "error"),
                        samples::counted(report.count(Severity::remark), "remark"));
    return text + nothing_text(report);
}

nlohmann::ordered_json report_json(const Report& report) {
    nlohmann::ordered_json checks = nlohmann::ordered_json::array();
    for (const auto& check : report.checks) {
        nlohmann::ordered_json findings = nlohmann::ordered_json::array();
        for (const auto& finding : check.findings)
            findings.push_back(
                {{"severity", to_text(finding.severity)}, {"text", finding.text}, {"clause", finding.clause}});
        nlohmann::ordered_json one = {
            {"name", check.name}, {"what", check.what}, {"outcome", to_text(check.outcome)}, {"findings", findings}};
        if (!check.reason.empty()) one["reason"] = check.reason;
        checks.push_back(std::move(one));
    }
    return {{"number", report.number},
            {"device", report.device},
            {"vendor", report.vendor},
            {"product", report.product},
            {"revision", report.revision},
            {"conforms", report.conforms()},
            {"errors", report.count(Severity::error)},
            {"remarks", report.count(Severity::remark)},
            {"checks", std::move(checks)}};
}

}  // namespace margay::samples::conformance
