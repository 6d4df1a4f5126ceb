// Process data: SyncManagers and PDOs, configurations, domains; see standalone.hpp.
#include "ethercat/standalone.hpp"

#include "common/slave_report.hpp"
#include "ethercat/selection.hpp"
#include "wire/esc.hpp"
#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <margay/missing.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace margay::ethercat {
namespace {

constexpr std::uint16_t kAssignment = 0x1C10;  // of SyncManager 0
// Of process data. The frames of hundreds of slaves need more than half a millisecond.
constexpr Duration kReplyTimeout = std::chrono::milliseconds(10);

bool carries_process_data(const SmInfo& sm) { return sm.type == SmType::outputs || sm.type == SmType::inputs; }

PdoFacts facts_of(const files::EsiPdo& pdo) {
    PdoFacts facts{.index = pdo.index, .name = pdo.name};
    for (const auto& entry : pdo.entries)
        facts.entries.push_back({.index = entry.index,
                                 .subindex = entry.subindex,
                                 .bits = static_cast<std::uint8_t>(entry.bits),
                                 .name = entry.name,
                                 .data_type = files::data_type_number(entry.data_type)});
    return facts;
}

void add_startup(ConfigFacts& config, const SlaveConfiguration& wanted) {
    for (const StartupCommand& command : wanted.startup()) {
        const auto octets = command.octets();
        Octets data(octets.begin(), octets.end());
        if (command.kind == StartupCommand::Kind::write_object)
            config.sdos.push_back({command.index, command.subindex, command.complete_access, std::move(data)});
        if (command.kind == StartupCommand::Kind::write_parameter)
            config.parameters.push_back({command.subindex, command.index, std::move(data)});
    }
    const SyncSettings dc = wanted.dc();
    if (dc.source != SyncSettings::Source::application) return;
    config.assign_activate = dc.assign_activate;
    config.sync0_cycle_ns = std::max<std::int64_t>(dc.sync0_cycle.count(), 0);
    config.sync0_shift_ns = dc.shift.count();
    config.sync1_cycle_ns = dc.sync1_cycle.count();
}

}  // namespace

// ------------------------------------------------------------------ SyncManagers and PDOs

Result<PdoFacts> StandaloneSession::mapped_pdo(std::uint16_t number, std::uint16_t index, const files::EsiPdo* named) {
    PdoFacts pdo{.index = index, .name = named == nullptr ? std::string() : named->name};
    if (pdo.name.empty())
        if (const auto object = read_object_description(*ctx_, number, index))
            pdo.name = samples::words_of_slave(object->name());
    const auto entries = SDOread<std::uint8_t>(*ctx_, number, index, 0);
    if (!entries) return entries.error();
    for (unsigned e = 1; e <= *entries; ++e) {
        const auto mapped = SDOread<std::uint32_t>(*ctx_, number, index, static_cast<std::uint8_t>(e));
        if (!mapped) return mapped.error();
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
            const auto described = read_entry_description(*ctx_, number, entry.index, entry.subindex);
            if (described && entry.name.empty()) entry.name = samples::words_of_slave(described->name());
            if (described) entry.data_type = described->data_type;
        }
        pdo.entries.push_back(std::move(entry));
    }
    return pdo;
}

Result<std::vector<PdoFacts>> StandaloneSession::assigned_pdos(std::uint16_t number, std::uint8_t sync_manager,
                                                               const files::EsiDevice& sii) {
    const auto list = static_cast<std::uint16_t>(kAssignment + sync_manager);
    const auto count = SDOread<std::uint8_t>(*ctx_, number, list, 0);
    if (!count) return count.error();
    std::vector<PdoFacts> pdos;
    for (unsigned n = 1; n <= *count; ++n) {
        const auto index = SDOread<std::uint16_t>(*ctx_, number, list, static_cast<std::uint8_t>(n));
        if (!index) return index.error();
        if (*index == 0) continue;
        auto pdo = mapped_pdo(number, *index, sii.find_pdo(*index));
        if (!pdo) return pdo.error();
        pdos.push_back(std::move(*pdo));
    }
    return pdos;
}

