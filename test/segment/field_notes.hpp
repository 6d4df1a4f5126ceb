// A master and devices with deviations of real devices (sim/library/quirks.hpp), in virtual time. Used by the tests of
// the field notes.
#pragma once

#include "segment/bench.hpp"
#include "sim/library/quirks.hpp"
#include "sim/process_data.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <initializer_list>

namespace margay {

class FieldNotes : public SegmentTest {
  protected:
    using Names = std::initializer_list<std::string_view>;
    std::vector<std::byte> image = std::vector<std::byte>(4096);

    // Connects a library device with these quirks behind the last device.
    sim::Esc& plug_odd(Names manners, std::string_view device = "odd_device") {
        auto made = sim::make_device(device).value();
        for (const auto name : manners) EXPECT_TRUE(sim::add_quirk(made, name)) << name;
        return plug(std::move(made));
    }
    void start() {
        switch_on();
        const auto found = bring_up();
        expect_kept(found.error(), AlState::preop);
    }
    std::string told(std::size_t n) { return words(ctx.slave(n).error); }
    void map() {
        const auto bytes = config_map(ctx, image);
        ASSERT_TRUE(ctx.group(0).mapped) << words(bytes.error());
        expect_kept(bytes.error(), AlState::safeop);
    }
    // Checks that all slaves are in the requested state if there is no error. An error names a slave, and this slave
    // has its own error that describes the cause.
    void expect_kept(const Error& error, AlState state) {
        if (error.code != Errc::none) {
            ASSERT_NE(error.slave, 0) << words(error);
            EXPECT_NE(ctx.slave(error.slave).error.code, Errc::none) << words(error);
            return;
        }
        for (const Slave& slave : ctx.slaves()) {
            if (slave.config.group != 0 && state != AlState::preop) continue;
            EXPECT_EQ(slave.al.state, std::min(state, slave.config.highest)) << slave.number;
        }
    }

    // One cycle of a millisecond.
    Result<std::uint32_t> cycle() {
        osal.advance(std::chrono::milliseconds(1));
        const auto sent = send_processdata(ctx);
        const auto wkc =
            sent ? receive_processdata(ctx, std::chrono::microseconds(500)) : Result<std::uint32_t>(sent.error());
        (void)poll(ctx, osal.now());
        return wkc;
    }
    void cycles(int count) {
        for (int n = 0; n < count; ++n) (void)cycle();
    }
    // Requests a state of all slaves, with cycles until they reach it. Returns the reached state.
    AlStatus to(AlState state, int most = 2000) {
        EXPECT_TRUE(writestate(ctx, 0, state));
        AlStatus now;
        for (int n = 0; n < most; ++n) {
            (void)cycle();
            now = *statecheck(ctx, 0, state, Duration{0});
            if (now.state == state || now.error) break;
        }
        return now;
    }
    // Maps the group and brings the slaves to OP.
    AlStatus to_op() {
        map();
        cycles(5);
        return to(AlState::op);
    }
    // Returns whether the odd device exchanges data: in the next cycle it returns its first two output words as inputs.
    bool exchanges(std::size_t n) {
        auto out = ctx.slave(n).image.outputs.bytes;
        const auto in = ctx.slave(n).image.inputs.bytes;
        if (out.size() < 4 || in.size() < 4) return false;
        static constexpr std::array kValue{std::byte{0x12}, std::byte{0x34}, std::byte{0x56}, std::byte{0x78}};
        std::copy(kValue.begin(), kValue.end(), out.begin());
        cycles(5);
        return std::equal(kValue.begin(), kValue.end(), in.begin());
    }
    // Reads an object during cycles.
    std::uint32_t beside_the_cycle(std::uint16_t slave, std::uint16_t index, std::uint8_t subindex) {
        std::array<std::byte, 4> value{};
        SdoUpload request;
        request.slave = slave;
        request.index = index;
        request.subindex = subindex;
        request.data = value;
        EXPECT_TRUE(submit(ctx, request));
        for (int n = 0; n < 1000 && request.busy(); ++n) {
            const auto wkc = cycle();
            EXPECT_TRUE(wkc) << words(wkc.error());
        }
        EXPECT_EQ(request.state(), RequestState::success) << words(request.error());
        return load_le<std::uint32_t>(value);
    }
    // 0x1018:2 of the odd device.
    Result<std::uint32_t> product(std::size_t n) {
        return SDOread<std::uint32_t>(ctx, static_cast<std::uint16_t>(n), 0x1018, 2, std::chrono::seconds(1));
    }
    static constexpr std::uint32_t kProduct = 0x0DD0;

    bool full(std::uint32_t number, unsigned sync_manager) {
        const auto place = wire::reg::sync_manager(sync_manager).address + wire::SyncManagerLayout::status::offset;
        return (at<std::uint8_t>(number, static_cast<std::uint16_t>(place)) & wire::sm_status::kMailboxFull) != 0;
    }
    template <class T>
    T at(std::uint32_t number, std::uint16_t address) {
        return segment.slave(number).registers().get<T>(address);
    }
};

}  // namespace margay
