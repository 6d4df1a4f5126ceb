// Measures the speed of the simulated segment: datagrams times the slaves that each datagram passes, per second; cycles
// with the programs of slaves in OP; and allocations. The test fails when there is an allocation. The speed is only
// printed.
#include "sim/segment.hpp"
#include "bench/common/operating_segment.hpp"
#include "sim/devices.hpp"
#include "wire/datagram.hpp"
#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <new>
#include <vector>

static std::size_t allocations = 0;

void* operator new(std::size_t bytes) {
    ++allocations;
    if (void* memory = std::malloc(bytes)) return memory;
    std::abort();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

using namespace margay;
using wire::Command;
namespace reg = wire::reg;

constexpr std::uint32_t kSlaves = 1000;
constexpr std::size_t kBytes = 8;

double cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// The slaves that process a datagram at logical address 0: all slaves that have mapped these octets.
enum class Image { apart, shared };

class Bench {
  public:
    Bench(Image image, bool sync_managers, bool programs) {
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            auto device = programs ? sim::make_device("digital_in_8").value() : sim::Device{};
            device.chip = sim::ip_core();
            segment_.add(std::move(device).assemble());
            good_ &= n == 0 ? segment_.connect_master({0, 0}) : segment_.connect({n - 1, 1}, {n, 0});
        }
        segment_.power_up(now_);
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            auto& esc = segment_.slave(n);
            const LogicalAddress at{image == Image::apart ? static_cast<std::uint32_t>(n * kBytes) : 0};
            const auto half = static_cast<std::uint16_t>(kBytes / 2);
            write(esc, reg::kStationAddress.address, {std::byte(n & 0xFF), std::byte(n >> 8)});
            std::vector<std::byte> raw(2 * reg::kFmmuStride);
            wire::store_fmmu(raw, {at, half, 0, 7, 0x1000, 0, false, true, true});
            wire::store_fmmu(MutableBytes(raw).subspan(reg::kFmmuStride),
                             {{at.value + half}, half, 0, 7, 0x1100, 0, true, false, true});
            write(esc, reg::fmmu(0).address, raw);
            if (!sync_managers) continue;
            raw.resize(2 * reg::kSyncManagerStride);
            wire::store_sync_manager(raw, {0x1000, half, 0x64, 1});
            wire::store_sync_manager(MutableBytes(raw).subspan(reg::kSyncManagerStride), {0x1100, half, 0x20, 1});
            write(esc, reg::sync_manager(0).address, raw);
            esc.write(0x1100, std::vector<std::byte>(half));
        }
        segment_.reconsider();
    }

    // Prints a line; returns false after an error.
    bool run(const char* title, Command command, std::size_t datagrams, unsigned expected_wkc) {
        std::array<std::byte, wire::kMaxFrameBytes> frame{};
        std::array<std::byte, wire::kMaxFrameBytes> sent{};
        wire::FrameBuilder builder(sent, {0, 1, 2, 3, 4, 5});
        for (std::size_t d = 0; d < datagrams; ++d) {
            auto address = command == Command::FPRD
                               ? wire::DatagramAddress(StationAddress{static_cast<std::uint16_t>(d + 1)}, 0x0130)
                           : command == Command::BRD
                               ? wire::DatagramAddress(std::uint16_t{0}, 0x0130)
                               : wire::DatagramAddress(LogicalAddress{static_cast<std::uint32_t>(d * kBytes)});
            (void)builder.append(command, 0, address, kBytes);
        }
        const auto size = builder.finish().size();
        const auto pass = [&] {
            std::copy_n(sent.begin(), size, frame.begin());
            now_ += std::chrono::milliseconds(1);
            return segment_.process(MutableBytes(frame).first(size), now_).returned;
        };
        good_ &= pass() && pass();
        const std::size_t wkc_at =
            wire::kEthernetHeaderBytes + wire::kFrameHeaderBytes + wire::kDatagramHeaderBytes + kBytes;
        const auto wkc = load_le<std::uint16_t>(frame, wkc_at);
        const auto allocated = allocations;
        // The best of several runs, in CPU time of this thread, because other processes can be active.
        double rate = 0;
        for (int run = 0; run < 10; ++run) {
            const double begin = cpu_seconds();
            double spent = 0;
            std::size_t frames = 0;
            do {
                for (int i = 0; i < 16; ++i, ++frames) good_ &= pass();
                spent = cpu_seconds() - begin;
            } while (spent < 0.03);
            rate = std::max(rate, static_cast<double>(frames * datagrams * kSlaves) / spent);
        }
        const auto made = allocations - allocated;
        std::printf("%-58s %8.1f million/s %9.1f ns a slave %9.0f slaves fit into 1 ms %6zu allocations%s\n", title,
                    rate / 1e6, 1e9 / rate, rate / 1e3, made, wkc == expected_wkc ? "" : "  WRONG WORKING COUNTER");
        return good_ && made == 0 && wkc == expected_wkc;
    }

  private:
    void write(sim::Esc& esc, std::uint16_t address, const std::vector<std::byte>& data) {
        (void)esc.ecat_write(address, data, now_);
        esc.frame_end({.good = true, .at = now_, .processing = now_});
    }

    sim::Segment segment_;
    Time now_{};
    bool good_ = true;
};

