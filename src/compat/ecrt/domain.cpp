#include "compat/ecrt/domain.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"

#include <algorithm>
#include <set>
#include <utility>

namespace margay::compat::ecrt {
namespace {

constexpr std::uint32_t kMostDatagramBytes = 1486;

// The octets of a SyncManager in the image of its group; empty: it has no place there.
std::span<std::byte> place_of(Bus& bus, const DomainPart& part) {
    const Slave& slave = bus.ctx->slave(part.config->number.load(std::memory_order_relaxed));
    const ImagePart& image = part.output ? slave.image.outputs : slave.image.inputs;
    std::size_t at = 0;
    for (const ProcessSm& sm : slave.config.used_sms()) {
        if ((sm.direction == Direction::outputs) != part.output || sm.bits == 0) continue;
        if (sm.number == part.sync_manager) {
            if (sm.bytes() != part.bytes || at + sm.bytes() > image.bytes.size()) break;
            return image.bytes.span().subspan(at, sm.bytes());
        }
        at += sm.bytes();
    }
    return {};
}

}  // namespace

void plan_copies(Bus& bus, ec_domain& domain) {
    std::vector<Copy> outputs;
    std::vector<Copy> inputs;
    for (DomainPart& part : domain.parts) {
        const auto place = place_of(bus, part);
        part.placed = !place.empty();
        if (place.empty()) {
            if (part.bytes != 0 && domain.exchange->mapped)
                say("master %u: SyncManager %u of configuration %u:%u has no place in the process data", bus.index,
                    part.sync_manager, part.config->alias, part.config->position);
            continue;
        }
        auto* const in_image = reinterpret_cast<std::uint8_t*>(place.data());
        std::uint8_t* const in_domain = domain.data + part.offset;
        if (part.output)
            outputs.push_back({in_image, in_domain, part.bytes});
        else
            inputs.push_back({in_domain, in_image, part.bytes});
    }
    domain.outputs.set(std::move(outputs));
    domain.inputs.set(std::move(inputs));
}

void plan_counters(ec_domain& domain) {
    struct Datagram {
        bool outputs = false;
        bool inputs = false;
        std::set<std::pair<const ec_slave_config*, bool>> counted{};  // a slave counts once in each direction
    };
    std::vector<Datagram> datagrams(1);
    std::vector<std::size_t> datagram_of;
    std::uint32_t begin = 0;
    for (const DomainPart& part : domain.parts) {
        if (part.offset + part.bytes - begin > kMostDatagramBytes && part.offset != begin) {
            datagrams.emplace_back();
            begin = part.offset;
        }
        (part.output ? datagrams.back().outputs : datagrams.back().inputs) = true;
        datagram_of.push_back(datagrams.size() - 1);
    }
    domain.complete.working_counter = 0;
    for (std::size_t n = 0; n < domain.parts.size(); ++n) {
        DomainPart& part = domain.parts[n];
        Datagram& datagram = datagrams[datagram_of[n]];
        const bool first = part.bytes != 0 && datagram.counted.insert({part.config, part.output}).second;
        const bool both = datagram.outputs && datagram.inputs;
        part.share = !first ? 0U : both && part.output ? 2U : 1U;
        domain.complete.working_counter += part.share;
    }
    domain.complete.wc_state = domain.complete.working_counter != 0 ? EC_WC_COMPLETE : EC_WC_ZERO;
}

void update_best(const Bus& bus, Exchange& exchange) {
    const auto takes_part = [&bus](const DomainPart& part) {
        const std::uint16_t number = part.config->number.load(std::memory_order_relaxed);
        return part.bytes == 0 || (part.placed && bus.ctx->slave(number).takes_part);
    };
    const auto is_whole = [&](const ec_domain* domain) { return std::ranges::all_of(domain->parts, takes_part); };
    exchange.best = std::ranges::all_of(exchange.domains, is_whole) ? Answer::complete : Answer::incomplete;
}

void judge(ec_domain& domain) {
    Bus& bus = domain.bus;
    const Exchange& exchange = *domain.exchange;
    const Group& group = bus.ctx->group(exchange.group);
    const bool exchanged = exchange.mapped && !exchange.held;
    unsigned on_wire = 0;
    for (const DatagramStatus& datagram : group.datagrams)
        if (exchanged && datagram.came) on_wire += datagram.got;
    const bool came = on_wire != 0;
    unsigned counter = 0;
    for (const DomainPart& part : domain.parts) {
        if (!came || part.share == 0 || !part.placed) continue;
        const std::uint16_t number = part.config->number.load(std::memory_order_relaxed);
        if (bus.ctx->slave(number).takes_part && inputs_fresh(*bus.ctx, number)) counter += part.share;
    }
    // Some slaves have responded. It is not known yet which slaves.
    if (counter == 0 && came && domain.complete.working_counter > 1)
        counter = std::min(on_wire, domain.complete.working_counter - 1);
    if (counter != 0) domain.inputs.execute();
    domain.state.working_counter = counter;
    domain.state.wc_state = counter == 0                                 ? EC_WC_ZERO
                            : counter >= domain.complete.working_counter ? EC_WC_COMPLETE
                                                                         : EC_WC_INCOMPLETE;
}

}  // namespace margay::compat::ecrt
