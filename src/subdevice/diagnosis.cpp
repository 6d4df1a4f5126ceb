#include "subdevice/diagnosis.hpp"

#include "subdevice/application.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace {

// Flags of subindex 5.
constexpr std::uint16_t kSendsEmergencies = 0x0001;
constexpr std::uint16_t kNoInformation = 0x0002;
constexpr std::uint16_t kNoWarnings = 0x0004;
constexpr std::uint16_t kNoErrors = 0x0008;
constexpr std::uint16_t kAcknowledgeMode = 0x0010;
constexpr std::uint16_t kLost = 0x0020;  // a message was overwritten or discarded before it was acknowledged
constexpr std::uint16_t kWritable = 0x001F;

struct MessageLayout {
    using code = Field<std::uint32_t, 0>;
    using flags = Field<std::uint16_t, 4>;  // bits 0–3 type, bits 8–15 number of parameters
    using text_id = Field<std::uint16_t, 6>;
    using time_stamp = Field<std::uint64_t, 8>;
};
constexpr std::size_t kLengthBytes = 2;  // length field before each message in the memory; it is not sent to the master

}  // namespace

std::size_t DiagnosisHistory::length(Bytes line) { return load_le<std::uint16_t>(line); }

void DiagnosisHistory::clear() {
    std::fill(memory_.begin(), memory_.end(), std::byte{0});
    const auto kept = flags::load(head_);
    head_ = {};
    maximum::store(head_, lines_);
    flags::store(head_, static_cast<std::uint16_t>(kept & kWritable));
    next_ = unread_ = 0;
}

bool DiagnosisHistory::full() const { return unread_ == lines_; }

bool DiagnosisHistory::add(const DiagnosisMessage& message) {
    auto state = flags::load(head_);
    const std::uint16_t filters[] = {kNoInformation, kNoWarnings, kNoErrors};
    if ((state & filters[static_cast<unsigned>(message.type)]) != 0) return false;
    if (full()) {
        state |= kLost;
        flags::store(head_, state);
        if ((state & kAcknowledgeMode) != 0) return false;
        --unread_;
    }
    const auto at = line(next_);
    const auto body = at.subspan(kLengthBytes);
    const bool fits = kHeadBytes + message.parameter_bytes.size() <= body.size();
    const auto parameters = fits ? message.parameter_bytes : Bytes{};
    MessageLayout::code::store(body, message.code);
    MessageLayout::flags::store(body, static_cast<std::uint16_t>(static_cast<unsigned>(message.type) |
                                                                 ((fits ? message.parameters : 0u) << 8)));
    MessageLayout::text_id::store(body, message.text_id);
    MessageLayout::time_stamp::store(body, message.time_stamp_ns);
    std::copy(parameters.begin(), parameters.end(), body.begin() + kHeadBytes);
    store_le(at, 0, static_cast<std::uint16_t>(kHeadBytes + parameters.size()));
    latest::store(head_, static_cast<std::uint8_t>(kFirstSubindex + next_));
    next_ = static_cast<std::uint8_t>((next_ + 1) % lines_);
    ++unread_;
    available::store(head_, 1);
    if ((state & kSendsEmergencies) != 0 && emergencies_ != nullptr) {
        EmergencyMessage emergency{.error_code = static_cast<std::uint16_t>(message.code),
                                   .error_register = emergencies_->error_register()};
        store_le(MutableBytes(emergency.data), 0, message.text_id);
        emergency.data[2] = static_cast<std::byte>(message.type);
        (void)emergencies_->raise(emergency);
    }
    return true;
}

MutableBytes DiagnosisHistory::field(unsigned subindex) {
    switch (subindex) {
        case 1: return MutableBytes(head_).subspan(maximum::offset, 1);
        case 2: return MutableBytes(head_).subspan(latest::offset, 1);
        case 3: return MutableBytes(head_).subspan(acknowledged::offset, 1);
        case 4: return MutableBytes(head_).subspan(available::offset, 1);
        case 5: return MutableBytes(head_).subspan(flags::offset, 2);
        default: break;
    }
    const auto n = std::size_t{subindex} - kFirstSubindex;
    if (subindex < kFirstSubindex || n >= lines_) return {};
    const auto at = line(n);
    return at.subspan(kLengthBytes, length(at));
}

Abort DiagnosisHistory::check_write(unsigned subindex, Bytes data) const {
    if (subindex == 5) {
        const auto possible = kWritable | kLost;
        const auto taken = emergencies_ != nullptr ? possible : possible & ~kSendsEmergencies;
        return (load_le<std::uint16_t>(data) & ~taken) != 0 ? Abort::value_range : Abort::none;
    }
    // Subindex 3, newest acknowledged message: 0 clears the history, 1 to 5 are invalid, larger values select a
    // message.
    const auto n = std::to_integer<unsigned>(data[0]);
    if (n == 0) return Abort::none;
    if (n < kFirstSubindex) return Abort::value_too_low;
    if (n >= unsigned{kFirstSubindex} + lines_) return Abort::value_too_high;
    return length(memory_.subspan((n - kFirstSubindex) * room())) == 0 ? Abort::value_range : Abort::none;
}

void DiagnosisHistory::written(unsigned subindex) {
    if (subindex != 3) return;
    const auto n = acknowledged::load(head_);
    if (n == 0) return clear();
    // Messages newer than the acknowledged message stay unread.
    const auto last_line = (next_ + lines_ - 1u) % lines_;
    unread_ = static_cast<std::uint8_t>((last_line + lines_ - (n - kFirstSubindex)) % lines_);
    available::store(head_, unread_ != 0 ? 1 : 0);
    flags::store(head_, static_cast<std::uint16_t>(flags::load(head_) & kWritable));
}

void DiagnosisHistory::read(unsigned subindex) {
    const bool acknowledges = (flags::load(head_) & kAcknowledgeMode) != 0;
    if (!acknowledges && subindex >= kFirstSubindex && subindex == latest::load(head_)) available::store(head_, 0);
}

namespace diagnosis_history {

// nullptr: the device has no diagnosis history.
static DiagnosisHistory* of(const ObjectAccess& access) {
    return access.application != nullptr ? access.application->diagnosis() : nullptr;
}

bool exists(const ObjectAccess& access) { return of(access) != nullptr; }

HookAnswer before_read(const ObjectAccess& access) {
    if (!access.complete) of(access)->read(access.subindex);
    return Abort::none;
}

HookAnswer before_write(const ObjectAccess& access, Bytes data) {
    if (access.complete) return Abort::complete_access_unsupported;
    return of(access)->check_write(access.subindex, data);
}

void after_write(const ObjectAccess& access) { of(access)->written(access.subindex); }

MutableBytes memory(const ObjectAccess& access) {
    auto* const history = of(access);
    return history != nullptr ? history->field(access.subindex) : MutableBytes{};
}

}  // namespace diagnosis_history

}  // namespace margay::subdevice