// A cycle of a millisecond with the programs of 1000 slaves in OP, as virtual_segment must execute it in this
// millisecond.
bool run_in_op(const char* title, std::span<const std::string_view> devices) {
    bench::OperatingSegment segment;
    if (!segment.build(kSlaves, devices)) {
        std::printf("%-58s cannot be brought to OP\n", title);
        return false;
    }
    bool good = true;
    const auto cycle = [&] { good &= segment.cycle() == segment.expected_wkc(); };
    for (int n = 0; n < 20; ++n) cycle();
    const auto allocated = allocations;
    const auto worked = segment.work();
    double best = 1;
    constexpr int kCycles = 20;
    for (int run = 0; run < 20; ++run) {
        const double begin = cpu_seconds();
        for (int n = 0; n < kCycles; ++n) cycle();
        best = std::min(best, (cpu_seconds() - begin) / kCycles);
    }
    const auto made = allocations - allocated;
    const double steps = static_cast<double>(segment.work() - worked) / (20.0 * kCycles * kSlaves);
    good &= segment.all_in_op() && made == 0;
    std::printf(
        "%-58s %8.2f million/s %9.1f ns a slave %9.0f slaves fit into 1 ms %6zu allocations, %zu frames, %.2f "
        "steps%s\n",
        title, kSlaves / best / 1e6, best / kSlaves * 1e9, kSlaves * 1e-3 / best, made, segment.frames(), steps,
        good ? "" : "  WRONG");
    return good;
}

}  // namespace

// Executes the case with this number (from 1), or all cases.
int main(int argc, char** argv) {
    const int only = argc > 1 ? std::atoi(argv[1]) : 0;
    const auto wanted = [only](int n) { return only == 0 || only == n; };
    std::printf("%u slaves; datagrams of %zu octets\n", kSlaves, kBytes);
    bool good = true;
    if (wanted(1)) {
        Bench bench(Image::apart, true, false);
        good &= bench.run("LRW, one a slave, 60 in a frame", Command::LRW, 60, 3);
        good &= bench.run("FPRD, one a slave, 60 in a frame", Command::FPRD, 60, 1);
        good &= bench.run("BRD, every slave answers", Command::BRD, 1, kSlaves);
    }
    if (wanted(2)) {
        Bench bench(Image::shared, false, false);
        good &= bench.run("LRW, every slave reads and writes, plain memory", Command::LRW, 1, 3 * kSlaves);
    }
    if (wanted(3)) {
        Bench bench(Image::shared, true, false);
        good &= bench.run("LRW, every slave reads and writes, SyncManagers", Command::LRW, 1, 3 * kSlaves);
    }
    if (wanted(4)) {
        Bench bench(Image::shared, true, true);
        good &= bench.run("LRW, every slave reads and writes, with its program", Command::LRW, 1, 3 * kSlaves);
    }
    constexpr std::array<std::string_view, 2> kTerminals{"analog_in_4", "analog_out_2"};
    constexpr std::array<std::string_view, 1> kStack{"digital_io_16"};
    if (wanted(5)) good &= run_in_op("cycle in OP, terminals with the program of their SII", kTerminals);
    if (wanted(6)) good &= run_in_op("cycle in OP, devices with the whole slave stack", kStack);
    return good ? 0 : 1;
}
