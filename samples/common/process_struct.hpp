// Writes a process image as a struct of C and C++. A program includes this header and accesses every PDO entry in the
// image by name.
#pragma once

#include "common/process_map.hpp"

namespace margay::samples {

// Returns a complete header with one struct for the outputs and one for the inputs. The members have the offsets of
// the entries, for a little-endian machine. An entry that begins or ends inside an octet becomes a bit-field. The
// header asserts the offset of every other member and the size of both structs, so that the compilation fails when a
// compiler uses a different layout.
[[nodiscard]] std::string map_cstruct(Context& ctx, const ProcessMap& map);

// Makes an identifier from a name: "Channel 1 / Output" becomes channel_1_output. Letters outside ASCII are left out.
[[nodiscard]] std::string identifier(const std::string& text);

}  // namespace margay::samples
