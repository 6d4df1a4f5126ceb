// CoE by the public API: requests and the calls that wait for them.
#include "mail_requests.hpp"
#include "mailbox/coe_information.hpp"
#include "mailbox/coe_mail_pdo.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

Error check_coe(Network& network, std::uint16_t slave, Step step, std::uint16_t index, std::uint8_t subindex) {
    return check_mailbox(network, mailbox_protocol::kCoE,
                         {.step = step, .slave = slave, .index = index, .subindex = subindex});
}

// Complete access begins at subindex 0 or 1 (ETG.1000.6, "Complete access").
Error check_sdo(Network& network, std::uint16_t slave, Step step, std::uint16_t index, std::uint8_t subindex,
                bool complete) {
    if (complete && subindex > 1)
        return {.code = Errc::invalid_argument, .step = step, .slave = slave, .index = index, .subindex = subindex};
    return check_coe(network, slave, step, index, subindex);
}

}  // namespace

// ------------------------------------------------------------------ what each request does

static Error check(Network& network, const SdoUpload& r) {
    return check_sdo(network, r.slave, Step::sdo_upload, r.index, r.subindex, r.complete_access);
}
static Error check(Network& network, const SdoDownload& r) {
    return check_sdo(network, r.slave, Step::sdo_download, r.index, r.subindex, r.complete_access);
}
static Error check(Network& network, const ObjectListRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, 0, 0);
}
static Error check(Network& network, const ObjectDescriptionRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, r.index, 0);
}
static Error check(Network& network, const EntryDescriptionRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, r.index, r.subindex);
}
static Error check(Network& network, const MailPdoSend& r) {
    return check_coe(network, r.slave, Step::mailbox_send, r.number, 0);
}
static Error check(Network& network, const MailPdoFetch& r) {
    return check_coe(network, r.slave, Step::mailbox_receive, r.number, 0);
}

static Task<Result<>> run(Network& network, SdoUpload& request) {
    const SdoObject object{request.index, request.subindex, request.complete_access};
    auto read = co_await sdo_upload(channel_of(network, request), object, request.data, patience_of(request));
    request.bytes = read ? *read : std::size_t{0};
    co_return read ? Result<>() : Result<>(read.error());
}

static Task<Result<>> run(Network& network, SdoDownload& request) {
    const SdoObject object{request.index, request.subindex, request.complete_access};
    co_return co_await sdo_download(channel_of(network, request), object, request.data, patience_of(request));
}

static Task<Result<>> run(Network& network, ObjectListRequest& request) {
    ObjectListQuery query(request.list, request.found, request.user);
    auto done = co_await ask_information(channel_of(network, request), query, {}, patience_of(request));
    request.count = query.count();
    co_return done;
}

static Task<Result<>> run(Network& network, ObjectDescriptionRequest& request) {
    ObjectQuery query(request.index);
    auto done =
        co_await ask_information(channel_of(network, request), query, {.index = request.index}, patience_of(request));
    request.description = query.description;
    co_return done;
}

static Task<Result<>> run(Network& network, EntryDescriptionRequest& request) {
    EntryQuery query(request.index, request.subindex, request.with_values);
    auto done = co_await ask_information(channel_of(network, request), query,
                                         {.index = request.index, .subindex = request.subindex}, patience_of(request));
    request.description = query.description;
    co_return done;
}

static Task<Result<>> run(Network& network, MailPdoSend& request) {
    co_return co_await send_rx_pdo(channel_of(network, request), request.number, request.data, patience_of(request));
}

static Task<Result<>> run(Network& network, MailPdoFetch& request) {
    auto read = co_await fetch_tx_pdo(channel_of(network, request), request.number, request.data, patience_of(request));
    request.bytes = read ? *read : std::size_t{0};
    co_return read ? Result<>() : Result<>(read.error());
}

Result<> submit(Context& ctx, SdoUpload& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, SdoDownload& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, ObjectListRequest& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, ObjectDescriptionRequest& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, EntryDescriptionRequest& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, MailPdoSend& request) { return submit_queued(ctx, request); }
Result<> submit(Context& ctx, MailPdoFetch& request) { return submit_queued(ctx, request); }

// ------------------------------------------------------------------ calls that wait

Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, std::span<std::byte> into, Duration timeout) {
    SdoUpload request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.complete_access = complete_access;
    request.data = into;
    const auto done = do_and_wait(ctx, request, Step::sdo_upload, index, subindex);
    if (!done) return done.error();
    return request.bytes;
}

Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  std::span<const std::byte> value, Duration timeout) {
    SdoDownload request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.complete_access = complete_access;
    request.data = value;
    return do_and_wait(ctx, request, Step::sdo_download, index, subindex);
}

Result<std::uint32_t> object_list(Context& ctx, std::uint16_t slave, ObjectList list,
                                  void (*found)(std::span<const std::uint16_t> indices, void* user), void* user,
                                  Duration timeout) {
    ObjectListRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.list = list;
    request.found = found;
    request.user = user;
    const auto done = do_and_wait(ctx, request, Step::sdo_information, 0, 0);
    if (!done) return done.error();
    return request.count;
}

Result<ObjectDescription> object_description(Context& ctx, std::uint16_t slave, std::uint16_t index, Duration timeout) {
    ObjectDescriptionRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    const auto done = do_and_wait(ctx, request, Step::sdo_information, index, 0);
    if (!done) return done.error();
    return request.description;
}

Result<EntryDescription> entry_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                           std::uint8_t subindex, bool with_values, Duration timeout) {
    EntryDescriptionRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.with_values = with_values;
    const auto done = do_and_wait(ctx, request, Step::sdo_information, index, subindex);
    if (!done) return done.error();
    return request.description;
}

Result<std::string_view> SDOread_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                      std::span<char> into, Duration timeout) {
    const auto read = SDOread(ctx, slave, index, subindex, false, std::as_writable_bytes(into), timeout);
    if (!read) return read.error();
    const std::string_view text(into.data(), *read);
    return text.substr(0, std::min(text.size(), text.find('\0')));
}

Result<> SDOwrite_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                       std::string_view text, Duration timeout) {
    return SDOwrite(ctx, slave, index, subindex, false, std::as_bytes(std::span(text)), timeout);
}

std::string_view sdo_abort_text(std::uint32_t code) { return wire::coe::to_text(static_cast<wire::coe::Abort>(code)); }

// ------------------------------------------------------------------ what slaves report on their own

EmergencyRing& emergencies(Context& ctx, std::uint16_t slave) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr || slave < 1 || slave > network->count) return ContextAccess::no_emergencies(ctx);
    return network->mailboxes.channel(slave).emergencies();
}

void watch_mailboxes(Context& ctx, Duration every) {
    if (Network* network = ContextAccess::network(ctx); network != nullptr) network->mailboxes.watch(every);
}

MailboxStatistics mailbox_statistics(Context& ctx, std::uint16_t slave) {
    Network* network = ContextAccess::network(ctx);
    if (network == nullptr || slave < 1 || slave > network->count) return {};
    return network->mailboxes.channel(slave).statistics();
}

}  // namespace margay
