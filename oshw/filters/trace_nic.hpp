// Shows every datagram sent and received as one readable line.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"

#include <string_view>

namespace margay {

// Where the lines go.
class TraceSink {
  public:
    // One line without an end of line; valid only during the call.
    virtual void line(std::string_view text) noexcept = 0;

  protected:
    ~TraceSink() = default;
};

// A line is: time in seconds, "tx" or "rx", number of the frame in this direction, and the datagram
// (wire::describe()). A frame with a fault gets a line that names it, behind those of the datagrams that
// could be read. Frames that the inner NIC did not take are shown as "tx busy" or "tx failed". As fast as the
// sink; not for a cycle that has to be met.
class TraceNic final : public FilterNic {
  public:
    // All three must outlive the filter.
    TraceNic(Nic& inner, Osal& clock, TraceSink& sink) noexcept : FilterNic(inner), clock_(clock), sink_(sink) {}

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;

  private:
    void show(std::string_view direction, std::uint64_t number, std::span<const std::byte> frame) noexcept;

    Osal& clock_;
    TraceSink& sink_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
};

}  // namespace margay
