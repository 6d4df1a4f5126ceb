#include "sim/library/sii_revision.hpp"

#include "wire/esc.hpp"

#include <array>

namespace margay::sim {
namespace {

namespace reg = wire::reg;
namespace control = wire::sii_control;

constexpr std::uint32_t kRevisionWord = 0x000C;
constexpr Duration kPause = std::chrono::microseconds(500);
constexpr Duration kPatience = std::chrono::milliseconds(5);  // while the master uses the EEPROM

}  // namespace

void SiiRevision::start(subdevice::EscAccess& esc, std::uint32_t known, std::uint32_t wanted) {
    esc_ = &esc;
    stored_ = known;
    wanted_ = wanted;
    word_ = 0;
    writing_ = false;
}

bool SiiRevision::take_access() {
    std::array<std::byte, 1> octet{std::byte{1}};
    esc_->write(reg::kSiiPdiAccess.address, octet);
    esc_->read(reg::kSiiPdiAccess.address, octet);
    return octet[0] == std::byte{1};
}

void SiiRevision::release_access() {
    const std::array<std::byte, 1> none{};
    esc_->write(reg::kSiiPdiAccess.address, none);
}

void SiiRevision::write_word() {
    std::array<std::byte, 4> address{};
    std::array<std::byte, 2> octets{};
    store_le<std::uint32_t>(address, 0, kRevisionWord + word_);
    esc_->write(reg::kSiiAddress.address, address);
    store_le<std::uint16_t>(octets, 0, static_cast<std::uint16_t>(wanted_ >> (16 * word_)));
    esc_->write(reg::kSiiData.address, octets);
    store_le<std::uint16_t>(octets, 0, control::kCommandWrite | control::kWriteEnable);
    esc_->write(reg::kSiiControl.address, octets);
    writing_ = true;
}

// A command that was not acknowledged, because the EEPROM still stores the word before, is repeated.
Time SiiRevision::advance(Time now) {
    if (esc_ == nullptr || stored_ == wanted_) return kNever;
    std::array<std::byte, 2> octets{};
    esc_->read(reg::kSiiControl.address, octets);
    const auto status = load_le<std::uint16_t>(octets);
    if ((status & control::kBusy) != 0) return now + kPause;
    if (writing_) {
        writing_ = false;
        if ((status & (control::kMissingAcknowledge | control::kWriteEnableError)) == 0) ++word_;
    }
    if (word_ == 2) {
        stored_ = wanted_;
        release_access();
        return kNever;
    }
    if (!take_access()) return now + kPatience;
    write_word();
    return now + kPause;
}

}  // namespace margay::sim
