// Faults of a device for the tests of subdevice_check, made between its firmware and its ESC.
#pragma once

#include "samples/conformance.hpp"
#include "subdevice/esc_access.hpp"
#include "wire/coe.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <memory>
#include <utility>

namespace margay::samples::conformance {

using Octets = std::vector<std::byte>;

struct Fault {
    std::string_view check;  // the check that finds it, as an error
    std::string_view what;
    // Change the data that the firmware writes or reads. `write` returns false to drop a write.
    bool (*write)(std::uint16_t address, Octets& data) = nullptr;
    void (*read)(std::uint16_t address, MutableBytes data) = nullptr;
    // Acts on the ESC beside the firmware, in each step.
    void (*step)(subdevice::EscAccess& esc) = nullptr;
    // Changes chip or SII before the device is switched on.
    void (*prepare)(sim::Device& device) = nullptr;
    Severity severity = Severity::error;
    std::string_view device = "odd_device";
};

// Tables of faults, one for each subject.
[[nodiscard]] std::span<const Fault> machine_faults();
[[nodiscard]] std::span<const Fault> mail_faults();
[[nodiscard]] std::span<const Fault> object_faults();

class FaultyPdi final : public subdevice::EscAccess {
  public:
    FaultyPdi(subdevice::EscAccess& esc, const Fault& fault) : esc_(esc), fault_(fault) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override {
        esc_.read(address, into);
        if (fault_.read != nullptr) fault_.read(address, into);
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        Octets octets(data.begin(), data.end());
        if (fault_.write == nullptr || fault_.write(address, octets)) esc_.write(address, octets);
    }
    Time now() noexcept override { return esc_.now(); }

  private:
    subdevice::EscAccess& esc_;
    const Fault& fault_;
};

class FaultyFirmware final : public sim::Firmware {
  public:
    FaultyFirmware(std::unique_ptr<sim::Firmware> inner, const Fault& fault)
        : inner_(std::move(inner)), fault_(fault) {}
    void start(subdevice::EscAccess& esc, Time now) override {
        pdi_ = std::make_unique<FaultyPdi>(esc, fault_);
        inner_->start(*pdi_, now);
    }
    Time step(Time now) override {
        const auto next = inner_->step(now);
        if (fault_.step == nullptr) return next;
        fault_.step(*pdi_);
        return std::min(next, now + std::chrono::milliseconds(1));
    }

