// A group with prepared frames at an engine. The test writes every reply. The tests of the cycle use this group.
#pragma once

#include "engine/scripted_nic.hpp"
#include "link/engine.hpp"
#include "network/process_data.hpp"
#include "process_data/slaves.hpp"
#include "util/task.hpp"

#include <gtest/gtest.h>

namespace margay {

inline constexpr std::size_t kIndexAt = wire::kFramePrefixBytes + 1;
inline constexpr std::size_t kDataAt = wire::kFramePrefixBytes + wire::kDatagramHeaderBytes;

class PreparedGroup {
  public:
    explicit PreparedGroup(std::vector<Slave> of, std::size_t group_count = 1)
        : slaves(std::move(of)), groups(group_count) {}

    Time now{std::chrono::seconds(1)};
    ScriptedNic nic;
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(8);
    std::vector<std::byte> memory = std::vector<std::byte>(64 * 1024);
    Engine engine{nic, slots, memory};
    std::vector<Slave> slaves;
    std::vector<SlaveMarks> marks = std::vector<SlaveMarks>(slaves.size());
    std::array<std::byte, 8> image{};

    std::vector<ProcessGroup> groups;
    std::vector<PreparedFrame> frames = std::vector<PreparedFrame>(2);
    std::vector<PreparedDatagram> datagrams = std::vector<PreparedDatagram>(4);
    std::vector<DatagramStatus> statuses = std::vector<DatagramStatus>(4);
    std::vector<DatagramPlan> plans = std::vector<DatagramPlan>(4);
    std::vector<DatagramPlan> scratch = std::vector<DatagramPlan>(4);
    ProcessTables tables{groups, frames, datagrams, statuses, plans, scratch};
    ProcessGroup& group = groups[0];

    // Prepares the frames from the present group.config.
    void prepare_frames() {
        group.layout = *lay_out(slaves, 0, group.config, image);
        group.image = image;
        group.slaves = slaves;
        group.marks = marks;
        const auto count = plan_datagrams(slaves, 0, group.config, group.layout, scratch);
        ASSERT_TRUE(prepare(tables, group, *count, engine.link()).ok());
    }
    const LinkStatistics& counted() { return engine.link().statistics(); }
};

}  // namespace margay
