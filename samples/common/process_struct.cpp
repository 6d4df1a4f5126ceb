#include "common/process_struct.hpp"

#include "common/slave_report.hpp"

#include <fmt/format.h>

#include <cctype>
#include <set>
#include <span>

namespace margay::samples {
namespace {

constexpr std::uint32_t kMostFieldBits = 64;

// Removes characters that could end the comment in which a name is written.
std::string comment(std::string text) {
    for (char& c : text)
        if (c == '*' || c == '/' || c == '\\' || static_cast<unsigned char>(c) < 0x20) c = ' ';
    return text;
}

struct CType {
    std::string type;
    std::string suffix{};
};

// The C type for a CoE type when the lengths agree, else an unsigned integer, else an array of octets.
CType c_type(const MapEntry& e) {
    const bool is_signed = (e.data_type >= 0x02 && e.data_type <= 0x04) || e.data_type == 0x15;
    if (e.data_type == 0x08 && e.bits == 32) return {"float"};
    if (e.data_type == 0x11 && e.bits == 64) return {"double"};
    if (e.bits == 8 || e.bits == 16 || e.bits == 32 || e.bits == 64)
        return {fmt::format("{}int{}_t", is_signed ? "" : "u", e.bits)};
    return {"uint8_t", fmt::format("[{}]", e.bits / 8)};
}

// Writes one of the two structs (outputs or inputs).
class StructWriter {
  public:
    StructWriter(Context& ctx, std::string name, std::uint32_t begin_bytes, std::uint32_t bytes)
        : ctx_(ctx),
          name_(std::move(name)),
          at_(begin_bytes * 8),
          begin_(begin_bytes * 8),
          end_((begin_bytes + bytes) * 8) {}

    std::string run(std::span<const MapEntry> entries) {
        for (std::size_t n = 0; n < entries.size();) {
            skip_to(entries[n].offset_bits / 8 * 8);
            if (entries[n].offset_bits % 8 == 0 && entries[n].bits % 8 == 0)
                member(entries[n++]);
            else
                n = fields(entries, n);
        }
        skip_to(end_);
        const std::uint32_t bytes = (end_ - begin_) / 8;
        if (bytes == 0) return {};
        return fmt::format("typedef struct {} {{\n{}}} {};\n\n{}static_assert(sizeof({}) == {}, \"\");\n\n", name_,
                           members_, name_, asserts_, name_, bytes);
    }

