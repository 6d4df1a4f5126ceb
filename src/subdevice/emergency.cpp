#include "subdevice/emergency.hpp"

#include "subdevice/application.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace coe = wire::coe;

namespace {
constexpr std::size_t kLineBytes = 4;
}

bool Emergencies::raise(const EmergencyMessage& message) {
    error_register_ = message.error_register;
    if (message.error_code != 0 && history_.size() >= kLineBytes) {
        const auto lines = history_.size() / kLineBytes;
        std::copy_backward(history_.begin(), history_.begin() + static_cast<std::ptrdiff_t>((lines - 1) * kLineBytes),
                           history_.begin() + static_cast<std::ptrdiff_t>(lines * kLineBytes));
        // A history line contains the error code, and the first two octets of the manufacturer-specific data as
        // additional information.
        store_le(history_, 0, message.error_code);
        history_[2] = message.data[0];
        history_[3] = message.data[1];
        const auto used = std::to_integer<std::size_t>(count_[0]);
        count_[0] = static_cast<std::byte>(std::min({used + 1, lines, std::size_t{254}}));
    }
    if (waiting_ == queue_.size()) {
        ++lost_;
        return false;
    }
    queue_[(first_ + waiting_++) % queue_.size()] = message;
    return true;
}

void Emergencies::step(Outbox& out) {
    while (waiting_ != 0) {
        const auto at = out.open();
        if (at.size() < coe::kEmergencyBytes) return;
        const auto& message = queue_[first_];
        coe::store_header(at, {0, coe::Service::emergency});
        coe::EmergencyLayout::error_code::store(at, message.error_code);
        coe::EmergencyLayout::error_register::store(at, message.error_register);
        std::copy(message.data.begin(), message.data.end(), at.begin() + coe::EmergencyLayout::data);
        out.commit(wire::MailboxType::coe, coe::kEmergencyBytes, 0);
        first_ = (first_ + 1) % queue_.size();
        --waiting_;
    }
}

MutableBytes Emergencies::line(unsigned subindex) {
    const auto from = (subindex - std::size_t{1}) * kLineBytes;
    return from + kLineBytes <= history_.size() ? history_.subspan(from, kLineBytes) : MutableBytes{};
}

void Emergencies::clear_history() {
    count_[0] = std::byte{0};
    std::fill(history_.begin(), history_.end(), std::byte{0});
}

namespace error_history {

// nullptr: the device has no emergencies.
static Emergencies* of(const ObjectAccess& access) {
    return access.application != nullptr ? access.application->emergencies() : nullptr;
}

bool exists(const ObjectAccess& access) { return of(access) != nullptr; }

HookAnswer before_read(const ObjectAccess& access) {
    const auto used = std::to_integer<unsigned>(of(access)->count()[0]);
    return !access.complete && access.subindex > used ? Abort::no_subindex : Abort::none;
}

// Only the value 0 may be written. It clears the history.
HookAnswer before_write(const ObjectAccess& access, Bytes data) {
    (void)access;
    return !data.empty() && data[0] != std::byte{0} ? Abort::value_range : Abort::none;
}

void after_write(const ObjectAccess& access) { of(access)->clear_history(); }

MutableBytes memory(const ObjectAccess& access) {
    auto* const emergencies = of(access);
    if (emergencies == nullptr) return {};
    return access.subindex == 0 ? emergencies->count() : emergencies->line(access.subindex);
}

}  // namespace error_history

}  // namespace margay::subdevice
