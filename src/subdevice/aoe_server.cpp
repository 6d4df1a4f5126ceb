#include "subdevice/aoe_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace aoe = wire::aoe;
using aoe::Command;
using aoe::IndexLayout;

namespace {

constexpr std::uint64_t kTicksPerSecond = 10'000'000;  // time stamps and cycle times count 100 ns

// A quotient by digits of 16 bits: the division of 64 bits is large on a microcontroller.
std::uint64_t divided(std::uint64_t value, std::uint16_t by) {
    std::uint64_t quotient = 0;
    std::uint32_t rest = 0;
    for (int shift = 48; shift >= 0; shift -= 16) {
        const auto digits = rest << 16 | static_cast<std::uint32_t>(value >> shift & 0xFFFFU);
        quotient |= std::uint64_t{digits / by} << shift;
        rest = digits % by;
    }
    return quotient;
}

AoeIndex index_of(Bytes data) { return {IndexLayout::group::load(data), IndexLayout::offset::load(data)}; }

// The fewest octets of the data of a request; UINT16_MAX: unknown command.
std::size_t least_bytes(Command command) {
    switch (command) {
        case Command::read_device_info:
        case Command::read_state: return 0;
        case Command::read:
        case Command::write: return aoe::kIndexBytes;
        case Command::read_write: return aoe::kReadWriteBytes;
        case Command::write_control: return aoe::kControlBytes;
        case Command::add_notification: return aoe::kNotificationBytes;
        case Command::delete_notification: return sizeof(std::uint32_t);
        case Command::notification: break;
    }
    return UINT16_MAX;
}

// Whether the message contains the octets that the data announces.
bool is_complete(Command command, Bytes data) {
    switch (command) {
        case Command::write: return IndexLayout::bytes::load(data) == data.size() - aoe::kIndexBytes;
        case Command::read_write: return IndexLayout::written_bytes::load(data) == data.size() - aoe::kReadWriteBytes;
        case Command::write_control: return aoe::ControlLayout::bytes::load(data) == data.size() - aoe::kControlBytes;
        default: return true;
    }
}

void store_identity(MutableBytes at, const AoeIdentity& identity) {
    std::ranges::fill(at.first(aoe::kDeviceInfoBytes), std::byte{0});
    store_le(at, 0, identity.major);
    store_le(at, 1, identity.minor);
    store_le(at, 2, identity.build);
    const auto name = identity.name.substr(0, aoe::kDeviceNameBytes);
    std::ranges::copy(std::as_bytes(std::span(name)), at.begin() + 4);
}

}  // namespace

void AoeServer::start(AlState, const MailboxRoom& room) {
    room_ = room.send_bytes;
    for (AoeWatch& watch : watches_) watch = {};
}

void AoeServer::stop() {
    for (AoeWatch& watch : watches_) watch = {};
}

// ------------------------------------------------------------------ commands

std::optional<wire::MailboxErrorCode> AoeServer::receive(const wire::MailboxMessage& message, Outbox& out, Time now) {
    if (message.data.size() < aoe::kHeaderBytes) return wire::MailboxErrorCode::size_too_short;
    Request request{.header = aoe::load_header(message.data), .mail_address = message.header.address, .now = now};
    if ((request.header.flags & aoe::state_flag::kResponse) != 0) return wire::MailboxErrorCode::invalid_header;
    request.data = message.data.subspan(aoe::kHeaderBytes);
    const auto slot = out.open();
    if (slot.size() < aoe::kHeaderBytes + aoe::kResultBytes) return wire::MailboxErrorCode::no_more_memory;
    aoe::Header reply = request.header;
    std::swap(reply.target, reply.source);
    reply.flags |= aoe::state_flag::kResponse;
    reply.data_bytes = 0;
    reply.error_code = static_cast<std::uint32_t>(find(request));
    if (reply.error_code == 0) {
        const auto response = slot.subspan(aoe::kHeaderBytes);
        std::size_t bytes = 0;
        const AoeError result = execute(request, response.subspan(aoe::kResultBytes), bytes);
        store_le(response, 0, static_cast<std::uint32_t>(result));
        reply.data_bytes = static_cast<std::uint32_t>(aoe::kResultBytes + bytes);
    }
    if ((request.header.flags & aoe::state_flag::kNoReturn) != 0) return std::nullopt;
    aoe::store_header(slot, reply);
    out.commit(wire::MailboxType::aoe, aoe::kHeaderBytes + reply.data_bytes, request.mail_address);
    return std::nullopt;
}

