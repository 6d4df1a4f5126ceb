#include "sim/process_data.hpp"

#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::sim {

namespace reg = wire::reg;

void ProcessDataFirmware::begin(subdevice::EscAccess& esc) {
    esc_ = &esc;
    channel_count_ = input_bytes_ = output_bytes_ = 0;
    live_ = {};
    std::fill(outputs_.begin(), outputs_.end(), std::byte{0});
}

void ProcessDataFirmware::show_always(std::uint8_t sync_manager, std::uint16_t start) {
    if (sync_manager >= live_.size()) return;
    live_[sync_manager] = start;
    configure();
    write_inputs();
}

void ProcessDataFirmware::configure() {
    channel_count_ = input_bytes_ = output_bytes_ = 0;
    const auto count =
        std::min<unsigned>(subdevice::read_register<std::uint8_t>(*esc_, reg::kSyncManagerCount.address), 16);
    for (unsigned n = 0; n < count; ++n) {
        std::array<std::byte, reg::kSyncManagerStride> raw{};
        esc_->read(reg::sync_manager(n).address, raw);
        const auto sm = wire::load_sync_manager(raw);
        const auto off = wire::SyncManagerLayout::pdi_control::load(raw) & wire::sm_pdi_control::kDeactivate;
        if (!sm.enabled() || sm.mailbox() || sm.length_bytes == 0 || off != 0) {
            if (live_[n] != 0) channels_[channel_count_++] = {live_[n], 1, false}, ++input_bytes_;
            continue;
        }
        auto& bytes = sm.ecat_writes() ? output_bytes_ : input_bytes_;
        if (bytes + sm.length_bytes > kMaxBytes) continue;
        channels_[channel_count_++] = {sm.physical_start, sm.length_bytes, sm.ecat_writes()};
        bytes += sm.length_bytes;
    }
}

void ProcessDataFirmware::write_inputs() {
    if (esc_ == nullptr) return;
    std::size_t at = 0;
    for (std::size_t i = 0; i < channel_count_; ++i) {
        const auto& channel = channels_[i];
        if (channel.outputs) continue;
        esc_->write(channel.start, Bytes(inputs_).subspan(at, channel.length));
        at += channel.length;
    }
}

void ProcessDataFirmware::read_outputs() {
    std::size_t at = 0;
    for (std::size_t i = 0; i < channel_count_; ++i) {
        const auto& channel = channels_[i];
        if (!channel.outputs) continue;
        esc_->read(channel.start, MutableBytes(outputs_).subspan(at, channel.length));
        at += channel.length;
    }
}

void ProcessDataFirmware::clear_outputs() { std::fill(outputs_.begin(), outputs_.end(), std::byte{0}); }

}  // namespace margay::sim