Answer<std::vector<SyncManagerFacts>> StandaloneSession::sync_managers(std::uint16_t position) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const Slave& slave = ctx_->slave(*number);
    const auto sii = sii_of(*number);
    if (!sii) return sii.problem();
    const bool coe = slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
    std::vector<SyncManagerFacts> all;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        const SmInfo& sm = slave.sync_managers[n];
        SyncManagerFacts facts{.number = n,
                               .start = sm.start,
                               .default_bytes = sm.length_bytes,
                               .control = sm.control,
                               .enable = sm.enable,
                               .mailbox = sm.type == SmType::mailbox_out || sm.type == SmType::mailbox_in};
        bool by_sii = true;
        if (coe && carries_process_data(sm)) {
            auto pdos = assigned_pdos(*number, n, **sii);
            by_sii = !pdos && pdos.error().code == Errc::sdo_abort;  // the slave has no such object
            if (!pdos && !by_sii) return problem_of(*ctx_, pdos.error());
            if (pdos) facts.pdos = std::move(*pdos);
        }
        if (by_sii)
            for (const auto& pdo : (*sii)->pdos)
                if (pdo.sync_manager == n) facts.pdos.push_back(facts_of(pdo));
        all.push_back(std::move(facts));
    }
    return all;
}

// ------------------------------------------------------------------ configurations

Answer<std::vector<ConfigFacts>> StandaloneSession::expected() {
    const auto ready = open();
    if (!ready) return ready.problem();
    (void)readstate(*ctx_);
    std::vector<ConfigFacts> all;
    AliasAddress address;
    for (const Slave& slave : ctx_->slaves()) {
        const bool expected = !slave.seen && slave.wanted != nullptr;
        const std::uint16_t alias = expected ? slave.wanted->alias.value_or(0) : slave.alias;
        if (alias != 0) address = {.alias = alias, .relative = 0};
        ConfigFacts config{.alias = address.alias,
                           .relative = address.relative++,
                           .vendor = slave.identity.vendor,
                           .product = slave.identity.product,
                           .state = slave.al.state};
        if (slave.wanted != nullptr) {
            config.vendor = slave.wanted->vendor.value_or(slave.seen ? config.vendor : 0);
            config.product = slave.wanted->product.value_or(slave.seen ? config.product : 0);
        }
        if (slave.ring_position != 0) config.position = position_of(slave.number);
        config.may_be_missing = margay::may_be_missing(*ctx_, slave.number);
        all.push_back(std::move(config));
    }
    return all;
}

Answer<std::vector<ConfigFacts>> StandaloneSession::configs() {
    const auto ready = map();
    if (!ready) return ready.problem();
    auto all = expected();
    if (!all) return all;
    for (std::size_t n = 0; n < all->size(); ++n) {
        ConfigFacts& config = (*all)[n];
        if (config.position) {
            auto sms = sync_managers(*config.position);
            if (!sms && sms.problem().code == samples::exit_code::kSystem) return sms.problem();
            if (!sms) config.problem = sms.problem().text;
            if (sms)
                std::ranges::copy_if(*sms, std::back_inserter(config.sync_managers),
                                     [](const SyncManagerFacts& sm) { return !sm.mailbox; });
        }
        add_startup(config, ctx_->slaves()[n].config);
    }
    return all;
}

// ------------------------------------------------------------------ domains

Answer<> StandaloneSession::map() {
    const auto ready = open();
    if (!ready) return ready.problem();
    if (mapped_) return {};
    image_.assign(std::size_t{1} << 20, std::byte{0});
    const auto done = samples::map_groups(*ctx_, eni(), image_);
    bool any = done.ok();
    for (std::size_t n = 0; n < ctx_->limits().groups; ++n) any |= ctx_->group(n).mapped;
    if (!any) return problem_of(*ctx_, done.error());
    mapped_ = true;
    return {};
}

