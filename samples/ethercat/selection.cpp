#include "ethercat/selection.hpp"

#include <algorithm>
#include <charconv>

namespace margay::ethercat {

std::optional<std::uint64_t> parse_unsigned(std::string_view text, std::uint64_t most) {
    int base = 10;
    if (text.starts_with("0x") || text.starts_with("0X")) {
        base = 16;
        text.remove_prefix(2);
    } else if (text.size() > 1 && text.front() == '0') {
        base = 8;
        text.remove_prefix(1);
    }
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    if (text.empty() || error != std::errc{} || end != text.data() + text.size() || value > most) return std::nullopt;
    return value;
}

std::optional<std::int64_t> parse_signed(std::string_view text, std::int64_t least, std::int64_t most) {
    const bool negative = text.starts_with('-');
    if (negative || text.starts_with('+')) text.remove_prefix(1);
    const auto limit = negative ? ~static_cast<std::uint64_t>(least) + 1 : static_cast<std::uint64_t>(most);
    const auto value = parse_unsigned(text, limit);
    if (!value) return std::nullopt;
    return static_cast<std::int64_t>(negative ? ~*value + 1 : *value);
}

std::optional<Numbers> Numbers::parse(std::string_view text) {
    Numbers out;
    const auto number = [](std::string_view word) { return parse_unsigned(word, UINT32_MAX); };
    for (std::size_t at = 0; at <= text.size();) {
        const auto comma = std::min(text.find(',', at), text.size());
        const auto word = text.substr(at, comma - at);
        at = comma + 1;
        const auto dash = word.find('-');
        const auto first = dash == 0 ? std::optional<std::uint64_t>(0) : number(word.substr(0, dash));
        const auto last = dash == std::string_view::npos ? first
                          : dash + 1 == word.size()      ? std::optional<std::uint64_t>(UINT32_MAX)
                                                         : number(word.substr(dash + 1));
        if (word.empty() || !first || !last || *first > *last) return std::nullopt;
        out.ranges_.push_back({static_cast<std::uint32_t>(*first), static_cast<std::uint32_t>(*last)});
    }
    return out;
}

bool Numbers::contains(std::uint32_t number) const {
    return std::ranges::any_of(ranges_, [&](const Range& r) { return number >= r.first && number <= r.last; });
}

std::optional<std::uint32_t> Numbers::single() const {
    if (ranges_.size() != 1 || ranges_[0].first != ranges_[0].last) return std::nullopt;
    return ranges_[0].first;
}

std::optional<std::string> Numbers::missing(const std::vector<std::uint32_t>& there) const {
    const auto found = [&](const Range& range) {
        return std::ranges::any_of(there, [&](std::uint32_t n) { return n >= range.first && n <= range.last; });
    };
    const auto at = std::ranges::find_if_not(ranges_, found);
    if (at == ranges_.end()) return std::nullopt;
    if (at->first == at->last) return std::to_string(at->first);
    return std::to_string(at->first) + "-" + (at->last == UINT32_MAX ? "" : std::to_string(at->last));
}

std::vector<AliasAddress> alias_addresses(const std::vector<SlaveFacts>& slaves) {
    std::vector<AliasAddress> out;
    std::uint16_t alias = 0;
    std::uint16_t base = 0;
    for (const SlaveFacts& slave : slaves) {
        if (slave.alias != 0) {
            alias = slave.alias;
            base = slave.position;
        }
        out.push_back({slave.position, alias, static_cast<std::uint16_t>(slave.position - base)});
    }
    return out;
}

AliasAddress address_of(const std::vector<AliasAddress>& addresses, std::uint16_t position) {
    const auto* found = at_position(addresses, position);
    return found != nullptr ? *found : AliasAddress{position, 0, position};
}

std::vector<SlaveFacts> select(const std::vector<SlaveFacts>& slaves, const std::optional<Numbers>& aliases,
                               const std::optional<Numbers>& positions) {
    const auto addresses = alias_addresses(slaves);
    std::vector<SlaveFacts> out;
    // The slaves with a selected alias at or before the slave, by their distance to it: a relative position may reach
    // beyond the next slave with another alias.
    std::vector<std::uint16_t> bases;
    for (std::size_t n = 0; n < slaves.size(); ++n) {
        if (aliases && slaves[n].alias != 0 && aliases->contains(slaves[n].alias)) bases.push_back(slaves[n].position);
        const bool by_position = positions && positions->contains(slaves[n].position);
        const bool by_both = positions && ((aliases && aliases->contains(0) && by_position) ||
                                           std::ranges::any_of(bases, [&](std::uint16_t base) {
                                               return positions->contains(slaves[n].position - std::uint32_t{base});
                                           }));
        const bool by_alias = aliases && aliases->contains(addresses[n].alias);
        if (aliases ? (positions ? by_both : by_alias) : !positions || by_position) out.push_back(slaves[n]);
    }
    return out;
}

std::optional<std::string> unmatched(const std::vector<SlaveFacts>& slaves, const std::optional<Numbers>& aliases,
                                     const std::optional<Numbers>& positions) {
    std::vector<std::uint32_t> known;
    if (aliases) {
        for (const AliasAddress& address : alias_addresses(slaves)) known.push_back(address.alias);
        if (positions) known.push_back(0);  // positions in the ring
        if (const auto alias = aliases->missing(known)) return "--alias " + *alias;
    }
    if (!positions) return std::nullopt;
    known.clear();
    for (const SlaveFacts& slave : slaves)
        if (!aliases || aliases->contains(0)) known.push_back(slave.position);
    // The first slave with a selected alias has the most slaves behind it, and a relative position reaches all of them.
    const auto base = std::ranges::find_if(
        slaves, [&](const SlaveFacts& slave) { return aliases && slave.alias != 0 && aliases->contains(slave.alias); });
    for (auto slave = base; slave != slaves.end(); ++slave)
        known.push_back(slave->position - std::uint32_t{base->position});
    if (const auto position = positions->missing(known)) return "--position " + *position;
    return std::nullopt;
}

}  // namespace margay::ethercat
