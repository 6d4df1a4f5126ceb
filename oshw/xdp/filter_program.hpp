// The XDP program that passes EtherCAT frames, with or without a VLAN tag, to the AF_XDP socket of their receive queue.
#pragma once

#include <linux/bpf.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace margay::xdp {

// One instruction.
[[nodiscard]] inline bpf_insn op(int code, std::uint8_t to, std::uint8_t from, int offset, int immediate) {
    bpf_insn i{};
    i.code = static_cast<std::uint8_t>(code);
    i.dst_reg = to & 0xF;
    i.src_reg = from & 0xF;
    i.off = static_cast<std::int16_t>(offset);
    i.imm = immediate;
    return i;
}

// `sockets`: the file descriptor of the map with the sockets by queue (BPF_MAP_TYPE_XSKMAP).
[[nodiscard]] inline std::array<bpf_insn, 18> filter_program(int sockets) {
    constexpr std::uint8_t r0 = BPF_REG_0;
    constexpr std::uint8_t r1 = BPF_REG_1;
    constexpr std::uint8_t r2 = BPF_REG_2;
    constexpr std::uint8_t r3 = BPF_REG_3;
    constexpr std::uint8_t r4 = BPF_REG_4;
    constexpr std::uint8_t r5 = BPF_REG_5;
    // The values that the processor reads from the octets 88 A4 and 81 00.
    constexpr bool kLittle = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__;
    constexpr int kEtherCat = kLittle ? 0xA488 : 0x88A4;
    constexpr int kVlan = kLittle ? 0x0081 : 0x8100;
    constexpr int kMov = BPF_ALU64 | BPF_MOV;
    constexpr int kLoad = BPF_LDX | BPF_MEM;
    return {
        op(kLoad | BPF_W, r2, r1, offsetof(xdp_md, data), 0),
        op(kLoad | BPF_W, r3, r1, offsetof(xdp_md, data_end), 0),
        op(kMov | BPF_X, r4, r2, 0, 0),
        op(BPF_ALU64 | BPF_ADD | BPF_K, r4, 0, 0, 18),  // both EtherTypes
        op(BPF_JMP | BPF_JGT | BPF_X, r4, r3, 11, 0),   // too short: pass
        op(kLoad | BPF_H, r5, r2, 12, 0),
        op(BPF_JMP | BPF_JEQ | BPF_K, r5, 0, 3, kEtherCat),
        op(BPF_JMP | BPF_JNE | BPF_K, r5, 0, 8, kVlan),  // pass
        op(kLoad | BPF_H, r5, r2, 16, 0),
        op(BPF_JMP | BPF_JNE | BPF_K, r5, 0, 6, kEtherCat),  // pass
        // take:
        op(kLoad | BPF_W, r2, r1, offsetof(xdp_md, rx_queue_index), 0),
        op(BPF_LD | BPF_IMM | BPF_DW, r1, BPF_PSEUDO_MAP_FD, 0, sockets),
        op(0, 0, 0, 0, 0),                     // the upper half of the constant
        op(kMov | BPF_K, r3, 0, 0, XDP_PASS),  // used if the queue has no socket
        op(BPF_JMP | BPF_CALL, 0, 0, 0, BPF_FUNC_redirect_map),
        op(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
        op(kMov | BPF_K, r0, 0, 0, XDP_PASS),  // pass:
        op(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
    };
}

}  // namespace margay::xdp
