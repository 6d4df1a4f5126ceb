#include "compat/ecrt/log.hpp"

#include "compat/ecrt/bus.hpp"

#include <array>
#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <string_view>
#include <system_error>

namespace margay::compat::ecrt {
namespace {

// The text of an error whose text in the library names functions that a program for ecrt.h does not have. Empty: the
// text of the library is used.
std::string_view words_without_functions(Errc code) {
    switch (code) {
        case Errc::identity_unread: return "the slave was away, and its identity was not compared since";
        case Errc::no_place: return "the slave has process data, and the frames have no place for it";
        case Errc::remapping_needed: return "its revision, SyncManagers or PDOs have changed since activation";
        case Errc::unknown_group: return "there is no such group, or nothing is mapped in it";
        case Errc::place_unknown:
            return "no place in the frames, the sizes of its process data are not known (ecrt_slave_config_pdos())";
        case Errc::not_polled: return "the cyclic thread does not call ecrt_master_receive() and ecrt_master_send()";
        case Errc::not_supervised: return "the states of the slaves were read more than a second ago";
        case Errc::no_cycle: return "no cycle is on the wire";
        case Errc::supervised: return "the master keeps the slave in another state";
        default: return {};
    }
}

// Without the remarks in parentheses that say which function to call.
std::string without_advice(std::string words) {
    for (auto begin = words.find(" (call "); begin != std::string::npos; begin = words.find(" (call ")) {
        auto end = begin + 1;
        for (unsigned open = 1; open != 0 && ++end < words.size();)
            if (words[end] == '(')
                ++open;
            else if (words[end] == ')')
                --open;
        words.erase(begin, end + 1 - begin);
    }
    return words;
}

}  // namespace

std::string words_of(const Error& error, std::string_view place) {
    std::array<char, 384> text{};
    std::string words = without_advice(std::string(describe(error, text)));
    if (error.slave != 0) words.erase(0, words.find(": ") + 2);  // "slave N": the interface has positions
    if (!place.empty()) words.insert(0, std::string(place) + ": ");
    const auto ours = words_without_functions(error.code);
    const auto theirs = to_text(error.code);
    const auto at = ours.empty() ? std::string::npos : words.find(theirs);
    if (at != std::string::npos) words.replace(at, theirs.size(), ours);
    // The error text also contains the step.
    const auto call = words.find(": call ");
    const auto end = call == std::string::npos ? call : words.find("()", call);
    return end == std::string::npos ? words : words.erase(call, end + 2 - call);
}

void say(const char* format, ...) {
    constexpr std::string_view kCut = "...";
    std::array<char, 4096> line{};
    va_list arguments;
    va_start(arguments, format);
    const int length = std::vsnprintf(line.data(), line.size(), format, arguments);
    va_end(arguments);
    if (length >= static_cast<int>(line.size())) kCut.copy(line.data() + line.size() - 1 - kCut.size(), kCut.size());
    std::fprintf(stderr, "margay ecrt: %s\n", line.data());
}

std::string with_positions(std::string words, const std::function<std::string(std::uint16_t)>& place_of) {
    constexpr std::string_view kSlave = "slave ";
    for (auto at = words.find(kSlave); at != std::string::npos; at = words.find(kSlave, at + 1)) {
        const char* const digits = words.data() + at + kSlave.size();
        std::uint16_t number = 0;
        const auto read = std::from_chars(digits, words.data() + words.size(), number);
        if (read.ec != std::errc{}) continue;
        words.replace(at, static_cast<std::size_t>(read.ptr - words.data()) - at, place_of(number));
    }
    return words;
}

void say_error(Bus& bus, const char* what, const Error& error) {
    const auto place_of = [&bus](std::uint16_t number) { return bus.place_of({.slave = number}); };
    const auto words = with_positions(words_of(error, bus.place_of(error)), place_of);
    say("master %u: %s: %s", bus.index, what, words.c_str());
}

}  // namespace margay::compat::ecrt
