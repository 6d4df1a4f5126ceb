// A filter that prints each sent and received datagram as one readable line.
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"

#include <string_view>

namespace margay {

// Receives the lines.
class TraceSink {
  public:
    // One line without end-of-line character. Valid only during the call.
    virtual void line(std::string_view text) noexcept = 0;

  protected:
    ~TraceSink() = default;
};

// A line contains: time in seconds, "tx" or "rx", the number of the frame in this direction, and the datagram
// (wire::describe()). A malformed frame gets an additional line with the error after the lines of its readable
// datagrams. Frames that the inner NIC did not send are shown as "tx busy" or "tx failed". The filter is as fast as the
// sink; do not use it in a cycle with deadlines.
class TraceNic final : public FilterNic {
  public:
    // All three arguments must outlive the filter.
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
