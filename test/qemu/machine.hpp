// A board in QEMU with a simulated segment at its Ethernet port: a network namespace with a TAP device,
// `virtual_segment` on this device, and QEMU behind it. The destructor ends both programs by their process ids and
// removes the namespace.
#pragma once

#include "process/netns.hpp"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace margay::qemu {

// FOLDER/NAME: the image of samples/mps2_an386 that the test `embedded/mps2_builds` or `embedded/cortex_m0plus_builds`
// has built in its folder.
[[nodiscard]] std::filesystem::path image(const std::string& name);

class Machine {
  public:
    // `more`: further arguments for QEMU.
    explicit Machine(const std::string& image_name, const std::string& more = {});
    ~Machine();
    Machine(const Machine&) = delete;
    Machine& operator=(const Machine&) = delete;

    // The reason why the machine cannot run here; empty: it runs.
    [[nodiscard]] const std::string& missing() const { return missing_; }

    // Waits until the text appears on the UART, after the texts of earlier calls. Returns false when the text has not
    // appeared within `limit`, or when QEMU or the segment has ended.
    [[nodiscard]] bool says(const std::string& text, std::chrono::seconds limit = std::chrono::seconds(120));
    // Everything that the UART and the programs have printed, for the report of a failure.
    [[nodiscard]] std::string report() const;
    [[nodiscard]] std::string uart() const;

    // Send a command to virtual_segment, or to QEMU's monitor.
    void tell_segment(const std::string& command) const;
    void tell_qemu(const std::string& command) const;
    [[nodiscard]] process::Child& segment() { return *segment_; }
    // Reads octets of the board's memory at this address, while the program runs.
    [[nodiscard]] std::string memory(std::uint32_t address, std::uint32_t octets) const;

  private:
    void start(const std::filesystem::path& image_path, const std::string& more);
    [[nodiscard]] std::string file(const std::string& name) const { return (folder_ / name).string(); }

    std::filesystem::path folder_;
    std::string missing_;
    process::Cable cable_;
    std::unique_ptr<process::Child> segment_;
    std::unique_ptr<process::Child> qemu_;
    int segment_commands_ = -1;
    int qemu_commands_ = -1;
    std::size_t seen_ = 0;
};

}  // namespace margay::qemu
