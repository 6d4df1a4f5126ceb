// A file that replaces an older one only when it is complete.
#pragma once

#include <string>
#include <string_view>

namespace margay::samples {

// The new content is written beside the file, into FILE.new, and commit() renames it. Without commit() the older file
// keeps its content, and the destructor removes FILE.new. What is no regular file (a device, a pipe) is written
// directly. Errors are sentences that name the file as the user does; empty when there is no error.
class NewFile {
  public:
    explicit NewFile(std::string path);
    ~NewFile();
    NewFile(const NewFile&) = delete;
    NewFile& operator=(const NewFile&) = delete;

    [[nodiscard]] const std::string& path() const { return path_; }
    // Where the content is written; another writer may write there in the place of write().
    [[nodiscard]] const std::string& beside() const { return beside_; }
    // Replaces what was written before.
    [[nodiscard]] std::string write(std::string_view content);
    [[nodiscard]] std::string commit();

  private:
    std::string path_;    // as the user has written it
    std::string target_;  // behind symbolic links
    std::string beside_;
    bool in_place_ = true;
    bool existed_ = false;
    bool committed_ = false;
    bool begun_ = false;
};

}  // namespace margay::samples
