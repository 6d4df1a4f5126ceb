// Parts of the library that a context uses because its slaves need them, without a call of the application.
// init(ctx, nic, osal) gives a context all of these parts. A program for a small system gives a context only the parts
// that its slaves need; the linker leaves out the others:
//
//     init(ctx, nic, osal, {});                            // none of them
//     init(ctx, nic, osal, {.coe = &margay::kCoeFeature});
//
// Every other part of the library is linked only when the program calls a function of that part, or contains a request
// or a list of that part.
#pragma once

#include <cstdint>

namespace margay {

struct CoeFeature;
struct SoeFeature;
struct RoutingFeature;
struct OverlapFeature;
struct BootFeature;

// Which feature the context would need: the detail of Errc::unsupported from the steps discover_pdos, map_process_data
// and request_state. describe() names it.
enum class Feature : std::uint8_t { none, coe, soe, overlap, boot };

// The PDOs of a slave with an object dictionary are read from the dictionary (0x1C00, 0x1C12, 0x1C13 …). Without this
// feature the sizes come from the SII of the slave, unless the application lists its PDOs for each SyncManager:
// warnings() then has Errc::unsupported once for the slave, with the number of octets that are used. Where the SII has
// no sizes, config_map() fails with this error. The slave may refuse SAFEOP if its PDOs differ from its SII.
extern const CoeFeature kCoeFeature;
// The process data of SoE drives is read from their parameters. Without this feature the sizes come from the SII of the
// drive, with the same warning and the same error as without kCoeFeature.
extern const SoeFeature kSoeFeature;
// Mail from one slave to another is forwarded. Without this feature such mail is counted as unexpected.
extern const RoutingFeature kRoutingFeature;
// GroupConfiguration::cycles_in_flight may be more than 1. Without this feature config_map() refuses such a value
// (Errc::unsupported).
extern const OverlapFeature kOverlapFeature;

// Slaves can be brought to BOOT, where they accept firmware. Without this feature BOOT is refused (Errc::unsupported),
// and a slave that was away and is in BOOT by itself is refused (Errc::identity_unread) until it has left BOOT.
extern const BootFeature kBootFeature;

struct Features {
    const CoeFeature* coe = nullptr;
    const SoeFeature* soe = nullptr;
    const RoutingFeature* routing = nullptr;
    const OverlapFeature* overlap = nullptr;
    const BootFeature* boot = nullptr;
};

inline constexpr Features kAllFeatures{.coe = &kCoeFeature,
                                       .soe = &kSoeFeature,
                                       .routing = &kRoutingFeature,
                                       .overlap = &kOverlapFeature,
                                       .boot = &kBootFeature};

}  // namespace margay
