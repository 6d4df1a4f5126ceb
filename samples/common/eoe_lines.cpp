#include "common/eoe_lines.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace margay::samples {

namespace {

const Slave* other_with_alias(const Slave& slave, std::span<const Slave> all) {
    const auto found = std::ranges::find_if(all, [&slave](const Slave& other) {
        return slave.alias != 0 && other.alias == slave.alias && other.number != slave.number && has_eoe(other);
    });
    return found == all.end() ? nullptr : &*found;
}

}  // namespace

std::string eoe_interface_name(unsigned master, const Slave& slave, std::span<const Slave> all) {
    if (slave.alias != 0 && other_with_alias(slave, all) == nullptr)
        return fmt::format("eoe{}a{}", master, slave.alias);
    return fmt::format("eoe{}s{}", master, slave.number - 1);
}

std::string shared_alias(const Slave& slave, std::span<const Slave> all) {
    const Slave* const other = other_with_alias(slave, all);
    if (other == nullptr) return {};
    return fmt::format("slave {} has the alias {} of slave {}: its interface is named after its position", slave.number,
                       slave.alias, other->number);
}

bool has_eoe(const Slave& slave) { return (slave.mailbox.protocols & mailbox_protocol::kEoE) != 0; }

EoeLines::Opened EoeLines::open(Context& ctx, const Slave& slave, const std::string& name) {
    auto line = std::make_unique<Line>();
    line->name = name;
    line->port.slave = slave.number;
    line->port.set_interface_name(name);
    if (const auto begun = submit(ctx, line->port); !begun)
        return {fmt::format("no interface {}: {}", name, sentence(begun.error())), true};
    auto problem = line->tap.open(name);
    if (problem.empty()) {
        lines_.push_back(std::move(line));
        return {};
    }
    const bool taken = line->tap.name_taken();
    line->port.cancel();
    ended_.push_back(std::move(line));
    if (taken) problem = fmt::format("slave {} gets no interface: {}", slave.number, problem);
    return {std::move(problem), taken};
}

void EoeLines::cancel() {
    for (const auto& line : lines_) line->port.cancel();
}

bool EoeLines::busy() const {
    const auto busy = [](const auto& line) { return line->port.busy(); };
    return std::ranges::any_of(lines_, busy) || std::ranges::any_of(ended_, busy);
}

bool EoeLines::pass(Line& line, std::span<std::byte> buffer) {
    bool any = false;
    while (const auto frame = line.port.receive(buffer)) {
        line.not_taken += line.tap.send(buffer.first(frame->bytes)) == SendStatus::sent ? 0U : 1U;
        any = true;
    }
    while (line.port.can_send()) {
        const auto size = line.tap.receive(buffer);
        if (size == 0) break;
        (void)line.port.send(buffer.first(size));
        any = true;
    }
    return any;
}

bool EoeLines::pass() {
    std::array<std::byte, kEoeFrameBytes> buffer;
    bool any = false;
    for (const auto& line : lines_) any |= pass(*line, buffer);
    return any;
}

std::vector<EoeLines::Ended> EoeLines::end_deleted() {
    std::vector<Ended> reports;
    std::erase_if(ended_, [](const auto& line) { return !line->port.busy(); });
    for (auto& line : lines_) {
        if (!line->tap.gone()) continue;
        line->port.cancel();
        reports.push_back(
            {fmt::format("the interface {} was deleted: its frames are not exchanged any more", line->name),
             report(*line)});
        ended_.push_back(std::move(line));
    }
    std::erase(lines_, nullptr);
    return reports;
}

void EoeLines::add_files(std::vector<pollfd>& files) const {
    for (const auto& line : lines_)
        if (line->port.can_send()) files.push_back({line->tap.wait_handle(), POLLIN, 0});
}

std::vector<std::string> EoeLines::report() const {
    std::vector<std::string> reports;
    for (const auto& line : lines_) reports.push_back(report(*line));
    return reports;
}

std::string EoeLines::report(const Line& line) {
    const EoeStatistics s = line.port.statistics();
    const auto dropped_out = s.refused + s.not_sent;
    const auto dropped_in = s.overrun + s.incomplete + s.malformed + s.too_long;
    auto text = fmt::format("{}: to the slave {}, {}, {} dropped; from the slave {}, {}, {} dropped", line.name,
                            counted(s.sent, "frame"), counted(s.sent_octets, "octet"), dropped_out,
                            counted(s.received, "frame"), counted(s.received_octets, "octet"), dropped_in);
    if (dropped_in != 0)
        text += fmt::format(" ({} queue full, {} fragment missing, {} malformed, {} too long)", s.overrun, s.incomplete,
                            s.malformed, s.too_long);
    if (line.not_taken != 0) text += fmt::format("; {} not taken by the kernel", line.not_taken);
    return text;
}

}  // namespace margay::samples
