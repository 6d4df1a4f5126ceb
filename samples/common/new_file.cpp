#include "common/new_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

namespace margay::samples {
namespace {

namespace fs = std::filesystem;

std::string file_failure(const std::string& path, std::string_view what, int error) {
    return fmt::format("{}: {}: {}", path, what, std::strerror(error));
}

// Whether a link, for example /dev/stdout, leads to an open file of a process.
bool is_open_file(fs::path link) {
    constexpr int kMostLinks = 40;
    std::error_code error;
    for (int n = 0; n < kMostLinks && fs::is_symlink(link, error); ++n) {
        const fs::path folder = link.has_parent_path() ? link.parent_path() : fs::path(".");
        if (fs::canonical(folder, error).string().starts_with("/proc/")) return true;
        link = folder / fs::read_symlink(link, error);
    }
    return false;
}

}  // namespace

FileTarget target_of(const std::string& path) {
    FileTarget target{.path = path};
    std::error_code error;
    const auto kind = fs::status(path, error).type();
    target.is_replaced = kind == fs::file_type::regular || kind == fs::file_type::not_found;
    if (!target.is_replaced) return target;
    const auto canonical = fs::canonical(path, error);
    target.existed = !error;
    if (target.existed) target.path = canonical.string();
    if (is_open_file(path))
        target.error = fmt::format("{}: this is a regular file that is open: give its own name", path);
    else if (!target.existed && fs::is_symlink(path, error))
        target.error = fmt::format("{}: this symbolic link leads to no file", path);
    return target;
}

NewFile::NewFile(std::string path)
    : path_(std::move(path)),
      target_(target_of(path_)),
      beside_(target_.is_replaced ? target_.path + ".new" : target_.path) {}

NewFile::~NewFile() {
    std::error_code ignored;
    if (target_.is_replaced && begun_ && !committed_) fs::remove(beside_, ignored);
}

// The first call chooses a name that no file of the user has. The mode "x" does not follow symbolic links.
std::FILE* NewFile::open() {
    if (begun_ || !target_.is_replaced) return std::fopen(beside_.c_str(), "wb");
    constexpr int kMost = 100;
    for (int n = 1;; ++n) {
        std::FILE* file = std::fopen(beside_.c_str(), "wbx");
        if (file != nullptr || errno != EEXIST || n > kMost) return file;
        beside_ = fmt::format("{}.new{}", target_.path, n);
    }
}

std::string NewFile::write(std::string_view content) {
    if (!target_.error.empty()) return target_.error;
    if (content.empty() && !target_.is_replaced) return {};  // the reader of a pipe would get the end of file
    std::FILE* file = open();
    if (file == nullptr) return file_failure(path_, "cannot be written", errno);
    begun_ = true;
    errno = 0;
    const bool written = std::fwrite(content.data(), 1, content.size(), file) == content.size();
    const bool flushed = written && std::fflush(file) == 0;
    int error = errno;
    const bool closed = std::fclose(file) == 0;
    if (flushed && closed) return {};
    if (flushed) error = errno;
    return file_failure(path_, "cannot be written", error);
}

std::string NewFile::commit() {
    if (!target_.is_replaced) return {};
    if (!target_.error.empty()) return target_.error;
    if (!begun_)
        if (auto failed = write({}); !failed.empty()) return failed;
    std::error_code error;
    if (target_.existed) fs::permissions(beside_, fs::status(target_.path, error).permissions(), error);
    if (std::rename(beside_.c_str(), target_.path.c_str()) != 0)
        return file_failure(path_, "cannot be replaced", errno);
    committed_ = true;
    return {};
}

bool is_same_file(const std::string& one, const std::string& other) {
    std::error_code none;
    const auto whole = [&none](const std::string& name) {
        return std::filesystem::weakly_canonical(std::filesystem::absolute(name, none), none);
    };
    return !one.empty() && !other.empty() && whole(one) == whole(other);
}

}  // namespace margay::samples
