// The request that maps process data.
#include "network/group_layout.hpp"
#include "network/groups.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {

static Error check(Network& network, const MapRequest& request) {
    if (network.count == 0) return {.code = Errc::wrong_state, .step = Step::map_process_data};
    if (!network.is_expected_list()) return {.code = Errc::scan_needed, .step = Step::map_process_data};
    return request.group < network.process.groups.size() ? Error{} : unmapped_group(network, request.group);
}

static Task<Result<>> run(Network& network, MapRequest& request) {
    const ImageMemory memory{.image = request.image, .provide = request.memory, .user = request.memory_user};
    auto mapped = co_await map_group(network, request.group, memory);
    note_of_segment(network, mapped.error());
    request.bytes = mapped ? *mapped : network.process.groups[request.group].image.size();
    co_return mapped ? Result<>() : Result<>(mapped.error());
}

static constexpr OperationDescription kMap =
    describe_operation<MapRequest, check, run>(Operation::map, Step::map_process_data, Needs::segment);
MapRequest::MapRequest() : Request(kMap) {}

Result<std::size_t> config_map(Context& ctx, std::span<std::byte> image, std::uint8_t group) {
    MapRequest request;
    request.group = group;
    request.image = image;
    return submit_and_wait(ctx, request, request.bytes);
}

}  // namespace margay
