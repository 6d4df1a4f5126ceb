// ESI and ENI files as the programs use them.
#pragma once

#include <margay/files/eni.hpp>
#include <margay/files/esi.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace margay::samples {

// Whether a path names an ESI: "FILE.xml", or "FILE.xml#TYPE" for one of its devices.
[[nodiscard]] bool names_esi(const std::string& path);

// The SII image of a device of an ESI. `type`: the order code or the name of the device; empty: the file has one only.
struct EsiImage {
    std::vector<std::byte> octets{};
    std::string type{};
    std::vector<std::string> remarks{};
    std::string error{};  // a sentence with the name of the file
};
[[nodiscard]] EsiImage esi_image(const std::string& file, const std::string& type);
[[nodiscard]] EsiImage esi_image(const std::string& path);  // "FILE.xml" or "FILE.xml#TYPE"

// Reads an ENI for a program that brings a segment up by it. Remarks go to standard error as warnings.
struct EniFile {
    std::optional<files::EniConfiguration> configuration{};
    std::string error{};
};
[[nodiscard]] EniFile load_eni(const std::string& path);

// Maps the groups of the file, or group 0 without a file. Returns the octets of all of them.
[[nodiscard]] Result<std::size_t> map_groups(Context& ctx, const files::EniConfiguration* eni,
                                             std::span<std::byte> image);

// Limits with room for the slaves and groups of the file.
[[nodiscard]] Limits with_room(Limits limits, const files::EniConfiguration* eni);

// Scans the segment; with a file as its slaves and clocks say.
[[nodiscard]] Result<std::uint16_t> scan_by(Context& ctx, const files::EniConfiguration* eni);

}  // namespace margay::samples
