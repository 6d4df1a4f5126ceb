// What eepromtool does with an EEPROM, whatever that is: of a slave, in a file, or one that a test makes
// fail.
#pragma once

#include "util/bytes.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

// Errors are sentences, empty where all is well.
class Eeprom {
  public:
    struct Written {
        std::size_t words = 0;  // so many, from the first on, are written and were read back
        std::string error{};
    };

    virtual ~Eeprom() = default;
    Eeprom() = default;
    Eeprom(const Eeprom&) = delete;
    Eeprom& operator=(const Eeprom&) = delete;

    // "slave 3", "x.bin".
    [[nodiscard]] virtual std::string name() const = 0;
    // Whole words from `word` on.
    [[nodiscard]] virtual std::string read(std::uint32_t word, MutableBytes into) = 0;
    [[nodiscard]] virtual Written write(std::uint32_t word, Bytes octets) = 0;
    // How large it is for sure; 0 when only its content can tell.
    [[nodiscard]] virtual std::size_t known_size() const { return 0; }
    // After writing: makes what was written last.
    [[nodiscard]] virtual std::string keep() { return {}; }
};

// Called with what is being done and how much of it; false stops it.
using Progress = std::function<bool(std::string_view what, std::size_t done, std::size_t total)>;
[[nodiscard]] inline Progress no_progress() {
    return [](std::string_view, std::size_t, std::size_t) { return true; };
}

struct EepromSize {
    std::size_t octets = 0;
    std::string error{};
};
// The size that is known, or else the one that word 0x3E tells; an error when that word is blank.
[[nodiscard]] EepromSize eeprom_size(Eeprom& eeprom);

struct EepromContent {
    std::vector<std::byte> octets{};
    std::string error{};
};
// The first `octets` octets.
[[nodiscard]] EepromContent read_eeprom(Eeprom& eeprom, std::size_t octets, const Progress& progress);
// Up to the end mark of the categories, the mark included, or up to where the chain of categories is broken; and never
// more than 64 KiB, whatever the size word says. What lies behind belongs to nobody: read_eeprom() reads that too.
[[nodiscard]] EepromContent read_described(Eeprom& eeprom, const Progress& progress);

// What is so wrong with an image that no slave should get it; empty when nothing is. What the strict check
// finds beyond that is for the user to judge.
[[nodiscard]] std::string why_not_to_write(Bytes image);

struct WriteReport {
    std::size_t words = 0;      // of the image
    std::size_t different = 0;  // had to be written
    std::size_t written = 0;    // were written for sure before it ended: each was read back
    bool verified = false;      // in the end the whole image was read back and is right
    bool restored = false;      // it failed, and the old content is there again: it was read back
    std::string error{};
    std::string left{};  // after an error: what the EEPROM holds now, in words; empty where nothing was written
};
// Writes the words that differ, the configuration area (words 0x00–0x07) last, so that its checksum vouches for no
// half-written image (wire/sii_area.hpp); then reads all of it back. When a word fails, when `progress` stops it, and
// when other words are read back than were written (an EEPROM that is smaller than it says wraps its addresses around),
// all words that were written get their old content again. Between the first and the last changed word of the
// configuration area an end of power or of the connection leaves a wrong checksum, which the ESC tells and does not
// load.
[[nodiscard]] WriteReport write_eeprom(Eeprom& eeprom, Bytes image, const Progress& progress);

struct AliasReport {
    std::uint16_t before = 0;
    std::uint16_t after = 0;
    std::string error{};
};
[[nodiscard]] AliasReport read_alias(Eeprom& eeprom);
// Writes the alias and the checksum that goes with it, and reads both back. An area whose checksum is wrong
// already is left as it is, unless `force` says so: a right one would vouch for whatever is in it.
[[nodiscard]] AliasReport write_alias(Eeprom& eeprom, std::uint16_t alias, bool force);

// A file as it is read and written: octets as they are, or Intel HEX.
enum class ImageFormat : std::uint8_t { binary, intel_hex };
[[nodiscard]] ImageFormat format_by_name(std::string_view path);  // .hex, .ihex and .ihx are Intel HEX

struct ImageFile {
    std::vector<std::byte> octets{};
    ImageFormat format = ImageFormat::binary;
    std::string error{};
};
// `path` - is standard input. Which of the formats it is, is seen from the content.
[[nodiscard]] ImageFile load_image(const std::string& path);
// `path` - is standard output. Other than that: the file is as it was when this fails.
[[nodiscard]] std::string save_image(const std::string& path, ImageFormat format, Bytes image);

// An image file as an EEPROM; keep() writes it back in the format that it had.
class FileEeprom final : public Eeprom {
  public:
    FileEeprom(std::string path, ImageFile file) : path_(std::move(path)), file_(std::move(file)) {}

    [[nodiscard]] std::string name() const override { return path_; }
    [[nodiscard]] std::string read(std::uint32_t word, MutableBytes into) override;
    [[nodiscard]] Written write(std::uint32_t word, Bytes octets) override;
    [[nodiscard]] std::size_t known_size() const override { return file_.octets.size(); }
    [[nodiscard]] std::string keep() override { return save_image(path_, file_.format, file_.octets); }

  private:
    std::string path_;
    ImageFile file_;
};

}  // namespace margay::samples
