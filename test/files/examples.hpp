// Files that were written for these tests. They are also the first inputs of the fuzz harnesses.
#pragma once

#include <margay/files/text_place.hpp>

#include <places.hpp>
#include <string>

namespace margay::files {

[[nodiscard]] inline std::string corpus(const std::string& name) {
    return read_file(std::string(MARGAY_SOURCE_DIR) + "/test/fuzz/corpus/" + name).octets;
}

inline const std::string kExampleEsi = corpus("esi/drive");    // a drive with all elements of a device
inline const std::string kModularEsi = corpus("esi/modules");  // a coupler with slots, and two modules
// Two slaves as a configuration tool writes them, with the offsets of the tool. The logical addresses of the outputs
// begin at 0x01000000, those of the inputs at 0x01000800.
inline const std::string kExampleEni = corpus("eni/two_slaves");

}  // namespace margay::files
