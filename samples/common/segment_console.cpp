#include "common/segment_console.hpp"

#include "common/counted.hpp"
#include "sim/process_data.hpp"
#include "wire/al_status_code.hpp"

#include <margay/al_state.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <vector>

namespace margay::samples {

namespace {

namespace reg = wire::reg;
using Words = std::vector<std::string>;

constexpr std::string_view kHelp =
    "break S[.P]             cut the cable at port P of slave S (without P: the cable to its parent)\n"
    "heal S[.P] | all        reconnect the cable\n"
    "power off|on S          switch a slave off and on\n"
    "drop RATE               lose this share of frames from now on, 0 to 1\n"
    "corrupt RATE            damage this share of frames\n"
    "drift S PPMppm          set the drift of the slave's clock (ppm, or ppb)\n"
    "latch S 0|1 rise|fall   make an edge at a latch input\n"
    "hang S                  stop the slave's firmware until power off and on\n"
    "set S OFFSET OCTET …    set the inputs of the slave, starting at octet OFFSET\n"
    "get S in|out            show the process data of slave S\n"
    "get S ADDRESS [COUNT]   show registers and memory of slave S, as its firmware sees them\n"
    "states                  show the states of all slaves\n"
    "S is a number from 1 or a name.";

struct Problem {
    std::string text;
};

std::optional<std::uint64_t> number(const std::string& word) {
    const bool hex = word.starts_with("0x");
    const auto* begin = word.data() + (hex ? 2 : 0);
    const auto* end = word.data() + word.size();
    std::uint64_t value = 0;
    const auto [at, error] = std::from_chars(begin, end, value, hex ? 16 : 10);
    if (error != std::errc{} || at != end) return std::nullopt;
    return value;
}

class Console {
  public:
    Console(SimulatedSegment& simulated, Time now) : simulated_(simulated), segment_(simulated.segment), now_(now) {}

    std::string run(const Words& words) {
        const auto& what = words[0];
        const auto count = words.size();
        if (what == "help") return std::string(kHelp);
        if (what == "states") return states();
        if ((what == "break" || what == "heal") && count == 2) return cable(words[1], what == "heal");
        if (what == "power" && count == 3 && (words[1] == "on" || words[1] == "off"))
            return power(words[2], words[1] == "on");
        if ((what == "drop" || what == "corrupt") && count == 2) return noise(words[1], what == "drop");
        if (what == "drift" && count == 3) return drift(words[1], words[2]);
        if (what == "latch" && count == 4) return latch(words);
        if (what == "hang" && count == 2) return hang(words[1]);
        if (what == "set" && count >= 4) return set(words);
        if (what == "get" && count >= 3) return get(words);
        return fmt::format("'{}' is an unknown command or arguments are missing; see help", what);
    }

  private:
    std::optional<std::uint32_t> slave(const std::string& word, std::string& problem) const {
        if (const auto n = number(word); n && *n >= 1 && *n <= segment_.size())
            return static_cast<std::uint32_t>(*n - 1);
        const auto found = std::find(simulated_.names.begin(), simulated_.names.end(), word);
        if (found != simulated_.names.end()) return static_cast<std::uint32_t>(found - simulated_.names.begin());
        problem = fmt::format("there is no slave '{}'; they are 1 to {}", word, segment_.size());
        return std::nullopt;
    }

    std::string cable(const std::string& word, bool intact) {
        if (intact && word == "all") {
            for (std::uint32_t n = 0; n < segment_.size(); ++n)
                for (std::uint8_t p = 0; p < sim::kMaxPorts; ++p) segment_.set_cable({n, p}, true);
            return "all cables are connected";
        }
        const auto dot = word.find('.');
        std::string problem;
        const auto n = slave(word.substr(0, dot), problem);
        if (!n) return problem;
        std::uint64_t port = 0;
        if (dot != std::string::npos) {
            const auto given = number(word.substr(dot + 1));
            if (!given || *given >= sim::kMaxPorts)
                return fmt::format("'{}' names no port: 0 to {}", word, sim::kMaxPorts - 1);
            port = *given;
        }
        segment_.set_cable({*n, static_cast<std::uint8_t>(port)}, intact);
        return fmt::format("the cable at port {} of slave {} is {}", port, *n + 1, intact ? "connected" : "broken");
    }

    std::string power(const std::string& word, bool on) {
        std::string problem;
        const auto n = slave(word, problem);
        if (!n) return problem;
        segment_.set_power(*n, on, now_);
        return fmt::format("slave {} is {}", *n + 1, on ? "on" : "off");
    }

    std::string noise(const std::string& word, bool drop) {
        char* end = nullptr;
        const double rate = std::strtod(word.c_str(), &end);
        if (end == word.c_str() || *end != '\0' || !(rate >= 0 && rate <= 1))
            return fmt::format("'{}' is no share from 0 to 1", word);
        auto wanted = segment_.noise();
        (drop ? wanted.lost : wanted.corrupted) = rate;
        segment_.set_noise(wanted);
        return fmt::format("{} of all frames are {}", rate, drop ? "lost" : "damaged");
    }

