#include "osal/linux/irq_threads.hpp"

#include "util/text_writer.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>

namespace margay {
namespace {

using Path = std::array<char, 256>;

// Builds a path of several parts; a path that is too long is empty.
template <class... Parts>
Path path_of(const Parts&... parts) noexcept {
    Path path{};
    const std::span<char> room(path.data(), path.size() - 1);
    TextWriter text(room);
    (text << ... << parts);
    if (text.text().size() == room.size()) path[0] = 0;
    return path;
}

// The number in the text; 0: the text is no number.
unsigned number_of(std::string_view text) noexcept {
    unsigned number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() ? number : 0;
}

// Calls `take(name)` for each entry of a folder, until it returns false.
template <class Take>
void for_each_entry(const char* folder, const Take& take) noexcept {
    DIR* const open = ::opendir(folder);
    if (open == nullptr) return;
    while (const dirent* entry = ::readdir(open))
        if (!take(std::string_view(entry->d_name))) break;
    ::closedir(open);
}

bool has_entry(const char* folder, std::string_view name) noexcept {
    bool found = false;
    for_each_entry(folder, [&](std::string_view entry) { return !(found = entry == name); });
    return found;
}

// The interrupt number in names such as "irq/24-eth0" and "irq/24-s-eth0"; 0: another thread.
unsigned irq_of(std::string_view name, std::string_view& action) noexcept {
    if (!name.starts_with("irq/")) return 0;
    const auto dash = name.find('-');
    if (dash == std::string_view::npos) return 0;
    action = name.substr(dash + 1);
    if (action.starts_with("s-")) action.remove_prefix(2);
    return number_of(name.substr(4, dash - 4));
}

// The kernel cuts names of threads to 15 octets.
bool is_action_of(std::string_view action, std::string_view interface) noexcept {
    return action == interface || (action.starts_with(interface) && action[interface.size()] == '-');
}

// Whether the interrupt belongs to the device of the interface. The interrupts of a virtio device belong to the device
// above it.
bool is_of_device(unsigned irq, std::string_view interface, const IrqThreads::Places& places) noexcept {
    std::array<char, 12> text{};
    TextWriter number(text);
    number << std::uint64_t{irq};
    const Path device = path_of(places.sys, "/class/net/", interface, "/device");
    if (has_entry(path_of(device.data(), "/msi_irqs").data(), number.text())) return true;
    Path target{};
    const auto length = ::readlink(device.data(), target.data(), target.size());
    const std::string_view at(target.data(), static_cast<std::size_t>(std::max<ssize_t>(length, 0)));
    return at.substr(at.rfind('/') + 1).starts_with("virtio") &&
           has_entry(path_of(device.data(), "/../msi_irqs").data(), number.text());
}

// The name of the process; it ends without the line feed.
std::string_view name_of(const char* proc, std::string_view id, std::span<char> memory) noexcept {
    const int file = ::open(path_of(proc, "/", id, "/comm").data(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return {};
    const auto length = ::read(file, memory.data(), memory.size());
    ::close(file);
    const std::string_view text(memory.data(), static_cast<std::size_t>(std::max<ssize_t>(length, 0)));
    return text.substr(0, text.find('\n'));
}

// Reads the present policy and priority. False: the thread does not exist any more.
bool read_priority(IrqThread& thread) noexcept {
    sched_param now{};
    const int policy = ::sched_getscheduler(thread.id);
    if (policy < 0 || ::sched_getparam(thread.id, &now) != 0) return false;
    thread.policy = policy & ~SCHED_RESET_ON_FORK;
    thread.priority = now.sched_priority;
    return true;
}

}  // namespace

bool IrqThreads::find(std::string_view interface, const Places& places) noexcept {
    count_ = 0;
    changed_ = {};
    if (interface.empty()) return false;
    for_each_entry(places.proc, [&](std::string_view entry) {
        IrqThread thread;
        thread.id = static_cast<int>(number_of(entry));
        if (thread.id == 0) return true;
        std::string_view action;
        const auto name = name_of(places.proc, entry, thread.name);
        thread.irq = irq_of(name, action);
        if (thread.irq == 0) return true;
        if (!is_action_of(action, interface) && !is_of_device(thread.irq, interface, places)) return true;
        thread.name[std::min(name.size(), thread.name.size() - 1)] = 0;
        if (read_priority(thread)) threads_[count_++] = thread;
        return count_ < kMost;
    });
    return count_ != 0;
}

int IrqThreads::set_priority(int priority) noexcept {
    int refused = 0;
    const sched_param wanted{.sched_priority = priority};
    for (std::size_t n = 0; n < count_; ++n) {
        const bool set = ::sched_setscheduler(threads_[n].id, SCHED_FIFO, &wanted) == 0;
        if (!set && refused == 0) refused = errno;
        if (!set) continue;
        changed_[n] = true;
        set_to_[n] = priority;
    }
    return refused;
}

int IrqThreads::restore() noexcept {
    int refused = 0;
    for (std::size_t n = 0; n < count_; ++n) {
        if (!changed_[n]) continue;
        changed_[n] = false;
        IrqThread now = threads_[n];
        if (!read_priority(now) || now.policy != SCHED_FIFO || now.priority != set_to_[n]) continue;
        const sched_param before{.sched_priority = threads_[n].priority};
        if (::sched_setscheduler(now.id, threads_[n].policy, &before) != 0 && refused == 0) refused = errno;
    }
    return refused;
}

bool is_above(const IrqThread& thread, int cycle_priority) noexcept {
    const bool realtime = thread.policy == SCHED_FIFO || thread.policy == SCHED_RR;
    return (realtime ? thread.priority : 0) > cycle_priority;
}

std::string_view describe(const IrqThread& thread, int cycle_priority, std::span<char> memory) noexcept {
    constexpr int kHighest = 99;  // of SCHED_FIFO
    TextWriter text(memory);
    const auto number = [](int value) { return static_cast<std::uint64_t>(std::max(value, 0)); };
    text << thread.name.data() << " (thread " << number(thread.id) << ") has the priority " << number(thread.priority);
    if (is_above(thread, cycle_priority)) {
        text << ", above that of the cycle";
    } else {
        text << ", not above that of the cycle (" << number(cycle_priority)
             << "): replies wait while a thread of that priority uses its processor; ";
        if (cycle_priority >= kHighest)
            text << "give the cycle a lower priority: no thread can be above " << number(kHighest);
        else
            text << "mend it with: chrt -f -p " << number(cycle_priority + 1) << " " << number(thread.id);
    }
    return text.text();
}

}  // namespace margay
