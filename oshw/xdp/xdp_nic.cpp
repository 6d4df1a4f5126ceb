#include "oshw/xdp/xdp_nic.hpp"

#include "oshw/xdp/filter_program.hpp"
#include "oshw/xdp/once_free.hpp"
#include "util/text_writer.hpp"
#include "wire/ethernet.hpp"

#include <bpf/bpf.h>
#include <bpf/libbpf.h>
#include <linux/if_link.h>
#include <linux/if_xdp.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>
#include <xdp/xsk.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <new>
#include <utility>

namespace margay {
namespace {

constexpr std::uint32_t kChunkBytes = 2048;    // one frame
constexpr std::uint32_t kReceiveChunks = 256;  // frames that can be received between two calls of receive()
constexpr std::uint32_t kSendChunks = 64;      // frames that can be on their way to the driver
constexpr std::size_t kMemoryBytes = std::size_t{kChunkBytes} * (kReceiveChunks + kSendChunks);
constexpr std::size_t kLeastFrameBytes = 60;   // without the FCS; some drivers do not pad
constexpr std::size_t kMostFrameBytes = 1518;  // with a VLAN tag
constexpr std::uint32_t kQueues = 1024;        // entries of the map: a queue with a higher number cannot be chosen
constexpr std::size_t kTypeAt = 12;            // the EtherType of the frame, or of a VLAN tag
constexpr std::size_t kTagBytes = 4;

// A file descriptor that the destructor closes.
class Handle {
  public:
    Handle() = default;
    explicit Handle(int fd) : fd_(fd) {}
    Handle(Handle&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Handle& operator=(Handle&& other) noexcept {
        std::swap(fd_, other.fd_);
        return *this;
    }
    ~Handle() {
        if (fd_ >= 0) ::close(fd_);
    }
    [[nodiscard]] int get() const { return fd_; }
    [[nodiscard]] explicit operator bool() const { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

// Switches off the messages of libbpf and libxdp on standard error. problem() has the reason of a failure.
class Quiet {
  public:
    Quiet() : before_(libbpf_set_print(nullptr)) {}
    Quiet(const Quiet&) = delete;
    Quiet& operator=(const Quiet&) = delete;
    ~Quiet() { (void)libbpf_set_print(before_); }

  private:
    libbpf_print_fn_t before_;
};

// A thread holds the lock for some instructions, never during a system call. A thread that does not get the lock soon
// gives up, because the thread with the lock may wait for the processor.
class SendLock {
  public:
    explicit SendLock(std::atomic_flag& flag) : flag_(flag) {
        constexpr int kTries = 1000;
        for (int n = 0; n < kTries && !held_; ++n) held_ = !flag_.test_and_set(std::memory_order_acquire);
    }
    SendLock(const SendLock&) = delete;
    SendLock& operator=(const SendLock&) = delete;
    ~SendLock() {
        if (held_) flag_.clear(std::memory_order_release);
    }
    [[nodiscard]] bool held() const { return held_; }

  private:
    std::atomic_flag& flag_;
    bool held_ = false;
};

}  // namespace

// The objects of an open NIC. The members are destroyed from the last to the first.
struct XdpNic::Rings {
    static constexpr std::uint64_t kNoChunk = ~std::uint64_t{0};
    Handle map;
    Handle program;
    Handle attached;  // the program is attached as long as this descriptor is open
    void* memory = MAP_FAILED;
    xsk_umem* umem = nullptr;
    xsk_socket* socket = nullptr;
    xsk_ring_prod fill{};
    xsk_ring_cons completed{};
    xsk_ring_cons received{};
    xsk_ring_prod sent{};
    std::array<std::uint64_t, kSendChunks> free{};  // addresses of the chunks that send() may use
    std::uint32_t free_count = 0;
    std::atomic_flag sending{};
    Mode mode = Mode::automatic;
    std::uint32_t queue = 0;

    ~Rings() {
        take_down();
        if (memory != MAP_FAILED) ::munmap(memory, kMemoryBytes);
    }
    [[nodiscard]] int fd() const { return socket == nullptr ? -1 : xsk_socket__fd(socket); }
    [[nodiscard]] std::byte* at(std::uint64_t chunk) const { return static_cast<std::byte*>(memory) + chunk; }

    void close_socket() {
        if (socket != nullptr) xsk_socket__delete(std::exchange(socket, nullptr));
        if (umem != nullptr) (void)xsk_umem__delete(std::exchange(umem, nullptr));
    }
    void take_down() {
        close_socket();
        attached = Handle();
    }
    int load_program();
    int attach(int interface, Mode wanted);
    int open_socket(const char* interface, Mode wanted);
    int begin();
};

// These return 0, or a negative error number.

int XdpNic::Rings::load_program() {
    map = Handle(bpf_map_create(BPF_MAP_TYPE_XSKMAP, "ethercat", sizeof(std::uint32_t), sizeof(int), kQueues, nullptr));
    if (!map) return -errno;
    const auto code = xdp::filter_program(map.get());
    program = Handle(bpf_prog_load(BPF_PROG_TYPE_XDP, "ethercat", "MIT", code.data(), code.size(), nullptr));
    return program ? 0 : -errno;
}

int XdpNic::Rings::attach(int interface, Mode wanted) {
    bpf_link_create_opts options{};
    options.sz = sizeof options;
    options.flags = wanted == Mode::generic ? XDP_FLAGS_SKB_MODE : XDP_FLAGS_DRV_MODE;
    attached = Handle(bpf_link_create(program.get(), interface, BPF_XDP, &options));
    return attached ? 0 : -errno;
}

int XdpNic::Rings::open_socket(const char* interface, Mode wanted) {
    close_socket();
    xsk_umem_config memory_settings{};
    memory_settings.fill_size = kReceiveChunks;
    memory_settings.comp_size = kSendChunks;
    memory_settings.frame_size = kChunkBytes;
    if (const int e = xsk_umem__create(&umem, memory, kMemoryBytes, &fill, &completed, &memory_settings); e != 0)
        return e;
    xsk_socket_config settings{};
    settings.rx_size = kReceiveChunks;
    settings.tx_size = kSendChunks;
    settings.libxdp_flags = XSK_LIBXDP_FLAGS__INHIBIT_PROG_LOAD;
    settings.bind_flags =
        static_cast<std::uint16_t>(XDP_USE_NEED_WAKEUP | (wanted == Mode::zero_copy ? XDP_ZEROCOPY : XDP_COPY));
    return xsk_socket__create(&socket, interface, queue, umem, &received, &sent, &settings);
}

// Gives the kernel the chunks for received frames, and connects the socket to the program.
int XdpNic::Rings::begin() {
    std::uint32_t at = 0;
    if (xsk_ring_prod__reserve(&fill, kReceiveChunks, &at) != kReceiveChunks) return -ENOSPC;
    for (std::uint32_t n = 0; n < kReceiveChunks; ++n)
        *xsk_ring_prod__fill_addr(&fill, at + n) = std::uint64_t{kChunkBytes} * n;
    xsk_ring_prod__submit(&fill, kReceiveChunks);
    free_count = 0;
    for (std::uint32_t n = 0; n < kSendChunks; ++n)
        free[free_count++] = std::uint64_t{kChunkBytes} * (kReceiveChunks + n);
    const int own = fd();
    return bpf_map_update_elem(map.get(), &queue, &own, 0) == 0 ? 0 : -errno;
}

XdpNic::XdpNic() noexcept = default;
XdpNic::~XdpNic() = default;

void XdpNic::close() noexcept {
    rings_.reset();
    interface_.close();
}

Result<> XdpNic::open(std::string_view interface, const Settings& settings) noexcept {
    close();
    last_error_ = 0;
    auto done = interface_.open(interface);
    if (done) done = interface_.check();
    if (!done) {
        last_error_ = static_cast<int>(done.error().actual);
        return done;
    }
    source_mac_ = interface_.address();
    source_mac_[0] &= 0xFC;
    const Quiet quiet;
    done = set_up(settings);
    if (!done) close();
    return done;
}

Result<> XdpNic::fail(int error, std::string_view what, std::string_view advice) noexcept {
    last_error_ = error;
    return interface_.fail(error, what, advice);
}

namespace {

struct SystemClock {
    [[nodiscard]] static std::chrono::steady_clock::time_point now() { return std::chrono::steady_clock::now(); }
    static void wait(std::chrono::milliseconds time) { ::poll(nullptr, 0, static_cast<int>(time.count())); }
};

bool is_refused_mode(int error) {
    return error == -EOPNOTSUPP || error == -EINVAL || error == -EPROTONOSUPPORT || error == -ENOTSUP;
}

}  // namespace

Result<> XdpNic::set_up(const Settings& settings) noexcept {
    rings_.reset(new (std::nothrow) Rings);
    if (!rings_) return fail(ENOMEM, "no memory");
    Rings& rings = *rings_;
    rings.queue = settings.queue;
    if (settings.queue >= kQueues) return fail(EINVAL, "its receive queue does not exist", "queue 0 always exists");
    rings.memory =
        ::mmap(nullptr, kMemoryBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (rings.memory == MAP_FAILED) return fail(errno, "no memory for its frames");
    int error = rings.load_program();
    const auto not_permitted = [&] {
        last_error_ = EPERM;
        return interface_.fail_no_permission(
            "no permission for XDP, the capabilities CAP_BPF, CAP_NET_ADMIN and CAP_NET_RAW are needed",
            "cap_bpf,cap_net_admin,cap_net_raw");
    };
    if (error == -EPERM || error == -EACCES) return not_permitted();
    if (error != 0) return fail(-error, "the kernel refused the filter program for XDP");
    const char* step = "";
    for (const Mode mode : {Mode::zero_copy, Mode::copy, Mode::generic}) {
        if (settings.mode != Mode::automatic && settings.mode != mode) continue;
        rings.take_down();
        rings.mode = mode;
        step = mode == Mode::generic ? "the kernel refused XDP in generic mode" : "its driver refused XDP";
        error = once_free(SystemClock{}, [&] { return rings.attach(interface_.index(), mode); });
        if (error == 0) {
            step = mode == Mode::zero_copy ? "its driver refused XDP without copies" : "its XDP socket was refused";
            error = once_free(SystemClock{}, [&] { return rings.open_socket(interface_.name(), mode); });
        }
        if (error == 0) break;
        if (!is_refused_mode(error)) break;
    }
    if (error == 0) error = rings.begin();
    switch (error) {
        case 0: return {};
        case -EPERM:
        case -EACCES: return not_permitted();
        case -EEXIST:  // a program in another mode
        case -EBUSY: {
            std::array<char, 240> advice{};
            TextWriter text(advice);
            if (!rings.attached)
                text << "see it with: ip link show dev " << interface_.name()
                     << "; detach one that is left over with: ip link set dev " << interface_.name()
                     << " xdp off (a program that is attached by a BPF link ends with the process that attached it)";
            else
                text << "another program has it, or choose another queue";
            return rings.attached ? fail(EBUSY, "its receive queue has an XDP socket already", text.text())
                                  : fail(EBUSY, "another XDP program is attached to it", text.text());
        }
        case -ENOBUFS: return fail(ENOBUFS, step, "raise the limit of locked memory (ulimit -l)");
        case -EINVAL:
            return fail(EINVAL, step,
                        "does it have this receive queue (ethtool -l)? Without XDP, use the AF_PACKET NIC");
        default: return fail(-error, step);
    }
}

XdpNic::Mode XdpNic::mode() const noexcept { return rings_ ? rings_->mode : Mode::automatic; }

int XdpNic::wait_handle() const noexcept { return rings_ ? rings_->fd() : -1; }

std::uint64_t XdpNic::overruns() const noexcept {
    xdp_statistics statistics{};
    socklen_t size = sizeof statistics;
    if (::getsockopt(wait_handle(), SOL_XDP, XDP_STATISTICS, &statistics, &size) != 0) return 0;
    return statistics.rx_dropped + statistics.rx_ring_full + statistics.rx_fill_ring_empty_descs;
}

SendStatus XdpNic::send(std::span<const std::byte> frame) noexcept {
    const bool is_frame = frame.size() >= wire::kEthernetHeaderBytes && frame.size() <= kMostFrameBytes;
    if (!rings_ || !is_frame) {
        last_error_ = rings_ ? EMSGSIZE : EBADF;
        return SendStatus::failed;
    }
    Rings& rings = *rings_;
    std::uint64_t chunk = 0;
    {
        const SendLock lock(rings.sending);
        if (!lock.held()) return SendStatus::busy;
        std::uint32_t at = 0;
        const std::uint32_t done = xsk_ring_cons__peek(&rings.completed, kSendChunks, &at);
        for (std::uint32_t n = 0; n < done; ++n)
            rings.free[rings.free_count++] = *xsk_ring_cons__comp_addr(&rings.completed, at + n);
        if (done > 0) xsk_ring_cons__release(&rings.completed, done);
        const bool room = rings.free_count > 0 && xsk_ring_prod__reserve(&rings.sent, 1, &at) == 1;
        if (room) {
            chunk = rings.free[--rings.free_count];
            const std::size_t length = std::max(frame.size(), kLeastFrameBytes);
            std::byte* const to = rings.at(chunk);
            std::memcpy(to, frame.data(), frame.size());
            std::memset(to + frame.size(), 0, length - frame.size());
            *xsk_ring_prod__tx_desc(&rings.sent, at) = {chunk, static_cast<std::uint32_t>(length), 0};
            xsk_ring_prod__submit(&rings.sent, 1);
        } else {
            last_error_ = ENOBUFS;
            chunk = Rings::kNoChunk;
        }
    }
    if (chunk != Rings::kNoChunk) return xsk_ring_prod__needs_wakeup(&rings.sent) != 0 ? kick(chunk) : SendStatus::sent;
    // Frames that the driver has not fetched yet need another wake-up.
    (void)::sendto(rings.fd(), nullptr, 0, MSG_DONTWAIT, nullptr, 0);
    return SendStatus::busy;
}

// Wakes the driver. A frame that it cannot send now stays in the ring and would be sent later, with old outputs: its
// EtherType is changed, so that no slave processes it then.
SendStatus XdpNic::kick(std::uint64_t chunk) noexcept {
    constexpr int kTries = 3;
    for (int n = 0; n < kTries; ++n) {
        if (::sendto(rings_->fd(), nullptr, 0, MSG_DONTWAIT, nullptr, 0) >= 0) {
            interface_.note_sent();
            return SendStatus::sent;
        }
        if (errno != EAGAIN && errno != EINTR && errno != EBUSY) break;
    }
    const int error = errno;
    last_error_ = error;
    if (error == EAGAIN || error == EINTR || error == EBUSY) return SendStatus::sent;  // the driver is at work
    std::memset(rings_->at(chunk) + kTypeAt, 0, 2);
    return error == ENOBUFS && !interface_.lacks_carrier() ? SendStatus::busy : SendStatus::failed;
}

std::size_t XdpNic::receive(std::span<std::byte> into) noexcept {
    if (!rings_) return 0;
    Rings& rings = *rings_;
    std::uint32_t at = 0;
    if (xsk_ring_cons__peek(&rings.received, 1, &at) == 0) {
        if (xsk_ring_prod__needs_wakeup(&rings.fill) != 0)
            (void)::recvfrom(rings.fd(), nullptr, 0, MSG_DONTWAIT, nullptr, nullptr);
        return 0;
    }
    const xdp_desc& frame = *xsk_ring_cons__rx_desc(&rings.received, at);
    const std::byte* const from = rings.at(frame.addr);
    std::size_t length = frame.len;
    const bool tagged = length > kTypeAt + kTagBytes && from[kTypeAt] == std::byte{0x81};
    if (tagged) {
        length -= kTagBytes;
        const std::size_t head = std::min(kTypeAt, into.size());
        std::memcpy(into.data(), from, head);
        if (into.size() > head)
            std::memcpy(into.data() + head, from + head + kTagBytes, std::min(length, into.size()) - head);
    } else {
        std::memcpy(into.data(), from, std::min(length, into.size()));
    }
    const std::uint64_t chunk = frame.addr - frame.addr % kChunkBytes;
    xsk_ring_cons__release(&rings.received, 1);
    // There are as many chunks as places in the ring, so a place is always free.
    if (xsk_ring_prod__reserve(&rings.fill, 1, &at) == 1) {
        *xsk_ring_prod__fill_addr(&rings.fill, at) = chunk;
        xsk_ring_prod__submit(&rings.fill, 1);
    }
    return std::min(length, into.size());
}

std::string_view to_text(XdpNic::Mode mode) {
    switch (mode) {
        case XdpNic::Mode::automatic: return "automatic";
        case XdpNic::Mode::zero_copy: return "zero copy";
        case XdpNic::Mode::copy: return "copy";
        case XdpNic::Mode::generic: return "generic";
    }
    return "unknown";
}

}  // namespace margay
