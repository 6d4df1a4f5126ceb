// The Unix socket of a server: bound, with its owner and permissions, and removed at the end.
#pragma once

#include <margay/attach/server.hpp>

#include <string>

namespace margay::attach {

class Listener {
  public:
    Listener() = default;
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    // Returns a sentence if the socket cannot be served; empty: the socket listens.
    [[nodiscard]] std::string open(const std::string& path, const AttachSettings& settings);
    [[nodiscard]] int fd() const { return fd_; }

  private:
    void close();  // also removes the socket
    [[nodiscard]] std::string bind_and_listen(const AttachSettings& settings);
    [[nodiscard]] std::string replace_left_behind();
    [[nodiscard]] std::string set_access(const AttachSettings& settings) const;

    int fd_ = -1;
    std::string path_{};
    // The inode of the socket in the file system, so that close() does not remove the socket of another program.
    unsigned long long inode_ = 0;
    bool bound_ = false;
};

}  // namespace margay::attach
