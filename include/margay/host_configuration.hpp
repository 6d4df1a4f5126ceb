// For systems with a heap: a configuration that owns all its lists, for programs that build it at run time. The library
// itself does not include this header.
#pragma once

#include <margay/expected.hpp>

#include <cstddef>
#include <deque>
#include <span>
#include <utility>
#include <vector>

namespace margay {

// A list of expected slaves with deep copies of all their data: configurations, setups, PDOs, entries, start-up
// commands and their data. The arguments of add() need not live longer than the call.
//
//     margay::HostConfiguration plan;
//     plan.add({.number = 1, .product = 0x07D43052}, config);
//     margay::expect(ctx, plan.expected());       // `plan` lives at least as long as the context
//
// add() moves no expected slave that was added before, so a context may use the list meanwhile. After add(), pass
// expected() to expect() again.
class HostConfiguration {
  public:
    HostConfiguration() = default;
    HostConfiguration(const HostConfiguration&) = delete;  // contexts point into it
    HostConfiguration& operator=(const HostConfiguration&) = delete;

    // Adds a slave and copies `slave.config` if it is set, or `config`.
    void add(const ExpectedSlave& slave) {
        room().push_back(slave);
        if (slave.config != nullptr) expected_.back().back().config = keep(*slave.config);
    }
    void add(const ExpectedSlave& slave, const SlaveConfiguration& config) {
        room().push_back(slave);
        expected_.back().back().config = keep(config);
    }

    [[nodiscard]] Borrowed<ExpectedSlave> expected() const { return expected_.back(); }

    // Copies a configuration with all its lists; the copy lives as long as this object.
    [[nodiscard]] const SlaveConfiguration* keep(const SlaveConfiguration& config) {
        SlaveConfiguration copy = config;
        if (config.setup != nullptr) copy.setup = keep(*config.setup);
        return &configurations_.emplace_back(copy);
    }
    [[nodiscard]] const SlaveSetup* keep(const SlaveSetup& setup) {
        SlaveSetup copy = setup;
        copy.pdos = keep(setup.pdos);
        copy.startup = keep(setup.startup);
        return &setups_.emplace_back(copy);
    }

  private:
    template <class T>
    static std::vector<T>& copied(std::deque<std::vector<T>>& lists, std::span<const T> list) {
        return lists.emplace_back(list.begin(), list.end());
    }
    std::span<const SmPdos> keep(std::span<const SmPdos> list) {
        std::vector<SmPdos>& copy = copied(sm_pdos_, list);
        for (SmPdos& sm : copy) {
            std::vector<Pdo>& pdos = copied<Pdo>(pdos_, sm.pdos);
            for (Pdo& pdo : pdos) pdo.entries = copied<PdoEntry>(entries_, pdo.entries);
            sm.pdos = pdos;
        }
        return copy;
    }
    std::span<const StartupCommand> keep(std::span<const StartupCommand> list) {
        std::vector<StartupCommand>& copy = copied(commands_, list);
        for (StartupCommand& command : copy)
            if (!command.data.empty()) command.data = copied<std::byte>(data_, command.data);
        return copy;
    }

    // The list, with space for one more slave. A full list stays for the contexts that use it; a larger copy replaces
    // it here.
    std::vector<ExpectedSlave>& room() {
        if (expected_.back().size() < expected_.back().capacity()) return expected_.back();
        std::vector<ExpectedSlave> larger;
        larger.reserve(2 * expected_.back().size() + 8);
        larger.assign(expected_.back().begin(), expected_.back().end());
        return expected_.emplace_back(std::move(larger));
    }

    std::deque<std::vector<ExpectedSlave>> expected_{std::vector<ExpectedSlave>()};
    // Lists of lists that grow only at their end: no element moves.
    std::deque<SlaveConfiguration> configurations_;
    std::deque<SlaveSetup> setups_;
    std::deque<std::vector<SmPdos>> sm_pdos_;
    std::deque<std::vector<Pdo>> pdos_;
    std::deque<std::vector<PdoEntry>> entries_;
    std::deque<std::vector<StartupCommand>> commands_;
    std::deque<std::vector<std::byte>> data_;
};

}  // namespace margay
