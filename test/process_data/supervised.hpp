// A supervised segment in virtual time, with a check of the inputs in every cycle.
#pragma once

#include "process_data/bus.hpp"

namespace margay {

// A segment, its master, and the supervision.
struct Run {
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(8192);
    SuperviseRequest supervision;
    std::uint8_t counter = 0;

    bool mapped = false;

    Run() = default;
    // Maps the group and submits the supervision, which then brings the slaves to OP.
    explicit Run(unsigned slaves, const Limits& limits = {.slaves = 64}) {
        start(slaves, limits);
        mapped = config_map(ctx(), image).ok() && submit(ctx(), supervision).ok();
    }
    HostContext& ctx() { return *bus.ctx; }
    void start(unsigned slaves, const Limits& limits = {.slaves = 64}) {
        for (unsigned n = 0; n < slaves; ++n) bus.add(16, 16);
        bus.start(limits);
    }
    void to_op() {
        ASSERT_TRUE(config_map(ctx(), image).ok());
        (void)events();  // drops the events of slaves that config_map() has started again
        ASSERT_EQ(bus.to_op().state, AlState::op);
        ASSERT_TRUE(submit(ctx(), supervision).ok());
        for (int i = 0; i < 5; ++i) (void)cycle();
        EXPECT_EQ(events(), std::vector<std::string>());
    }
    // Executes a cycle in which every device provides a new value and its number in the other octet. Checks the image:
    // for each slave it contains the new value or the last value. If the cycle succeeds, it contains the new value.
    Result<std::uint32_t> cycle() {
        ++counter;
        const std::size_t count = ctx().slaves().size();
        before.resize(count + 1);
        for (std::size_t n = 1; n <= count; ++n) {
            before[n] = shown(n);
            if (!bus.segment.powered(static_cast<std::uint32_t>(n - 1))) continue;
            auto inputs = bus.device(n).inputs();
            if (inputs.size() < 2) continue;
            inputs[0] = static_cast<std::byte>(counter);
            inputs[1] = static_cast<std::byte>(n);
            bus.device(n).poke();
        }
        const auto wkc = bus.cycle();
        for (std::size_t n = 1; n <= count; ++n) {
            const auto now = shown(n);
            const bool is_new = now == std::pair(static_cast<std::byte>(counter), static_cast<std::byte>(n));
            if ((wkc.ok() && !is_new) || (!is_new && now != before[n])) ++wrong;
        }
        EXPECT_EQ(wrong, 0) << "cycle " << int{counter};
        return wkc;
    }
    std::pair<std::byte, std::byte> shown(std::size_t n) {
        const auto bytes = ctx().slave(n).image.inputs.bytes;
        return {bytes[0], bytes[1]};
    }
    std::vector<std::pair<std::byte, std::byte>> before;
    int wrong = 0;
    bool fresh(std::size_t n) { return ctx().slave(n).image.inputs.bytes[0] == static_cast<std::byte>(counter); }
    std::vector<std::string> events() {
        std::vector<std::string> all;
        while (const auto event = ctx().events().take()) {
            std::array<char, 256> text{};
            all.emplace_back(describe(*event, text));
        }
        return all;
    }
    static bool has(const std::vector<std::string>& all, const std::string& text) {
        return std::ranges::any_of(all, [&](const std::string& one) { return one.find(text) != std::string::npos; });
    }
    static std::string joined(const std::vector<std::string>& all) {
        std::string text;
        for (const auto& one : all) text += one + "\n";
        return text;
    }
    // Returns the number of cycles until all slaves are in OP and the cycle succeeds, at most `most`.
    int cycles_until_right(int most = 5000) {
        for (int n = 1; n <= most; ++n) {
            const auto wkc = cycle();
            const bool all = std::ranges::all_of(
                ctx().slaves(), [](const Slave& s) { return s.al.state == AlState::op && !s.al.error; });
            if (wkc.ok() && all) return n;
        }
        return most + 1;
    }
};

}  // namespace margay