    std::string drift(const std::string& who, const std::string& word) {
        std::string problem;
        const auto n = slave(who, problem);
        if (!n) return problem;
        char* end = nullptr;
        const double value = std::strtod(word.c_str(), &end);
        const std::string unit = end;
        if (end == word.c_str() || (unit != "ppm" && unit != "ppb" && !unit.empty()))
            return fmt::format("'{}' is no rate such as 20ppm", word);
        const double ppb = unit == "ppb" ? value : value * 1000;
        if (!(std::abs(ppb) <= 1e8)) return "the drift is too large: at most 100000 ppm";
        segment_.slave(*n).set_drift(static_cast<std::int32_t>(std::lround(ppb)), now_);
        return fmt::format("the clock of slave {} is off by {} ppb", *n + 1, std::lround(ppb));
    }

    std::string latch(const Words& words) {
        std::string problem;
        const auto n = slave(words[1], problem);
        if (!n) return problem;
        const auto input = number(words[2]);
        if (!input || *input > 1 || (words[3] != "rise" && words[3] != "fall")) return "latch S 0|1 rise|fall";
        segment_.slave(*n).latch(static_cast<unsigned>(*input), words[3] == "rise", now_);
        segment_.reconsider();
        return fmt::format("latch {} of slave {}", *input, *n + 1);
    }

    std::string hang(const std::string& word) {
        std::string problem;
        const auto n = slave(word, problem);
        if (!n) return problem;
        segment_.slave(*n).halt_firmware(now_);
        segment_.reconsider();
        return fmt::format("the firmware of slave {} hangs", *n + 1);
    }

    std::string set(const Words& words) {
        std::string problem;
        const auto n = slave(words[1], problem);
        if (!n) return problem;
        auto* device = segment_.slave(*n).process_data();
        if (device == nullptr) return fmt::format("slave {} has no inputs", *n + 1);
        const auto offset = number(words[2]);
        const auto inputs = device->inputs();
        if (!offset || *offset > inputs.size() || words.size() - 3 > inputs.size() - *offset)
            return fmt::format("slave {} has {} of inputs now", *n + 1, counted(inputs.size(), "octet"));
        std::vector<std::byte> octets;
        for (std::size_t i = 3; i < words.size(); ++i) {
            const auto value = number(words[i]);
            if (!value || *value > 0xFF) return fmt::format("'{}' is no octet", words[i]);
            octets.push_back(static_cast<std::byte>(*value));
        }
        std::copy(octets.begin(), octets.end(), inputs.begin() + static_cast<std::ptrdiff_t>(*offset));
        device->poke();
        segment_.reconsider();
        return hex(inputs);
    }

    std::string get(const Words& words) {
        std::string problem;
        const auto n = slave(words[1], problem);
        if (!n) return problem;
        auto& esc = segment_.slave(*n);
        if (words[2] == "in" || words[2] == "out") {
            auto* device = esc.process_data();
            if (device == nullptr) return fmt::format("slave {} has no process data", *n + 1);
            return hex(words[2] == "in" ? Bytes(device->inputs()) : device->outputs());
        }
        const auto address = number(words[2]);
        const auto count = words.size() > 3 ? number(words[3]) : std::optional<std::uint64_t>(1);
        if (!address || *address > 0xFFFF || !count || *count == 0 || *count > 256)
            return "get S ADDRESS [COUNT], at most 256 octets";
        return hex(esc.peek(static_cast<std::uint16_t>(*address), *count));
    }

    std::string states() {
        std::string text;
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            text += fmt::format("{}{:4} {:16} {}", n == 0 ? "" : "\n", n + 1, simulated_.names[n],
                                segment_.powered(n) ? state_of(segment_.slave(n)) : "off");
        return text;
    }

    static std::string hex(Bytes bytes) {
        std::string text;
        for (const auto octet : bytes)
            text += fmt::format("{}{:02x}", text.empty() ? "" : " ", std::to_integer<unsigned>(octet));
        return text;
    }

    SimulatedSegment& simulated_;
    sim::Segment& segment_;
    Time now_;
};

}  // namespace

std::string state_of(const sim::Esc& esc) {
    const auto status = esc.registers().get<std::uint16_t>(reg::kAlStatus.address);
    std::string text;
    switch (static_cast<AlState>(status & wire::al::kStateMask)) {
        case AlState::init: text = "INIT"; break;
        case AlState::preop: text = "PREOP"; break;
        case AlState::boot: text = "BOOT"; break;
        case AlState::safeop: text = "SAFEOP"; break;
        case AlState::op: text = "OP"; break;
        default: text = fmt::format("state {}", status & wire::al::kStateMask);
    }
    if ((status & wire::al::kErrorIndication) == 0) return text;
    const auto code = esc.registers().get<std::uint16_t>(reg::kAlStatusCode.address);
    return fmt::format("{} + ERROR 0x{:04x} ({})", text, code, wire::to_text(static_cast<wire::AlStatusCode>(code)));
}

std::string execute(SimulatedSegment& simulated, std::string_view command, Time now) {
    std::istringstream in{std::string(command)};
    Words words;
    for (std::string word; in >> word;) words.push_back(word);
    if (words.empty()) return {};
    return Console(simulated, now).run(words);
}

}  // namespace margay::samples
