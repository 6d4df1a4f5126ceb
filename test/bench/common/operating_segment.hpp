// A simulated segment in OP with the programs of its slaves, and the frames of one cycle. A benchmark sends these
// frames repeatedly in place of a master.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/run.hpp>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <vector>

namespace margay::bench {

class OperatingSegment {
  public:
    // Brings slaves of these devices, in turns, to OP. Returns false when a step has failed.
    [[nodiscard]] bool build(std::uint32_t slaves, std::span<const std::string_view> devices) {
        for (std::uint32_t n = 0; n < slaves; ++n) {
            auto device = sim::make_device(devices[n % devices.size()]).value();
            segment_.add(std::move(device).assemble());
            if (!(n == 0 ? segment_.connect_master({0, 0}) : segment_.connect({n - 1, 1}, {n, 0}))) return false;
        }
        segment_.power_up(osal_.now());
        HostContext ctx{Limits{.slaves = static_cast<std::uint16_t>(slaves), .process_frames = 32}};
        const CycleSettings cycle{.reply_timeout = std::chrono::milliseconds(20)};
        if (!init(ctx, nic_, osal_) || !config_init(ctx) || !config_map(ctx, image_)) return false;
        if (!reach(ctx, AlState::op, std::chrono::seconds(60), cycle)) return false;
        nic_.keep = true;
        if (!send_processdata(ctx) || !receive_processdata(ctx, cycle.reply_timeout)) return false;
        expected_wkc_ = ctx.group(0).expected_wkc;
        now_ = osal_.now();
        return true;
    }

    // Executes one cycle of a millisecond as virtual_segment does: the frames one after the other, and the programs
    // each 50 µs. Returns the working counter of all frames.
    [[nodiscard]] unsigned cycle() {
        constexpr Duration kPeriod = std::chrono::milliseconds(1);
        constexpr Duration kLook = std::chrono::microseconds(50);
        const Time end = now_ + kPeriod;
        unsigned wkc = 0;
        for (const auto& sent : nic_.frames) {
            std::copy(sent.begin(), sent.end(), frame_.begin());
            const auto bytes = std::span(frame_).first(sent.size());
            if (segment_.process(bytes, now_).returned) wkc += counted(bytes);
            now_ += kLook;
            segment_.advance(now_);
        }
        for (; now_ < end; now_ += kLook) segment_.advance(now_);
        now_ = end;
        return wkc;
    }
    [[nodiscard]] unsigned expected_wkc() const { return expected_wkc_; }
    [[nodiscard]] std::size_t frames() const { return nic_.frames.size(); }
    [[nodiscard]] bool all_in_op() {
        for (std::uint32_t n = 0; n < segment_.size(); ++n)
            if (segment_.slave(n).registers().get<std::uint16_t>(wire::reg::kAlStatus.address) != 0x08) return false;
        return true;
    }
    // The number of times that programs and units of the slaves had work to do.
    [[nodiscard]] std::uint64_t work() {
        std::uint64_t sum = 0;
        for (std::uint32_t n = 0; n < segment_.size(); ++n) sum += segment_.slave(n).work();
        return sum;
    }

  private:
    // Keeps the frames that it sends while `keep` is set.
    class KeepingNic final : public Nic {
      public:
        explicit KeepingNic(Nic& to) : to_(to) {}
        bool keep = false;
        std::vector<std::vector<std::byte>> frames;
        SendStatus send(std::span<const std::byte> frame) noexcept override {
            if (keep) frames.emplace_back(frame.begin(), frame.end());
            return to_.send(frame);
        }
        std::size_t receive(std::span<std::byte> into) noexcept override { return to_.receive(into); }
        Time next_arrival() const noexcept override { return to_.next_arrival(); }

      private:
        Nic& to_;
    };

    // The sum of the working counters of the datagrams.
    static unsigned counted(std::span<const std::byte> frame) {
        unsigned sum = 0;
        std::size_t at = wire::kEthernetHeaderBytes + wire::kFrameHeaderBytes;
        for (bool more = true; more;) {
            const auto word = load_le<std::uint16_t>(frame, at + 6);
            at += wire::kDatagramHeaderBytes + (word & 0x07FF);
            sum += load_le<std::uint16_t>(frame, at);
            at += 2;
            more = (word & 0x8000) != 0;
        }
        return sum;
    }

    VirtualOsal osal_;
    sim::Segment segment_;
    SimulatedNic simulated_{segment_, osal_};
    KeepingNic nic_{simulated_};
    std::array<std::byte, 65536> image_{};
    std::array<std::byte, wire::kMaxFrameBytes> frame_{};
    Time now_{};
    unsigned expected_wkc_ = 0;
};

}  // namespace margay::bench
