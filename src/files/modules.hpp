// The modules of a slave: the configured list (object 0xF030) and the detected one (0xF050).
#pragma once

#include <margay/context.hpp>
#include <margay/result.hpp>
#include <margay/startup.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace margay::files {

inline constexpr std::uint16_t kConfiguredModules = 0xF030;
inline constexpr std::uint16_t kDetectedModules = 0xF050;

// The idents that start-up commands write to the list of configured modules, from slot 0 on.
[[nodiscard]] std::vector<std::uint32_t> configured_modules(std::span<const StartupCommand> commands);

// The first slot whose detected module differs from the wanted module. `there`: there is such a slot.
struct OtherModule {
    bool there = false;
    std::size_t slot = 0;
    std::uint32_t wanted = 0;
    std::uint32_t found = 0;
};
[[nodiscard]] Result<OtherModule> find_other_module(Context& ctx, std::uint16_t slave,
                                                    std::span<const std::uint32_t> wanted);

// The list of configured modules in the slave; empty: the slave has no such list, or no master has written it.
[[nodiscard]] std::vector<std::uint32_t> modules_in_use(Context& ctx, std::uint16_t slave);

}  // namespace margay::files
