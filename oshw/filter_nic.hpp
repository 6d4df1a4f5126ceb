// Base class of all filters: a NIC that contains another NIC and forwards all calls to it. A filter overrides the
// functions that it changes. The times of frames come from the inner NIC.
#pragma once

#include "oshw/nic.hpp"

namespace margay {

class FilterNic : public Nic {
  public:
    // `inner` must outlive the filter.
    explicit FilterNic(Nic& inner) noexcept : inner_(inner) {}
    FilterNic(const FilterNic&) = delete;
    FilterNic& operator=(const FilterNic&) = delete;

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override { return inner_.send(frame); }
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override { return inner_.receive(into); }
    [[nodiscard]] LinkState link_state() noexcept override { return inner_.link_state(); }
    [[nodiscard]] bool hides_own_frames() const noexcept override { return inner_.hides_own_frames(); }
    [[nodiscard]] MacAddress source_mac() const noexcept override { return inner_.source_mac(); }
    [[nodiscard]] int wait_handle() const noexcept override { return inner_.wait_handle(); }
    [[nodiscard]] Time next_arrival() const noexcept override { return inner_.next_arrival(); }
    [[nodiscard]] int last_error() const noexcept override { return inner_.last_error(); }
    [[nodiscard]] FrameTiming timing() noexcept override { return inner_.timing(); }

  protected:
    ~FilterNic() = default;
    [[nodiscard]] Nic& inner() noexcept { return inner_; }
    [[nodiscard]] const Nic& inner() const noexcept { return inner_; }

  private:
    Nic& inner_;
};

}  // namespace margay
