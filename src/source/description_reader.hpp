// Reads values of TOML files that describe something, with errors that name the file and the line.
#pragma once

#include <margay/time.hpp>

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

namespace margay::hosted {

struct Failure {
    std::string text;
};
using Fault = std::optional<Failure>;

class DescriptionReader {
  public:
    explicit DescriptionReader(std::string origin) : origin_(std::move(origin)) {}

    [[nodiscard]] const std::string& origin() const { return origin_; }
    [[nodiscard]] Failure at(const toml::node& node, const std::string& text) const {
        return Failure{fmt::format("{}: line {}: {}", origin_, node.source().begin.line, text)};
    }

    template <std::size_t N>
    Fault check_keys(const toml::table& table, const std::string_view (&known)[N], std::string_view where) const {
        for (const auto& [key, node] : table)
            if (std::find(std::begin(known), std::end(known), key.str()) == std::end(known))
                return at(node, fmt::format("{} has no key '{}'; its keys are: {}", where, key.str(),
                                            fmt::join(known, ", ")));
        return {};
    }

    Fault integer(const toml::node& node, std::string_view name, std::int64_t least, std::int64_t most,
                  std::int64_t& into) const {
        const auto value = node.value_exact<std::int64_t>();
        if (!value) return at(node, fmt::format("'{}' must be an integer", name));
        if (*value < least || *value > most)
            return at(node, fmt::format("'{}' is {}, it must be from {} to {}", name, *value, least, most));
        into = *value;
        return {};
    }

    // Reads an integer into a field of any type if the table has this key.
    template <class T>
    Fault optional_integer(const toml::table& table, std::string_view name, std::int64_t least, std::int64_t most,
                           T& field) const {
        const auto* node = table.get(name);
        if (node == nullptr) return {};
        std::int64_t value = 0;
        if (const auto fault = integer(*node, name, least, most, value)) return fault;
        field = static_cast<T>(value);
        return {};
    }

    Fault text(const toml::node& node, std::string_view name, std::string& into) const {
        const auto value = node.value_exact<std::string>();
        if (!value) return at(node, fmt::format("'{}' must be a string", name));
        into = *value;
        return {};
    }

    Fault microseconds(const toml::table& table, std::string_view name, Duration& field) const {
        std::int64_t us = -1;
        if (const auto fault = optional_integer(table, name, 0, 10'000'000, us)) return fault;
        if (us >= 0) field = std::chrono::microseconds(us);
        return {};
    }

    Fault boolean(const toml::table& table, std::string_view name, bool& field) const {
        const auto* node = table.get(name);
        if (node == nullptr) return {};
        const auto value = node->value_exact<bool>();
        if (!value) return at(*node, fmt::format("'{}' must be true or false", name));
        field = *value;
        return {};
    }

  private:
    std::string origin_;
};

}  // namespace margay::hosted
