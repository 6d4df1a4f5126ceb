#include "common/firmware_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace margay::samples {
namespace fs = std::filesystem;

namespace {

std::string failure_of(const std::string& path, std::string_view what) {
    return fmt::format("{}: {}: {}", path, what, std::strerror(errno));
}

std::uint32_t number_of_failure() { return errno != 0 ? static_cast<std::uint32_t>(errno) : 1U; }

}  // namespace

FirmwareFile::FirmwareFile(const std::string& path) : path_(path) {
    std::error_code failed;
    if (fs::is_directory(path, failed)) {
        error_ = fmt::format("{}: this is a folder", path);
        return;
    }
    file_.reset(std::fopen(path.c_str(), "rb"));
    const bool opened = file_ != nullptr && std::fseek(file_.get(), 0, SEEK_END) == 0;
    const long end = opened ? std::ftell(file_.get()) : -1;
    if (end < 0) {
        fail();
        return;
    }
    bytes_ = static_cast<std::size_t>(end);
    if (bytes_ == 0) error_ = fmt::format("{}: the file is empty", path);
    rewind();
}

void FirmwareFile::fail() { error_ = failure_of(path_, "cannot be read"); }

void FirmwareFile::rewind() {
    if (file_ != nullptr) std::rewind(file_.get());
    given_ = 0;
    asked_ = false;
}

ByteSource::Piece FirmwareFile::pull(std::span<std::byte> into) {
    asked_ = true;
    errno = 0;
    const std::size_t wanted = std::min(into.size(), bytes_ - given_);
    const std::size_t got = std::fread(into.data(), 1, wanted, file_.get());
    if (got < wanted) {
        const std::uint32_t number = number_of_failure();
        if (std::ferror(file_.get()) != 0)
            fail();
        else
            error_ = fmt::format("{}: the file became shorter while it was read", path_);
        return {.failure = number};
    }
    given_ += got;
    return {.bytes = got, .last = given_ == bytes_};
}

ByteSink::Taken FirmwareComparison::push(std::span<const std::byte> octets) {
    std::array<std::byte, 2048> own{};
    std::size_t done = 0;
    while (done < octets.size() && !differs_) {
        const std::size_t part = std::min(octets.size() - done, own.size());
        const ByteSource::Piece piece = file_.pull(std::span(own).first(part));
        if (piece.failure != 0 && !file_.error().empty() && equal_ + done < file_.bytes())
            return {.failure = piece.failure};
        const auto theirs = octets.subspan(done, part);
        const auto end = std::mismatch(theirs.begin(), theirs.end(), own.begin(),
                                       own.begin() + static_cast<std::ptrdiff_t>(piece.bytes));
        const auto same = static_cast<std::size_t>(end.first - theirs.begin());
        equal_ += same;
        differs_ = same < part;
        done += part;
    }
    return {.bytes = octets.size()};
}

std::string FirmwareComparison::difference() const {
    if (differs_) return fmt::format("octet {} differs from the file", equal_);
    if (equal_ < file_.bytes()) return fmt::format("the device returned {} of {} octets", equal_, file_.bytes());
    return {};
}

// A device or a pipe is written directly; it must not be replaced by a file.
FirmwareCopy::FirmwareCopy(const std::string& path) : path_(path), target_(target_of(path)), beside_(target_.path) {
    error_ = target_.error;
    if (!error_.empty()) return;
    if (!target_.is_replaced) {
        file_.reset(std::fopen(path_.c_str(), "wb"));
    } else {  // does not overwrite a file of the user
        beside_ = target_.path + ".new";
        constexpr int kMost = 100;
        for (int n = 1; n <= kMost && file_ == nullptr; ++n) {
            file_.reset(std::fopen(beside_.c_str(), "wbx"));
            if (file_ == nullptr && errno != EEXIST) break;
            if (file_ == nullptr) beside_ = target_.path + ".new" + std::to_string(n);
        }
    }
    if (file_ == nullptr) fail();
}

FirmwareCopy::~FirmwareCopy() {
    if (file_ == nullptr) return;
    file_.reset();
    remove_copy();
}

void FirmwareCopy::remove_copy() {
    std::error_code ignored;
    if (target_.is_replaced) fs::remove(beside_, ignored);
}

void FirmwareCopy::fail() { error_ = failure_of(path_, "cannot be written"); }

ByteSink::Taken FirmwareCopy::push(std::span<const std::byte> octets) {
    errno = 0;
    if (std::fwrite(octets.data(), 1, octets.size(), file_.get()) == octets.size()) return {.bytes = octets.size()};
    const std::uint32_t number = number_of_failure();
    fail();
    return {.failure = number};
}

std::string FirmwareCopy::complete() {
    errno = 0;
    const bool written = std::fclose(file_.release()) == 0;
    if (written && (!target_.is_replaced || std::rename(beside_.c_str(), target_.path.c_str()) == 0)) return {};
    fail();
    remove_copy();
    return error_;
}

}  // namespace margay::samples
