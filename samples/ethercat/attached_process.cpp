// Process data as the application exchanges it, and the PDOs of its slaves; see attached.hpp.
#include "common/slave_report.hpp"
#include "ethercat/attached.hpp"
#include "ethercat/selection.hpp"
#include "ethercat/session_eeprom.hpp"
#include "files/esi_object.hpp"
#include "wire/esc.hpp"
#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::ethercat {
namespace {

using attach::Operation;

constexpr std::uint16_t kFirstAssignment = 0x1C10;  // of SyncManager 0

template <class T>
Answer<T> number_in(const Answer<Octets>& octets, std::uint16_t position, std::uint16_t index) {
    if (!octets) return octets.problem();
    if (octets->size() != sizeof(T))
        return Problem{fmt::format("position {}: object 0x{:04x} has {} octets and not {}", position, index,
                                   octets->size(), sizeof(T))};
    return load_le<T>(*octets);
}

PdoFacts pdo_of(const files::EsiPdo& pdo) {
    PdoFacts facts{.index = pdo.index, .name = pdo.name};
    for (const auto& entry : pdo.entries)
        facts.entries.push_back({.index = entry.index,
                                 .subindex = entry.subindex,
                                 .bits = static_cast<std::uint8_t>(entry.bits),
                                 .name = entry.name,
                                 .data_type = files::data_type_number(entry.data_type)});
    return facts;
}

}  // namespace

// ------------------------------------------------------------------ SII

Answer<const files::EsiDevice*> AttachedSession::sii_of(std::uint16_t position) {
    if (const auto known = sii_.find(position); known != sii_.end()) return &known->second;
    SessionEeprom eeprom(*this, position);
    const auto content = samples::read_used_part(eeprom, samples::no_progress());
    if (!content.error.empty()) return eeprom.problem(content.error);
    auto described = files::describe_sii(content.octets);
    if (!described) return Problem{fmt::format("position {}: its SII: {}", position, to_text(described.problem))};
    return &sii_.emplace(position, std::move(*described)).first->second;
}

Answer<SlaveTexts> AttachedSession::texts(std::uint16_t position) {
    const auto sii = sii_of(position);
    if (!sii) return sii.problem();
    const auto& device = **sii;
    return SlaveTexts{.order = device.type,
                      .group = device.group,
                      .name = device.name,
                      .enable_safeop = device.safeop_configuration,
                      .no_lrw = device.no_lrw};
}

// By the SII and the dictionary, as files::describe_slave().
Answer<Session::Description> AttachedSession::describe(std::uint16_t position) {
    const auto sii = sii_of(position);
    if (!sii) return sii.problem();
    Description out{.device = **sii};
    const auto& mailbox = out.device.mailbox;
    if (!mailbox || (mailbox->protocols & mailbox_protocol::kCoE) == 0 ||
        (mailbox->coe_details & coe_detail::kSdoInformation) == 0)
        return out;
    const auto objects = dictionary(position, true);
    if (!objects) {
        out.remarks.push_back("the dictionary is left out: " + objects.problem().text);
        return out;
    }
    for (const auto& object : *objects) {
        std::vector<files::SaidEntry> entries;
        for (const auto& entry : object.entries)
            entries.push_back({entry.subindex, entry.access, entry.data_type, entry.bits, entry.name});
        out.device.dictionary.push_back(files::esi_object(object.index, object.name, object.max_subindex, entries));
    }
    return out;
}

// ------------------------------------------------------------------ SyncManagers and PDOs

