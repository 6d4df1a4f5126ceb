// Parts of the library that a context uses because its slaves need them, without a call of the application.
// init(ctx, nic, osal) gives a context all of these parts. A program for a small system gives a context only the parts
// that its slaves need; the linker leaves out the others:
//
//     init(ctx, nic, osal, {});                            // none of them
//     init(ctx, nic, osal, {.soe = &margay::kSoeFeature});
//
// Every other part of the library is linked only when the program calls a function of that part, or contains a request
// or a list of that part.
#pragma once

namespace margay {

struct SoeFeature;
struct RoutingFeature;
struct OverlapFeature;
struct BootFeature;

// The process data of SoE drives is read from their parameters. Without it, sizes come from the SII.
extern const SoeFeature kSoeFeature;
// Mail from one slave to another is forwarded. Without it such mail is counted as unexpected.
extern const RoutingFeature kRoutingFeature;
// GroupConfiguration::cycles_in_flight may be more than 1. Without it config_map() refuses that (Errc::unsupported).
extern const OverlapFeature kOverlapFeature;

// Slaves can be brought to BOOT, where they accept firmware. Without it BOOT is refused (Errc::unsupported), and a
// slave that was away and is in BOOT by itself is refused (Errc::identity_unread) until it has left BOOT.
extern const BootFeature kBootFeature;

struct Features {
    const SoeFeature* soe = nullptr;
    const RoutingFeature* routing = nullptr;
    const OverlapFeature* overlap = nullptr;
    const BootFeature* boot = nullptr;
};

inline constexpr Features kAllFeatures{
    .soe = &kSoeFeature, .routing = &kRoutingFeature, .overlap = &kOverlapFeature, .boot = &kBootFeature};

}  // namespace margay
