// The files that were made up for these tests; they are also the first inputs of the fuzz harnesses.
#pragma once

#include <margay/files/text_place.hpp>

#include <places.hpp>
#include <string>

namespace margay::files {

[[nodiscard]] inline std::string corpus(const std::string& name) {
    return read_file(std::string(MARGAY_SOURCE_DIR) + "/test/fuzz/corpus/" + name).octets;
}

inline const std::string kExampleEsi = corpus("esi/drive");    // a drive with all that a device may have
inline const std::string kModularEsi = corpus("esi/modules");  // a coupler with slots, and two modules
// Two slaves as a tool writes them, with offsets of its own: outputs at 0x01000000, inputs at 0x01000800.
inline const std::string kExampleEni = corpus("eni/two_slaves");

}  // namespace margay::files
