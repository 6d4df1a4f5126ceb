#include "far_end.hpp"
#include "oshw/xdp/filter_program.hpp"

#include <array>
#include <cerrno>
#include <cstring>

#ifdef MARGAY_LIBBPF
#include <bpf/bpf.h>
#include <bpf/libbpf.h>
#include <linux/bpf.h>
#include <linux/if_link.h>
#include <net/if.h>
#include <unistd.h>
#endif

namespace margay::bench {

#ifdef MARGAY_LIBBPF
namespace {

constexpr std::uint8_t r0 = BPF_REG_0;
constexpr std::uint8_t r1 = BPF_REG_1;
constexpr std::uint8_t r2 = BPF_REG_2;
constexpr std::uint8_t r3 = BPF_REG_3;
constexpr std::uint8_t r4 = BPF_REG_4;

using xdp::op;

bpf_insn load(int size, std::uint8_t to, std::uint8_t from, std::size_t offset) {
    return op(BPF_LDX | BPF_MEM | size, to, from, static_cast<int>(offset), 0);
}
bpf_insn store(int size, std::uint8_t to, std::uint8_t from, std::size_t offset) {
    return op(BPF_STX | BPF_MEM | size, to, from, static_cast<int>(offset), 0);
}

// The program passes on frames that are too short or are not EtherCAT. No socket receives them.
std::array<bpf_insn, 16> program(const Answer& answer) {
    constexpr int kEtherCatInWireOrder = 0xA488;
    constexpr int kPass = 11;  // relative to the comparison at 4; 9 relative to the comparison at 6
    return {
        load(BPF_W, r2, r1, offsetof(xdp_md, data)),
        load(BPF_W, r3, r1, offsetof(xdp_md, data_end)),
        op(BPF_ALU64 | BPF_MOV | BPF_X, r4, r2, 0, 0),
        op(BPF_ALU64 | BPF_ADD | BPF_K, r4, 0, 0, static_cast<int>(answer.frame_bytes)),
        op(BPF_JMP | BPF_JGT | BPF_X, r4, r3, kPass - 2, 0),
        load(BPF_H, r0, r2, 12),
        op(BPF_JMP | BPF_JNE | BPF_K, r0, 0, kPass - 4, kEtherCatInWireOrder),
        load(BPF_B, r0, r2, 6),
        op(BPF_ALU64 | BPF_OR | BPF_K, r0, 0, 0, 2),
        store(BPF_B, r2, r0, 6),
        op(BPF_ALU64 | BPF_MOV | BPF_K, r0, 0, 0, answer.wkc),
        store(BPF_H, r2, r0, answer.wkc_at),
        op(BPF_ALU64 | BPF_MOV | BPF_K, r0, 0, 0, XDP_TX),
        op(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
        op(BPF_ALU64 | BPF_MOV | BPF_K, r0, 0, 0, XDP_PASS),
        op(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
    };
}

class XdpEcho final : public FarEnd {
  public:
    XdpEcho(int interface, int program) : interface_(interface), program_(program) {}
    ~XdpEcho() override {
        (void)bpf_xdp_detach(interface_, XDP_FLAGS_SKB_MODE, nullptr);
        ::close(program_);
    }
    [[nodiscard]] std::string name() const override { return "an XDP program at the far end of a veth pair"; }

  private:
    int interface_;
    int program_;
};

}  // namespace

std::unique_ptr<FarEnd> echo_by_xdp(const Answer& answer, std::string& why) {
    const auto code = program(answer);
    std::array<char, 4096> log{};
    bpf_prog_load_opts options{};
    options.sz = sizeof options;
    options.log_buf = log.data();
    options.log_size = log.size();
    options.log_level = 1;
    const int loaded = bpf_prog_load(BPF_PROG_TYPE_XDP, "echo", "MIT", code.data(), code.size(), &options);
    if (loaded < 0) {
        why = std::string("the kernel does not take the XDP program: ") + std::strerror(errno) + ' ' + log.data();
        return nullptr;
    }
    const auto far = static_cast<int>(if_nametoindex("far"));
    // Generic mode: the frame is already an skb, and the near end needs no NAPI.
    if (const int error = bpf_xdp_attach(far, loaded, XDP_FLAGS_SKB_MODE, nullptr); error != 0) {
        why = std::string("the XDP program cannot be attached: ") + std::strerror(-error);
        ::close(loaded);
        return nullptr;
    }
    return std::make_unique<XdpEcho>(far, loaded);
}

#else

std::unique_ptr<FarEnd> echo_by_xdp(const Answer&, std::string& why) {
    why = "built without libbpf";
    return nullptr;
}

#endif

}  // namespace margay::bench
