// The requests for AoE commands.
#include "mailbox/aoe.hpp"

#include <margay/aoe.hpp>

#include "api/mail.hpp"

namespace margay {

namespace {

using wire::aoe::Command;
using wire::aoe::IndexLayout;

std::uint32_t octets_of(std::size_t size) { return static_cast<std::uint32_t>(size); }

// A call whose message begins with index group and index offset.
AoeCall call_at(Command command, Step step, std::uint32_t group, std::uint32_t offset, std::size_t bytes) {
    AoeCall call{.command = command, .step = step, .head_bytes = wire::aoe::kIndexBytes};
    IndexLayout::group::store(call.head, group);
    IndexLayout::offset::store(call.head, offset);
    IndexLayout::bytes::store(call.head, octets_of(bytes));
    return call;
}

AoeCall call_of(const AoeRead& r) {
    AoeCall call = call_at(Command::read, Step::aoe_read, r.index_group, r.index_offset, r.data.size());
    call.counted = true;
    call.into = r.data;
    return call;
}

AoeCall call_of(const AoeWrite& r) {
    AoeCall call = call_at(Command::write, Step::aoe_write, r.index_group, r.index_offset, r.data.size());
    call.data = r.data;
    return call;
}

AoeCall call_of(const AoeReadWrite& r) {
    AoeCall call = call_at(Command::read_write, Step::aoe_read_write, r.index_group, r.index_offset, r.data.size());
    IndexLayout::written_bytes::store(call.head, octets_of(r.written.size()));
    call.head_bytes = wire::aoe::kReadWriteBytes;
    call.counted = true;
    call.data = r.written;
    call.into = r.data;
    return call;
}

AoeCall call_of(const AoeWriteControl& r) {
    AoeCall call{.command = Command::write_control, .step = Step::aoe_write_control};
    wire::aoe::ControlLayout::ads_state::store(call.head, r.ads_state);
    wire::aoe::ControlLayout::device_state::store(call.head, r.device_state);
    wire::aoe::ControlLayout::bytes::store(call.head, octets_of(r.data.size()));
    call.head_bytes = wire::aoe::kControlBytes;
    call.data = r.data;
    return call;
}

AoeCall call_of(const AoeReadState&) { return {.command = Command::read_state, .step = Step::aoe_read_state}; }

AoeCall call_of(const AoeReadDeviceInfo&) {
    return {.command = Command::read_device_info, .step = Step::aoe_device_info};
}

AoeCall call_of(const AoeAddNotification& r) {
    using wire::aoe::NotificationLayout;
    AoeCall call = call_at(Command::add_notification, Step::aoe_notification, r.index_group, r.index_offset, r.length);
    constexpr auto in_100_ns = [](Duration time) { return static_cast<std::uint32_t>(time / Duration(100)); };
    NotificationLayout::transmission::store(call.head, r.transmission);
    NotificationLayout::longest_delay::store(call.head, in_100_ns(r.longest_delay));
    NotificationLayout::cycle_time::store(call.head, in_100_ns(r.cycle_time));
    call.head_bytes = wire::aoe::kNotificationBytes;
    return call;
}

AoeCall call_of(const AoeDeleteNotification& r) {
    AoeCall call{.command = Command::delete_notification, .step = Step::aoe_notification};
    store_le(call.head, 0, r.handle);
    call.head_bytes = sizeof r.handle;
    return call;
}

AoeCall call_of(const AoeSetNetId& r) {
    AoeCall call = call_at(Command::write, Step::aoe_net_id, r.index_group, r.index_offset, r.net_id.octets.size());
    call.data = std::as_bytes(std::span(r.net_id.octets));
    return call;
}

// Checks whether `bytes` octets of data fit a message of `most` octets, of which the command itself needs `around`.
Error check_size(std::size_t bytes, std::size_t around, std::size_t most, const Error& where) {
    if (most >= around && bytes <= most - around) return {};
    Error error = invalid(Argument::aoe_size, where.step, where.slave);
    error.expected = octets_of(most >= around ? most - around : 0);
    error.actual = octets_of(bytes);
    return error;
}

Error check_call(Network& network, const AoeRequest& r, const AoeCall& call) {
    const Error where{.step = call.step, .slave = r.slave};
    const Error refused = check_mailbox(network, mailbox_protocol::kAoE, where);
    if (refused.code != Errc::none) return refused;
    const MailboxChannel& channel = channel_of(network, r);
    constexpr std::size_t kHeader = wire::aoe::kHeaderBytes;
    const Error sent = check_size(call.data.size(), kHeader + call.head_bytes, channel.send_room(), where);
    if (sent.code != Errc::none) return sent;
    const std::size_t around = kHeader + wire::aoe::kResultBytes + (call.counted ? sizeof(std::uint32_t) : 0);
    return check_size(call.into.size(), around, channel.receive_room(), where);
}

template <class R>
Error check(Network& network, const R& r) {
    return check_call(network, r, call_of(r));
}

template <>
Error check(Network& network, const AoeAddNotification& r) {
    constexpr Duration kLongest = UINT32_MAX * Duration(100);
    const bool right =
        std::min(r.longest_delay, r.cycle_time) >= Duration{0} && std::max(r.longest_delay, r.cycle_time) <= kLongest;
    if (!right) return invalid(Argument::aoe_time, Step::aoe_notification, r.slave);
    return check_call(network, r, call_of(r));
}

// The result of a command beside its codes: the number of octets, or octets of a fixed size that `store` reads.
struct Outcome {
    std::size_t* bytes = nullptr;
    std::size_t fixed_bytes = 0;
    void (*store)(AoeRequest& request, Bytes octets) = nullptr;
};

Task<Result<>> execute(Network& network, AoeRequest& r, AoeCall call, Outcome outcome) {
    std::array<std::byte, wire::aoe::kDeviceInfoBytes> fixed{};
    if (outcome.store != nullptr) call.into = MutableBytes(fixed).first(outcome.fixed_bytes);
    r.error_code = r.result_code = 0;
    call.target = r.target;
    call.source = r.source;
    const MailPatience patience = patience_of(r);
    const std::uint32_t ticket = RequestAccess::ticket(r);  // 0: within a hook, so without the queue
    const std::uint32_t invoke_id = ticket != 0 ? ticket : aoe_invoke_id(network.engine.now());
    auto done = co_await aoe_call(channel_of(network, r), call, invoke_id, patience);
    const Error& error = done.error();
    if (error.code == Errc::aoe_error) r.error_code = error.detail;
    if (error.code == Errc::aoe_result) r.result_code = error.detail;
    if (outcome.bytes != nullptr) *outcome.bytes = done ? *done : std::size_t{0};
    if (!done) co_return error;
    if (outcome.store != nullptr) outcome.store(r, fixed);
    co_return Nothing{};
}

void store_state(AoeRequest& request, Bytes octets) {
    auto& r = static_cast<AoeReadState&>(request);
    r.ads_state = load_le<AdsState>(octets);
    r.device_state = load_le<std::uint16_t>(octets, 2);
}

void store_info(AoeRequest& request, Bytes octets) {
    AoeDeviceInfo& info = static_cast<AoeReadDeviceInfo&>(request).info;
    info.major = load_le<std::uint8_t>(octets, 0);
    info.minor = load_le<std::uint8_t>(octets, 1);
    info.build = load_le<std::uint16_t>(octets, 2);
    for (std::size_t n = 0; n < info.name_text.size(); ++n)
        info.name_text[n] = static_cast<char>(std::to_integer<unsigned char>(octets[4 + n]));
}

void store_handle(AoeRequest& request, Bytes octets) {
    static_cast<AoeAddNotification&>(request).handle = load_le<std::uint32_t>(octets);
}

Task<Result<>> run(Network& network, AoeRead& r) { return execute(network, r, call_of(r), {.bytes = &r.bytes}); }
Task<Result<>> run(Network& network, AoeWrite& r) { return execute(network, r, call_of(r), {}); }
Task<Result<>> run(Network& network, AoeReadWrite& r) { return execute(network, r, call_of(r), {.bytes = &r.bytes}); }
Task<Result<>> run(Network& network, AoeWriteControl& r) { return execute(network, r, call_of(r), {}); }
Task<Result<>> run(Network& network, AoeReadState& r) {
    return execute(network, r, call_of(r), {.fixed_bytes = wire::aoe::kStateBytes, .store = store_state});
}
Task<Result<>> run(Network& network, AoeReadDeviceInfo& r) {
    return execute(network, r, call_of(r), {.fixed_bytes = wire::aoe::kDeviceInfoBytes, .store = store_info});
}
Task<Result<>> run(Network& network, AoeAddNotification& r) {
    return execute(network, r, call_of(r), {.fixed_bytes = sizeof r.handle, .store = store_handle});
}
Task<Result<>> run(Network& network, AoeDeleteNotification& r) { return execute(network, r, call_of(r), {}); }
Task<Result<>> run(Network& network, AoeSetNetId& r) {
    r.target.net_id = r.net_id;
    return execute(network, r, call_of(r), {});
}

template <class R>
constexpr OperationDescription describe_aoe(Step step) {
    return describe_mail<R, check<R>, run>(Operation::aoe, step);
}

constexpr OperationDescription kRead = describe_aoe<AoeRead>(Step::aoe_read);
constexpr OperationDescription kWrite = describe_aoe<AoeWrite>(Step::aoe_write);
constexpr OperationDescription kReadWrite = describe_aoe<AoeReadWrite>(Step::aoe_read_write);
constexpr OperationDescription kWriteControl = describe_aoe<AoeWriteControl>(Step::aoe_write_control);
constexpr OperationDescription kReadState = describe_aoe<AoeReadState>(Step::aoe_read_state);
constexpr OperationDescription kDeviceInfo = describe_aoe<AoeReadDeviceInfo>(Step::aoe_device_info);
constexpr OperationDescription kAddNotification = describe_aoe<AoeAddNotification>(Step::aoe_notification);
constexpr OperationDescription kDeleteNotification = describe_aoe<AoeDeleteNotification>(Step::aoe_notification);
constexpr OperationDescription kSetNetId = describe_aoe<AoeSetNetId>(Step::aoe_net_id);

template <class R>
void address(R& request, std::uint16_t slave, const AoeAddress& target, Duration timeout) {
    request.slave = slave;
    request.timeout = timeout;
    request.target = target;
}

}  // namespace

AoeRead::AoeRead() : AoeRequest(kRead) {}
AoeWrite::AoeWrite() : AoeRequest(kWrite) {}
AoeReadWrite::AoeReadWrite() : AoeRequest(kReadWrite) {}
AoeWriteControl::AoeWriteControl() : AoeRequest(kWriteControl) {}
AoeReadState::AoeReadState() : AoeRequest(kReadState) {}
AoeReadDeviceInfo::AoeReadDeviceInfo() : AoeRequest(kDeviceInfo) {}
AoeAddNotification::AoeAddNotification() : AoeRequest(kAddNotification) {}
AoeDeleteNotification::AoeDeleteNotification() : AoeRequest(kDeleteNotification) {}
AoeSetNetId::AoeSetNetId() : AoeRequest(kSetNetId) {}

// ------------------------------------------------------------------ functions that wait

Result<std::size_t> AOEread(Context& ctx, std::uint16_t slave, const AoeAddress& target, std::uint32_t index_group,
                            std::uint32_t index_offset, std::span<std::byte> into, Duration timeout) {
    AoeRead request;
    address(request, slave, target, timeout);
    request.index_group = index_group;
    request.index_offset = index_offset;
    request.data = into;
    return submit_and_wait(ctx, request, request.bytes);
}

Result<> AOEwrite(Context& ctx, std::uint16_t slave, const AoeAddress& target, std::uint32_t index_group,
                  std::uint32_t index_offset, std::span<const std::byte> data, Duration timeout) {
    AoeWrite request;
    address(request, slave, target, timeout);
    request.index_group = index_group;
    request.index_offset = index_offset;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<std::size_t> AOEread_write(Context& ctx, std::uint16_t slave, const AoeAddress& target,
                                  std::uint32_t index_group, std::uint32_t index_offset,
                                  std::span<const std::byte> written, std::span<std::byte> into, Duration timeout) {
    AoeReadWrite request;
    address(request, slave, target, timeout);
    request.index_group = index_group;
    request.index_offset = index_offset;
    request.written = written;
    request.data = into;
    return submit_and_wait(ctx, request, request.bytes);
}

Result<> AOEwrite_control(Context& ctx, std::uint16_t slave, const AoeAddress& target, AdsState ads_state,
                          std::uint16_t device_state, std::span<const std::byte> data, Duration timeout) {
    AoeWriteControl request;
    address(request, slave, target, timeout);
    request.ads_state = ads_state;
    request.device_state = device_state;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<AdsState> AOEread_state(Context& ctx, std::uint16_t slave, const AoeAddress& target, Duration timeout) {
    AoeReadState request;
    address(request, slave, target, timeout);
    return submit_and_wait(ctx, request, request.ads_state);
}

Result<AoeDeviceInfo> AOEread_device_info(Context& ctx, std::uint16_t slave, const AoeAddress& target,
                                          Duration timeout) {
    AoeReadDeviceInfo request;
    address(request, slave, target, timeout);
    return submit_and_wait(ctx, request, request.info);
}

Result<> AOEset_net_id(Context& ctx, std::uint16_t slave, const AoeNetId& net_id, Duration timeout) {
    AoeSetNetId request;
    address(request, slave, {net_id, 0}, timeout);
    request.net_id = net_id;
    return submit_and_wait(ctx, request);
}

std::string_view aoe_error_text(std::uint32_t code) { return wire::aoe::error_text(code); }

}  // namespace margay
