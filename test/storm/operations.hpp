// All kinds of requests. Each is made from four numbers.
#pragma once

#include <margay/margay.hpp>

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace margay::storm {

class Operation {
  public:
    virtual ~Operation() = default;
    [[nodiscard]] virtual Result<> submit(Context& ctx) = 0;
    [[nodiscard]] virtual Request& request() = 0;
    // The request, if other threads can submit this kind; nullptr when only the owner can submit it.
    virtual void cancel() = 0;
    [[nodiscard]] std::uint32_t kind() const { return kind_; }

    std::uint32_t kind_ = 0;
};

struct KindInfo {
    std::string_view name;
    std::unique_ptr<Operation> (*make)();
    void (*set)(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b);
    bool mail;        // any thread can submit it
    bool stays_busy;  // the request stays busy until it is cancelled
    bool reads;       // the request does not change the slave
};

[[nodiscard]] const std::vector<KindInfo>& kinds();
// The last ones of kinds().
[[nodiscard]] std::vector<KindInfo> later_kinds();
[[nodiscard]] std::string_view kind_name(std::uint32_t kind);
[[nodiscard]] std::optional<std::uint32_t> kind_by_name(std::string_view name);
// Makes a request that is ready for submit(). The operation owns the buffers of the request.
[[nodiscard]] std::unique_ptr<Operation> make_operation(std::uint32_t kind, std::uint32_t slave, std::uint32_t a,
                                                        std::uint32_t b);
// Changes the parameters of an existing operation.
void set_operation(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b);

}  // namespace margay::storm
