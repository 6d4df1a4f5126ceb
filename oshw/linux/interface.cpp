#include "oshw/linux/interface.hpp"

#include "util/text_writer.hpp"
#include "wire/ethernet.hpp"

#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace margay {
namespace {

constexpr int kNeededMtu = static_cast<int>(wire::kMaxFrameBytes - wire::kEthernetHeaderBytes);

}  // namespace

Interface::~Interface() { close(); }

void Interface::close() noexcept {
    if (control_ >= 0) ::close(control_);
    control_ = -1;
    note_sent();
}

Result<> Interface::open(std::string_view name) noexcept {
    close();
    problem_size_ = 0;
    name_ = {};
    if (name.size() >= name_.size()) return fail_no_interface(name);
    std::copy(name.begin(), name.end(), name_.begin());
    index_ = static_cast<int>(::if_nametoindex(name_.data()));
    if (index_ == 0) return fail_no_interface(name);
    control_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (control_ < 0) control_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);  // a kernel without IP
    if (control_ < 0) return fail(errno, "no socket");
    return {};
}

bool Interface::request(unsigned long what, ifreq& request) const noexcept {
    static_assert(sizeof request.ifr_name == std::tuple_size_v<decltype(name_)>);
    std::memcpy(request.ifr_name, name_.data(), name_.size());
    return ::ioctl(control_, what, &request) == 0;
}

Result<> Interface::check() noexcept {
    ifreq asked{};
    if (!request(SIOCGIFHWADDR, asked)) return fail(errno, "it vanished while it was opened");
    if (asked.ifr_hwaddr.sa_family != ARPHRD_ETHER)
        return fail(EOPNOTSUPP, "it is not an Ethernet interface", "EtherCAT needs a wired Ethernet port");
    std::memcpy(address_.data(), asked.ifr_hwaddr.sa_data, address_.size());

    if (!request(SIOCGIFFLAGS, asked)) return fail(errno, "it vanished while it was opened");
    if ((asked.ifr_flags & IFF_UP) == 0) {
        std::array<char, 64> advice{};
        TextWriter text(advice);
        text << "bring it up with: ip link set " << name_.data() << " up";
        return fail(ENETDOWN, "it is switched off", text.text());
    }
    if (!request(SIOCGIFMTU, asked)) return fail(errno, "it vanished while it was opened");
    if (asked.ifr_mtu < kNeededMtu) {
        std::array<char, 64> advice{};
        TextWriter text(advice);
        text << "widen it with: ip link set " << name_.data() << " mtu " << std::uint64_t{kNeededMtu};
        return fail(EMSGSIZE, "its MTU is too small for EtherCAT frames", text.text());
    }
    return {};
}

// Reads the carrier from the driver, because IFF_RUNNING changes up to one second later.
LinkState Interface::link_state() const noexcept {
    ifreq asked{};
    ethtool_value carrier{};
    carrier.cmd = ETHTOOL_GLINK;
    asked.ifr_data = reinterpret_cast<char*>(&carrier);
    if (request(SIOCETHTOOL, asked)) return carrier.data != 0 ? LinkState::up : LinkState::down;
    if (errno != EOPNOTSUPP) return LinkState::down;  // interface removed, or never opened
    asked = {};
    constexpr auto kBoth = IFF_UP | IFF_RUNNING;
    return request(SIOCGIFFLAGS, asked) && (asked.ifr_flags & kBoth) == kBoth ? LinkState::up : LinkState::down;
}

bool Interface::lacks_carrier() noexcept {
    constexpr unsigned kAskAgain = 16;
    const unsigned before = refused_.load(std::memory_order_relaxed);
    if (before == kNoCarrier) return true;
    const bool lacks = before % kAskAgain == 0 && link_state() == LinkState::down;
    refused_.store(lacks ? kNoCarrier : (before + 1) % kNoCarrier, std::memory_order_relaxed);
    return lacks;
}

bool Interface::switch_on() const noexcept {
    ifreq flags{};
    if (!request(SIOCGIFFLAGS, flags)) return false;
    if ((flags.ifr_flags & IFF_UP) != 0) return true;
    flags.ifr_flags = static_cast<short>(flags.ifr_flags | IFF_UP);
    return request(SIOCSIFFLAGS, flags);
}

Result<> Interface::fail(int error, std::string_view what, std::string_view advice) noexcept {
    TextWriter text(problem_);
    text << "interface " << name_.data() << ": " << what;
    if (advice.empty())
        text << " (" << ::strerror(error) << ")";
    else
        text << "; " << advice;
    problem_size_ = text.text().size();
    return Error{.code = Errc::nic, .step = Step::open_nic, .actual = static_cast<std::uint32_t>(error)};
}

Result<> Interface::fail_no_interface(std::string_view asked) noexcept {
    std::array<char, 256> there{};
    TextWriter text(there);
    text << "there are:";
    if (auto* all = ::if_nameindex(); all != nullptr) {
        for (const auto* one = all; one->if_index != 0; ++one) text << " " << one->if_name;
        ::if_freenameindex(all);
    }
    TextWriter sentence(problem_);
    sentence << "there is no interface \"" << asked << "\"; " << text.text();
    problem_size_ = sentence.text().size();
    return Error{.code = Errc::nic, .step = Step::open_nic, .actual = ENODEV};
}

Result<> Interface::fail_no_permission(std::string_view what, std::string_view capabilities) noexcept {
    std::array<char, 256> program{};
    const auto length = ::readlink("/proc/self/exe", program.data(), program.size());
    std::array<char, 400> advice{};
    TextWriter text(advice);
    text << "give it once with: sudo setcap " << capabilities << "+ep "
         << (length > 0 ? std::string_view(program.data(), static_cast<std::size_t>(length)) : "PROGRAM")
         << " (or run with sudo)";
    return fail(EPERM, what, text.text());
}

}  // namespace margay
