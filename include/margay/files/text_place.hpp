// Remarks of the readers of ESI and ENI files about a file, and the result of reading a file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace margay::files {

// A remark about a place of a file. Many ENI files have one line only, so that the column is needed, too.
struct Remark {
    std::uint32_t line = 0;    // the first line is 1; 0: the remark is about the whole file
    std::uint32_t column = 0;  // in octets, the first is 1
    std::string text{};        // one sentence without a full stop
};

// "line 12, column 5: text"
[[nodiscard]] std::string to_text(const Remark& remark);

// The result of reading a file: the value, or the problem that prevented the reading. `remarks` lists all unusual
// contents of the file, and all contents that the reader does not use although they would change the work of the
// master.
template <class T>
struct Read {
    std::optional<T> value{};
    Remark problem{};
    std::vector<Remark> remarks{};

    [[nodiscard]] explicit operator bool() const { return value.has_value(); }
    [[nodiscard]] T& operator*() { return *value; }
    [[nodiscard]] const T& operator*() const { return *value; }
    [[nodiscard]] T* operator->() { return &*value; }
    [[nodiscard]] const T* operator->() const { return &*value; }
};

// The content of a file. `error` is a sentence when the file cannot be read or has more than `most_bytes`.
struct FileContent {
    std::string octets{};
    std::string error{};
};
inline constexpr std::size_t kMostFileBytes = std::size_t{64} * 1024 * 1024;
[[nodiscard]] FileContent read_file(const std::string& path, std::size_t most_bytes = kMostFileBytes);

// The written text, or a sentence with the reason why it could not be written.
struct Written {
    std::string text{};
    std::string error{};
    // Facts about the slaves that the format cannot express, or that the writer does not know: one sentence each.
    std::vector<std::string> remarks{};
    [[nodiscard]] explicit operator bool() const { return error.empty(); }
};

}  // namespace margay::files
