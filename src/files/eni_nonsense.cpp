// Contents of an ENI file that the library does not use, and that are invalid or contradict used contents. They show
// that the file is not as its author intended.
#include "files/eni_read.hpp"
#include "files/transitions.hpp"

#include <algorithm>

namespace margay::files {
namespace {

// ------------------------------------------------------------------ values without a meaning

// Numbers that the library does not use. Numbers that it uses are checked where they are read.
struct UnusedNumber {
    std::string_view element;
    std::uint64_t most;
};
constexpr UnusedNumber kUnusedNumbers[] = {{"ByteSize", 0xFFFF'FFFF},
                                           {"ControlByte", 0xFF},
                                           {"StartAddress", 0xFFFF},
                                           {"DefaultSize", 0xFFFF},
                                           {"MinSize", 0xFFFF},
                                           {"MaxSize", 0xFFFF},
                                           {"StartAddr", 0xFFFF'FFFF},
                                           {"Priority", 0xFFFF'FFFF},
                                           {"TaskId", 0xFFFF'FFFF},
                                           {"BeforeSlave", 0xFFFF},
                                           {"Adp", 0xFFFF},
                                           {"Cnt", 0xFFFF},
                                           {"Retries", 0xFFFF},
                                           {"Count", 0xFFFF'FFFF},
                                           {"CycleTime1", 0xFFFF'FFFF},
                                           {"Timeout", 0xFFFF'FFFF},
                                           {"Cmd", 0xFF}};

bool is_one_of(std::string_view text, std::initializer_list<std::string_view> words) {
    return std::ranges::any_of(words, [&](std::string_view word) { return same_word(text, word); });
}
bool has_hex_digits(std::string_view text, std::size_t count) {
    return text.size() == count && text.find_first_not_of("0123456789abcdefABCDEF") == std::string_view::npos;
}

// The expected value in words if the value is wrong; empty: the value is right.
std::string wanted_number(std::string_view element, std::string_view text) {
    const auto* const known = std::ranges::find(kUnusedNumbers, element, &UnusedNumber::element);
    if (known == std::end(kUnusedNumbers)) return {};
    const Number read = parse_number(text);
    const bool negative = read.negative && read.magnitude != 0;
    if (read.valid && !negative && read.magnitude <= known->most) return {};
    return "no number from 0 to " + std::to_string(known->most);
}
std::string wanted_word(std::string_view parent, std::string_view element, std::string_view text) {
    if (element == "State" && parent == "Cmd")
        return is_one_of(text, {"INIT", "PREOP", "BOOT", "SAFEOP", "OP"}) ? "" : "no AL state";
    if (element == "Enable" && parent.starts_with("Sm"))
        return is_one_of(text, {"0", "1", "true", "false"}) ? "" : "neither true nor false";
    if (element == "Port" && parent == "PreviousPort")
        return is_one_of(text, {"A", "B", "C", "D"}) ? "" : "no port from A to D";
    if (element == "Type" && parent.size() == 3 && parent.starts_with("Sm"))
        return is_one_of(text, {"MBoxOut", "MBoxIn", "Outputs", "Inputs", "Unused"}) ? "" : "no use of a SyncManager";
    if (element == "Protocol" && parent == "Mailbox")
        return is_one_of(text, {"AoE", "EoE", "CoE", "FoE", "SoE", "VoE"}) ? "" : "no protocol of a mailbox";
    if (element == "PotentialReferenceClock")
        return is_one_of(text, {"0", "1", "true", "false"}) ? "" : "neither true nor false";
    if (element == "Data" && parent == "IdentifyCmd")
        return text.size() % 2 == 0 && has_hex_digits(text, text.size()) ? "" : "no whole number of octets";
    if (element == "Transition" && parent == "IdentifyCmd")
        return transition_by_initials(text) != Transition::none || is_one_of(text, {"II", "PP", "SS", "PO"})
                   ? ""
                   : "no transition";
    if (parent != "Info") return {};
    if (element == "Destination" || element == "Source")
        return has_hex_digits(text, 12) ? "" : "no MAC address of 12 hexadecimal digits";
    // The octets of the type are swapped in the files of most tools.
    if (element == "EtherType") return is_one_of(text, {"a488", "88a4"}) ? "" : "not the type of EtherCAT, a488";
    return {};
}

void name_nonsense(Reader& r, Node node) {
    const Value value = content(node);
    if (!value.there) return;
    std::string wanted = wanted_number(node.name(), value.text);
    if (wanted.empty()) wanted = wanted_word(node.parent().name(), node.name(), value.text);
    if (!wanted.empty())
        r.remark(node, value.name + " is " + quoted(value.text) + ", which is " + wanted + ": it is not used");
}

void name_nonsense_below(Reader& r, Node top) {
    class Walker : public pugi::xml_tree_walker {
      public:
        explicit Walker(Reader& reader) : r_(reader) {}
        bool for_each(Node& node) override {
            name_nonsense(r_, node);
            return true;
        }

      private:
        Reader& r_;
    } walker(r);
    (void)top.traverse(walker);
}

// ------------------------------------------------------------------ process data described twice

// Compares the elements Sm<n> with the init commands.
void compare_sync_managers(Reader& r, const EniSlaveData& s) {
    for (const auto& [number, sm] : s.sms) {
        const Value start =
            child(s.node.child("ProcessData").child(("Sm" + std::to_string(number)).c_str()), "StartAddress");
        const Number said = parse_number(start.text);
        if (start.there && said.valid && said.magnitude <= 0xFFFF && said.magnitude != sm.start && sm.bytes != 0)
            r.remark(start.at, "StartAddress of Sm" + std::to_string(number) + " is " + hex(said.magnitude) +
                                   ", and an init command sets the SyncManager to " + hex(sm.start) +
                                   ": the init command is sent");
    }
}

// Some tools write the number of octets for data whose size is in bits.
void compare_lengths(Reader& r, const EniSlaveData& s, Direction direction) {
    const auto& parts = direction == Direction::outputs ? s.outputs : s.inputs;
    if (!s.has_inits || parts.empty()) return;
    std::uint64_t said = 0;
    for (const EniBits& part : parts) said += part.bits;
    std::uint64_t exchanged = 0;
    std::uint64_t least = 0;
    for (const ProcessSm& sm : s.config.used_sms())
        if (sm.direction == direction) {
            exchanged = up_to_octet(exchanged) + sm.bits;
            least += sm.bits;
        }
    if (said >= least && said <= up_to_octet(exchanged)) return;
    r.remark(parts.front().node, std::string(parts.front().node.name()) + " has " + std::to_string(said) +
                                     " bits by BitLength, and the slave exchanges " + std::to_string(exchanged) +
                                     ": variables beyond the smaller number have no slave");
}

// ------------------------------------------------------------------ variables

// The bits of a value of a base data type (ETG.1000.6); 0 for any other type.
std::uint32_t bits_of_type(std::string_view type) {
    struct Known {
        std::string_view name;
        std::uint32_t bits;
    };
    constexpr Known kKnown[] = {{"BOOL", 1},   {"BIT", 1},    {"SINT", 8},   {"USINT", 8},  {"BYTE", 8},
                                {"INT", 16},   {"UINT", 16},  {"WORD", 16},  {"DINT", 32},  {"UDINT", 32},
                                {"DWORD", 32}, {"REAL", 32},  {"LINT", 64},  {"ULINT", 64}, {"LWORD", 64},
                                {"LREAL", 64}, {"INT24", 24}, {"UINT24", 24}};
    const auto* const known = std::ranges::find(kKnown, type, &Known::name);
    return known == std::end(kKnown) ? 0 : known->bits;
}

// A BOOL may have 8 bits.
void compare_type(Reader& r, const EniVariable& variable, Node node) {
    const std::uint32_t bits = bits_of_type(variable.data_type);
    if (bits == 0 || bits == variable.bits || (bits == 1 && variable.bits == 8)) return;
    r.remark(node, "the variable " + quoted(variable.name) + " has BitSize " + std::to_string(variable.bits) +
                       ", and a " + variable.data_type + " has " + std::to_string(bits) + " bits: BitSize is used");
}

struct Placed {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
    const EniVariable* variable = nullptr;
    Node node{};
};

// Reports overlapping variables. A variable may be inside another one, like a member of a struct. If it is only partly
// inside, its place is wrong.
void name_straddling(Reader& r, std::vector<Placed> all) {
    std::ranges::sort(
        all, [](const Placed& a, const Placed& b) { return a.begin != b.begin ? a.begin < b.begin : a.end > b.end; });
    std::vector<Placed> around;  // each contains the next one
    for (const Placed& one : all) {
        while (!around.empty() && around.back().end <= one.begin) around.pop_back();
        if (!around.empty() && one.end > around.back().end)
            r.remark(one.node, "the variable " + quoted(one.variable->name) + " begins inside of " +
                                   quoted(around.back().variable->name) + " and ends behind it: its BitOffs is " +
                                   std::to_string(one.begin));
        else
            around.push_back(one);
    }
}

}  // namespace

void name_nonsense(Reader& r, const std::deque<EniSlaveData>& slaves) {
    for (const EniSlaveData& s : slaves) {
        compare_sync_managers(r, s);
        for (const Direction direction : {Direction::outputs, Direction::inputs}) compare_lengths(r, s, direction);
    }
    name_nonsense_below(r, r.root());
}

void name_odd_variables(Reader& r, std::span<const EniVariable> variables, std::span<const Node> nodes) {
    std::vector<Placed> placed;
    for (std::size_t n = 0; n < variables.size(); ++n) {
        const EniVariable& one = variables[n];
        compare_type(r, one, nodes[n]);
        if (one.bits != 0) placed.push_back({one.file_bit, std::uint64_t{one.file_bit} + one.bits, &one, nodes[n]});
    }
    name_straddling(r, std::move(placed));
}

}  // namespace margay::files
