// SII images in files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace margay::hosted {

// Returns a sentence if `path` exists and is neither a file nor a folder; empty: it may be read. Opening a pipe without
// a writer would wait without end, and a device may have no end.
[[nodiscard]] std::string odd_file(const std::filesystem::path& path);

// Reads an SII image, or makes it of an ESI (see esi_image.hpp). Refuses content that cannot come from an EEPROM: an
// empty file, a text file, a folder, or a file larger than any EEPROM. Returns the error in words; empty: none.
[[nodiscard]] std::string load_image(const std::filesystem::path& path, std::vector<std::byte>& image);

}  // namespace margay::hosted
