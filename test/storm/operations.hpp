// All kinds of requests, each made from four numbers.
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
    // The request where another thread may have submitted it; nullptr: its kind is for the owner.
    virtual void cancel() = 0;
    [[nodiscard]] std::uint32_t kind() const { return kind_; }

    std::uint32_t kind_ = 0;
};

struct KindInfo {
    std::string_view name;
    std::unique_ptr<Operation> (*make)();
    void (*set)(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b);
    bool mail;        // any thread may submit it
    bool stays_busy;  // until it is cancelled
    bool reads;       // leaves the slave as it is
};

[[nodiscard]] const std::vector<KindInfo>& kinds();
[[nodiscard]] std::string_view kind_name(std::uint32_t kind);
[[nodiscard]] std::optional<std::uint32_t> kind_by_name(std::string_view name);
// A request that is ready for submit(). Its buffers live as long as it does.
[[nodiscard]] std::unique_ptr<Operation> make_operation(std::uint32_t kind, std::uint32_t slave, std::uint32_t a,
                                                        std::uint32_t b);
// Sets a request that was made before to other numbers.
void set_operation(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b);

}  // namespace margay::storm