void StandaloneSession::exchange() {
    if (follows_clock()) {
        (void)pace_->wait();
        (void)pace_->exchange(kReplyTimeout);
        return;
    }
    for (std::uint16_t n = 0; n < ctx_->limits().groups; ++n) {
        if (!ctx_->group(n).mapped || ctx_->group(n).datagrams.empty()) continue;
        const auto group = static_cast<std::uint8_t>(n);
        if (send_processdata(*ctx_, group)) (void)receive_processdata(*ctx_, kReplyTimeout, group);
    }
    (void)poll(*ctx_, source_->osal().now());
}

// The FMMUs of process data, as the registers of the slave have them.
void StandaloneSession::add_fmmus(DomainFacts& domain, const Slave& slave) {
    const auto position = position_of(slave.number);
    const auto fmmus = read_registers(position, wire::reg::kFmmuBase,
                                      std::size_t{wire::reg::kFmmuStride} * std::max<unsigned>(slave.dl.fmmus, 1));
    const auto sms =
        read_registers(position, wire::reg::kSyncManagerBase,
                       std::size_t{wire::reg::kSyncManagerStride} * std::max<unsigned>(slave.dl.sync_managers, 1));
    if (!fmmus || !sms) {
        note((fmmus ? sms : fmmus).problem().text);
        return;
    }
    const auto mapped = mapped_fmmus(position, *fmmus, *sms);
    domain.fmmus.insert(domain.fmmus.end(), mapped.begin(), mapped.end());
}

DomainFacts StandaloneSession::domain_facts(std::uint16_t index) {
    const Group& group = ctx_->group(index);
    DomainFacts domain{.index = index, .base = UINT32_MAX, .expected_wkc = group.expected_wkc};
    const auto octets = group.image.first(group.output_bytes + group.input_bytes);
    domain.data.assign(octets.begin(), octets.end());
    for (std::size_t n = 0; n < group.datagrams.size(); ++n) {
        domain.base = std::min(domain.base, process_datagram(*ctx_, n, static_cast<std::uint8_t>(index)).address.value);
        if (group.datagrams[n].came) domain.wkc += group.datagrams[n].got;
    }
    if (group.datagrams.empty()) domain.base = 0;
    for (const Slave& slave : ctx_->slaves())
        if (slave.image.group == index && slave.ring_position != 0 &&
            slave.image.outputs.bits + slave.image.inputs.bits != 0)
            add_fmmus(domain, slave);
    return domain;
}

Answer<std::vector<DomainFacts>> StandaloneSession::domains() {
    const auto ready = map();
    if (!ready) return ready.problem();
    exchange();
    std::vector<DomainFacts> all;
    for (std::uint16_t n = 0; n < ctx_->limits().groups; ++n)
        if (ctx_->group(n).mapped) all.push_back(domain_facts(n));
    return all;
}

// ------------------------------------------------------------------ cycles

Result<> StandaloneSession::bring_to(AlState state, samples::CyclePace& pace) {
    return reach(*ctx_, state, std::chrono::seconds(10),
                 {.period = pace.clock_period(), .reply_timeout = kReplyTimeout, .clock = pace.clock()});
}

Answer<StandaloneSession::CycleRun> StandaloneSession::run_cycles(unsigned cycles, const samples::PaceOptions& pace) {
    const auto ready = map();
    if (!ready) return ready.problem();
    const auto plan = pace.plan(eni());
    if (!plan.error.empty()) return Problem{settings_.eni + ": " + plan.error};
    if (!plan.remark.empty()) note(plan.remark);
    CycleRun run{.period = plan.period};
    auto& keeper = pace_.emplace(*source_, *ctx_, pace, plan);
    const auto reached = bring_to(AlState::op, keeper);
    if (!reached) run.problem = problem_of(*ctx_, reached.error()).text;
    keeper.start();
    for (unsigned n = 0; n < cycles && !samples::stop_asked(); ++n) {
        if (n != 0) keeper.wait();
        (void)keeper.exchange(kReplyTimeout);
    }
    run.figures = keeper.figures();
    return run;
}

}  // namespace margay::ethercat
