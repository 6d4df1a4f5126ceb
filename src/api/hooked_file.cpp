// The functions of HookedSlave for files (FoE).
#include "api/mail.hpp"
#include "mailbox/foe.hpp"
#include "network/hooks.hpp"

namespace margay {
namespace {

// The same as the request does, within the sequence of the hook.
template <class R>
void set(R& request, HookedSlave hooked, std::string_view name, std::uint32_t password) {
    request.slave = hooked.number();
    request.name = name;
    request.password = password;
}

Task<Result<std::size_t>> read_file(HookedSlave hooked, std::string_view name, std::uint32_t password,
                                    MutableBytes into) {
    Network& network = HookAccess::network(hooked);
    FoeRead request;
    set(request, hooked, name, password);
    request.data = into;
    const Error refused = RequestAccess::operation(request).check(network, request);
    if (refused.code != Errc::none) {
        auto later = co_await refuse_in_hook(hooked, refused);
        co_return later.error();
    }
    co_await required(RequestAccess::operation(request).sequence(network, request));
    co_return request.bytes();
}

Task<> write_file(HookedSlave hooked, std::string_view name, std::uint32_t password, Bytes content) {
    Network& network = HookAccess::network(hooked);
    FoeWrite request;
    set(request, hooked, name, password);
    request.data = content;
    const Error refused = RequestAccess::operation(request).check(network, request);
    if (refused.code != Errc::none) co_return co_await required(refuse_in_hook(hooked, refused));
    auto done = co_await RequestAccess::operation(request).sequence(network, request);
    co_return done;
}

}  // namespace

Task<Result<std::size_t>> HookedSlave::foe_read(std::string_view name, std::uint32_t password,
                                                std::span<std::byte> into) const {
    return read_file(*this, name, password, into);
}
Task<> HookedSlave::foe_write(std::string_view name, std::uint32_t password, std::span<const std::byte> content) const {
    return write_file(*this, name, password, content);
}

}  // namespace margay