Answer<PdoFacts> AttachedSession::mapped_pdo(std::uint16_t position, std::uint16_t index, const files::EsiPdo* named) {
    PdoFacts pdo{.index = index, .name = named == nullptr ? std::string() : named->name};
    if (pdo.name.empty())
        if (const auto object =
                read<attach::ObjectFacts>(ask_slave(position, Operation::object_description, {.index = index})))
            pdo.name = samples::words_of_slave(object->name);
    const auto count = number_in<std::uint8_t>(upload(position, index, 0, false), position, index);
    if (!count) return count.problem();
    for (unsigned e = 1; e <= *count; ++e) {
        const auto mapped =
            number_in<std::uint32_t>(upload(position, index, static_cast<std::uint8_t>(e), false), position, index);
        if (!mapped) return mapped.problem();
        PdoEntryFacts entry{.index = static_cast<std::uint16_t>(*mapped >> 16),
                            .subindex = static_cast<std::uint8_t>(*mapped >> 8),
                            .bits = static_cast<std::uint8_t>(*mapped)};
        if (named != nullptr)
            for (const auto& known : named->entries)
                if (entry.index != 0 && known.index == entry.index && known.subindex == entry.subindex) {
                    entry.name = known.name;
                    entry.data_type = files::data_type_number(known.data_type);
                }
        if (entry.index != 0 && (entry.name.empty() || entry.data_type == 0)) {
            const auto described = dictionary_entry(position, entry.index, entry.subindex);
            if (described && entry.name.empty()) entry.name = described->name;
            if (described) entry.data_type = described->data_type;
        }
        pdo.entries.push_back(std::move(entry));
    }
    return pdo;
}

Answer<std::vector<PdoFacts>> AttachedSession::assigned_pdos(std::uint16_t position, std::uint8_t sync_manager,
                                                             const files::EsiDevice& sii) {
    const auto list = static_cast<std::uint16_t>(kFirstAssignment + sync_manager);
    const auto count = number_in<std::uint8_t>(upload(position, list, 0, false), position, list);
    if (!count) return count.problem();
    std::vector<PdoFacts> pdos;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto index =
            number_in<std::uint16_t>(upload(position, list, static_cast<std::uint8_t>(n), false), position, list);
        if (!index) return index.problem();
        if (*index == 0) continue;
        auto pdo = mapped_pdo(position, *index, sii.find_pdo(*index));
        if (!pdo) return pdo.problem();
        pdos.push_back(std::move(*pdo));
    }
    return pdos;
}

Answer<std::vector<SyncManagerFacts>> AttachedSession::sync_managers(std::uint16_t position) {
    const auto slave = slave_at(position);
    if (!slave) return slave.problem();
    const auto sii = sii_of(position);
    if (!sii) return sii.problem();
    const bool coe = slave->mailbox.present() && (slave->mailbox.protocols & mailbox_protocol::kCoE) != 0;
    std::vector<SyncManagerFacts> all;
    for (std::uint8_t n = 0; n < std::min<std::size_t>(slave->sm_count, slave->sync_managers.size()); ++n) {
        const SmInfo& sm = slave->sync_managers[n];
        SyncManagerFacts facts{.number = n,
                               .start = sm.start,
                               .default_bytes = sm.length_bytes,
                               .control = sm.control,
                               .enable = sm.enable,
                               .mailbox = sm.type == SmType::mailbox_out || sm.type == SmType::mailbox_in};
        bool by_sii = true;
        if (coe && (sm.type == SmType::outputs || sm.type == SmType::inputs)) {
            auto pdos = assigned_pdos(position, n, **sii);
            by_sii = !pdos && last_error_ == Errc::sdo_abort;  // the slave has no such object
            if (!pdos && !by_sii) return pdos.problem();
            if (pdos) facts.pdos = std::move(*pdos);
        }
        if (by_sii)
            for (const auto& pdo : (*sii)->pdos)
                if (pdo.sync_manager == n) facts.pdos.push_back(pdo_of(pdo));
        all.push_back(std::move(facts));
    }
    return all;
}

// ------------------------------------------------------------------ configurations and domains

