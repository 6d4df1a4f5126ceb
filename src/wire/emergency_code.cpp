#include "wire/emergency_code.hpp"

#include <algorithm>
#include <array>

namespace margay::wire {
namespace {

struct Range {
    std::uint16_t first;
    std::uint16_t last;
    std::string_view text;
};

// Narrow ranges are before the wide ranges that contain them.
constexpr std::array kRanges{
    Range{0x8210, 0x8210, "PDO not processed, wrong length"},
    Range{0x8220, 0x8220, "PDO length exceeded"},
    Range{0xA000, 0xA000, "PREOP to SAFEOP not successful"},
    Range{0xA001, 0xA001, "SAFEOP to OP not successful"},
    Range{0x2100, 0x21FF, "current, device input side"},
    Range{0x2200, 0x22FF, "current inside the device"},
    Range{0x2300, 0x23FF, "current, device output side"},
    Range{0x3100, 0x31FF, "mains voltage"},
    Range{0x3200, 0x32FF, "voltage inside the device"},
    Range{0x3300, 0x33FF, "output voltage"},
    Range{0x4100, 0x41FF, "ambient temperature"},
    Range{0x4200, 0x42FF, "device temperature"},
    Range{0x6100, 0x61FF, "internal software"},
    Range{0x6200, 0x62FF, "user software"},
    Range{0x6300, 0x63FF, "data set"},
    // 0x7100 to 0x7600 and 0x8300 to 0x8A00: IEC 61800-7-201 (CiA 402).
    Range{0x7100, 0x71FF, "power, brake chopper or motor"},
    Range{0x7200, 0x72FF, "measurement circuit"},
    Range{0x7300, 0x73FF, "sensor"},
    Range{0x7400, 0x74FF, "computation circuit"},
    Range{0x7500, 0x75FF, "communication"},
    Range{0x7600, 0x76FF, "data storage"},
    Range{0x8100, 0x81FF, "communication"},
    Range{0x8200, 0x82FF, "protocol error"},
    Range{0x8300, 0x83FF, "torque controller"},
    Range{0x8400, 0x84FF, "velocity controller"},
    Range{0x8500, 0x85FF, "position controller"},
    Range{0x8600, 0x86FF, "positioning controller"},
    Range{0x8700, 0x87FF, "synchronization controller"},
    Range{0x8800, 0x88FF, "winding controller"},
    Range{0x8900, 0x89FF, "process data monitoring"},
    Range{0x8A00, 0x8AFF, "control"},
    Range{0x0000, 0x00FF, "error reset or no error"},
    Range{0x1000, 0x10FF, "generic error"},
    Range{0x2000, 0x2FFF, "current"},
    Range{0x3000, 0x3FFF, "voltage"},
    Range{0x4000, 0x4FFF, "temperature"},
    Range{0x5000, 0x5FFF, "device hardware"},
    Range{0x6000, 0x6FFF, "device software"},
    Range{0x7000, 0x70FF, "additional modules"},
    Range{0x8000, 0x8FFF, "monitoring"},
    Range{0x9000, 0x90FF, "external error"},
    Range{0xA000, 0xA0FF, "EtherCAT state machine"},
    Range{0xF000, 0xF0FF, "additional functions"},
    Range{0xFF00, 0xFFFF, "device specific"},
};

}  // namespace

std::string_view emergency_text(std::uint16_t code) {
    const auto found =
        std::ranges::find_if(kRanges, [code](const Range& r) { return code >= r.first && code <= r.last; });
    return found == kRanges.end() ? std::string_view("unknown code") : found->text;
}

}  // namespace margay::wire
