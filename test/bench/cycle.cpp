// Measures the cost of a cycle: user instructions of send_processdata() + receive_processdata() by callgrind, frames,
// octets on the wire and allocations. The segment is simulated until the slaves are mapped. Then the NIC answers at
// once, so that only the master is counted. The cost of the NIC and the clock of this program is measured separately
// and subtracted. The `bare` loop does only what every master must do: copy the outputs to the frame, send, receive,
// compare the working counter, copy the inputs.
#include "common/attached_cycle.hpp"
#include "common/mapped_bus.hpp"
#include "mailbox/channel.hpp"
#include "network/entries.hpp"

#include <margay/entry.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <utility>

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

// A far end that returns every frame at once, with the expected working counter.
class EchoNic final : public Nic {
  public:
    const Group* group = nullptr;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        frame_[count_++ % frame_.size()] = frame;
        return SendStatus::sent;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (taken_ == count_) return 0;
        const auto frame = frame_[taken_ % frame_.size()];
        std::memcpy(into.data(), frame.data(), frame.size());
        into[6] |= std::byte{2};
        const std::uint16_t wkc = group->datagrams[taken_ % group->datagrams.size()].expected;
        into[frame.size() - 2] = static_cast<std::byte>(wkc);
        into[frame.size() - 1] = static_cast<std::byte>(wkc >> 8);
        ++taken_;
        return frame.size();
    }

  private:
    std::array<std::span<const std::byte>, 64> frame_;
    std::size_t count_ = 0;
    std::size_t taken_ = 0;
};

struct Bench : bench::MappedBus {
    EchoNic echo;

    bool start(std::uint32_t slaves, std::uint32_t output_bytes, std::uint32_t input_bytes) {
        if (!build(slaves, output_bytes, input_bytes)) return false;
        echo.group = &ctx->group(0);
        plug_over(echo);
        return true;
    }
};

// A hundred inputs of 16 bits, eight per slave. They are read by handles, and by pointers that the application has
// calculated itself.
class Entries {
  public:
    static constexpr std::size_t kCount = 100;
    static constexpr std::uint32_t kSlaves = 13;
    static constexpr std::uint32_t kOctets = 16;  // per slave and direction

    // The only PDO of these slaves has one entry for all octets. Therefore the handles are bound here, in the same way
    // as config_map() binds them.
    [[nodiscard]] bool find(Context& ctx) {
        const Group& group = ctx.group(0);
        for (std::size_t n = 0; n < kCount; ++n) {
            const Slave& slave = ctx.slave(n / 8 + 1);
            const EntryPlace place{
                .slave = slave.number,
                .direction = Direction::inputs,
                .offset_bits = slave.image.inputs.offset_bits + static_cast<std::uint32_t>(n % 8 * 16),
                .bits = 16,
                .mapping = group.mappings};
            EntryAccess::bind(handles_[n], place, group.image, 0);
            pointers_[n] = group.image.data() + place.offset_bits / 8;
        }
        return handles_[kCount - 1].mapped();
    }
    [[nodiscard]] std::uint64_t by_handle() const {
        std::uint64_t sum = 0;
        for (const Input<std::uint16_t>& handle : handles_) sum += handle.read();
        return sum;
    }
    [[nodiscard]] std::uint64_t by_pointer() const {
        std::uint64_t sum = 0;
        for (const std::byte* pointer : pointers_) {
            std::uint16_t value = 0;
            std::memcpy(&value, pointer, sizeof value);
            sum += value;
        }
        return sum;
    }

  private:
    template <std::size_t... N>
    static std::array<Input<std::uint16_t>, kCount> make(std::index_sequence<N...>) {
        return {Input<std::uint16_t>{std::uint16_t{1}, static_cast<std::uint16_t>(N)}...};
    }
    std::array<Input<std::uint16_t>, kCount> handles_ = make(std::make_index_sequence<kCount>());
    std::array<const std::byte*, kCount> pointers_{};
};

