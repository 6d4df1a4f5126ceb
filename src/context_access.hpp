// What the files of src/ may see of a context.
#pragma once

#include <margay/context.hpp>

namespace margay {

struct ContextAccess {
    static Network*& network(Context& ctx) { return ctx.network_; }
    static Osal*& osal(Context& ctx) { return ctx.osal_; }
    static LinkSettings& early_settings(Context& ctx) { return ctx.early_settings_; }
    static EventQueue& no_events(Context& ctx) { return ctx.no_events_; }
    static EmergencyRing& no_emergencies(Context& ctx) { return ctx.no_emergencies_; }
    static std::span<std::byte> memory(Context& ctx) { return ctx.memory_; }
};

}  // namespace margay