// The slave gets its NetID from a write whose target is not a device behind the gateway.
bool AoeServer::sets_net_id(const Request& request) const {
    const auto behind = [&](const AoeRoute& route) {
        return route.behind && route.net_id == request.header.target.net_id;
    };
    return request.header.command == Command::write && index_of(request.data) == kNetIdIndex &&
           request.data.size() == aoe::kIndexBytes + net_id_.octets.size() && std::ranges::none_of(routes_, behind);
}

// Finds the device, or the error of the header.
AoeError AoeServer::find(Request& request) const {
    const std::size_t least = least_bytes(request.header.command);
    if (least == UINT16_MAX) return AoeError::unknown_command;
    if (request.header.data_bytes != request.data.size() || request.data.size() < least)
        return AoeError::invalid_length;
    if (!is_complete(request.header.command, request.data)) return AoeError::invalid_length;
    if (sets_net_id(request)) return AoeError::none;
    bool known = false;
    for (const AoeRoute& route : routes_) {
        if ((route.behind ? route.net_id : net_id_) != request.header.target.net_id) continue;
        known = true;
        if (route.port == request.header.target.port) request.device = route.device;
    }
    if (!known) return AoeError::target_machine_not_found;
    return request.device == nullptr ? AoeError::target_port_not_found : AoeError::none;
}

// Returns the result; `response` is behind it, and `bytes` octets of it are used.
AoeError AoeServer::execute(const Request& request, MutableBytes response, std::size_t& bytes) {
    const Bytes data = request.data;
    switch (request.header.command) {
        case Command::read_device_info:
            if (response.size() < aoe::kDeviceInfoBytes) return AoeError::no_memory;
            store_identity(response, request.device->identity());
            bytes = aoe::kDeviceInfoBytes;
            return AoeError::none;
        case Command::read_state:
            if (response.size() < aoe::kStateBytes) return AoeError::no_memory;
            store_le(response, 0, request.device->state());
            store_le(response, 2, request.device->device_state());
            bytes = aoe::kStateBytes;
            return AoeError::none;
        case Command::read:
        case Command::read_write: return read(request, response, bytes);
        case Command::write:
            if (sets_net_id(request)) {
                for (std::size_t n = 0; n < net_id_.octets.size(); ++n)
                    net_id_.octets[n] = std::to_integer<std::uint8_t>(data[aoe::kIndexBytes + n]);
                return AoeError::none;
            }
            return request.device->write(index_of(data), data.subspan(aoe::kIndexBytes), request.now);
        case Command::write_control:
            return request.device->write_control(aoe::ControlLayout::ads_state::load(data),
                                                 aoe::ControlLayout::device_state::load(data),
                                                 data.subspan(aoe::kControlBytes), request.now);
        case Command::add_notification: return add_watch(request, response, bytes);
        case Command::delete_notification: return delete_watch(request);
        case Command::notification: break;
    }
    return AoeError::service_not_supported;
}

AoeError AoeServer::read(const Request& request, MutableBytes response, std::size_t& bytes) {
    constexpr std::size_t kLengthBytes = sizeof(std::uint32_t);
    const std::size_t wanted = IndexLayout::bytes::load(request.data);
    if (response.size() < kLengthBytes || wanted > response.size() - kLengthBytes) return AoeError::invalid_size;
    const auto into = response.subspan(kLengthBytes, wanted);
    std::size_t read = 0;
    const AoeIndex index = index_of(request.data);
    const AoeError result =
        request.header.command == Command::read
            ? request.device->read(index, into, read, request.now)
            : request.device->read_write(index, request.data.subspan(aoe::kReadWriteBytes), into, read, request.now);
    read = result == AoeError::none ? std::min(read, into.size()) : 0;
    store_le(response, 0, static_cast<std::uint32_t>(read));
    bytes = kLengthBytes + read;
    return result;
}

// ------------------------------------------------------------------ notifications

