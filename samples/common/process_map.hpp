// The layout of a process image: every PDO entry with its offset, its length and its name, as text, as JSON, and as a
// C struct. The sizes are the ones that config_map() laid out. The objects are the ones that the slave's dictionary or
// SII assigns. Names come from the slave's SII, or else from its dictionary.
#pragma once

#include <margay/context.hpp>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace margay::samples {

struct MapEntry {
    std::uint16_t slave = 0;
    Direction direction = Direction::outputs;
    std::uint8_t sync_manager = 0;
    std::uint16_t pdo = 0;         // index of the PDO; 0: the content of this SyncManager is unknown
    std::uint8_t pdo_place = 0;    // place of the PDO in the SyncManager; the first is 1
    std::uint8_t entry_place = 0;  // place of the entry in the PDO; the first is 1
    std::string pdo_name{};
    std::uint16_t index = 0;  // index of the object; 0: a gap
    std::uint8_t subindex = 0;
    std::string name{};
    std::uint8_t data_type = 0;     // CoE data type; 0: unknown
    std::uint32_t offset_bits = 0;  // in the process image
    std::uint32_t bits = 0;
};

struct ProcessMap {
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::vector<MapEntry> entries{};     // in the order of the process image
    std::vector<std::string> remarks{};  // what could not be read, and where SII and mapping differ
};

// Reads the SII and the PDOs of each slave of the group. The group must be mapped. Blocks until all answers have
// arrived.
[[nodiscard]] ProcessMap read_process_map(Context& ctx, std::uint8_t group = 0);

// Lines with offset, bits, slave, object and name, followed by the C++ declarations for the entries.
[[nodiscard]] std::string map_text(Context& ctx, const ProcessMap& map);
[[nodiscard]] nlohmann::ordered_json map_json(Context& ctx, const ProcessMap& map);

}  // namespace margay::samples
