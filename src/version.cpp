#include <margay/version.hpp>

namespace margay {

Version library_version() { return kVersion; }

}  // namespace margay
