// A firmware file, read or written as a stream. The whole file is never in memory.
#pragma once

#include "common/new_file.hpp"

#include <margay/stream.hpp>

#include <cstdio>
#include <memory>
#include <string>

namespace margay::samples {

struct CloseFirmware {
    void operator()(std::FILE* file) const { (void)std::fclose(file); }
};
using FirmwareHandle = std::unique_ptr<std::FILE, CloseFirmware>;

// An existing file. Not copyable; error() is empty when the file can be used.
class FirmwareFile final : public ByteSource {
  public:
    explicit FirmwareFile(const std::string& path);
    [[nodiscard]] const std::string& error() const { return error_; }
    [[nodiscard]] std::size_t bytes() const { return bytes_; }
    // Whether pull() was called since the object was created, or since rewind().
    [[nodiscard]] bool asked() const { return asked_; }
    // Restarts with the first octet.
    void rewind();
    Piece pull(std::span<std::byte> into) override;

  private:
    void fail();
    std::string path_;
    FirmwareHandle file_;
    std::size_t bytes_ = 0;
    std::size_t given_ = 0;
    bool asked_ = false;
    std::string error_;
};

// Compares the octets from a slave with a file.
class FirmwareComparison final : public ByteSink {
  public:
    explicit FirmwareComparison(FirmwareFile& file) : file_(file) { file_.rewind(); }
    Taken push(std::span<const std::byte> octets) override;
    // A sentence; empty when all of the file was read back and is equal.
    [[nodiscard]] std::string difference() const;

  private:
    FirmwareFile& file_;
    std::size_t equal_ = 0;
    bool differs_ = false;
};

// A new file, which gets its name when it is complete. An incomplete file is deleted. Symbolic links are kept, see
// target_of().
class FirmwareCopy final : public ByteSink {
  public:
    explicit FirmwareCopy(const std::string& path);
    ~FirmwareCopy();
    FirmwareCopy(const FirmwareCopy&) = delete;
    FirmwareCopy& operator=(const FirmwareCopy&) = delete;
    [[nodiscard]] const std::string& error() const { return error_; }
    Taken push(std::span<const std::byte> octets) override;
    // Writes the rest and gives the file its name. Returns a sentence about an error, or nothing.
    [[nodiscard]] std::string complete();

  private:
    void fail();
    void remove_copy();
    std::string path_;
    FileTarget target_;
    std::string beside_;  // the file that is written; the target itself if it is not a regular file
    FirmwareHandle file_;
    std::string error_;
};

}  // namespace margay::samples
