// The object dictionary of a slave with its values, as text for people and as JSON for programs.
#pragma once

#include <margay/coe.hpp>
#include <margay/context.hpp>

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace margay::samples {

struct DictionaryEntry {
    EntryDescription description;
    std::vector<std::byte> value;
    std::string problem;  // why there is no value; empty: there is one
};

struct DictionaryObject {
    ObjectDescription description;
    std::vector<DictionaryEntry> entries;
    std::string problem;
};

struct Dictionary {
    std::vector<DictionaryObject> objects;
    std::string problem;  // why there is none; empty: there is one
};

// Asks the slave for its list of all objects, then for each object and entry, and reads what can be read in PREOP.
// Waits.
[[nodiscard]] Dictionary read_dictionary(Context& ctx, std::uint16_t slave);

// A value by its type: numbers, texts, else octets.
[[nodiscard]] std::string value_text(std::uint16_t data_type, std::span<const std::byte> value);

[[nodiscard]] std::string dictionary_text(const Dictionary& dictionary);
[[nodiscard]] nlohmann::ordered_json dictionary_json(const Dictionary& dictionary);

}  // namespace margay::samples
