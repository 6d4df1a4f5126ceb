#include "sim/library/model.hpp"

namespace margay::sim {

void Model::report(std::uint16_t error_code, std::uint8_t error_register, Time now) {
    [[maybe_unused]] const bool queued = emergencies_.raise({error_code, error_register, {}});
    [[maybe_unused]] const bool noted = diagnosis_.add(
        {.code = 0xE8000000u | error_code,
         .type = error_code == 0 ? subdevice::DiagnosisType::information : subdevice::DiagnosisType::error,
         .text_id = error_code,
         .time_stamp_ns = static_cast<std::uint64_t>(now.time_since_epoch().count())});
}

}  // namespace margay::sim
