#include "sim/esc_description.hpp"

namespace margay::sim {

namespace {

using wire::PortKind;
using namespace std::chrono_literals;

constexpr PortDescription kMii{PortKind::mii, 140ns};
constexpr PortDescription kEbus{PortKind::ebus, 10ns};
constexpr PortDescription kUnused{PortKind::not_configured, 0ns};
constexpr PortDescription kNone{};

// The difference between the delays of a frame with and without the processing unit. ET1100 and ET1200: 20 ns, as
// recorded (test/clock/delays_test.cpp). For the other chips no recording exists: 40 ns.
constexpr Duration kProcessingOfEt = EscDescription{}.forwarding_delay + 20ns;
constexpr Duration kProcessing = EscDescription{}.forwarding_delay + 40ns;

}  // namespace

EscDescription et1100() {
    EscDescription esc;
    esc.processing_delay = kProcessingOfEt;
    esc.ports = {kMii, kEbus, kMii, kNone};
    return esc;
}

EscDescription et1200() {
    EscDescription esc;
    esc.processing_delay = kProcessingOfEt;
    esc.type = 0x12;
    esc.revision = 1;
    esc.build = 1;
    esc.fmmus = 3;
    esc.sync_managers = 4;
    esc.ram_kib = 1;
    esc.features = 0x01FC;
    esc.dc_needs_enable = true;
    esc.ports = {kEbus, kEbus, kUnused, kNone};
    return esc;
}

EscDescription ip_core() {
    EscDescription esc;
    esc.processing_delay = kProcessing;
    esc.type = 0x04;
    esc.revision = 2;
    esc.build = 0;
    esc.features = 0x01CC;
    esc.mii_management = true;
    esc.ports = {kMii, kMii, kNone, kNone};
    esc.sii.reads_8_bytes = false;
    return esc;
}

EscDescription lan9252() {
    EscDescription esc;
    esc.processing_delay = kProcessing;
    esc.type = 0xC0;
    esc.revision = 2;
    esc.build = 0;
    esc.fmmus = 3;
    esc.sync_managers = 4;
    esc.ram_kib = 4;
    esc.features = 0x01CC;
    esc.mii_management = true;
    esc.ports = {kMii, kMii, kUnused, kNone};
    esc.sii.reads_8_bytes = false;
    esc.sii.status_bits = wire::sii_control::kTwoByteAddressing;
    return esc;
}

EscDescription junction() {
    EscDescription esc;
    esc.processing_delay = kProcessingOfEt;
    esc.ports = {kMii, kMii, kMii, kMii};
    return esc;
}

}  // namespace margay::sim
