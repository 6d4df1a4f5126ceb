// The identification of a slave in an ENI: alias and device id, hot connect groups.
#include "files/eni_write.hpp"
#include "wire/esc.hpp"

#include <margay/expected.hpp>

#include <algorithm>

namespace margay::files {
namespace {

namespace reg = wire::reg;

// The ENI has this element for only one register: the alias has precedence, as in the library.
void identification(Node info, std::uint16_t value, std::uint16_t ado) {
    Node node = add(info, "Identification");
    set(node, "Value", std::to_string(value));
    add(node, "Ado", std::uint64_t{ado});
}

void identify(Node group, const Slave& slave, std::uint16_t ado, std::uint16_t value) {
    constexpr std::uint64_t kAprd = 1;
    Node node = add(group, "IdentifyCmd");
    add(node, "Comment", std::string(ado == reg::kStationAlias.address ? "check alias" : "check device id"));
    add(node, "Cmd", kAprd);
    add(node, "Adp", std::uint64_t{static_cast<std::uint16_t>(1 - slave.ring_position)});
    add(node, "Ado", std::uint64_t{ado});
    add(node, "Data", hex_value(0, 2));
    add(node, "Cnt", std::uint64_t{1});
    add(node, "Retries", std::uint64_t{3});
    Node validate = add(node, "Validate");
    add(validate, "Data", hex_value(value, 2));
    add(validate, "Timeout", std::uint64_t{100});
}

// Whether the slave is recognised only by its alias or device id, at any place. The library has no group for such a
// slave, and an ENI needs a group.
bool is_anywhere(const ExpectedSlave& wanted) { return wanted.number == 0 && wanted.hot_connect == 0; }

bool is_first_of_group(Context& ctx, const Slave& slave) {
    if (slave.wanted == nullptr || slave.wanted->hot_connect == 0) return false;
    // The members of a group have consecutive numbers.
    const std::uint8_t before = slave.number < 2 || ctx.slave(slave.number - 1U).wanted == nullptr
                                    ? std::uint8_t{0}
                                    : ctx.slave(slave.number - 1U).wanted->hot_connect;
    return before != slave.wanted->hot_connect;
}

}  // namespace

std::vector<std::string> write_identification(Node info, Context& ctx, const Slave& slave) {
    if (slave.wanted == nullptr) return {};
    const ExpectedSlave& wanted = *slave.wanted;
    std::vector<std::string> lost;
    const std::string name = "slave " + std::to_string(slave.number);
    if (is_first_of_group(ctx, slave) || is_anywhere(wanted)) return lost;  // IdentifyCmd
    if (wanted.alias) identification(info, *wanted.alias, reg::kStationAlias.address);
    if (!wanted.alias && wanted.device_id) identification(info, *wanted.device_id, reg::kAlStatusCode.address);
    if (wanted.alias && wanted.device_id)
        lost.push_back(name + ": the device id is left out, because an ENI has either alias or device id");
    if (wanted.optional && wanted.hot_connect == 0)
        lost.push_back(name + " may be missing, which an ENI can only say of a hot connect group");
    return lost;
}

std::vector<std::string> write_hot_connect(Node node, Context& ctx, const Slave& slave) {
    const bool group_begins = is_first_of_group(ctx, slave);
    if (!group_begins && (slave.wanted == nullptr || !is_anywhere(*slave.wanted))) return {};
    const ExpectedSlave& wanted = *slave.wanted;
    std::vector<std::string> lost;
    const auto is_member = [&](const Slave& one) {
        return one.ring_position != 0 && one.wanted != nullptr && one.wanted->hot_connect == wanted.hot_connect;
    };
    Node group = add(node, "HotConnect");
    add(group, "GroupName",
        std::string(group_begins ? "Group " + std::to_string(wanted.hot_connect)
                                 : "Slave " + std::to_string(slave.number)));
    const auto members = group_begins ? std::ranges::count_if(ctx.slaves(), is_member) : 1;
    add(group, "GroupMemberCnt", static_cast<std::uint64_t>(members));
    if (wanted.alias) identify(group, slave, reg::kStationAlias.address, *wanted.alias);
    if (wanted.device_id) identify(group, slave, reg::kAlStatusCode.address, *wanted.device_id);
    if (!group_begins)
        lost.push_back("slave " + std::to_string(slave.number) +
                       " may be at any place: it is written as a hot connect group, which may be missing");
    return lost;
}

}  // namespace margay::files
