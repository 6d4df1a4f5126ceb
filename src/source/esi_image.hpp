// SII images of devices that an ESI file describes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace margay::hosted {

// Whether a path names an ESI: "FILE.xml", or "FILE.xml#TYPE" or "FILE.xml#TYPE/REVISION" for one of its devices.
[[nodiscard]] bool names_esi(const std::string& path);

// The SII image of a device of an ESI. `type`: the order code or the name of the device, with /REVISION behind it
// where it is not the greatest one (EX100/0x00010000); empty: the file has one device only.
struct EsiImage {
    std::vector<std::byte> octets{};
    std::string type{};
    std::vector<std::string> remarks{};
    std::string error{};      // a sentence with the name of the file
    bool needs_type = false;  // the error: the file has several devices, and `type` is empty
};
[[nodiscard]] EsiImage esi_image(const std::string& file, const std::string& type);
[[nodiscard]] EsiImage esi_image(const std::string& path);  // "FILE.xml" or "FILE.xml#TYPE"…

}  // namespace margay::hosted
