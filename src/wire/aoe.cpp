#include "wire/aoe.hpp"

#include <iterator>

namespace margay::wire::aoe {
namespace {

AoeAddress load_address(Bytes at) {
    AoeAddress address;
    for (std::size_t n = 0; n < address.net_id.octets.size(); ++n)
        address.net_id.octets[n] = std::to_integer<std::uint8_t>(at[n]);
    address.port = load_le<std::uint16_t>(at, address.net_id.octets.size());
    return address;
}

void store_address(MutableBytes at, const AoeAddress& address) {
    for (std::size_t n = 0; n < address.net_id.octets.size(); ++n) at[n] = std::byte{address.net_id.octets[n]};
    store_le(at, address.net_id.octets.size(), address.port);
}

struct ErrorLine {
    std::uint16_t code;
    const char* text;
};
constexpr ErrorLine kErrors[] = {
    {0x001, "internal error"},
    {0x006, "no device has this port"},
    {0x007, "no route to this NetID"},
    {0x008, "unknown command"},
    {0x00E, "wrong length of the AoE message"},
    {0x00F, "invalid NetID"},
    {0x012, "the port is disabled"},
    {0x018, "invalid port"},
    {0x019, "out of memory"},
    {0x700, "device error"},
    {0x701, "the device does not support the command"},
    {0x702, "invalid index group"},
    {0x703, "invalid index offset"},
    {0x704, "reading or writing is not permitted"},
    {0x705, "wrong size of the data"},
    {0x706, "invalid data"},
    {0x707, "the device is not ready"},
    {0x708, "the device is busy"},
    {0x70A, "out of memory in the device"},
    {0x70B, "invalid parameter"},
    {0x70C, "not found"},
    {0x70D, "syntax error"},
    {0x70F, "already exists"},
    {0x710, "symbol not found"},
    {0x712, "invalid state of the device"},
    {0x713, "the device does not support this transmission mode"},
    {0x714, "unknown notification handle"},
    {0x716, "no more notification handles"},
    {0x719, "timeout in the device"},
};

}  // namespace

Header load_header(Bytes at) {
    return {.target = load_address(at.subspan(Layout::target)),
            .source = load_address(at.subspan(Layout::source)),
            .command = Layout::command::load(at),
            .flags = Layout::flags::load(at),
            .data_bytes = Layout::data_bytes::load(at),
            .error_code = Layout::error_code::load(at),
            .invoke_id = Layout::invoke_id::load(at)};
}

void store_header(MutableBytes at, const Header& header) {
    store_address(at.subspan(Layout::target), header.target);
    store_address(at.subspan(Layout::source), header.source);
    Layout::command::store(at, header.command);
    Layout::flags::store(at, header.flags);
    Layout::data_bytes::store(at, header.data_bytes);
    Layout::error_code::store(at, header.error_code);
    Layout::invoke_id::store(at, header.invoke_id);
}

std::string_view error_text(std::uint32_t code) {
    const auto* const line =
        std::find_if(std::begin(kErrors), std::end(kErrors), [&](const ErrorLine& one) { return one.code == code; });
    return line == std::end(kErrors) ? "unknown code" : line->text;
}

}  // namespace margay::wire::aoe
