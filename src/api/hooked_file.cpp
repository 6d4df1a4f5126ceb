// The functions of HookedSlave for files (FoE).
#include "api/hooked.hpp"

#include <margay/foe.hpp>

namespace margay {
namespace {

template <class R>
void set(R& request, HookedSlave hooked, std::string_view name, std::uint32_t password) {
    request.slave = hooked.number();
    request.name = name;
    request.password = password;
}

Task<Result<std::size_t>> read_file(HookedSlave hooked, std::string_view name, std::uint32_t password,
                                    MutableBytes into) {
    FoeRead request;
    set(request, hooked, name, password);
    request.data = into;
    auto done = co_await run_in_hook(hooked, request);
    co_return done ? Result<std::size_t>(request.bytes()) : Result<std::size_t>(done.error());
}

Task<> write_file(HookedSlave hooked, std::string_view name, std::uint32_t password, Bytes content) {
    FoeWrite request;
    set(request, hooked, name, password);
    request.data = content;
    auto done = co_await run_in_hook(hooked, request);
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
