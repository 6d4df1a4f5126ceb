// Process data of a simulated device, copied from and to the SyncManagers that the master has configured.
#pragma once

#include "sim/firmware.hpp"
#include "wire/sync_manager.hpp"

#include <vector>

namespace margay::sim {

class ProcessDataFirmware : public Firmware {
  public:
    // The inputs and outputs of the device, with all SyncManagers of one direction in sequence. The master sees new
    // inputs after poke(). The length of both spans is the length that the master has configured, and changes with it.
    [[nodiscard]] virtual MutableBytes inputs() { return MutableBytes(inputs_).first(input_bytes_); }
    [[nodiscard]] virtual Bytes outputs() { return Bytes(outputs_).first(output_bytes_); }
    // Writes the inputs into the SyncManager buffers.
    virtual void poke() { write_inputs(); }
    [[nodiscard]] ProcessDataFirmware* process_data() override { return this; }

  protected:
    void begin(subdevice::EscAccess& esc);
    // The inputs of this SyncManager are one octet of plain memory at `start` (see SyncManagers::any_single()): the
    // device writes them continuously, like digital inputs, also while the SyncManager is off.
    void show_always(std::uint8_t sync_manager, std::uint16_t start);
    // Reads the configuration of the SyncManagers. Call it when a SyncManager was activated or deactivated.
    void configure();
    void write_inputs();
    void read_outputs();
    // Sets the outputs to zero, their safe value.
    void clear_outputs();

  private:
    static constexpr std::size_t kMaxBytes = 8192;
    struct Channel {
        std::uint16_t start = 0;
        std::uint16_t length = 0;
        bool outputs = false;
    };

    subdevice::EscAccess* esc_ = nullptr;
    std::vector<std::byte> inputs_ = std::vector<std::byte>(kMaxBytes);
    std::vector<std::byte> outputs_ = std::vector<std::byte>(kMaxBytes);
    std::array<Channel, 16> channels_{};
    std::array<std::uint16_t, 16> live_{};  // start of the octet that is always shown, by SyncManager; 0: none
    std::size_t channel_count_ = 0;
    std::size_t input_bytes_ = 0;
    std::size_t output_bytes_ = 0;
};

}  // namespace margay::sim
