// Which slaves shall be there, and what each of them shall be configured with: known before anybody has been asked.
#pragma once

#include <margay/configuration.hpp>

#include <cstdint>
#include <optional>

namespace margay {

// One slave that is expected. What is not set is not looked at.
struct ExpectedSlave {
    // Where: at a place in the ring, 1 the first; or, with position 0, the slave with this alias, wherever it is.
    std::uint16_t position = 0;
    std::optional<std::uint16_t> alias{};
    // What.
    std::optional<std::uint32_t> vendor{};
    std::optional<std::uint32_t> product{};
    std::optional<std::uint32_t> revision{};
    std::optional<std::uint32_t> serial{};
    // That it is missing is no error.
    bool optional = false;
    // Becomes slave(n).config before the slave leaves INIT. nullptr: what the slave says itself. The caller's memory.
    const SlaveConfiguration* config = nullptr;
};

}  // namespace margay
