// PDO assignment and mapping: their objects against the SII, and the rules by which a master changes them.
#include "subdevice_check/kept.hpp"
#include "wire/al_status_code.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

namespace sii = wire::sii;

constexpr std::uint16_t kDetectedModules = 0xF050;  // ETG.5001.1
constexpr std::string_view kAssign = "ETG.1000.6, Sync Manager PDO Assignment";
constexpr std::string_view kMapping = "ETG.1000.6, PDO Mapping";

std::uint16_t assignment_of(const ProcessArea& area) { return static_cast<std::uint16_t>(0x1C10 + area.sync_manager); }

// The assigned PDOs by the dictionary; nullopt when the objects do not exist or cannot be read.
std::optional<std::vector<SiiPdo>> dictionary_pdos(Session& session, const ProcessArea& area) {
    const auto count = session.sdo.number(assignment_of(area), 0);
    if (!count) return std::nullopt;
    std::vector<SiiPdo> pdos;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto index = session.sdo.number(assignment_of(area), static_cast<std::uint8_t>(n));
        if (!index) return std::nullopt;
        SiiPdo pdo{static_cast<std::uint16_t>(*index)};
        const auto entries = session.sdo.number(pdo.index, 0);
        if (!entries) return std::nullopt;
        for (unsigned m = 1; m <= *entries; ++m) {
            const auto entry = session.sdo.number(pdo.index, static_cast<std::uint8_t>(m));
            if (!entry) return std::nullopt;
            pdo.entries.push_back(*entry);
        }
        pdos.push_back(std::move(pdo));
    }
    return pdos;
}

void begin_pdo_check(Session& session) {
    begin_sdo_check(session);
    if (session.bench.areas().empty()) session.bench.skip("the SII describes no process data");
    find_process_data_lengths(session);  // before a check changes the objects
}

std::string entry_text(std::uint32_t entry) {
    return fmt::format("{} with {} bits",
                       object_text(static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8)),
                       entry & 0xFFU);
}

void check_assignment_objects(Session& session) {
    begin_pdo_check(session);
    auto& bench = session.bench;
    const auto& slave = bench.slave();
    if (const auto types = session.sdo.number(0x1C00, 0); !types) {
        bench.fail("object 0x1C00 (SyncManager communication type) does not exist",
                   "ETG.1000.6, Sync Manager Communication Type");
    } else {
        for (std::uint8_t n = 0; n < slave.sm_count && n < *types; ++n) {
            const auto type = session.sdo.number(0x1C00, static_cast<std::uint8_t>(n + 1));
            if (type && *type != static_cast<std::uint32_t>(slave.sync_managers[n].type))
                bench.fail(fmt::format("SyncManager {} has type {} in object 0x1C00 and {} in the SII", n, *type,
                                       static_cast<unsigned>(slave.sync_managers[n].type)),
                           "ETG.1000.6, Sync Manager Communication Type");
        }
    }
    for (const auto& area : bench.areas()) {
        const auto up = session.sdo.upload(assignment_of(area), 0);
        if (!up.ok())
            bench.fail(
                fmt::format("SyncManager {} has process data, and the upload of its PDO assignment 0x{:04x} "
                            "ended with {}",
                            area.sync_manager, assignment_of(area), abort_text(up.abort)));
    }
}