// Executes the work that callgrind counts: `work` is "cycle", "bare", "nic" (only the NIC and the clock), or a cycle
// with entries read by "handles" or by "pointers".
int child(const std::string& work, std::uint32_t slaves, std::uint32_t out, std::uint32_t in, unsigned cycles) {
    static Bench bench;
    if (!bench.start(slaves, out, in)) return 1;
    const Group& group = bench.ctx->group(0);
    alignas(8) static std::array<std::byte, 1514> sent{};
    static std::array<std::byte, 1514> got{};
    const std::size_t allocated = allocations;
    std::uint64_t sum = 0;
    const bool handles = work == "handles";
    const bool pointers = work == "pointers";
    static Entries entries;
    if ((handles || pointers) && !entries.find(*bench.ctx)) return 1;
    const bool cycle = work == "cycle" || handles || pointers;
    const bool bare = work == "bare";
    for (unsigned n = 0; n < cycles; ++n) {
        if (cycle) {
            if (!send_processdata(*bench.ctx)) return 1;
            const auto wkc = receive_processdata(*bench.ctx, std::chrono::milliseconds(1));
            if (!wkc) return 1;
            sum += *wkc;
            if (handles) sum += entries.by_handle();
            if (pointers) sum += entries.by_pointer();
            continue;
        }
        if (!bare) sum += static_cast<std::uint64_t>(bench.osal.now().time_since_epoch().count() & 1);
        for (const DatagramStatus& d : group.datagrams) {
            const auto bytes = std::min<std::size_t>(group.image.size(), 1486);
            if (bare)
                std::memcpy(sent.data() + 26, group.image.data(), std::min<std::size_t>(bytes, group.output_bytes));
            (void)bench.nic.send(std::span(sent).first(bytes + 28));
            const std::size_t length = bench.nic.receive(got);
            if (!bare) continue;
            if (got[length - 2] != static_cast<std::byte>(d.expected)) return 1;
            std::memcpy(
                group.image.data() + group.output_bytes, got.data() + 26 + group.output_bytes,
                std::min<std::size_t>(bytes - std::min<std::size_t>(bytes, group.output_bytes), group.input_bytes));
        }
    }
    if (allocations != allocated) {
        std::fprintf(stderr, "%zu allocations in %u cycles\n", allocations - allocated, cycles);
        return 1;
    }
    return sum == 1 ? 2 : 0;
}

// Instructions per cycle, the difference of two runs; negative after an error.
double count(const std::string& self, const std::string& work, std::uint32_t slaves, std::uint32_t out,
             std::uint32_t in) {
    constexpr unsigned kCycles = 1000;
    double collected[2] = {};
    for (unsigned run = 0; run < 2; ++run) {
        const std::string command = "valgrind --tool=callgrind --callgrind-out-file=/dev/null " + self + " " + work +
                                    " " + std::to_string(slaves) + " " + std::to_string(out) + " " +
                                    std::to_string(in) + " " + std::to_string((run + 1) * kCycles) + " 2>&1";
        FILE* pipe = popen(command.c_str(), "r");
        if (pipe == nullptr) return -1;
        char line[256];
        while (std::fgets(line, sizeof line, pipe) != nullptr)
            if (const char* at = std::strstr(line, "Collected : ")) collected[run] = std::strtod(at + 12, nullptr);
        if (pclose(pipe) != 0) return -1;
    }
    return (collected[1] - collected[0]) / kCycles;
}

// Instruction counts of other masters for the same cycle; 0: unknown.
unsigned known_peer(std::uint32_t slaves, std::uint32_t out) {
    if (out != 32) return 0;
    switch (slaves) {
        case 1: return 884;
        case 10: return 1109;
        case 50: return 3522;
        case 100: return 6109;
        default: return 0;
    }
}

// Limits: a larger count means that the cycle has become more expensive. memcpy() differs a little between machines.
struct Most {
    std::uint32_t slaves;
    std::uint32_t octets;  // of outputs and of inputs, per slave
    double instructions;
};
constexpr Most kMost[] = {{1, 16, 265}, {1, 743, 450}, {100, 32, 1400}};

// The instructions for the entries of a cycle, and for the cycle itself, without the NIC.
struct EntryCost {
    double cycle = 0;
    double handles = 0;
    double pointers = 0;
};
constexpr double kMostForHandles = 1.4;
EntryCost count_entries(const std::string& self) {
    const auto cost = [&](const char* work) {
        return count(self, work, Entries::kSlaves, Entries::kOctets, Entries::kOctets);
    };
    const double cycle = cost("cycle");
    return {cycle - cost("nic"), cost("handles") - cycle, cost("pointers") - cycle};
}

// Fails when the cycle needs more instructions than the limits. Instruction counts do not depend on the load of the
// machine.
int check(const std::string& self) {
    if (!bench::check_attached(self, false)) return 1;
    if (std::system("valgrind --version >/dev/null 2>&1") != 0) {
        std::printf("no valgrind here: no instructions were counted\n");
        return 77;
    }
    int grown = bench::check_attached(self, true) ? 0 : 1;
    for (const Most& most : kMost) {
        const double net = count(self, "cycle", most.slaves, most.octets, most.octets) -
                           count(self, "nic", most.slaves, most.octets, most.octets);
        std::printf("%u x %u octets: %.0f instructions, %.0f at most\n", most.slaves, 2 * most.octets, net,
                    most.instructions);
        grown |= net > 0 && net <= most.instructions ? 0 : 1;
    }
    const EntryCost cost = count_entries(self);
    const double by_handle = cost.cycle + cost.handles;
    const double by_pointer = cost.cycle + cost.pointers;
    std::printf("a cycle with %zu entries: %.0f instructions by handles, %.0f by pointers; %.2f times, %.2f at most\n",
                Entries::kCount, by_handle, by_pointer, by_handle / by_pointer, kMostForHandles);
    grown |= cost.pointers > 0 && by_handle <= by_pointer * kMostForHandles ? 0 : 1;
    return grown;
}