AoeError AoeServer::add_watch(const Request& request, MutableBytes response, std::size_t& bytes) {
    using aoe::NotificationLayout;
    const auto length = NotificationLayout::length::load(request.data);
    const auto mode = NotificationLayout::transmission::load(request.data);
    constexpr std::size_t kAround = aoe::kHeaderBytes + 8 + aoe::kStampBytes + aoe::kSampleBytes;
    if (response.size() < sizeof(std::uint32_t)) return AoeError::no_memory;
    if (mode != AoeTransmission::cyclic && mode != AoeTransmission::on_change)
        return AoeError::transmission_not_supported;
    if (length == 0 || length > AoeWatch::kMostBytes || kAround + length > room_) return AoeError::invalid_size;
    const auto free = std::ranges::find_if(watches_, [](const AoeWatch& watch) { return watch.device == nullptr; });
    if (free == watches_.end()) return AoeError::no_more_handles;
    // Whether the device has this value.
    std::array<std::byte, AoeWatch::kMostBytes> value{};
    std::size_t read = 0;
    const AoeError result =
        request.device->read(index_of(request.data), MutableBytes(value).first(length), read, request.now);
    if (result != AoeError::none) return result;
    const Duration cycle(std::int64_t{NotificationLayout::cycle_time::load(request.data)} * 100);
    *free = {.device = request.device,
             .source = request.header.target,
             .target = request.header.source,
             .index = index_of(request.data),
             .handle = ++last_handle_,
             .bytes = static_cast<std::uint8_t>(length),
             .on_change = mode == AoeTransmission::on_change,
             .every = std::max<Duration>(cycle, std::chrono::milliseconds(1)),
             .due = request.now,
             .address = request.mail_address};
    store_le(response, 0, last_handle_);
    bytes = sizeof(std::uint32_t);
    return AoeError::none;
}

AoeError AoeServer::delete_watch(const Request& request) {
    const auto handle = load_le<std::uint32_t>(request.data);
    const auto watch = std::ranges::find_if(watches_, [&](const AoeWatch& one) {
        return one.device == request.device && one.device != nullptr && one.handle == handle;
    });
    if (watch == watches_.end()) return AoeError::unknown_handle;
    *watch = {};
    return AoeError::none;
}

Time AoeServer::step(Outbox& out, Time now) {
    Time next = kNever;
    for (AoeWatch& watch : watches_) {
        if (watch.device == nullptr) continue;
        // Without a free slot, the server tries again when the next step finds one.
        if (watch.due <= now && notify(watch, out, now)) watch.due = now + watch.every;
        if (watch.due > now) next = std::min(next, watch.due);
    }
    return next;
}

// False: no slot of the outbox is free.
bool AoeServer::notify(AoeWatch& watch, Outbox& out, Time now) {
    std::array<std::byte, AoeWatch::kMostBytes> octets{};
    const auto value = MutableBytes(octets).first(watch.bytes);
    std::size_t read = 0;
    if (watch.device->read(watch.index, value, read, now) != AoeError::none) return true;
    if (watch.on_change && watch.sent && octets == watch.last) return true;
    const std::size_t bytes = 8 + aoe::kStampBytes + aoe::kSampleBytes + value.size();
    const auto slot = out.open();
    if (slot.size() < aoe::kHeaderBytes + bytes) return false;
    aoe::store_header(slot, {.target = watch.target,
                             .source = watch.source,
                             .command = Command::notification,
                             .data_bytes = static_cast<std::uint32_t>(bytes)});
    const auto data = slot.subspan(aoe::kHeaderBytes);
    const auto nanoseconds = static_cast<std::uint64_t>(now.time_since_epoch().count());
    store_le(data, 0, static_cast<std::uint32_t>(bytes - 4));
    store_le(data, 4, std::uint32_t{1});
    store_le(data, 8, divided(nanoseconds, 1'000'000'000 / kTicksPerSecond));
    store_le(data, 16, std::uint32_t{1});
    store_le(data, 20, watch.handle);
    store_le(data, 24, static_cast<std::uint32_t>(value.size()));
    std::ranges::copy(value, data.begin() + 28);
    out.commit(wire::MailboxType::aoe, aoe::kHeaderBytes + bytes, watch.address);
    watch.last = octets;
    watch.sent = true;
    return true;
}

}  // namespace margay::subdevice
