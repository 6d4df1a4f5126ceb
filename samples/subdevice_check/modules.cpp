// Modular devices: the lists of slots against each other and against the PDOs, and the comparison of the modules that
// the master expects with the modules that are there.
#include "subdevice_check/kept.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>
#include <functional>

namespace margay::samples::conformance {
namespace {

constexpr std::string_view kProfile = "ETG.5001.1, Modular Device Profile";
constexpr std::uint16_t kGeneral = 0xF000;
constexpr std::uint16_t kProfiles = 0xF010;
constexpr std::uint16_t kConfigured = 0xF030;
constexpr std::uint16_t kDetected = 0xF050;

// The idents of 0xF050, from the first slot on.
std::vector<std::uint32_t> detected_modules(Session& session) {
    begin_sdo_check(session);
    const auto count = session.sdo.number(kDetected, 0);
    if (!count) session.bench.skip("the device has no list of detected modules (0xF050)");
    std::vector<std::uint32_t> idents;
    for (unsigned slot = 1; slot <= *count; ++slot) {
        const auto ident = session.sdo.number(kDetected, static_cast<std::uint8_t>(slot));
        if (!ident) session.bench.fail(object_text(kDetected, static_cast<std::uint8_t>(slot)) + " cannot be read");
        idents.push_back(ident.value_or(0));
    }
    return idents;
}

void check_slot_lists(Session& session) {
    const auto idents = detected_modules(session);
    auto& bench = session.bench;
    auto& sdo = session.sdo;
    const auto distance = sdo.number(kGeneral, 1);
    const auto most = sdo.number(kGeneral, 2);
    if (!distance || !most) {
        bench.fail("0xF050 exists, and object 0xF000 has no subindices 1 and 2");
        return;
    }
    if (idents.size() > *most)
        bench.fail(fmt::format("{} says {} slots, and {} says {} at most", object_text(kDetected, 0), idents.size(),
                               object_text(kGeneral, 2), *most));
    const auto profiles = sdo.number(kProfiles, 0);
    if (profiles && *profiles != idents.size())
        bench.fail(fmt::format("{} is {}, and {} is {}", object_text(kProfiles, 0), *profiles,
                               object_text(kDetected, 0), idents.size()));
    if (*distance == 0) return;
    for (const auto& area : bench.areas()) {
        const auto assignment = static_cast<std::uint16_t>(0x1C10 + area.sync_manager);
        const auto pdos = sdo.number(assignment, 0).value_or(0);
        for (unsigned n = 1; n <= pdos; ++n) {
            const auto pdo =
                static_cast<std::uint16_t>(sdo.number(assignment, static_cast<std::uint8_t>(n)).value_or(0));
            const auto entries = sdo.number(pdo, 0).value_or(0);
            for (unsigned m = 1; m <= entries; ++m) {
                const auto entry = sdo.number(pdo, static_cast<std::uint8_t>(m)).value_or(0);
                const auto index = static_cast<std::uint16_t>(entry >> 16);
                if (index < 0x6000 || index >= 0xF000) continue;
                const auto slot = (index & 0x0FFFU) / *distance + 1;
                if (slot > *most) continue;  // an object of the device itself, behind the slots
                if (slot <= idents.size() && idents[slot - 1] != 0) continue;
                bench.fail(fmt::format("PDO 0x{:04x} maps {}, an object of slot {}, which is empty by 0xF050", pdo,
                                       object_text(index, static_cast<std::uint8_t>(entry >> 8)), slot));
            }
        }
    }
}

// Writes the list of expected modules. False: the device does not have it, or it cannot be written.
bool expect(SdoClient& sdo, const std::vector<std::uint32_t>& idents) {
    if (sdo.download<std::uint8_t>(kConfigured, 0, 0) != Abort::none) return false;
    for (std::size_t n = 0; n < idents.size(); ++n)
        if (sdo.download<std::uint32_t>(kConfigured, static_cast<std::uint8_t>(n + 1), idents[n]) != Abort::none)
            return false;
    return sdo.download<std::uint8_t>(kConfigured, 0, static_cast<std::uint8_t>(idents.size())) == Abort::none;
}

// The list as it was.
Kept kept_list(Session& session) {
    if (!session.sdo.number(kConfigured, 0))
        session.bench.skip("the device has no list of configured modules (0xF030)");
    return Kept::list(session, kConfigured);
}

// Requests SAFEOP from PREOP with this list.
AlStatus start_with(Session& session, const std::vector<std::uint32_t>& idents) {
    auto& bench = session.bench;
    for (;;) {
        bench.enter(AlState::preop);
        if (!expect(session.sdo, idents)) bench.skip("the list of configured modules (0xF030) cannot be written");
        bench.configure_process_data();
        const auto status = bench.go(AlState::safeop);
        if (!bench.wants_clock(status)) return status;
    }
}

void check_match(Session& session) {
    const auto idents = detected_modules(session);
    if (idents.empty()) session.bench.skip("no module is plugged in");
    const Kept kept = kept_list(session);
    const auto status = start_with(session, idents);
    if (status.state != AlState::safeop || status.error)
        session.bench.fail(fmt::format(
            "the list of the detected modules was written to 0xF030, and SAFEOP is refused: {}", status_text(status)));
}

void check_mismatch(Session& session) {
    const auto idents = detected_modules(session);
    const Kept kept = kept_list(session);
    auto plugged = idents;
    while (!plugged.empty() && plugged.back() == 0) plugged.pop_back();  // empty slots behind the last module
    auto other = plugged;
    if (other.empty()) other.push_back(0);
    other.front() ^= 1;
    auto fewer = plugged;
    if (!fewer.empty()) fewer.pop_back();
    auto more = plugged;  // a module that is not present
    if (more.size() < session.sdo.number(kGeneral, 2).value_or(0))
        more.push_back(more.empty() || more.back() == 0 ? 1 : more.back());
    auto exchanged = plugged;  // the same modules in other slots
    const auto differ = std::ranges::adjacent_find(exchanged, std::not_equal_to{});
    if (differ != exchanged.end()) std::iter_swap(differ, differ + 1);
    std::vector<std::vector<std::uint32_t>> lists{other, fewer, more, exchanged};
    // One wrong module in each of the first slots, and in the last one.
    constexpr std::size_t kMostSlots = 16;
    for (std::size_t slot = 1; slot < plugged.size(); ++slot) {
        if (slot >= kMostSlots && slot + 1 != plugged.size()) continue;
        lists.push_back(plugged);
        lists.back()[slot] ^= 1;
    }
    for (const auto& wrong : lists) {
        if (wrong.empty() || wrong == plugged) continue;  // no expectation, or the right one
        const auto status = start_with(session, wrong);
        if (status.state != AlState::preop || !status.error)
            session.bench.fail(
                fmt::format("0xF030 has {} modules that differ from the detected ones, and SAFEOP is "
                            "accepted: {}",
                            wrong.size(), status_text(status)));
        else if (static_cast<wire::AlStatusCode>(status.code) != wire::AlStatusCode::module_list_mismatch)
            session.bench.fail(fmt::format("0xF030 differs from the detected modules: SAFEOP is refused with {}, "
                                           "expected 0x0070",
                                           status_text(status)),
                               "ETG.1020, AL Status Codes");
    }
}

constexpr Check kModuleChecks[] = {
    {"modules.lists", "the lists of slots agree with each other and with the PDOs", kProfile, check_slot_lists},
    {"modules.match", "the list of the detected modules is accepted", kProfile, check_match},
    {"modules.mismatch", "a list of other modules is refused with 0x0070", kProfile, check_mismatch},
};

}  // namespace

std::span<const Check> module_checks() { return kModuleChecks; }

}  // namespace margay::samples::conformance
