// A file that replaces an older one only when it is complete.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

namespace margay::samples {

// The place where a file must be created that replaces an older file.
struct FileTarget {
    std::string path{};       // the path after following symbolic links, which are kept
    bool is_replaced = true;  // false: not a regular file, written directly
    bool existed = false;
    std::string error{};  // a sentence if the path cannot be replaced or written
};
[[nodiscard]] FileTarget target_of(const std::string& path);

// The new content is written beside the file, into FILE.new (FILE.new1, … if the user has a file of this name), and
// commit() renames it. Without commit() the older file keeps its content, and the destructor removes FILE.new. A file
// that is not regular (a device, a pipe) is written directly. Errors are sentences with the file name of the user;
// empty when there is no error.
class NewFile {
  public:
    explicit NewFile(std::string path);
    ~NewFile();
    NewFile(const NewFile&) = delete;
    NewFile& operator=(const NewFile&) = delete;

    [[nodiscard]] const std::string& path() const { return path_; }
    // The file to which the content is written, valid after the first write(). Another writer may then write to it.
    [[nodiscard]] const std::string& beside() const { return beside_; }
    // Replaces the content that was written before.
    [[nodiscard]] std::string write(std::string_view content);
    [[nodiscard]] std::string commit();

  private:
    [[nodiscard]] std::FILE* open();

    std::string path_;  // as the user has written it
    FileTarget target_;
    std::string beside_;
    bool committed_ = false;
    bool begun_ = false;
};

// Whether both names are of the same file, which may not exist yet.
[[nodiscard]] bool is_same_file(const std::string& one, const std::string& other);

}  // namespace margay::samples
