#include "analyse/recording.hpp"
#include "common/program.hpp"
#include "ethercat/analysis_output.hpp"
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace margay::ethercat {

int run_analyse(Call& call) {
    const auto& path = call.words()[0];
    const auto analysis = analyse::analyse_file(path);
    const auto named = [&](const std::string& text) { return fmt::format("recording {}: {}", path, text); };
    // The packets before a damaged packet are shown too.
    if (analysis.frames.ethercat != 0) {
        Output output;
        output.json = {{"file", path}};
        if (call.json())
            output.json.update(analysis_json(analysis));
        else
            output.text = fmt::format("{}\n\n{}", path, analysis_text(analysis, call.has("verbose")));
        (void)call.print(output);
    }
    if (!analysis.problem.empty()) return call.fail({named(analysis.problem), samples::exit_code::kSystem});
    const auto warn = [&](const std::string& remark) {
        if (!remark.empty() && !call.has("quiet")) samples::warn("warning: " + named(remark));
    };
    warn(analysis.remark);
    for (const auto& other : analysis.others) warn(other.remark);
    return samples::exit_code::kWell;
}

}  // namespace margay::ethercat