  private:
    std::string unique(const MapEntry& e) {
        std::string name = identifier(e.pdo_name);
        const std::string own = identifier(e.name);
        if (!own.empty()) name += (name.empty() ? "" : "_") + own;
        if (name.empty())
            name =
                e.pdo == 0 ? fmt::format("sm{}", e.sync_manager) : fmt::format("x{:04x}_{:02x}", e.index, e.subindex);
        name = fmt::format("s{}_{}", e.slave, name);
        std::string candidate = name;
        for (int n = 2; !names_.insert(candidate).second; ++n) candidate = fmt::format("{}_{}", name, n);
        return candidate;
    }
    std::string remark(const MapEntry& e) {
        return comment(fmt::format("slave {} {} {:#06x}:{} at {}.{}", e.slave,
                                   words_of_slave(ctx_.slave(e.slave).name()), e.index, e.subindex, e.offset_bits / 8,
                                   e.offset_bits % 8));
    }
    void skip_to(std::uint32_t bit) {
        if (at_ >= bit) return;
        members_ += fmt::format("    uint8_t pad_{}[{}];\n", at_ / 8, (bit - at_) / 8);
        at_ = bit;
    }
    void member(const MapEntry& e) {
        if (e.index == 0 && e.pdo != 0) return skip_to(e.offset_bits + e.bits);  // a gap has no name
        const auto type = c_type(e);
        const auto name = unique(e);
        members_ += fmt::format("    {} {}{}; /* {} */\n", type.type, name, type.suffix, remark(e));
        asserts_ +=
            fmt::format("static_assert(offsetof({}, {}) == {}, \"\");\n", name_, name, (e.offset_bits - begin_) / 8);
        at_ += e.bits;
    }
    // Writes the entries that share octets, up to an entry that ends on an octet boundary. When the run has too many
    // bits for a bit-field, it becomes one array.
    std::size_t fields(std::span<const MapEntry> entries, std::size_t n) {
        std::size_t last = n;
        std::uint32_t end = entries[n].offset_bits + entries[n].bits;
        bool long_one = entries[n].bits > kMostFieldBits;
        while (end % 8 != 0 && last + 1 < entries.size() && entries[last + 1].offset_bits < (end + 7) / 8 * 8) {
            ++last;
            end = entries[last].offset_bits + entries[last].bits;
            long_one |= entries[last].bits > kMostFieldBits;
        }
        const std::uint32_t octets_end = (end + 7) / 8 * 8;
        if (long_one) {
            members_ += fmt::format("    uint8_t bits_{}[{}];", (at_ - begin_) / 8, (octets_end - at_) / 8);
            for (std::size_t i = n; i <= last; ++i)
                members_ += fmt::format(" /* {} bits: {} */", entries[i].bits, remark(entries[i]));
            members_ += "\n";
            at_ = octets_end;
            return last + 1;
        }
        std::uint32_t bit = at_;
        for (std::size_t i = n; i <= last; ++i) {
            gap(entries[i].offset_bits - bit, octets_end - at_);
            const std::string name =
                entries[i].index == 0 && entries[i].pdo != 0 ? std::string() : " " + unique(entries[i]);
            members_ += fmt::format("    {}{} : {}; /* {} */\n", field_type(octets_end - at_), name, entries[i].bits,
                                    remark(entries[i]));
            bit = entries[i].offset_bits + entries[i].bits;
        }
        gap(octets_end - bit, octets_end - at_);
        at_ = octets_end;
        return last + 1;
    }
    // All fields of a run have one type. The struct is packed, so the run occupies no more octets than its fields
    // need.
    static const char* field_type(std::uint32_t run_bits) {
        return run_bits <= 8 ? "uint8_t" : run_bits <= 16 ? "uint16_t" : run_bits <= 32 ? "uint32_t" : "uint64_t";
    }
    void gap(std::uint32_t bits, std::uint32_t run_bits) {
        for (; bits > 0; bits -= std::min(bits, 8U))
            members_ += fmt::format("    {} : {};\n", field_type(run_bits), std::min(bits, 8U));
    }

    Context& ctx_;
    std::string name_;
    std::uint32_t at_;
    std::uint32_t begin_;
    std::uint32_t end_;
    std::set<std::string> names_{};
    std::string members_{};
    std::string asserts_{};
};

}  // namespace

std::string identifier(const std::string& text) {
    std::string out;
    for (const char c : text) {
        const auto letter = static_cast<unsigned char>(c);
        if (letter < 0x80 && std::isalnum(letter) != 0)
            out += static_cast<char>(std::tolower(letter));
        else if (!out.empty() && out.back() != '_')
            out += '_';
    }
    while (!out.empty() && out.back() == '_') out.pop_back();
    return out;
}

std::string map_cstruct(Context& ctx, const ProcessMap& map) {
    std::size_t outputs = 0;
    while (outputs < map.entries.size() && map.entries[outputs].offset_bits < map.output_bytes * 8) ++outputs;
    const std::span<const MapEntry> all(map.entries);
    std::string text =
        "/* Process image of an EtherCAT segment, for little-endian machines: outputs at octet 0 of the image, inputs "
        "behind them. */\n"
        "#pragma once\n\n#include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n\n#pragma pack(push, 1)\n\n";
    text += StructWriter(ctx, "process_outputs", 0, map.output_bytes).run(all.first(outputs));
    text += StructWriter(ctx, "process_inputs", map.output_bytes, map.input_bytes).run(all.subspan(outputs));
    text += fmt::format("#pragma pack(pop)\n\nenum {{ kProcessOutputsOffset = 0, kProcessInputsOffset = {} }};\n",
                        map.output_bytes);
    return text;
}

}  // namespace margay::samples
