// ecrt_master_eoe_addif() gives a slave with EoE a network interface: the frames of the interface go to the slave, and
// the frames of the slave go to the interface. A thread of the facade passes them between the interface and an EoePort;
// the mailbox of the slave is served where the master polls: before activation by its thread, afterwards inside
// ecrt_master_receive() and ecrt_master_send().
#include "compat/ecrt/eoe_interfaces.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"

#include <margay/eoe.hpp>

#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

namespace margay::compat::ecrt {
namespace {

class EoeInterface {
  public:
    EoeInterface(std::uint16_t with_alias, std::uint16_t at_position) : alias(with_alias), position(at_position) {}
    ~EoeInterface() { remove(); }
    EoeInterface(const EoeInterface&) = delete;
    EoeInterface& operator=(const EoeInterface&) = delete;

    // Creates the interface and switches it on. Returns 0, or the error number.
    [[nodiscard]] int open(const std::string& name) {
        device_ = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
        if (device_ < 0) return errno;
        ifreq request{};
        name.copy(request.ifr_name, IFNAMSIZ - 1);
        request.ifr_flags = IFF_TAP | IFF_NO_PI;
        if (::ioctl(device_, TUNSETIFF, &request) < 0) return errno;
        const int any = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        if (any < 0) return errno;
        int error = ::ioctl(any, SIOCGIFFLAGS, &request) < 0 ? errno : 0;
        request.ifr_flags = static_cast<short>(request.ifr_flags | IFF_UP);
        if (error == 0 && ::ioctl(any, SIOCSIFFLAGS, &request) < 0) error = errno;
        ::close(any);
        return error;
    }
    // Removes it from the system.
    void remove() {
        if (device_ >= 0) ::close(device_);
        device_ = -1;
    }
    // Passes the frames that wait. False: there were none.
    bool pass(std::span<std::byte> buffer) {
        bool any = false;
        while (const auto frame = port.receive(buffer)) {
            any = true;
            if (::write(device_, buffer.data(), frame->bytes) < 0) break;  // the kernel drops it
        }
        while (port.can_send()) {
            const auto size = ::read(device_, buffer.data(), buffer.size());
            if (size <= 0) break;
            any = true;
            (void)port.send(buffer.first(static_cast<std::size_t>(size)));
        }
        return any;
    }
    [[nodiscard]] pollfd waiting() const {
        return {port.can_send() ? device_ : -1, POLLIN, 0};  // poll() leaves out -1
    }

    const std::uint16_t alias;
    const std::uint16_t position;

  private:
    int device_ = -1;
    EoePortMemory<16, 16> memory_;

  public:
    EoePort port{memory_};
};

// The interfaces of one master, and the thread that passes their frames.
class EoeInterfaces {
  public:
    EoeInterfaces() : passer_([this] { pass_frames(); }) {}
    ~EoeInterfaces() {
        stop_ = true;
        passer_.join();
    }
    EoeInterfaces(const EoeInterfaces&) = delete;
    EoeInterfaces& operator=(const EoeInterfaces&) = delete;

    [[nodiscard]] bool has(std::uint16_t alias, std::uint16_t position) {
        const std::lock_guard lock(mutex_);
        return find(alias, position) != all_.end();
    }
    void add(std::unique_ptr<EoeInterface> interface) {
        const std::lock_guard lock(mutex_);
        all_.push_back(std::move(interface));
    }
    // False: there is no such interface. The memory of its port stays valid until the owner of the context has ended
    // the port. Waits some milliseconds, because the system keeps the interface while the thread waits for its frames.
    bool remove(std::uint16_t alias, std::uint16_t position) {
        std::unique_ptr<EoeInterface> ending;
        std::uint32_t round = 0;
        {
            const std::lock_guard lock(mutex_);
            const auto found = find(alias, position);
            if (found == all_.end()) return false;
            ending = std::move(*found);
            all_.erase(found);
            round = rounds_;
        }
        rounds_.wait(round);
        ending->remove();
        ending->port.cancel();
        const std::lock_guard lock(mutex_);
        ending_.push_back(std::move(ending));
        return true;
    }
    [[nodiscard]] bool empty() {
        const std::lock_guard lock(mutex_);
        return all_.empty();
    }

  private:
    using List = std::vector<std::unique_ptr<EoeInterface>>;
    List::iterator find(std::uint16_t alias, std::uint16_t position) {
        auto at = all_.begin();
        while (at != all_.end() && ((*at)->alias != alias || (*at)->position != position)) ++at;
        return at;
    }
    void pass_frames() {
        std::array<std::byte, kEoeFrameBytes> buffer;
        std::vector<pollfd> files;
        while (!stop_) {
            bool any = false;
            files.clear();
            {
                const std::lock_guard lock(mutex_);
                std::erase_if(ending_, [](const auto& interface) { return !interface->port.busy(); });
                for (const auto& interface : all_) any |= interface->pass(buffer);
                for (const auto& interface : all_) files.push_back(interface->waiting());
            }
            // The arrival of a frame at a port wakes no thread, so the thread waits 1 ms at most.
            if (!any) ::poll(files.data(), files.size(), 1);
            ++rounds_;
            rounds_.notify_all();
        }
    }

