#include "oshw/filters/trace_nic.hpp"

#include "wire/text.hpp"

#include <array>

namespace margay {
namespace {

constexpr std::size_t kLineBytes = 256;

void put_time(TextWriter& to, Time time) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    const auto ns = time.time_since_epoch().count();
    if (ns < 0) to << "-";
    const auto magnitude = ns < 0 ? std::uint64_t{0} - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
    to << magnitude / kSecond << ".";
    const auto fraction = magnitude % kSecond;
    for (std::uint64_t digit = kSecond / 10; digit > 0; digit /= 10) to << fraction / digit % 10;
}

}  // namespace

SendStatus TraceNic::send(std::span<const std::byte> frame) noexcept {
    const auto status = inner().send(frame);
    constexpr std::string_view directions[] = {"tx", "tx busy", "tx failed"};
    show(directions[static_cast<std::size_t>(status)], ++sent_, frame);
    return status;
}

std::size_t TraceNic::receive(std::span<std::byte> into) noexcept {
    const auto length = inner().receive(into);
    if (length != 0) show("rx", ++received_, into.first(length));
    return length;
}

void TraceNic::show(std::string_view direction, std::uint64_t number, std::span<const std::byte> frame) noexcept {
    std::array<char, kLineBytes> buffer;
    TextWriter head(buffer);
    put_time(head, clock_.now());
    head << " " << direction << " " << number << " ";
    const auto head_size = head.text().size();
    const auto rest = std::span(buffer).subspan(head_size);
    const auto emit = [&](std::size_t tail) { sink_.line({buffer.data(), head_size + tail}); };

    wire::DatagramReader reader(frame);
    while (const auto datagram = reader.next()) emit(wire::describe(*datagram, rest).size());
    if (reader.fault() == wire::FrameFault::none) return;
    TextWriter fault(rest);
    fault << std::uint64_t{frame.size()} << " octets: " << wire::to_text(reader.fault());
    emit(fault.text().size());
}

}  // namespace margay
