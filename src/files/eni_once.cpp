// Elements that may occur only once at their place in an ENI file: a second one contradicts the first, or shows that a
// part of the file is missing.
#include "files/eni_read.hpp"

#include <algorithm>

namespace margay::files {
namespace {

// The elements in which the names below are checked. Elements of vendors may contain anything.
constexpr std::string_view kParents[] = {"EtherCATConfig",
                                         "Config",
                                         "Master",
                                         "Slave",
                                         "Info",
                                         "InitCmd",
                                         "IdentifyCmd",
                                         "Validate",
                                         "Mailbox",
                                         "BootStrap",
                                         "Bootstrap",
                                         "Send",
                                         "Recv",
                                         "Receive",
                                         "CoE",
                                         "SoE",
                                         "EoE",
                                         "AoE",
                                         "FoE",
                                         "DC",
                                         "HotConnect",
                                         "Cyclic",
                                         "Cmd",
                                         "ProcessImage",
                                         "Inputs",
                                         "Outputs",
                                         "Variable",
                                         "Entry"};
constexpr std::string_view kOnce[] = {"Config",
                                      "Master",
                                      "Info",
                                      "InitCmds",
                                      "ProcessData",
                                      "Mailbox",
                                      "BootStrap",
                                      "Bootstrap",
                                      "DC",
                                      "HotConnect",
                                      "CoE",
                                      "SoE",
                                      "EoE",
                                      "AoE",
                                      "FoE",
                                      "VendorId",
                                      "ProductCode",
                                      "RevisionNo",
                                      "SerialNo",
                                      "PhysAddr",
                                      "AutoIncAddr",
                                      "Adp",
                                      "Ado",
                                      "Addr",
                                      "Data",
                                      "DataMask",
                                      "DataLength",
                                      "Cnt",
                                      "Retries",
                                      "Validate",
                                      "Timeout",
                                      "Index",
                                      "SubIndex",
                                      "Ccs",
                                      "Disabled",
                                      "IDN",
                                      "DriveNo",
                                      "OpCode",
                                      "BitStart",
                                      "BitLength",
                                      "Start",
                                      "Length",
                                      "PollTime",
                                      "StatusBitAddr",
                                      "CycleTime",
                                      "CycleTime0",
                                      "CycleTime1",
                                      "ShiftTime",
                                      "ReferenceClock",
                                      "InputOffs",
                                      "OutputOffs",
                                      "BitSize",
                                      "BitOffs",
                                      "BitLen",
                                      "GroupMemberCnt",
                                      "ProcessImage",
                                      "Inputs",
                                      "Outputs",
                                      "ByteSize"};

bool is_once(std::string_view parent, std::string_view name) {
    if (name == "Cmd") return parent == "InitCmd" || parent == "IdentifyCmd" || parent == "Cmd";
    if (name == "Send" || name == "Recv" || name == "Receive")
        return parent == "Mailbox" || parent == "BootStrap" || parent == "Bootstrap";
    if (name == "Name") return parent == "Info" || parent == "Variable";
    return std::ranges::find(kOnce, name) != std::end(kOnce);
}

bool check_children(Reader& r, Node parent) {
    for (const Node node : parent.children()) {
        if (node.type() != pugi::node_element || !is_once(parent.name(), node.name())) continue;
        const Node first = parent.child(node.name());
        if (first == node) continue;
        r.fail(node, std::string("a second ") + node.name() + " in " + parent.name() + ": the first one is in line " +
                         std::to_string(r.line_of(first)));
        return false;
    }
    return true;
}

}  // namespace

bool check_eni_once(Reader& r) {
    class Walker : public pugi::xml_tree_walker {
      public:
        explicit Walker(Reader& reader) : r_(reader) {}
        bool for_each(Node& node) override {
            return std::ranges::find(kParents, std::string_view(node.name())) == std::end(kParents) ||
                   check_children(r_, node);
        }

      private:
        Reader& r_;
    } walker(r);
    return r.root().parent().traverse(walker);
}

}  // namespace margay::files
