// Functions of the programs for ESI and ENI files.
#pragma once

#include "source/esi_image.hpp"

#include <margay/files/eni.hpp>
#include <margay/files/esi.hpp>

#include <optional>
#include <string>

namespace margay::samples {

using namespace hosted;

// Reads an ENI for a program that brings a segment up by it. Remarks go to standard error as warnings.
struct EniFile {
    std::optional<files::EniConfiguration> configuration{};
    std::string error{};
};
[[nodiscard]] EniFile load_eni(const std::string& path);

// Maps the groups of the file, or group 0 without a file; after an error it continues with the other groups. Returns
// the number of octets of all groups, or the first error.
[[nodiscard]] Result<std::size_t> map_groups(Context& ctx, const files::EniConfiguration* eni,
                                             std::span<std::byte> image);

// Whether the file contains the device with this identity. A device with another revision does not match.
[[nodiscard]] bool has_device(const files::EsiFile& esi, const Identity& identity);

// Limits with room for the slaves and groups of the file.
[[nodiscard]] Limits with_room(Limits limits, const files::EniConfiguration* eni);

// Scans the segment. With a file, the slaves and clocks of the file are used, and the modules of the slaves are
// compared with it. The error of this comparison (check_failed) is not in errors().
[[nodiscard]] Result<std::uint16_t> scan_by(Context& ctx, const files::EniConfiguration* eni);

}  // namespace margay::samples
