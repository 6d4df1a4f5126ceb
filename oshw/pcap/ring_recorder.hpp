// Records both NICs of a ring in one file for Wireshark and PcapReplayNic: pcapng with two interfaces, each packet with
// its direction and nanoseconds. A frame that a NIC has not accepted is in the file with a comment about this.
//
//     PcapRingRecorder recorder(nic, second, osal);
//     if (!recorder.open("ring.pcapng")) …;
//     init_redundant(ctx, recorder.first(), recorder.second(), osal);
#pragma once

#include "osal/osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/pcap/pcapng.hpp"

#include <margay/result.hpp>

#include <string>

namespace margay {

class PcapRingRecorder {
  public:
    // All arguments must outlive the recorder.
    PcapRingRecorder(Nic& first, Nic& second, Osal& clock) noexcept
        : clock_(clock), first_(first, *this, 0), second_(second, *this, 1) {}
    PcapRingRecorder(const PcapRingRecorder&) = delete;
    PcapRingRecorder& operator=(const PcapRingRecorder&) = delete;
    ~PcapRingRecorder() { [[maybe_unused]] const auto closed = close(); }

    // The same as PcapRecorder::open() and close().
    [[nodiscard]] Result<> open(const std::string& path, Duration epoch = {});
    [[nodiscard]] Result<> close() { return file_.close(); }
    [[nodiscard]] const std::string& problem() const noexcept { return file_.problem(); }

    // The NICs to use in place of the NICs that the constructor gets. Buffered file I/O: do not use them in a cycle
    // with deadlines, nor by two threads.
    [[nodiscard]] Nic& first() noexcept { return first_; }
    [[nodiscard]] Nic& second() noexcept { return second_; }

  private:
    class End final : public FilterNic {
      public:
        End(Nic& inner, PcapRingRecorder& recorder, std::uint32_t number) noexcept
            : FilterNic(inner), recorder_(recorder), number_(number) {}
        [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
        [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;

      private:
        PcapRingRecorder& recorder_;
        std::uint32_t number_;
    };
    void write(const PacketOrigin& origin, std::span<const std::byte> frame) noexcept;

    Osal& clock_;
    Duration epoch_{};
    PcapngWriter file_;
    End first_;
    End second_;
};

}  // namespace margay
