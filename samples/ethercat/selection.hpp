// Numbers in the arguments of `ethercat`: single ones, lists and ranges ("1,4,5,7-9"), and the slaves that they select.
#pragma once

#include "ethercat/session.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::ethercat {

// Parses a whole number in the notation of C: decimal, octal with 0, hexadecimal with 0x. No value: `text` is not a
// number, or not from `least` to `most`.
[[nodiscard]] std::optional<std::uint64_t> parse_unsigned(std::string_view text, std::uint64_t most);
[[nodiscard]] std::optional<std::int64_t> parse_signed(std::string_view text, std::int64_t least, std::int64_t most);

// A set of numbers. "-" is all of them; "3-" is all from 3 on, "-3" all up to 3.
class Numbers {
  public:
    [[nodiscard]] static std::optional<Numbers> parse(std::string_view text);
    [[nodiscard]] bool contains(std::uint32_t number) const;
    // The number if it is a single one.
    [[nodiscard]] std::optional<std::uint32_t> single() const;
    // The first element of the list (a number or a range) without any number in `there`; no value: there is no such
    // element.
    [[nodiscard]] std::optional<std::string> missing(const std::vector<std::uint32_t>& there) const;

  private:
    struct Range {
        std::uint32_t first = 0;
        std::uint32_t last = 0;
    };
    std::vector<Range> ranges_{};
};

// The address of a slave by alias: the number of places behind the last slave with an alias. Alias 0: there is no such
// slave before it. A place whose slave is missing counts.
struct AliasAddress {
    std::uint16_t position = 0;
    std::uint16_t alias = 0;
    std::uint16_t relative = 0;
};
// For each slave of the ring, in the order of `slaves`. The positions of missing slaves are not in these lists, so an
// index in these lists is not a position.
[[nodiscard]] std::vector<AliasAddress> alias_addresses(const std::vector<SlaveFacts>& slaves);

// The element for the slave at a position, in the slaves or in a list made from them. nullptr: no slave is there.
template <class T>
[[nodiscard]] const T* at_position(const std::vector<T>& list, std::uint16_t position) {
    for (const T& element : list)
        if (element.position == position) return &element;
    return nullptr;
}

// The address of the slave at a position. A slave that was connected after `addresses` was read is not in this list.
// Its address is then its position.
[[nodiscard]] AliasAddress address_of(const std::vector<AliasAddress>& addresses, std::uint16_t position);

// The element of --alias or of --position that selects no slave, with its option, for example "--position 77". nullopt:
// each element selects a slave, or neither option was given.
[[nodiscard]] std::optional<std::string> unmatched(const std::vector<SlaveFacts>& slaves,
                                                   const std::optional<Numbers>& aliases,
                                                   const std::optional<Numbers>& positions);

// The slaves that --alias and --position select.
[[nodiscard]] std::vector<SlaveFacts> select(const std::vector<SlaveFacts>& slaves,
                                             const std::optional<Numbers>& aliases,
                                             const std::optional<Numbers>& positions);

}  // namespace margay::ethercat
