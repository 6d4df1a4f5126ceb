// Reads the object dictionary of a slave with its values and writes it as text for people and as JSON for programs.
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
    std::string problem;  // why there is no value; empty when there is a value
};

struct DictionaryObject {
    ObjectDescription description;
    std::vector<DictionaryEntry> entries;
    std::string problem;
};

struct Dictionary {
    std::vector<DictionaryObject> objects;
    std::string problem;  // why there is no dictionary; empty when there is one
};

// Reads the slave's list of all objects, then the description of each object and entry, then each value that is
// readable in PREOP. Blocks until all answers have arrived.
[[nodiscard]] Dictionary read_dictionary(Context& ctx, std::uint16_t slave);

// A value as text by its CoE data type: a number, a string, or else octets.
[[nodiscard]] std::string value_text(std::uint16_t data_type, std::span<const std::byte> value);

[[nodiscard]] std::string dictionary_text(const Dictionary& dictionary);
[[nodiscard]] nlohmann::ordered_json dictionary_json(const Dictionary& dictionary);

}  // namespace margay::samples
