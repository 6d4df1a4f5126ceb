// Process data of a simulated device: copied from and to whatever SyncManagers the master has set up for it.
#pragma once

#include "sim/firmware.hpp"
#include "wire/sync_manager.hpp"

#include <vector>

namespace margay::sim {

class ProcessDataFirmware : public Firmware {
  public:
    // What the device measures and what it was told, all SyncManagers of a direction one behind the other.
    // Setting is seen by the master after poke(); both spans are as long as the master has configured, and
    // change with that.
    [[nodiscard]] virtual MutableBytes inputs() { return MutableBytes(inputs_).first(input_bytes_); }
    [[nodiscard]] virtual Bytes outputs() { return Bytes(outputs_).first(output_bytes_); }
    // Puts the inputs where the master finds them.
    virtual void poke() { write_inputs(); }
    [[nodiscard]] ProcessDataFirmware* process_data() override { return this; }

  protected:
    void begin(subdevice::EscAccess& esc);
    // Looks at the SyncManagers anew. To be called when one was switched on or off.
    void configure();
    void write_inputs();
    void read_outputs();
    // Outputs go to their safe value.
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
    std::size_t channel_count_ = 0;
    std::size_t input_bytes_ = 0;
    std::size_t output_bytes_ = 0;
};

}  // namespace margay::sim
