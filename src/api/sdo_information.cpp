// The requests that describe the object dictionary of a slave (SDO information).
#include "api/mail.hpp"
#include "mailbox/coe_information.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
static Error check(Network& network, const ObjectListRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, 0, 0);
}
static Error check(Network& network, const ObjectDescriptionRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, r.index, 0);
}
static Error check(Network& network, const EntryDescriptionRequest& r) {
    return check_coe(network, r.slave, Step::sdo_information, r.index, r.subindex);
}

static Task<Result<>> run(Network& network, ObjectListRequest& request) {
    ObjectListQuery query(request.list, request.found, request.user);
    auto done = co_await ask_information(channel_of(network, request), query, {}, patience_of_each(request));
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

static constexpr OperationDescription kList =
    describe_mail<ObjectListRequest, check, run>(Operation::sdo_information, Step::sdo_information);
ObjectListRequest::ObjectListRequest() : SlaveRequest(kList) {}

static constexpr OperationDescription kObject =
    describe_mail<ObjectDescriptionRequest, check, run>(Operation::sdo_information, Step::sdo_information);
ObjectDescriptionRequest::ObjectDescriptionRequest() : SlaveRequest(kObject) {}

static constexpr OperationDescription kEntry =
    describe_mail<EntryDescriptionRequest, check, run>(Operation::sdo_information, Step::sdo_information);
EntryDescriptionRequest::EntryDescriptionRequest() : SlaveRequest(kEntry) {}

Result<std::uint32_t> read_object_list(Context& ctx, std::uint16_t slave, ObjectList list,
                                       void (*found)(std::span<const std::uint16_t> indices, void* user), void* user,
                                       Duration timeout) {
    ObjectListRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.list = list;
    request.found = found;
    request.user = user;
    return submit_and_wait(ctx, request, request.count);
}

Result<ObjectDescription> read_object_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                                  Duration timeout) {
    ObjectDescriptionRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    return submit_and_wait(ctx, request, request.description);
}

Result<EntryDescription> read_entry_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                                std::uint8_t subindex, bool with_values, Duration timeout) {
    EntryDescriptionRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.with_values = with_values;
    return submit_and_wait(ctx, request, request.description);
}

}  // namespace margay
