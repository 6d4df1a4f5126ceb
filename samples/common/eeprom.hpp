// The operations of eepromtool on any EEPROM: of a slave, in a file, or one of a test that reports failures.
#pragma once

#include "util/bytes.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

// An EEPROM. Errors are sentences; empty when there is no error.
class Eeprom {
  public:
    struct Written {
        std::size_t words = 0;  // number of words, from the first one, that were written and read back
        std::string error{};
        bool refused = false;  // the application has refused the access, and has not accessed the slave
    };

    virtual ~Eeprom() = default;
    Eeprom() = default;
    Eeprom(const Eeprom&) = delete;
    Eeprom& operator=(const Eeprom&) = delete;

    // "slave 3", "x.bin".
    [[nodiscard]] virtual std::string name() const = 0;
    // Read and write whole words, starting at `word`.
    [[nodiscard]] virtual std::string read(std::uint32_t word, MutableBytes into) = 0;
    [[nodiscard]] virtual Written write(std::uint32_t word, Bytes octets) = 0;
    // The size in octets if it is certain; 0 when only the content can give it.
    [[nodiscard]] virtual std::size_t known_size() const { return 0; }
    // Call it after the last write: makes the written content permanent.
    [[nodiscard]] virtual std::string keep() { return {}; }
};

// Called with the name of the operation, the amount done and the total. Return false to stop the operation.
using Progress = std::function<bool(std::string_view what, std::size_t done, std::size_t total)>;
[[nodiscard]] inline Progress no_progress() {
    return [](std::string_view, std::size_t, std::size_t) { return true; };
}

struct EepromSize {
    std::size_t octets = 0;
    std::string error{};
};
// The known size, otherwise the size in word 0x3E. An error when this word is blank.
[[nodiscard]] EepromSize eeprom_size(Eeprom& eeprom);

struct EepromContent {
    std::vector<std::byte> octets{};
    std::string error{};
};
// Reads the first `octets` octets.
[[nodiscard]] EepromContent read_eeprom(Eeprom& eeprom, std::size_t octets, const Progress& progress);
// Reads up to and including the end mark of the categories, or up to the point where the chain of categories is
// broken. It never reads more than 64 KiB, whatever the size word says. The octets behind the end mark have no defined
// meaning; read_eeprom() reads them too.
[[nodiscard]] EepromContent read_used_part(Eeprom& eeprom, const Progress& progress);

// Returns why an image must not be written to any slave; empty when it can be written. The strict check finds more
// faults. The user decides whether they matter.
[[nodiscard]] std::string image_fault(Bytes image);

struct WriteReport {
    std::size_t words = 0;      // number of words in the image
    std::size_t different = 0;  // number of words that differ from the EEPROM
    std::size_t written = 0;    // number of words that were certainly written before the end: each was read back
    bool verified = false;      // the whole image was read back at the end and is equal
    bool restored = false;      // writing failed, and the old content was written again and read back
    std::string error{};
    // After an error: a sentence about the present content of the EEPROM; empty when nothing was written.
    std::string left{};
};
// Writes the words that differ, then reads the whole image back. The configuration area (words 0x00–0x07) is written
// last, so that its checksum is not valid for a half-written image (wire/sii_area.hpp). All written words get their
// old content again in these cases: a word fails, `progress` returns false, or the words read back differ from the
// words written (addresses wrap in an EEPROM that is smaller than its size word says). When power or the connection
// fails between the first and the last changed word of the configuration area, the checksum is wrong: the ESC reports
// it and does not load the area.
[[nodiscard]] WriteReport write_eeprom(Eeprom& eeprom, Bytes image, const Progress& progress);

struct AliasReport {
    std::uint16_t before = 0;
    std::uint16_t after = 0;
    std::string error{};
};
[[nodiscard]] AliasReport read_alias(Eeprom& eeprom);
// Writes the alias and the new checksum, and reads both back. When the checksum of the area is already wrong, nothing
// is written unless `force` is set, because a correct checksum would make the unknown content of the area valid.
[[nodiscard]] AliasReport write_alias(Eeprom& eeprom, std::uint16_t alias, bool force);

// The format of a file: plain octets, or Intel HEX.
enum class ImageFormat : std::uint8_t { binary, intel_hex };
[[nodiscard]] ImageFormat format_by_name(std::string_view path);  // .hex, .ihex and .ihx are Intel HEX

struct ImageFile {
    std::vector<std::byte> octets{};
    ImageFormat format = ImageFormat::binary;
    std::string error{};
};
// Reads a file; `path` "-" is standard input. The content decides the format.
[[nodiscard]] ImageFile load_image(const std::string& path);
// Writes a file; `path` "-" is standard output. When writing fails, an existing file keeps its old content.
[[nodiscard]] std::string save_image(const std::string& path, ImageFormat format, Bytes image);

// An image file as an EEPROM. keep() writes the file in the format in which it was read.
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
