// The result of a conformance check: what each check found, as text for people and as JSON for programs.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace margay::samples::conformance {

// An error breaks a rule of the standard. A remark is allowed by the standard, but some masters have trouble with it.
enum class Severity : std::uint8_t { error, remark };

struct Finding {
    Severity severity = Severity::error;
    std::string text{};    // a sentence about this device
    std::string clause{};  // the rule: the standard, and the title of the section or table
};

enum class Outcome : std::uint8_t {
    passed,          // the rule was checked, and the device obeys it
    failed,          // at least one error
    not_applicable,  // the rule does not concern this device, or could not be tried; `reason` says why
    broken_off       // frames did not come back, so the rule is neither kept nor broken; `reason` says where
};

struct CheckResult {
    std::string name{};  // "states.skipped"; the part before the dot is the subject
    std::string what{};
    Outcome outcome = Outcome::passed;
    std::string reason{};
    std::vector<Finding> findings{};
};

struct Report {
    std::uint16_t number = 0;
    std::string device{};  // name of the SII, or a text that says that there is none
    std::uint32_t vendor = 0;
    std::uint32_t product = 0;
    std::uint32_t revision = 0;
    std::vector<CheckResult> checks{};

    [[nodiscard]] std::size_t count(Severity severity) const;
    [[nodiscard]] std::size_t count(Outcome outcome) const;
    // Whether no check has an error, and each check has finished. A device whose cable was removed has not passed.
    [[nodiscard]] bool conforms() const { return count(Severity::error) == 0 && count(Outcome::broken_off) == 0; }
};

[[nodiscard]] std::string_view to_text(Severity severity);
[[nodiscard]] std::string_view to_text(Outcome outcome);

// The whole report. Without `all`, checks that passed or do not apply, and have no finding, are only counted.
[[nodiscard]] std::string report_text(const Report& report, bool all);
[[nodiscard]] nlohmann::ordered_json report_json(const Report& report);

}  // namespace margay::samples::conformance