  private:
    std::unique_ptr<sim::Firmware> inner_;
    const Fault& fault_;
    std::unique_ptr<FaultyPdi> pdi_;
};

// In a write of the AL status code, one code instead of another.
template <std::uint16_t From, std::uint16_t To>
bool replace_code(std::uint16_t address, Octets& data) {
    if (address == reg::kAlStatusCode.address && load_le<std::uint16_t>(data, 0) == From)
        store_le<std::uint16_t>(data, 0, To);
    return true;
}
// The error indication is never set.
inline bool no_error_bit(std::uint16_t address, Octets& data) {
    if (address == reg::kAlStatus.address) data[0] &= ~std::byte{wire::al::kErrorIndication};
    return true;
}
// Returns whether the access is a write into the send mailbox of the odd device.
inline bool is_mail(std::uint16_t address, const Octets& data) { return address == 0x1400 && data.size() > 8; }
inline bool is_service(std::uint16_t address, const Octets& data, coe::Service service) {
    return is_mail(address, data) && data.size() >= 14 && (std::to_integer<unsigned>(data[5]) & 0x0F) == 3 &&
           coe::load_header(Bytes(data).subspan(6)).service == service;
}
template <std::uint32_t From, std::uint32_t To>
bool replace_abort(std::uint16_t address, Octets& data) {
    if (is_mail(address, data))
        for (std::size_t at = 6; at + 4 <= data.size(); ++at)
            if (load_le<std::uint32_t>(data, at) == From) store_le<std::uint32_t>(data, at, To);
    return true;
}
inline bool replace_error_detail(std::uint16_t address, Octets& data) {
    if (is_mail(address, data) && (std::to_integer<unsigned>(data[5]) & 0x0F) == 0) data[8] = std::byte{0x77};
    return true;
}
// An SDO information response of one opcode.
inline bool is_information(std::uint16_t address, const Octets& data, coe::InfoOpcode opcode) {
    return is_service(address, data, coe::Service::sdo_information) &&
           (std::to_integer<unsigned>(data[8]) & 0x7F) == static_cast<unsigned>(opcode);
}
// The first SDO response of an upload of this object.
inline bool is_upload(std::uint16_t address, const Octets& data, std::uint16_t index, std::uint8_t subindex) {
    return is_service(address, data, coe::Service::sdo_response) && data.size() >= 16 &&
           (std::to_integer<unsigned>(data[8]) >> 5) == coe::response::kUpload &&
           load_le<std::uint16_t>(data, 9) == index && std::to_integer<unsigned>(data[11]) == subindex;
}
// The first response of an upload by complete access, from this subindex on.
inline bool is_whole(std::uint16_t address, const Octets& data, std::uint16_t index, std::uint8_t from = 0) {
    return is_upload(address, data, index, from) && (data[8] & std::byte{0x10}) != std::byte{0};
}
// Complete access to one object is refused.
template <std::uint16_t Index, std::uint32_t Code>
bool refuse_whole(std::uint16_t address, Octets& data) {
    if (!is_whole(address, data, Index)) return true;
    store_le(MutableBytes(data), 0, std::uint16_t{coe::kSdoBytes});
    coe::store_header(MutableBytes(data).subspan(6), {0, coe::Service::sdo_request});
    data[8] = std::byte{0x80};
    store_le(MutableBytes(data), 12, Code);
    return true;
}
// The SII does not announce complete access.
inline void hide_complete_access(sim::Device& device) {
    const auto general = wire::sii::find_category(device.sii, wire::sii::category::kGeneral);
    ASSERT_TRUE(general);
    const auto at = static_cast<std::size_t>(general->data() - device.sii.data()) + 5;
    ASSERT_NE(device.sii[at] & std::byte{coe_detail::kCompleteAccess}, std::byte{0});
    device.sii[at] &= ~std::byte{coe_detail::kCompleteAccess};
}
// Changes the data that the firmware reads at one address.
template <std::uint16_t Address, unsigned Set, unsigned Cleared = 0>
void read_bits(std::uint16_t address, MutableBytes data) {
    if (address <= Address && Address < address + data.size()) {
        auto& octet = data[Address - address];
        octet = (octet | std::byte{Set}) & ~std::byte{Cleared};
    }
}
// The firmware always reads the expected settings of a SyncManager.
template <unsigned N, std::uint16_t Start, std::uint16_t Length, std::uint8_t Control>
void read_right_sync_manager(std::uint16_t address, MutableBytes data) {
    const auto at = reg::sync_manager(N).address;
    if (address > at || at + 8U > address + data.size()) return;
    wire::store_sync_manager(data.subspan(at - address, 8), {Start, Length, Control, 1});
}

// The AL status that the firmware has written last. In one status, the firmware reads another request than the master
// has written.
inline std::byte al_status_now{};
inline bool note_status(std::uint16_t address, Octets& data) {
    if (address == reg::kAlStatus.address) al_status_now = data[0];
    return true;
}
template <unsigned Status, unsigned Request, unsigned Other>
void read_request(std::uint16_t address, MutableBytes data) {
    if (al_status_now == std::byte{Status} && address == reg::kAlControl.address && data[0] == std::byte{Request})
        data[0] = std::byte{Other};
}

// True if SAFEOP or OP was reached and left for PREOP since INIT.
inline bool was_up = false;
inline bool note_up(std::uint16_t address, Octets& data) {
    static std::byte before{};
    if (address != reg::kAlStatus.address) return true;
    was_up = data[0] != std::byte{1} && (was_up || (before > std::byte{3} && data[0] == std::byte{2}));
    before = data[0];
    return true;
}

// An aborted SDO download of this subindex looks like a success.
template <std::uint16_t Index, std::uint8_t Subindex, std::uint16_t Mailbox = 0x1400>
bool grant(std::uint16_t address, Octets& data) {
    if (address != Mailbox || data.size() < 16 || data[8] != std::byte{0x80}) return true;
    if (load_le<std::uint16_t>(data, 9) != Index || data[11] != std::byte{Subindex}) return true;
    coe::store_header(MutableBytes(data).subspan(6), {0, coe::Service::sdo_response});
    data[8] = std::byte{0x60};
    store_le<std::uint32_t>(data, 12, 0);
    return true;
}
// An SDO request that the firmware reads from the receive mailbox, behind the header of the mailbox.
inline bool is_request(std::uint16_t address, Bytes data, unsigned command) {
    return address == 0x1006 && data.size() >= 10 && coe::load_header(data).service == coe::Service::sdo_request &&
           std::to_integer<unsigned>(data[2]) == command;
}
inline std::uint16_t al_status_of(subdevice::EscAccess& esc) {
    std::array<std::byte, 2> word{};
    esc.read(reg::kAlStatus.address, word);
    return load_le<std::uint16_t>(word, 0);
}
inline void set_al_status(subdevice::EscAccess& esc, std::uint16_t status, std::uint16_t code) {
    std::array<std::byte, 2> word{};
    store_le(MutableBytes(word), 0, code);
    esc.write(reg::kAlStatusCode.address, word);
    store_le(MutableBytes(word), 0, status);
    esc.write(reg::kAlStatus.address, word);
}
inline bool leave_op = false;      // the last message came in OP
inline bool full_message = false;  // the last message had the size of the mailbox
// True between the begin of an upload in segments and its last segment.
inline bool in_segments = false;
inline bool note_segments(std::uint16_t address, Octets& data) {
    if (!is_service(address, data, coe::Service::sdo_response) || data.size() < 10) return true;
    const auto command = std::to_integer<unsigned>(data[8]);
    if (command >> 5 == coe::response::kUpload) in_segments = (command & 2) == 0;
    if (command >> 5 == 0 && (command & 1) != 0) in_segments = false;
    return true;
}

// The number of segments that an upload has sent. From the second segment on, each request looks as if its toggle bit
// were right.
inline unsigned segments_sent = 0;
inline bool count_segments(std::uint16_t address, Octets& data) {
    if (!is_service(address, data, coe::Service::sdo_response) || data.size() < 10) return true;
    const auto specifier = std::to_integer<unsigned>(data[8]) >> 5;
    if (specifier == coe::response::kUpload) segments_sent = 0;
    if (specifier == coe::response::kUploadSegment) ++segments_sent;
    return true;
}
inline bool ignores_abort = false;  // the client has aborted after the first segment
inline void read_right_toggle(std::uint16_t address, MutableBytes data) {
    if (segments_sent == 0 || (!is_request(address, data, 0x60) && !is_request(address, data, 0x70))) return;
    data[2] = segments_sent % 2 != 0 ? std::byte{0x70} : std::byte{0x60};
}
// A segment of a download that the firmware reads.
inline bool is_download_segment(std::uint16_t address, Bytes data) {
    return address == 0x1006 && data.size() >= 10 && coe::load_header(data).service == coe::Service::sdo_request &&
           (std::to_integer<unsigned>(data[2]) >> 5) == coe::request::kDownloadSegment;
}

// After the device has reported an error, SYNC0 always looks as if it had arrived.
inline bool after_error = false;
inline bool note_any_error(std::uint16_t address, Octets& data) {
    if (address == reg::kAlStatus.address && data[0] == std::byte{0x14}) after_error = true;
    return true;
}
inline void read_sync0_after_error(std::uint16_t address, MutableBytes data) {
    if (after_error) read_bits<0x0220, 0x04>(address, data);
}
// Returns where the content of a category of the SII begins.
inline std::size_t category_at(const sim::Device& device, std::uint16_t type) {
    const auto content = wire::sii::find_category(device.sii, type);
    EXPECT_TRUE(content);
    return content ? static_cast<std::size_t>(content->data() - device.sii.data()) : 0;
}
// Adds SYNC1 to the DC operation modes of the SII with SYNC0.
inline void announce_sync1(sim::Device& device) {
    const auto modes = wire::sii::find_category(device.sii, wire::sii::category::kDc);
    ASSERT_TRUE(modes);
    constexpr std::size_t kModeBytes = 24;
    constexpr std::size_t kAssignActivate = 15;  // the high octet
    const auto first = static_cast<std::size_t>(modes->data() - device.sii.data());
    for (std::size_t at = first + kAssignActivate; at < first + modes->size(); at += kModeBytes)
        if (device.sii[at] == std::byte{3}) device.sii[at] = std::byte{7};
}
// A firmware that needs SYNC1 does not accept SYNC0 alone.
inline void need_sync1(std::uint16_t address, MutableBytes data) {
    if (address == reg::kSyncActivation.address && data[0] == std::byte{3}) data[0] = std::byte{1};
}

// An upload of this subindex gives another number.
template <std::uint16_t Index, std::uint8_t Subindex, std::uint32_t Number>
bool show_number(std::uint16_t address, Octets& data) {
    const bool upload = address == 0x1100 && data.size() >= 16 && data[6] == std::byte{0} &&
                        data[7] == std::byte{0x30} &&
                        (std::to_integer<unsigned>(data[8]) >> 5) == coe::response::kUpload;
    if (upload && load_le<std::uint16_t>(data, 9) == Index && data[11] == std::byte{Subindex})
        store_le(MutableBytes(data), 12, Number);
    return true;
}
// An expedited download of the first configured module reaches the firmware with this low octet.
template <std::uint8_t Octet>
void take_module(std::uint16_t address, MutableBytes data) {
    if (address != 0x1006 || data.size() < 10 || load_le<std::uint16_t>(data, 3) != 0xF030) return;
    if ((std::to_integer<unsigned>(data[2]) >> 5) == coe::request::kDownload && data[5] == std::byte{1})
        data[6] = std::byte{Octet};
}

// A list of configured modules reaches the firmware with the right module in this slot.
template <std::uint8_t Slot, std::uint16_t Ident>
void take_right_module(std::uint16_t address, MutableBytes data) {
    if (address != 0x1006 || data.size() < 10 || load_le<std::uint16_t>(data, 3) != 0xF030) return;
    if ((std::to_integer<unsigned>(data[2]) >> 5) == coe::request::kDownload && data[5] == std::byte{Slot})
        store_le<std::uint32_t>(data, 6, Ident);
}

}  // namespace margay::samples::conformance
