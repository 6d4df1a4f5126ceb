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
    // The error in words; empty on success.
    [[nodiscard]] std::string set(const std::string& path) {
        if (path.empty()) return "the path of the socket is empty";
        if (path.size() >= sizeof address_.sun_path)
            return path + ": the path has " + std::to_string(path.size()) +
                   " octets, and the path of a socket has at most " + std::to_string(sizeof address_.sun_path - 1);
        address_.sun_family = AF_UNIX;
        std::memcpy(address_.sun_path, path.c_str(), path.size() + 1);
        return {};
    }
    [[nodiscard]] const sockaddr* pointer() const { return reinterpret_cast<const sockaddr*>(&address_); }
    [[nodiscard]] static socklen_t bytes() { return sizeof(sockaddr_un); }

  private:
    sockaddr_un address_{};
};

}  // namespace margay::attach