// Every mapped entry exists, has the mapped size, and is mappable in this direction.
void check_mapped(Session& session) {
    begin_pdo_check(session);
    auto& bench = session.bench;
    if (!session.sdo.entries_complete) bench.skip("the dictionary was not read (information.entries)");
    for (const auto& area : bench.areas()) {
        const auto pdos = dictionary_pdos(session, area);
        if (!pdos) continue;  // pdos.objects reports it
        for (const auto& pdo : *pdos)
            for (const auto entry : pdo.entries) {
                if (entry >> 16 < 0x1000) continue;  // a gap
                const auto found = std::ranges::find_if(session.sdo.entries, [&](const DictionaryEntry& e) {
                    return e.index == entry >> 16 && e.subindex == (entry >> 8 & 0xFFU);
                });
                const auto wanted = area.outputs ? coe::access::kRxMappable : coe::access::kTxMappable;
                if (found == session.sdo.entries.end())
                    bench.fail(fmt::format("PDO 0x{:04x} maps {}, which does not exist", pdo.index, entry_text(entry)));
                else if (found->bits != (entry & 0xFFU))
                    bench.fail(fmt::format("PDO 0x{:04x} maps {}, which has {} bits", pdo.index, entry_text(entry),
                                           found->bits));
                else if ((found->access & wanted) == 0)
                    bench.fail(fmt::format("PDO 0x{:04x} maps {}, which is not mappable by its description", pdo.index,
                                           entry_text(entry)));
                else if (found->subindex > session.sdo.number(found->index, 0).value_or(255))
                    bench.remark(
                        fmt::format("PDO 0x{:04x} maps {}, and subindex 0 of this object is lower: a master "
                                    "that reads the object by its count does not see the value",
                                    pdo.index, entry_text(entry)));
            }
    }
}

void check_sii(Session& session) {
    begin_pdo_check(session);
    auto& bench = session.bench;
    if (!session.sii_fault.empty()) bench.skip("the SII cannot be read: " + session.sii_fault);
    for (const auto& area : bench.areas()) {
        const auto pdos = dictionary_pdos(session, area);
        if (!pdos) continue;
        const auto described = sii_pdos(session, area.sync_manager);
        if (described.empty()) continue;  // eeprom.process_data remarks it
        const auto indices = [](const std::vector<SiiPdo>& list) {
            std::string text;
            for (const auto& pdo : list) text += fmt::format("{}0x{:04x}", text.empty() ? "" : ", ", pdo.index);
            return text.empty() ? std::string("none") : text;
        };
        const bool differs = !std::ranges::equal(*pdos, described, [](const SiiPdo& a, const SiiPdo& b) {
            return a.index == b.index && a.entries == b.entries;
        });
        // The SII is written before the user plugs in the modules.
        if (differs && session.sdo.number(kDetectedModules, 0))
            bench.skip("the PDOs of a modular device are those of its modules; the SII describes others");
        if (!std::ranges::equal(*pdos, described, {}, &SiiPdo::index, &SiiPdo::index)) {
            bench.fail(fmt::format("SyncManager {}: object 0x{:04x} assigns {}, the SII assigns {}", area.sync_manager,
                                   assignment_of(area), indices(*pdos), indices(described)));
            continue;
        }
        for (std::size_t n = 0; n < described.size(); ++n)
            if ((*pdos)[n].entries != described[n].entries)
                bench.fail(
                    fmt::format("PDO 0x{:04x} has other entries in its object than in the SII", described[n].index));
    }
}

bool writable(const Session& session, std::uint16_t index) {
    return std::ranges::any_of(session.sdo.entries, [&](const DictionaryEntry& entry) {
        return entry.index == index && entry.subindex == 0 && (entry.access & coe::access::kWritePreop) != 0;
    });
}

// The areas whose assignment a master may change.
std::vector<ProcessArea> assignable(Session& session) {
    begin_pdo_check(session);
    std::vector<ProcessArea> areas;
    for (const auto& area : session.bench.areas())
        if (area.setting.length_bytes != 0 && writable(session, assignment_of(area))) areas.push_back(area);
    if (areas.empty()) session.bench.skip("the PDO assignment cannot be changed");
    return areas;
}

void check_assignment(Session& session) {
    auto& bench = session.bench;
    for (const auto& area : assignable(session)) {
        const auto index = assignment_of(area);
        const Kept kept = Kept::list(session, index);
        if (kept.values().empty()) continue;
        auto abort = session.sdo.download(index, 1, Bytes(kept.values().front()));
        if (abort == Abort::none)
            bench.fail(fmt::format("{} was written while subindex 0 was not 0", object_text(index, 1)));
        abort = session.sdo.download<std::uint8_t>(index, 0, 0);
        if (abort != Abort::none) {
            bench.fail(fmt::format("0 for {}: {}", object_text(index, 0), abort_text(abort)));
            continue;
        }
        if (session.sdo.number(index, 0) != 0U)
            bench.fail(object_text(index, 0) + " was set to 0 and reads as another value");
        bench.configure_process_data();
        bench.write_sync_manager(area.sync_manager, area.setting);
        const auto status = bench.go(AlState::safeop, false);
        if (status.state == AlState::safeop)
            bench.fail(fmt::format("no PDO is assigned to SyncManager {}, and SAFEOP is accepted with a length of {}",
                                   area.sync_manager, area.setting.length_bytes),
                       "ETG.1000.6, EtherCAT State Machine");
    }
}

