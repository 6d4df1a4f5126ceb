// The synchronization types that a master may write: subindex 1 of 0x1C32, 0x1C33 and their kin.
#include "subdevice_check/kept.hpp"

namespace margay::samples::conformance {
namespace {

constexpr std::uint8_t kType = 1;
constexpr std::uint8_t kSupported = 4;
constexpr std::uint16_t kNoType = 0x1FFF;

// A type that subindex 4 announces. Bits 2 to 4 are a number: the kind of DC synchronization.
struct Type {
    std::uint16_t value;
    std::uint32_t mask;
    std::uint32_t announced;
};
constexpr Type kTypes[] = {{0, 0x01, 0x01}, {1, 0x02, 0x02}, {2, 0x1C, 0x04}};

std::uint16_t object_of(const ProcessArea& area) { return static_cast<std::uint16_t>(0x1C30 + area.sync_manager); }

// A type that was accepted is the type of the object. Inputs that follow the outputs have 0x22 for 1.
void expect_type(Session& session, std::uint16_t index, std::uint16_t type) {
    const auto now = session.sdo.number(index, kType);
    if (now == std::uint32_t{type} || (type == 1 && now == 0x22U)) return;
    session.bench.fail(fmt::format("{} accepted the synchronization type {} and reads as {}", object_text(index, kType),
                                   type, now ? fmt::format("{}", *now) : std::string("nothing")));
}

void check_object(Session& session, std::uint16_t index) {
    auto& bench = session.bench;
    auto& sdo = session.sdo;
    const auto before = sdo.number(index, kType);
    if (!before) return;
    const auto name = object_text(index, kType);
    const Kept kept(session, index, kType);
    const auto abort = sdo.download(index, kType, kNoType);
    if (abort == Abort::none)
        bench.fail(fmt::format("{} accepted the synchronization type 0x{:04x}, which does not exist", name, kNoType));
    if (abort == Abort::read_only) return;  // the master has no choice
    if (const auto after = sdo.number(index, kType); abort != Abort::none && after != before)
        bench.fail(fmt::format("a refused write changed {} from {} to {}", name, *before, after.value_or(0)));
    if (const auto supported = sdo.number(index, kSupported)) {
        for (const auto& type : kTypes)
            if ((*supported & type.mask) == type.announced) {
                // Inputs that follow the outputs may have 0x22 in the place of 1.
                const auto refused = sdo.download(index, kType, type.value);
                if (refused == Abort::none) expect_type(session, index, type.value);
                if (refused != Abort::none && type.value != 1)
                    bench.fail(fmt::format("{} announces the synchronization type {}, and {} refused it: {}",
                                           object_text(index, kSupported), type.value, name, abort_text(refused)));
            }
    }
    if (sdo.download(index, kType, static_cast<std::uint16_t>(*before)) != Abort::none)
        bench.fail(fmt::format("{} refused {}, the value that it had", name, *before));
}

void check_types(Session& session) {
    session.sdo.needs_sdo();
    auto& bench = session.bench;
    bench.enter(AlState::preop);
    bool any = false;
    for (const auto& area : bench.areas()) {
        any = any || session.sdo.number(object_of(area), kType).has_value();
        check_object(session, object_of(area));
    }
    if (!any) bench.skip("the device has no synchronization parameters (0x1C32, 0x1C33)");
}

constexpr Check kSyncTypeChecks[] = {
    {"sync.types", "only supported synchronization types are accepted", "ETG.1020, Synchronization", check_types},
};

}  // namespace

std::span<const Check> sync_type_checks() { return kSyncTypeChecks; }

}  // namespace margay::samples::conformance
