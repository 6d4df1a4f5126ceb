// The summary at the top of a page: good results, results to check, and faults.
#pragma once

#include "segment_report/cables.hpp"
#include "segment_report/differences.hpp"
#include "segment_report/report.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace margay::segment_report {

enum class Severity : std::uint8_t { good, remark, fault };

struct Verdict {
    Severity severity = Severity::good;
    std::string text{};
    std::string section{};  // the section of the page with details
};

struct Judgement {
    std::vector<Verdict> verdicts{};  // faults first
    // The summary in one sentence: "3 slaves, all in OP; cable between slave 2 and slave 3: 14 damaged frames".
    std::string headline{};
    [[nodiscard]] Severity worst() const;
};

[[nodiscard]] Judgement judge(const Report& report, const std::vector<Cable>& cables,
                              const std::vector<AlikeGroup>& groups);

// "fault", "look at it", "good".
[[nodiscard]] std::string_view to_text(Severity severity);

// "SAFEOP + ERROR, AL status code 0x001b: …".
[[nodiscard]] std::string state_text(const AlStatus& status);

// The reason why scan or configuration of the slave failed, without its position; empty: no error.
[[nodiscard]] std::string problem_text(const SlaveFacts& slave);

}  // namespace margay::segment_report
