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

}  // namespace

NewFile::NewFile(std::string path) : path_(std::move(path)), target_(path_) {
    std::error_code error;
    const auto kind = fs::status(path_, error).type();
    in_place_ = kind == fs::file_type::regular || kind == fs::file_type::not_found;
    const auto canonical = fs::canonical(path_, error);
    existed_ = !error;
    if (existed_) target_ = canonical.string();
    beside_ = in_place_ ? target_ + ".new" : target_;
}

NewFile::~NewFile() {
    std::error_code ignored;
    if (in_place_ && begun_ && !committed_) fs::remove(beside_, ignored);
}

std::string NewFile::write(std::string_view content) {
    if (content.empty() && !in_place_) return {};  // a reader of a pipe would take it for the end
    std::FILE* file = std::fopen(beside_.c_str(), "wb");
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
    if (!in_place_) return {};
    begun_ = true;
    std::error_code error;
    if (existed_) fs::permissions(beside_, fs::status(target_, error).permissions(), error);
    if (std::rename(beside_.c_str(), target_.c_str()) != 0) return file_failure(path_, "cannot be replaced", errno);
    committed_ = true;
    return {};
}

}  // namespace margay::samples