void check_unknown_pdo(Session& session) {
    auto& bench = session.bench;
    for (const auto& area : assignable(session)) {
        const auto index = assignment_of(area);
        const Kept kept = Kept::list(session, index);
        (void)session.sdo.download<std::uint8_t>(index, 0, 0);
        const std::uint16_t absent = area.outputs ? 0x17FE : 0x1BFE;
        const auto refused = session.sdo.download<std::uint16_t>(index, 1, absent);
        if (refused != Abort::none) continue;
        if (session.sdo.download<std::uint8_t>(index, 0, 1) != Abort::none) continue;
        bench.configure_process_data();
        if (const auto status = bench.go(AlState::safeop, false); status.state == AlState::safeop)
            bench.fail(fmt::format("PDO 0x{:04x}, which does not exist, was assigned, and SAFEOP is accepted", absent));
        else
            bench.remark(fmt::format("PDO 0x{:04x}, which does not exist, was assigned; only SAFEOP was refused, {}",
                                     absent, status_text(status)));
    }
}

void check_locked(Session& session) {
    auto& bench = session.bench;
    begin_pdo_check(session);
    std::vector<std::uint16_t> changeable;
    for (const auto& area : bench.areas()) {
        if (area.setting.length_bytes == 0) continue;
        if (writable(session, assignment_of(area))) changeable.push_back(assignment_of(area));
        for (const auto& pdo : dictionary_pdos(session, area).value_or(std::vector<SiiPdo>{}))
            if (writable(session, pdo.index)) changeable.push_back(pdo.index);
    }
    if (changeable.empty()) bench.skip("the PDO assignment and the mapping cannot be changed");
    for (const auto index : changeable) {
        const Kept kept = Kept::list(session, index);
        for (const auto state : {AlState::safeop, AlState::op}) {
            bench.enter(state);
            const auto frames = bench.frames_in(state);
            if (session.sdo.download<std::uint8_t>(index, 0, 0) != Abort::none) continue;
            bench.fail(fmt::format("{} was changed in {}", object_text(index, 0), state_text(state)));
            return;
        }
    }
}

// The first mapping object that a master may change, of each SyncManager.
void check_mapping(Session& session) {
    auto& bench = session.bench;
    begin_pdo_check(session);
    if ((bench.slave().coe_details & coe_detail::kPdoConfiguration) == 0)
        bench.skip("the SII does not announce that the PDO mapping can be changed");
    for (const auto& area : bench.areas()) {
        const auto pdos = dictionary_pdos(session, area);
        if (!pdos) continue;
        const auto found = std::ranges::find_if(*pdos, [&](const auto& pdo) { return writable(session, pdo.index); });
        if (found == pdos->end()) continue;
        const auto index = found->index;
        const Kept kept = Kept::list(session, index);
        if (!kept.values().empty() && session.sdo.download(index, 1, Bytes(kept.values().front())) == Abort::none)
            bench.fail(fmt::format("{} was written while subindex 0 was not 0", object_text(index, 1)));
        if (session.sdo.download<std::uint8_t>(index, 0, 0) == Abort::none && session.sdo.number(index, 0) != 0U) {
            bench.fail(object_text(index, 0) + " was set to 0 and reads as another value");
            continue;
        }
        // An object that exists and cannot be mapped, and one that does not exist.
        for (const std::uint32_t entry : {0x10000020U, 0x5FFE0010U}) {
            if (session.sdo.download<std::uint32_t>(index, 1, entry) != Abort::none) continue;
            if (session.sdo.download<std::uint8_t>(index, 0, 1) == Abort::none)
                bench.fail(fmt::format("PDO 0x{:04x} accepts {}, which cannot be mapped", index, entry_text(entry)));
            (void)session.sdo.download<std::uint8_t>(index, 0, 0);
        }
        std::size_t subindices = 0;
        for (const auto& entry : session.sdo.entries) subindices += entry.index == index && entry.subindex != 0 ? 1 : 0;
        std::uint8_t n = 0;
        const auto wanted = area.outputs ? coe::access::kRxMappable : coe::access::kTxMappable;
        for (const auto& entry : session.sdo.entries) {
            if (n == subindices || (entry.access & wanted) == 0 || entry.bits == 0 || entry.bits > 32) continue;
            const auto value = std::uint32_t{entry.index} << 16 | std::uint32_t{entry.subindex} << 8 | entry.bits;
            const auto abort = session.sdo.download<std::uint32_t>(index, static_cast<std::uint8_t>(n + 1), value);
            if (abort != Abort::none) {
                bench.remark(fmt::format("PDO 0x{:04x} has {} subindices; entry {}, {}, was refused with {}", index,
                                         subindices, n + 1, entry_text(value), abort_text(abort)));
                break;
            }
            ++n;
        }
        if (const auto abort = session.sdo.download<std::uint8_t>(index, 0, n); abort != Abort::none)
            bench.remark(fmt::format("PDO 0x{:04x} with {} entries was refused with {}", index, n, abort_text(abort)));
    }
}

