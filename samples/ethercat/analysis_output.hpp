// An analysed recording as text for people and as JSON for programs.
#pragma once

#include "analyse/analysis.hpp"

#include <nlohmann/json_fwd.hpp>

#include <string>

namespace margay::ethercat {

// `verbose`: lists in full; otherwise the first and the last entries of a long list.
[[nodiscard]] std::string analysis_text(const analyse::Analysis& analysis, bool verbose);
[[nodiscard]] nlohmann::ordered_json analysis_json(const analyse::Analysis& analysis);

// "replies are marked by the first slave" …
[[nodiscard]] std::string_view words_of(analyse::Directions directions);
// "INIT", "SAFEOP + ERROR"
[[nodiscard]] std::string state_words(const AlStatus& status);
// "SDO upload 0x1018:01", "FoE read "firmware.bin""
[[nodiscard]] std::string words_of(const analyse::Conversation& conversation);
// "3 lost", "losses not known"
[[nodiscard]] std::string lost_words(const analyse::Analysis& analysis, std::uint64_t lost);
// False: the recording has only requests, or only replies.
[[nodiscard]] bool late_known(const analyse::Analysis& analysis);
// "3 late", "late replies not known"
[[nodiscard]] std::string late_words(const analyse::Analysis& analysis, std::uint64_t late);
// "done", "refused" …
[[nodiscard]] std::string_view words_of(analyse::Outcome outcome);
// "sdo_upload" …
[[nodiscard]] std::string_view key_of(analyse::Action action);
// Octets in hexadecimal: "12 34".
[[nodiscard]] std::string octet_list(const std::vector<std::byte>& octets);

}  // namespace margay::ethercat