    std::mutex mutex_;
    List all_;
    List ending_;
    std::atomic<bool> stop_{false};
    std::atomic<std::uint32_t> rounds_{0};  // of the thread
    std::thread passer_;
};

// The masters that have such interfaces.
std::mutex all_mutex;
std::map<const Bus*, std::unique_ptr<EoeInterfaces>>& all_interfaces() {
    static auto* const all = new std::map<const Bus*, std::unique_ptr<EoeInterfaces>>;
    return *all;
}
EoeInterfaces* interfaces_of(const Bus& bus) {
    const std::lock_guard lock(all_mutex);
    const auto found = all_interfaces().find(&bus);
    return found == all_interfaces().end() ? nullptr : found->second.get();
}
EoeInterfaces& make_interfaces(const Bus& bus) {
    const std::lock_guard lock(all_mutex);
    auto& interfaces = all_interfaces()[&bus];
    if (interfaces == nullptr) interfaces = std::make_unique<EoeInterfaces>();
    return *interfaces;
}

// The slave with the alias, or `position` slaves behind it; alias 0: the slave at the position.
bool find_slave(Bus& bus, std::uint16_t alias, std::uint16_t position, Slave& copy) {
    std::uint32_t at = position;
    if (alias != 0) {
        const std::uint16_t first = bus.first_with(alias);
        if (first == 0) return false;
        at += first - 1U;
    }
    return at <= 0xFFFF && bus.slave_at(static_cast<std::uint16_t>(at), copy);
}

int add_interface(Bus& bus, std::uint16_t alias, std::uint16_t position) {
    Slave slave;
    if (!find_slave(bus, alias, position, slave)) {
        say("master %u: there is no slave %u:%u for an EoE interface", bus.index, alias, position);
        return -ENOENT;
    }
    EoeInterfaces& interfaces = make_interfaces(bus);
    if (interfaces.has(alias, position)) {
        say("master %u: slave %u:%u has an EoE interface already", bus.index, alias, position);
        return -EEXIST;
    }
    if ((slave.mailbox.protocols & mailbox_protocol::kEoE) == 0) {
        say("master %u: slave %u:%u has no EoE", bus.index, alias, position);
        return -EOPNOTSUPP;
    }
    auto interface = std::make_unique<EoeInterface>(alias, position);
    const bool by_alias = alias != 0 && position == 0;
    const std::string name = "eoe" + std::to_string(bus.index) + (by_alias ? "a" : "s") +
                             std::to_string(by_alias ? alias : slave.ring_position - 1U);
    if (const int error = interface->open(name); error != 0) {
        say("master %u: no interface %s: %s%s", bus.index, name.c_str(), std::strerror(error),
            error == EPERM ? "; the program needs the capability CAP_NET_ADMIN" : "");
        return -error;
    }
    interface->port.slave = slave.number;
    interface->port.set_interface_name(name);
    if (const auto begun = submit(*bus.ctx, interface->port); !begun) {
        say_error(bus, name.c_str(), begun.error());
        return begun.error().code == Errc::busy ? -EBUSY : -EIO;
    }
    interfaces.add(std::move(interface));
    return 0;
}

}  // namespace

void close_eoe_interfaces(Bus& bus) {
    std::unique_ptr<EoeInterfaces> ending;
    {
        const std::lock_guard lock(all_mutex);
        const auto found = all_interfaces().find(&bus);
        if (found == all_interfaces().end()) return;
        ending = std::move(found->second);
        all_interfaces().erase(found);
    }
}

}  // namespace margay::compat::ecrt

using namespace margay::compat::ecrt;

extern "C" {

int ecrt_master_eoe_addif(ec_master_t* master, uint16_t alias, uint16_t posn) {
    return add_interface(*master->bus, alias, posn);
}

int ecrt_master_eoe_delif(ec_master_t* master, uint16_t alias, uint16_t posn) {
    EoeInterfaces* const interfaces = interfaces_of(*master->bus);
    return interfaces != nullptr && interfaces->remove(alias, posn) ? 0 : -ENOENT;
}

int ecrt_master_eoe_is_open(ec_master_t* master) {
    EoeInterfaces* const interfaces = interfaces_of(*master->bus);
    return interfaces != nullptr && !interfaces->empty() ? 1 : 0;
}

// The thread of the interfaces and the polls of the master process the frames.
int ecrt_master_eoe_process(ec_master_t*) { return 0; }

}  // extern "C"
