#include "common/interface_claim.hpp"

#include <fmt/format.h>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>

namespace margay::samples {

InterfaceClaim::~InterfaceClaim() {
    for (const int socket : sockets_) ::close(socket);
}

// An abstract socket address belongs to one network namespace, and the kernel releases it when the process ends.
std::string InterfaceClaim::take(const std::string& program, const std::string& source) {
    for (std::size_t begin = 0; begin < source.size();) {
        const std::size_t end = std::min(source.find('+', begin), source.size());
        const std::string interface = source.substr(begin, end - begin);
        begin = end + 1;
        const std::string name = fmt::format("margay/{}/{}", program, interface);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        if (name.size() + 1 > sizeof address.sun_path) continue;  // too long for an interface name
        std::memcpy(address.sun_path + 1, name.data(), name.size());
        const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
        const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        if (socket < 0) return fmt::format("cannot create a socket: {}", std::strerror(errno));
        sockets_.push_back(socket);
        if (::bind(socket, reinterpret_cast<const sockaddr*>(&address), size) == 0) continue;
        if (errno == EADDRINUSE) return fmt::format("{}: another {} uses this interface", interface, program);
        return fmt::format("{}: {}", interface, std::strerror(errno));
    }
    return {};
}

}  // namespace margay::samples