// The lower bound for this number of octets: one datagram per frame, and full frames.
struct Bound {
    unsigned frames = 0;
    unsigned wire_bytes = 0;
    explicit Bound(std::uint32_t octets) {
        for (std::size_t left = octets; left > 0; ++frames) {
            const std::size_t part = std::min(left, wire::kMaxDatagramData);
            wire_bytes += static_cast<unsigned>(
                wire::bytes_on_the_wire(wire::kFramePrefixBytes + wire::kDatagramOverheadBytes + part));
            left -= part;
        }
    }
};

bool report(const std::string& self, const char* title, std::uint32_t slaves, std::uint32_t out, std::uint32_t in) {
    const double cycle = count(self, "cycle", slaves, out, in);
    const double nic = count(self, "nic", slaves, out, in);
    const double bare = count(self, "bare", slaves, out, in);
    Bench bench;
    if (cycle < 0 || nic < 0 || bare < 0 || !bench.start(slaves, out, in)) {
        std::printf("%-28s failed\n", title);
        return false;
    }
    const LinkStatistics before = bench.ctx->statistics();
    for (int n = 0; n < 100; ++n) {
        (void)send_processdata(*bench.ctx);
        (void)receive_processdata(*bench.ctx, std::chrono::milliseconds(1));
    }
    const double frames = static_cast<double>(bench.ctx->statistics().frames_sent - before.frames_sent) / 100;
    const double wire = static_cast<double>(bench.ctx->statistics().bytes_on_wire - before.bytes_on_wire) / 100;
    const unsigned peer = known_peer(slaves, out);
    const Bound bound(slaves * (out + in));
    std::printf("%-28s %8.0f %8.0f %8.0f %8.0f %8s %5.2f %5u %6.1f %% %6.1f %%\n", title, cycle - nic, cycle, nic, bare,
                peer == 0 ? "" : std::to_string(peer).c_str(), frames, bound.frames, 100.0 * slaves * (out + in) / wire,
                100.0 * bound.wire_bytes / wire);
    return true;
}

}  // namespace

int main(int argc, char** argv) {
    const auto number = [&](int n) { return static_cast<std::uint32_t>(std::strtoul(argv[n], nullptr, 10)); };
    if (argc == 2 && std::strcmp(argv[1], "check") == 0) return check(argv[0]);
    if (const int code = bench::attached_child(argc, argv); code >= 0) return code;
    if (argc == 6) return child(argv[1], number(2), number(3), number(4), number(5));
    std::printf("instructions a cycle; NIC and clock taken off in the first column\n");
    std::printf("frames and their least; payload of the octets on the wire, and of the payload that can be\n");
    std::printf("%-28s %8s %8s %8s %8s %8s %5s %5s %8s %8s\n", "", "margay", "total", "nic", "bare", "peer", "frame",
                "least", "payload", "of best");
    bool good = report(argv[0], "1 slave, 16 + 16 octets", 1, 16, 16);
    good &= report(argv[0], "1 slave, 743 + 743 octets", 1, 743, 743);
    for (const std::uint32_t slaves : {1U, 10U, 50U, 100U})
        good &= report(argv[0], (std::to_string(slaves) + " slaves of 32 + 32 octets").c_str(), slaves, 32, 32);
    good &= report(argv[0], "100 slaves of 4 + 4 octets", 100, 4, 4);
    const EntryCost entries = count_entries(argv[0]);
    std::printf("a cycle of %u slaves: %.0f; reading %zu entries of it by handles: %.0f more, by pointers: %.0f more\n",
                Entries::kSlaves, entries.cycle, Entries::kCount, entries.handles, entries.pointers);
    std::printf("an application with an AttachServer, 10 slaves of 32 + 32 octets, without NIC and clock:\n");
    good &= bench::check_attached(argv[0], true);
    std::printf("allocations a cycle: %s\n", good ? "0" : "see above");
    constexpr Limits kUsual;
    std::printf(
        "state a slave: %zu octets, of these %zu what the application wants of it (configuration, hooks), %zu its "
        "place in the image\n",
        sizeof(Slave), sizeof(SlaveConfiguration) + sizeof(SlaveHooks), sizeof(SlaveImage));
    std::printf("with mailbox: %zu octets, of these %zu the channel, %zu emergencies kept\n",
                sizeof(Slave) + sizeof(MailboxChannel) + kUsual.emergencies * sizeof(Emergency), sizeof(MailboxChannel),
                kUsual.emergencies * sizeof(Emergency));
    return good ? 0 : 1;
}
