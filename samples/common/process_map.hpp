// What lies where in a process image: every PDO entry with its offset, its length and its name, for people, for
// programs, and as a struct for the compiler. The sizes are those that config_map() has laid out; the objects are those
// that the slave's dictionary or SII assigns. The names are those that its SII has for them, else those of its
// dictionary.
#pragma once

#include <margay/context.hpp>

#include <nlohmann/json.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace margay::samples {

struct MapEntry {
    std::uint16_t slave = 0;
    Direction direction = Direction::outputs;
    std::uint8_t sync_manager = 0;
    std::uint16_t pdo = 0;         // its index; 0: nobody told what is in this SyncManager
    std::uint8_t pdo_place = 0;    // which PDO of the SyncManager, 1 the first
    std::uint8_t entry_place = 0;  // which entry of the PDO, 1 the first
    std::string pdo_name{};
    std::uint16_t index = 0;  // of the object; 0: a gap
    std::uint8_t subindex = 0;
    std::string name{};
    std::uint8_t data_type = 0;     // of CoE; 0: not told
    std::uint32_t offset_bits = 0;  // in the image
    std::uint32_t bits = 0;
};

struct ProcessMap {
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::vector<MapEntry> entries{};     // in the order of the image
    std::vector<std::string> remarks{};  // what could not be read, and where SII and mapping disagree
};

// `ctx` has mapped the group. Reads the SII and the PDOs of each of its slaves; waits.
[[nodiscard]] ProcessMap read_process_map(Context& ctx, std::uint8_t group = 0);

// Lines of offset, bits, slave, object and name; and what an application writes to use them by name.
[[nodiscard]] std::string map_text(Context& ctx, const ProcessMap& map);
[[nodiscard]] nlohmann::ordered_json map_json(Context& ctx, const ProcessMap& map);

}  // namespace margay::samples
