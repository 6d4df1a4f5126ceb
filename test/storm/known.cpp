// What the storm finds and is not mended yet: by rule, with the sentence of the issue. To be emptied.
#include "storm/run.hpp"

#include <algorithm>
#include <array>

namespace margay::storm {
namespace {

struct Known {
    std::string_view rule;    // begins so
    std::string_view detail;  // and holds this
    const char* reason;
};

constexpr std::array kKnown{
    Known{"the cycle is right with a wrong slave", "", "1: wrong slaves get outputs, working counter as expected"},
    Known{"a wrong slave has outputs", "", "1: wrong slaves get outputs"},
    Known{"the cycle is right without a slave", "",
          "1: expected_wkc shrinks by a slave that is not configured (plans/right_without_a_slave.plan)"},
    Known{"crashes: Assertion '__idx < size()' failed. at src/network/scan.cpp", "",
          "3: a SuperviseRequest beside a busy ScanRequest (arrange())"},
    Known{"crashes: Assertion '__idx < size()' failed. at src/network/search.cpp", "",
          "3: a scan beside a RecoverRequest (tell_stranger())"},
    Known{"crashes: Assertion '__n < this->size()' failed. at src/station/sii_access.cpp", "",
          "2: two scans exclude each other"},
    Known{"the arena does not return to its level", "",
          "new: the pump of a slave that left during an exchange stays (plans/pump_of_a_slave_that_left.plan)"},
    Known{"crashes: a call of nothing", "",
          "2: hooks have one contract: a scan clears a hook that was busy and is called again "
          "(plans/busy_hook_beside_scan)"},
    Known{"a supervised slave does not come back", "without an address",
          "new: a slave that has lost its supply for a moment is not noticed (plans/unnoticed_fall, "
          "fallen_during_recovery)"},
    Known{"a supervised slave does not come back", "not as wanted (wanted 0x00000000, is 0x00000000)",
          "new: with few tasks a slave that cannot be brought back starves those behind it (supervisor.cpp, retry_at)"},
    Known{
        "while a group is mapped: an input is delivered as good that the slave did not have", "",
        "new: a MapRequest of a mapped group switches SyncManagers off while the old cycle goes on and is told right"},
    Known{"an input is delivered as good that the slave did not have", "bootloader",
          "new: the library's bootloader has its inputs in another SyncManager than its SII says"},
};

}  // namespace

const char* known_reason(const Verdict& verdict) {
    for (const auto& known : kKnown)
        if (verdict.rule.starts_with(known.rule) && verdict.detail.find(known.detail) != std::string::npos)
            return known.reason;
    return nullptr;
}

}  // namespace margay::storm
