#include "attach/visit_jobs.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"
#include "network/wanted.hpp"

#include <margay/clocks.hpp>
#include <margay/context.hpp>
#include <margay/expected.hpp>
#include <margay/margay.hpp>
#include <margay/missing.hpp>

#include <algorithm>

namespace margay::attach {
namespace {

constexpr std::uint16_t kSlavesOnce = 8;
constexpr std::size_t kFactsBytes = 8192;
constexpr std::size_t kStartupBytes = 65536;
constexpr std::size_t kPortsBytes = 6 + EoePortFacts::kOnce * EoePortFacts::kOctets;

void copy_master(Context& ctx, const Arguments&, Writer& into) {
    MasterFacts facts{.slaves = static_cast<std::uint16_t>(ctx.slaves().size()),
                      .groups = static_cast<std::uint16_t>(ctx.limits().groups),
                      .reference_clock = reference_clock(ctx),
                      .link = ctx.statistics()};
    into(facts);
}

PartFacts facts_of(const ImagePart& part) { return {part.offset_bits, part.bits}; }

// The facts of a slave may be old: after a silence, its identity was not compared yet.
Error error_of(Context& ctx, const Slave& s) {
    if (s.error.code != Errc::none) return s.error;
    const Network& network = master_of(ctx)->network;
    if (s.al.state != AlState::none && network.is_doubted(s) && !network.is_believed(s))
        return {.code = Errc::identity_unread, .step = Step::identify, .slave = s.number};
    return held_error(s, Step::identify);
}

SlaveFacts facts_of(Context& ctx, const Slave& s) {
    SlaveFacts facts{.number = s.number,
                     .ring_position = s.ring_position,
                     .station_address = s.station_address.value,
                     .alias = s.seen || s.wanted == nullptr ? s.alias : s.wanted->alias.value_or(0),
                     .dl_status = s.dl_status,
                     .identity = s.identity,
                     .dl = s.dl,
                     .al = s.al,
                     .target = s.target,
                     .seen = s.seen,
                     .takes_part = s.takes_part,
                     .error = error_of(ctx, s),
                     .parent = s.parent,
                     .parent_port = s.parent_port,
                     .entry_port = s.entry_port,
                     .mailbox = s.mailbox,
                     .boot_mailbox = s.boot_mailbox,
                     .coe_details = s.coe_details,
                     .ebus_current_ma = s.ebus_current_ma,
                     .sm_count = s.sm_count,
                     .sync_managers = s.sync_managers,
                     .group = s.image.group,
                     .outputs = facts_of(s.image.outputs),
                     .inputs = facts_of(s.image.inputs),
                     .name_text = s.name_text,
                     .name_bytes = s.name_bytes};
    if (s.wanted != nullptr)
        facts.wanted = {.vendor = s.wanted->vendor.value_or(0), .product = s.wanted->product.value_or(0)};
    for (std::size_t n = 0; n < facts.ports.size(); ++n)
        facts.ports[n] = {s.ports[n].type, s.ports[n].link, s.ports[n].open, s.ports[n].neighbour};
    const SlaveClock& clock = slave_clock(ctx, s.number);
    facts.clock = clock.kind;
    facts.delay_ns = clock.delay_ns;
    facts.difference_ns = clock.difference_ns;
    facts.in_sync = clock.in_sync;
    facts.may_be_missing = may_be_missing(ctx, s.number);
    return facts;
}

// Writes the number of all slaves, how many slaves follow, and the facts of these slaves.
void copy_slaves(Context& ctx, const Arguments& arguments, Writer& into) {
    const auto all = ctx.slaves();
    const std::size_t first = std::min<std::size_t>(std::max<std::uint32_t>(arguments.from, 1) - 1, all.size());
    const auto some = all.subspan(first, std::min<std::size_t>(kSlavesOnce, all.size() - first));
    into(static_cast<std::uint16_t>(all.size()), static_cast<std::uint16_t>(some.size()));
    for (const Slave& slave : some) into(facts_of(ctx, slave));
}

void copy_group(Context& ctx, const Arguments& arguments, Writer& into) {
    const Group& group = ctx.group(arguments.slave);
    GroupFacts facts{.mapped = group.mapped,
                     .mappings = group.mappings,
                     .output_bytes = group.output_bytes,
                     .input_bytes = group.input_bytes,
                     .expected_wkc = group.expected_wkc,
                     .cycle = group.cycle_received,
                     .frames = group.frames};
    const bool exchanged = group.mapped && !group.datagrams.empty();
    facts.base = exchanged ? UINT32_MAX : 0;
    for (std::size_t n = 0; exchanged && n < group.datagrams.size(); ++n) {
        const auto planned = process_datagram(ctx, n, static_cast<std::uint8_t>(arguments.slave));
        facts.base = std::min(facts.base, planned.address.value);
        if (group.datagrams[n].came) facts.wkc += group.datagrams[n].got;
    }
    into(facts);
    const std::size_t used =
        group.mapped ? std::min<std::size_t>(std::size_t{group.output_bytes} + group.input_bytes, group.image.size())
                     : 0;
    const std::size_t at = std::min<std::size_t>(arguments.from, used);
    into.octets(group.image.subspan(at, std::min(used - at, GroupFacts::kOnce)));
}

// Writes an octet 1 before each command, and an octet 0 after the last command.
void copy_startup(Context& ctx, const Arguments& arguments, Writer& into) {
    const SlaveConfiguration& config = ctx.slave(arguments.slave).config;
    const SyncSettings dc = config.dc();
    into(dc.source == SyncSettings::Source::application, dc.assign_activate,
         std::max<std::int64_t>(dc.sync0_cycle.count(), 0), static_cast<std::int64_t>(dc.shift.count()),
         static_cast<std::int64_t>(dc.sync1_cycle.count()));
    for (const StartupCommand& command : config.startup()) {
        const bool object = command.kind == StartupCommand::Kind::write_object;
        if (!object && command.kind != StartupCommand::Kind::write_parameter) continue;
        into(true, object, command.complete_access, command.index, command.subindex);
        into.octets(command.octets());
        if (!into.ok()) return;
    }
    into(false);
}

// Calls `visit` for each EoePort that is busy. The port may not have begun yet.
template <class Visit>
void for_each_port(const RequestQueue& queue, Visit visit) {
    for (Request* list : {queue.running, queue.waiting})
        for (Request* r = list; r != nullptr; r = RequestAccess::next(*r))
            if (RequestAccess::operation(*r).operation == margay::Operation::eoe_port)
                visit(static_cast<const EoePort&>(*r));
}

// Whether the port can exchange frames, by the same conditions as in the sequence of the port.
bool is_open(Network& network, std::uint16_t number) {
    if (number < 1 || number > network.count) return false;
    const Slave& slave = network.slave(number);
    return network.has_mailbox(slave) && network.mailbox(slave).is_reachable() && slave.al.state != AlState::boot &&
           (slave.mailbox.protocols & mailbox_protocol::kEoE) != 0;
}

// Writes the number of all ports, how many ports follow, and the facts of these ports.
void copy_eoe_ports(Context& ctx, const Arguments&, Writer& into) {
    Master& master = *master_of(ctx);
    std::size_t all = 0;
    for_each_port(master.queue, [&all](const EoePort&) { ++all; });
    auto left = static_cast<std::uint16_t>(std::min(all, EoePortFacts::kOnce));
    into(static_cast<std::uint32_t>(all), left);
    for_each_port(master.queue, [&](const EoePort& port) {
        if (left == 0) return;
        --left;
        EoePortFacts facts{
            .slave = port.slave, .open = is_open(master.network, port.slave), .counted = port.statistics()};
        const auto name = port.interface_name();
        facts.name_bytes = static_cast<std::uint8_t>(std::min(name.size(), facts.name_text.size()));
        std::ranges::copy_n(name.begin(), facts.name_bytes, facts.name_text.begin());
        into(facts);
    });
}

}  // namespace

VisitJob::VisitJob(Copy copy, Arguments arguments, std::size_t bytes)
    : copy_(copy), arguments_(std::move(arguments)), memory_(bytes) {
    request_.priority = 1;
    request_.user = this;
    request_.visit = [](Context& ctx, void* user) {
        auto& job = *static_cast<VisitJob*>(user);
        Writer into(job.memory_);
        job.copy_(ctx, job.arguments_, into);
        job.written_ = into.written().size();
        job.fits_ = into.ok();
    };
}

Octets VisitJob::answer() {
    memory_.resize(fits_ ? written_ : 0);  // if the memory was too small, the answer is empty, which the client reports
    return std::move(memory_);
}

std::unique_ptr<Job> make_visit(Operation operation, Arguments arguments) {
    const auto make = [&](VisitJob::Copy copy, std::size_t bytes) {
        return std::make_unique<VisitJob>(copy, std::move(arguments), bytes);
    };
    switch (operation) {
        case Operation::master: return make(copy_master, kFactsBytes);
        case Operation::slaves: return make(copy_slaves, kFactsBytes);
        case Operation::group: return make(copy_group, GroupFacts::kOnce + kFactsBytes);
        case Operation::startup: return make(copy_startup, kStartupBytes);
        case Operation::eoe_ports: return make(copy_eoe_ports, kPortsBytes);
        default: return nullptr;
    }
}

}  // namespace margay::attach
