// The page: one HTML file without references to anything outside of it, and without scripts.
#pragma once

#include "segment_report/markup.hpp"
#include "segment_report/report.hpp"
#include "segment_report/verdicts.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace margay::segment_report {

// The page, its summary in one sentence, and the worst verdict in it.
struct Page {
    std::string html{};
    std::string headline{};
    Severity worst = Severity::good;
};
[[nodiscard]] Page write_page(const Report& report);

// ------------------------------------------------------------------ parts of the page

// A part with a heading; `id` is the target of links.
[[nodiscard]] Markup section(std::string_view id, std::string_view title, const Markup& content);
// A word with the colour of its severity.
[[nodiscard]] Markup badge(Severity severity, std::string_view text);
[[nodiscard]] Markup slave_link(std::uint16_t position);

// page_slaves.cpp
[[nodiscard]] Markup slaves_section(const Report& report);
[[nodiscard]] Markup eeprom_section(const Report& report);
[[nodiscard]] Markup clocks_section(const Report& report);
// page_cables.cpp
[[nodiscard]] Markup cables_section(const Report& report, const std::vector<Cable>& cables);
// page_process.cpp
[[nodiscard]] Markup image_section(const Report& report);
[[nodiscard]] Markup alike_section(const Report& report, const std::vector<AlikeGroup>& groups);
[[nodiscard]] Markup cycles_section(const Report& report);
[[nodiscard]] Markup clock_log_section(const Report& report);
// page_recording.cpp
[[nodiscard]] Markup recording_section(const Report& report);
// page_machine.cpp
[[nodiscard]] Markup machine_section(const Report& report);
[[nodiscard]] Markup run_section(const Report& report);

}  // namespace margay::segment_report