Answer<std::vector<ConfigFacts>> AttachedSession::configs() {
    const auto slaves_now = table();
    if (!slaves_now) return slaves_now.problem();
    std::vector<ConfigFacts> all;
    AliasAddress address;
    for (const auto& slave : *slaves_now) {
        if (slave.alias != 0) address = {.alias = slave.alias, .relative = 0};
        const auto expected_or = [&](std::uint32_t wanted, std::uint32_t found) {
            return wanted == 0 && slave.seen ? found : wanted;
        };
        ConfigFacts config{.alias = address.alias,
                           .relative = address.relative++,
                           .vendor = expected_or(slave.wanted.vendor, slave.identity.vendor),
                           .product = expected_or(slave.wanted.product, slave.identity.product),
                           .state = slave.al.state,
                           .may_be_missing = slave.may_be_missing};
        if (slave.ring_position != 0) {
            config.position = static_cast<std::uint16_t>(slave.ring_position - 1);
            auto sms = sync_managers(*config.position);
            if (!sms && sms.problem().code == samples::exit_code::kSystem) return sms.problem();
            if (!sms) config.problem = sms.problem().text;
            for (std::size_t n = 0; sms && n < sms->size(); ++n)
                if (!(*sms)[n].mailbox) config.sync_managers.push_back(std::move((*sms)[n]));
        }
        const auto startup = ask(Operation::startup, {.slave = slave.number});
        if (!startup) return startup.problem();
        attach::Reader from(*startup);
        bool dc = false;
        std::uint16_t assign_activate = 0;
        from(dc, assign_activate, config.sync0_cycle_ns, config.sync0_shift_ns, config.sync1_cycle_ns);
        if (dc)
            config.assign_activate = assign_activate;
        else
            config.sync0_cycle_ns = config.sync0_shift_ns = config.sync1_cycle_ns = 0;
        bool more = false;
        for (from(more); more && from.ok(); from(more)) {
            attach::StartupFacts command;
            from(command);
            if (command.object)
                config.sdos.push_back(
                    {command.index, command.subindex, command.complete_access, std::move(command.data)});
            else
                config.parameters.push_back({command.subindex, command.index, std::move(command.data)});
        }
        if (!from.complete()) return Problem{fmt::format("slave {}: too many start-up commands", slave.number)};
        all.push_back(std::move(config));
    }
    return all;
}

// The FMMUs of process data, as the registers of the slave have them.
void AttachedSession::add_fmmus(DomainFacts& domain, const attach::SlaveFacts& slave) {
    const auto position = static_cast<std::uint16_t>(slave.ring_position - 1);
    const auto fmmus = read_registers(position, wire::reg::kFmmuBase,
                                      std::size_t{wire::reg::kFmmuStride} * std::max<unsigned>(slave.dl.fmmus, 1));
    const auto sms =
        read_registers(position, wire::reg::kSyncManagerBase,
                       std::size_t{wire::reg::kSyncManagerStride} * std::max<unsigned>(slave.dl.sync_managers, 1));
    if (!fmmus || !sms) {
        notes_.push_back((fmmus ? sms : fmmus).problem().text);
        return;
    }
    const auto mapped = mapped_fmmus(position, *fmmus, *sms);
    domain.fmmus.insert(domain.fmmus.end(), mapped.begin(), mapped.end());
}

Answer<std::vector<DomainFacts>> AttachedSession::domains() {
    const auto master_facts = read<attach::MasterFacts>(ask(Operation::master, {}));
    if (!master_facts) return master_facts.problem();
    const auto slaves_now = table();
    if (!slaves_now) return slaves_now.problem();
    std::vector<DomainFacts> all;
    for (std::uint16_t n = 0; n < master_facts->groups; ++n) {
        attach::GroupFacts group;
        DomainFacts domain{.index = n};
        do {  // an image of more than GroupFacts::kOnce octets comes in parts
            const auto part =
                ask(Operation::group, {.slave = n, .from = static_cast<std::uint32_t>(domain.data.size())});
            if (!part) return part.problem();
            attach::Reader from(*part);
            from(group);
            const auto octets = from.octets();
            if (!from.complete()) return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
            domain.data.insert(domain.data.end(), octets.begin(), octets.end());
            if (octets.empty()) break;
        } while (domain.data.size() < std::size_t{group.output_bytes} + group.input_bytes);
        if (!group.mapped) continue;
        domain.base = group.base;
        domain.wkc = group.wkc;
        domain.expected_wkc = group.expected_wkc;
        for (const auto& slave : *slaves_now)
            if (slave.group == n && slave.ring_position != 0 && slave.outputs.bits + slave.inputs.bits != 0)
                add_fmmus(domain, slave);
        all.push_back(std::move(domain));
    }
    return all;
}

}  // namespace margay::ethercat
