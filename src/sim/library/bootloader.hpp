// "bootloader" and "bootloader_open": devices whose firmware is replaced by FoE in BOOT.
#pragma once

#include "sim/library/model.hpp"
#include "sim/library/sii_revision.hpp"

#include <optional>
#include <vector>

namespace margay::sim {

class Bootloader : public Model, private subdevice::FoeStore {
  public:
    static constexpr std::uint32_t kPassword = 0x4D47;
    static constexpr std::size_t kFlashBytes = 256 * 1024;
    static constexpr std::uint32_t kProduct = 0x5B00;
    static constexpr std::uint32_t kOpenProduct = 0x5B01;

    // The properties in which the devices differ.
    struct Variant {
        const subdevice::DeviceDescription* description = nullptr;
        std::optional<std::uint32_t> password{};
        std::size_t flash_bytes = kFlashBytes;
    };

    // A firmware image: this header, followed by code.
    struct ImageLayout {
        static constexpr std::uint32_t kMagic = 0x5746474D;  // "MGFW"
        using magic = Field<std::uint32_t, 0>;
        using checksum = Field<std::uint32_t, 4>;  // CRC-32 of all following octets
        using product = Field<std::uint32_t, 8>;
        using minor = Field<std::uint16_t, 12>;
        using major = Field<std::uint16_t, 14>;
        static constexpr std::size_t bytes = 16;
    };
    [[nodiscard]] static std::vector<std::byte> make_image(std::uint16_t major, std::uint16_t minor,
                                                           std::size_t code_bytes, std::uint32_t product = kProduct);

    explicit Bootloader(const Variant& variant);
    [[nodiscard]] const subdevice::DeviceDescription& description() const override;
    void start(const Surroundings& around, Time now) override;
    void cycle(Time now, bool outputs_valid) override;
    [[nodiscard]] subdevice::Verdict may(subdevice::Transition transition, Time now) override;
    void after(subdevice::Transition transition, Time now) override;
    [[nodiscard]] subdevice::FoeStore* files() override { return this; }
    [[nodiscard]] bool wants_restart() override;

    // Writes the revision of a new firmware to the SII.
    Time advance(Time now) override { return sii_revision_.advance(now); }
    // Object 0x100A: the version of the executing firmware.
    [[nodiscard]] MutableBytes version_text() { return MutableBytes(text_).first(text_bytes_); }

  private:
    subdevice::FoeAnswer open_to_read(const subdevice::FoeFile& file, Time now) override;
    subdevice::FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time now) override;
    subdevice::FoeAnswer open_to_write(const subdevice::FoeFile& file, Time now) override;
    subdevice::FoeAnswer write(std::size_t offset, Bytes data, Time now) override;
    subdevice::FoeAnswer finish_write(std::size_t bytes, Time now) override;
    void give_up() override { finishing_ = false; }

    // Checks an image. Returns go(), or the error.
    [[nodiscard]] subdevice::FoeAnswer check_image(Bytes image) const;
    [[nodiscard]] subdevice::FoeAnswer check(const subdevice::FoeFile& file) const;
    [[nodiscard]] subdevice::FoeAnswer busy(Time now, Duration all, std::string_view what) const;

    const Variant& variant_;
    SiiRevision sii_revision_;
    MutableBytes image_;
    std::vector<std::byte> flash_;  // keeps its content without power
    std::array<std::byte, 16> text_{};
    std::size_t text_bytes_ = 0;
    Time started_{};
    Time busy_until_{};
    bool valid_ = false;   // the flash contains a valid image
    bool loaded_ = false;  // the image in the flash is new
    bool finishing_ = false;
    bool restart_ = false;
};

}  // namespace margay::sim
