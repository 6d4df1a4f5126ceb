#include "load.hpp"

#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace margay::bench {
namespace {

void compute() {
    volatile std::uint64_t sum = 1;
    for (;;) sum = sum * 6364136223846793005U + 1442695040888963407U;
}

// Copies more memory than the caches can contain.
void copy_memory() {
    constexpr std::size_t kOctets = std::size_t{64} << 20;
    std::vector<char> from(kOctets, 1);
    std::vector<char> to(kOctets);
    for (;;) {
        std::memcpy(to.data(), from.data(), kOctets);
        from[static_cast<unsigned char>(to[7])] ^= 1;
    }
}

void send_frames() {
    const int in = ::socket(AF_INET, SOCK_DGRAM, 0);
    const int out = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    if (::bind(in, any, size) != 0 || ::getsockname(in, any, &size) != 0 || ::connect(out, any, size) != 0) return;
    std::array<char, 1400> octets{};
    for (;;) {
        if (::send(out, octets.data(), octets.size(), 0) < 0) continue;
        (void)::recv(in, octets.data(), octets.size(), 0);
    }
}

}  // namespace

bool Load::start_one(void (*work)(), std::string& why) {
    const pid_t parent = ::getpid();
    const pid_t child = ::fork();
    if (child < 0) {
        why = std::strerror(errno);
        return false;
    }
    if (child == 0) {
        const sched_param none{};
        (void)::sched_setscheduler(0, SCHED_OTHER, &none);
        if (::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == parent) work();
        ::_exit(1);
    }
    processes_.push_back(child);
    return true;
}

bool Load::start(std::string_view kind, std::string& why) {
    void (*const work)() = kind == "cpu"       ? compute
                           : kind == "memory"  ? copy_memory
                           : kind == "network" ? send_frames
                                               : nullptr;
    if (work == nullptr) {
        why = "there is no load \"" + std::string(kind) + "\"; there are: cpu, memory, network";
        return false;
    }
    if (kind == "network" && std::system("ip link set lo up") != 0) {
        why = "the loopback interface cannot be switched on";
        return false;
    }
    const long processors = kind == "network" ? 1 : ::sysconf(_SC_NPROCESSORS_ONLN);
    for (long n = 0; n < processors; ++n)
        if (!start_one(work, why)) return false;
    return true;
}

void Load::stop() {
    for (const pid_t process : processes_) (void)::kill(process, SIGKILL);
    for (const pid_t process : processes_) (void)::waitpid(process, nullptr, 0);
    processes_.clear();
}

}  // namespace margay::bench
