// A process image as a struct of C and C++: #included and laid over the image it names every PDO entry.
#pragma once

#include "common/process_map.hpp"

namespace margay::samples {

// A whole header. One struct for the outputs and one for the inputs, whose members lie where the entries lie on a
// little-endian machine; what begins or ends inside an octet becomes a bit-field. The header asserts the offset of
// every other member and the size of both structs, so that a compiler that lays them out differently refuses it.
[[nodiscard]] std::string map_cstruct(Context& ctx, const ProcessMap& map);

// A name as an identifier: "Channel 1 / Output" becomes channel_1_output. Letters outside ASCII are left out.
[[nodiscard]] std::string identifier(const std::string& text);

}  // namespace margay::samples
