// Judges facts: which are good for EtherCAT, which could be better and by which command, and which are unknown. Reads
// nothing itself.
#pragma once

#include "nic_check/facts.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace margay::nic_check {

enum class Verdict : std::uint8_t { good, better, not_known };

struct Finding {
    Verdict verdict = Verdict::not_known;
    std::string subject{};  // "link speed"
    std::string text{};     // one sentence
    std::string command{};  // the command that corrects it; empty: there is no such command, or no fault
};

[[nodiscard]] std::vector<Finding> judge_interface(const InterfaceFacts& facts);
[[nodiscard]] std::vector<Finding> judge_machine(const MachineFacts& facts);
[[nodiscard]] std::vector<Finding> judge_probe(const ProbeFacts& facts);
// All of them, in this order.
[[nodiscard]] std::vector<Finding> judge(const Facts& facts);

[[nodiscard]] std::string_view to_text(Verdict verdict);  // "good", "could be better", "not known"

[[nodiscard]] std::string findings_text(const Facts& facts, const std::vector<Finding>& findings);
// One object with "interface", "findings", "counts" and, after a probe, "probe"; for programs.
[[nodiscard]] std::string findings_json(const Facts& facts, const std::vector<Finding>& findings);

}  // namespace margay::nic_check
