// The address of a Unix socket.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <cstddef>
#include <cstring>
#include <string>

namespace margay::attach {

class SocketAddress {
  public:
    // False: the path is empty or too long.
    [[nodiscard]] bool set(const std::string& path) {
        if (path.empty() || path.size() >= sizeof address_.sun_path) return false;
        address_.sun_family = AF_UNIX;
        std::memcpy(address_.sun_path, path.c_str(), path.size() + 1);
        return true;
    }
    [[nodiscard]] const sockaddr* pointer() const { return reinterpret_cast<const sockaddr*>(&address_); }
    [[nodiscard]] static socklen_t bytes() { return sizeof(sockaddr_un); }

  private:
    sockaddr_un address_{};
};

}  // namespace margay::attach