constexpr Check kPdoChecks[] = {
    {"pdos.objects", "0x1C00 and the PDO assignments exist and agree with the SII", kAssign, check_assignment_objects},
    {"pdos.mapped", "each mapped entry exists and can be mapped", kMapping, check_mapped},
    {"pdos.sii", "the objects and the SII assign the same PDOs", "ETG.2010, category TXPDO and RXPDO", check_sii},
    {"pdos.assignment", "the assignment is changed in the order of the standard", kAssign, check_assignment},
    {"pdos.unknown", "a PDO that does not exist cannot be used", kAssign, check_unknown_pdo},
    {"pdos.locked", "assignment and mapping cannot be changed in SAFEOP and OP", kAssign, check_locked},
    {"pdos.mapping", "the mapping is changed in the order of the standard", kMapping, check_mapping},
};

}  // namespace

std::vector<SiiPdo> sii_pdos(const Session& session, std::uint8_t sync_manager) {
    std::vector<SiiPdo> pdos;
    for (const auto type : {sii::category::kTxPdo, sii::category::kRxPdo}) {
        const auto content = sii::find_category(session.sii, type);
        if (!content) continue;
        sii::Pdos list(*content);
        while (const auto pdo = list.next()) {
            if (pdo->sync_manager != sync_manager) continue;
            SiiPdo one{pdo->index};
            sii::PdoEntries entries(pdo->entries);
            while (const auto entry = entries.next())
                one.entries.push_back(std::uint32_t{entry->index} << 16 | std::uint32_t{entry->subindex} << 8 |
                                      entry->bit_length);
            pdos.push_back(std::move(one));
        }
    }
    return pdos;
}

std::size_t bits_of(const std::vector<SiiPdo>& pdos) {
    std::size_t bits = 0;
    for (const auto& pdo : pdos)
        for (const auto entry : pdo.entries) bits += entry & 0xFFU;
    return bits;
}

void find_process_data_lengths(Session& session) {
    if (session.lengths_known) return;
    session.lengths_known = true;
    auto& bench = session.bench;
    const auto areas = bench.areas();
    for (const auto& area : areas) {
        std::optional<std::vector<SiiPdo>> pdos;
        try {
            session.sdo.needs_sdo();
            pdos = dictionary_pdos(session, area);
        } catch (const NotJudged&) {  // another check reports it
        }
        const auto described = bench.slave().sync_managers[area.sync_manager].length_bytes;
        if (!pdos && described == 0) pdos = sii_pdos(session, area.sync_manager);
        if (pdos) bench.set_area_length(area.sync_manager, static_cast<std::uint16_t>((bits_of(*pdos) + 7) / 8));
    }
}

std::span<const Check> pdo_checks() { return kPdoChecks; }

}  // namespace margay::samples::conformance
