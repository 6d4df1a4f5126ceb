// A file that replaces an older one only when it is complete.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

namespace margay::samples {

// Where a file has to be made that replaces an older one.
struct FileTarget {
    std::string path{};       // behind symbolic links, which stay what they are
    bool is_replaced = true;  // false: no regular file, it is written directly
    bool existed = false;
    std::string error{};  // a sentence, when the path leads to nothing that can be replaced or written
};
[[nodiscard]] FileTarget target_of(const std::string& path);

// The new content is written beside the file, into FILE.new (FILE.new1, … if the user has a file of this name), and
// commit() renames it. Without commit() the older file keeps its content, and the destructor removes FILE.new. What is
// no regular file (a device, a pipe) is written directly. Errors are sentences that name the file as the user does;
// empty when there is no error.
class NewFile {
  public:
    explicit NewFile(std::string path);
    ~NewFile();
    NewFile(const NewFile&) = delete;
    NewFile& operator=(const NewFile&) = delete;

    [[nodiscard]] const std::string& path() const { return path_; }
    // Where the content is written, after the first write(); another writer may write there afterwards.
    [[nodiscard]] const std::string& beside() const { return beside_; }
    // Replaces what was written before.
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

}  // namespace margay::samples
