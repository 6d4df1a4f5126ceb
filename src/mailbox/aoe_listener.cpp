// Notifications of AoE devices.
#include "wire/aoe.hpp"

#include <margay/aoe.hpp>

namespace margay {

namespace aoe = wire::aoe;

// If the lengths in a notification are inconsistent, the first value that does not fit and all later values are
// dropped. The listener accepts the mail nevertheless, because no other listener can use it.
bool AoeListener::tell(const UnaskedMail& mail) {
    if (mail.data.size() < aoe::kHeaderBytes + 2 * sizeof(std::uint32_t)) return false;
    const auto header = aoe::load_header(mail.data);
    const bool response = (header.flags & aoe::state_flag::kResponse) != 0;
    if (response || header.command != aoe::Command::notification) return false;
    Bytes left = mail.data.subspan(aoe::kHeaderBytes);
    const auto stamps = load_le<std::uint32_t>(left, sizeof(std::uint32_t));
    left = left.subspan(2 * sizeof(std::uint32_t));
    for (std::uint32_t stamp = 0; stamp < stamps && left.size() >= aoe::kStampBytes; ++stamp) {
        const auto time = load_le<std::uint64_t>(left);
        const auto samples = load_le<std::uint32_t>(left, sizeof(time));
        left = left.subspan(aoe::kStampBytes);
        for (std::uint32_t sample = 0; sample < samples; ++sample) {
            if (left.size() < aoe::kSampleBytes) return true;
            const auto handle = load_le<std::uint32_t>(left);
            const auto size = load_le<std::uint32_t>(left, sizeof(handle));
            left = left.subspan(aoe::kSampleBytes);
            if (size > left.size()) return true;
            notified(mail.slave,
                     {.source = header.source, .handle = handle, .time_stamp = time, .data = left.first(size)});
            left = left.subspan(size);
        }
    }
    return true;
}

}  // namespace margay
