// The version of these headers and of the linked library. CMakeLists.txt reads the three numbers from this file.
//
//     #if !MARGAY_VERSION_AT_LEAST(0, 1, 0)
//     #error "this program needs Margay 0.1.0"
//     #endif
//
// Versions follow semantic versioning. While the first number is 0, a new second number may change the API.
#pragma once

#include <compare>

#define MARGAY_VERSION_MAJOR 0
#define MARGAY_VERSION_MINOR 1
#define MARGAY_VERSION_PATCH 0

// A version as one number, for comparisons in the preprocessor. Each part is less than 1000.
#define MARGAY_VERSION_NUMBER(major_, minor_, patch_) ((major_)*1000000L + (minor_)*1000L + (patch_))
#define MARGAY_VERSION MARGAY_VERSION_NUMBER(MARGAY_VERSION_MAJOR, MARGAY_VERSION_MINOR, MARGAY_VERSION_PATCH)
#define MARGAY_VERSION_AT_LEAST(major_, minor_, patch_) \
    (MARGAY_VERSION >= MARGAY_VERSION_NUMBER(major_, minor_, patch_))

// "0.1.0"
#define MARGAY_VERSION_TEXT                        \
    MARGAY_VERSION_TEXT_OF(MARGAY_VERSION_MAJOR) \
    "." MARGAY_VERSION_TEXT_OF(MARGAY_VERSION_MINOR) "." MARGAY_VERSION_TEXT_OF(MARGAY_VERSION_PATCH)
#define MARGAY_VERSION_TEXT_OF(number) MARGAY_VERSION_TEXT_OF_(number)
#define MARGAY_VERSION_TEXT_OF_(number) #number

namespace margay {

struct Version {
    int major_number = 0;
    int minor_number = 0;
    int patch_number = 0;
    friend constexpr auto operator<=>(const Version&, const Version&) = default;
};

// The version of the headers that this file is compiled with.
inline constexpr Version kVersion = {MARGAY_VERSION_MAJOR, MARGAY_VERSION_MINOR, MARGAY_VERSION_PATCH};

// The version of the library that the program is linked with. It differs from kVersion when headers and library come
// from two installations. May be called from the cycle and from any thread.
[[nodiscard]] Version library_version();

}  // namespace margay
