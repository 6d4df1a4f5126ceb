#include "attach/listener.hpp"

#include "attach/socket_address.hpp"

#include <grp.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace margay::attach {
namespace {

std::string failed(const std::string& path, const char* what) {
    return path + ": " + what + ": " + std::strerror(errno);
}

// Connects to the socket, and returns the error number; 0: a program serves the socket.
int connection_error(const SocketAddress& address) {
    const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (probe < 0) return errno;
    const int why = ::connect(probe, address.pointer(), address.bytes()) == 0 ? 0 : errno;
    ::close(probe);
    return why;
}

// The same for a socket whose mode does not permit this user to connect, because a program has given its socket to
// another user. For the attempt, the socket is given to this user, if the system permits that.
int connection_error_as_owner(const std::string& path, const SocketAddress& address, const struct stat& found) {
    constexpr mode_t kPermissions = 0777;
    if (::lchown(path.c_str(), ::geteuid(), static_cast<gid_t>(-1)) != 0) return EACCES;
    const int why = ::chmod(path.c_str(), S_IRUSR | S_IWUSR) == 0 ? connection_error(address) : EACCES;
    if (why == ECONNREFUSED) return why;  // the caller removes the socket
    (void)::chmod(path.c_str(), found.st_mode & kPermissions);
    (void)::lchown(path.c_str(), found.st_uid, static_cast<gid_t>(-1));
    return why;
}

}  // namespace

Listener::~Listener() { close(); }

void Listener::close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    struct stat found {};
    if (bound_ && ::lstat(path_.c_str(), &found) == 0 && S_ISSOCK(found.st_mode) && found.st_ino == inode_)
        ::unlink(path_.c_str());
    bound_ = false;
}

std::string Listener::open(const std::string& path, const AttachSettings& settings) {
    path_ = path;
    if (settings.clients < 1 || settings.clients > 32)
        return path + ": " + std::to_string(settings.clients) + " clients are wanted, and 1 to 32 are possible";
    if (settings.transfer_bytes > (std::size_t{1} << 30)) return path + ": transfers have at most 1 GiB";
    auto error = bind_and_listen(settings);
    if (!error.empty()) close();
    return error;
}

// Removes a socket that no program serves, which refuses connections. Any other file is not changed.
std::string Listener::replace_left_behind() {
    struct stat found {};
    if (::lstat(path_.c_str(), &found) != 0) return {};
    if (!S_ISSOCK(found.st_mode)) return path_ + ": is there and is no socket";
    SocketAddress address;
    if (auto error = address.set(path_); !error.empty()) return error;
    int why = connection_error(address);
    if (why == EACCES || why == EPERM) why = connection_error_as_owner(path_, address, found);
    if (why == EACCES || why == EPERM)
        return path_ + ": is a socket that does not let this user in; whether a program serves it is unknown";
    if (why != ECONNREFUSED) return path_ + ": another program serves this socket";
    if (::unlink(path_.c_str()) != 0) return failed(path_, "the socket of an ended program cannot be removed");
    return {};
}

std::string Listener::set_access(const AttachSettings& settings) const {
    uid_t user = static_cast<uid_t>(-1);
    gid_t group = static_cast<gid_t>(-1);
    if (!settings.owner.empty()) {
        const auto* entry = ::getpwnam(settings.owner.c_str());
        if (entry == nullptr) return path_ + ": there is no user '" + settings.owner + "'";
        user = entry->pw_uid;
    }
    if (!settings.group.empty()) {
        const auto* entry = ::getgrnam(settings.group.c_str());
        if (entry == nullptr) return path_ + ": there is no group '" + settings.group + "'";
        group = entry->gr_gid;
    }
    // The permissions are set before the owner, because afterwards the file may belong to another user.
    if (::chmod(path_.c_str(), settings.mode & 0777U) != 0) return failed(path_, "its permissions cannot be set");
    if ((!settings.owner.empty() || !settings.group.empty()) && ::lchown(path_.c_str(), user, group) != 0)
        return failed(path_, "its owner cannot be set");
    return {};
}

// No client can connect before listen(), and the permissions are right by then.
std::string Listener::bind_and_listen(const AttachSettings& settings) {
    SocketAddress address;
    if (auto error = address.set(path_); !error.empty()) return error;
    if (auto error = replace_left_behind(); !error.empty()) return error;
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd_ < 0) return failed(path_, "no socket");
    if (::bind(fd_, address.pointer(), address.bytes()) != 0) return failed(path_, "cannot be bound");
    struct stat found {};
    if (::lstat(path_.c_str(), &found) != 0) return failed(path_, "cannot be found");
    inode_ = found.st_ino;
    bound_ = true;
    if (auto error = set_access(settings); !error.empty()) return error;
    if (::listen(fd_, 8) != 0) return failed(path_, "cannot listen");
    return {};
}

}  // namespace margay::attach
