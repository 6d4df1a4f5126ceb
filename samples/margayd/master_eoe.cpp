// The EoE interfaces of a master.
#include "common/slave_report.hpp"
#include "margayd/log.hpp"
#include "margayd/master.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace margay::service {
namespace {

using namespace std::chrono_literals;

bool is_place_of(const samples::EoeInterface& wanted, const Slave& slave) {
    return wanted.alias ? slave.alias == *wanted.alias
                        : slave.ring_position != 0 && slave.ring_position == *wanted.position + 1;
}

// Frames need the mailbox of the slave, and not that of BOOT.
bool has_mail(const Slave& slave) {
    return slave.al.state == AlState::preop || slave.al.state == AlState::safeop || slave.al.state == AlState::op;
}

}  // namespace

// Empty: the slave gets no interface.
std::string Master::eoe_name(const Slave& slave) const {
    const auto& named = configuration_.eoe_named;
    const auto found = std::ranges::find_if(named, [&](const auto& wanted) { return is_place_of(wanted, slave); });
    if (found != named.end() && !found->name.empty()) return found->name;
    if (found == named.end() && (!named.empty() || !samples::has_eoe(slave))) return {};
    return samples::eoe_interface_name(configuration_.number, slave, ctx_->slaves());
}

void Master::open_eoe() {
    auto lines = std::make_unique<samples::EoeLines>();
    has_eoe_line_.assign(ctx_->slaves().size(), false);
    for (const Slave& slave : ctx_->slaves()) {
        const auto name = eoe_name(slave);
        if (name.empty() || !has_mail(slave)) continue;  // see open_late_eoe()
        has_eoe_line_[slave.number - 1U] = true;
        const auto shared = configuration_.eoe_named.empty() ? samples::shared_alias(slave, ctx_->slaves()) : "";
        if (!shared.empty()) log(Priority::warning, shared);
        const auto opened = lines->open(*ctx_, slave, name);
        if (opened)
            log(Priority::notice, fmt::format("interface {}: slave {} ({})", name, slave.number, slave.name()));
        else
            log(Priority::error, opened.problem);
    }
    const auto slaves = ctx_->slaves();
    for (const auto& wanted : configuration_.eoe_named)
        if (std::ranges::none_of(slaves, [&](const Slave& slave) { return is_place_of(wanted, slave); }))
            log(Priority::error, wanted.alias
                                     ? fmt::format("no EoE: no slave has the alias {}", *wanted.alias)
                                     : fmt::format("no EoE: there is no slave at position {}", *wanted.position));
    companion_->take_lines(std::move(lines));
}

// Of slaves that have come since open_eoe(), or that were not in PREOP then. A system call or two for each of them.
void Master::open_late_eoe() {
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.number > has_eoe_line_.size() || has_eoe_line_[slave.number - 1U]) continue;
        if (!has_mail(slave) || !samples::has_eoe(slave)) continue;
        const auto name = eoe_name(slave);
        if (!name.empty()) has_eoe_line_[slave.number - 1U] = companion_->open_line(*ctx_, slave, name);
    }
}

void Master::close_eoe() {
    const auto lines = companion_->give_lines();
    if (lines == nullptr) return;
    lines->cancel();
    for (int n = 0; n < 100 && lines->busy(); ++n) {
        (void)poll(*ctx_, source_->osal().now());
        source_->osal().wait(source_->osal().now() + 1ms, source_->wait_handles());
    }
    for (const auto& counters : lines->report()) log(Priority::info, counters);
}

}  // namespace margay::service
