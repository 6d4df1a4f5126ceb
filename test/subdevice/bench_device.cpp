#include "bench_device.hpp"

#include <algorithm>

namespace margay::subdevice::testing {

using wire::coe::SdoLayout;

std::vector<Recorded>& recording() {
    static std::vector<Recorded> all;
    return all;
}

Transfer upload(Bench& bench, int index, int subindex, bool complete) {
    Transfer out;
    auto reply = bench.exchange(sdo_request(complete ? 0x50 : 0x40, index, subindex));
    out.abort = abort_of(reply);
    if (out.abort != Abort::none || reply.size() < 10) return out;
    const auto command = std::to_integer<unsigned>(reply[2]);
    EXPECT_EQ(SdoLayout::index::load(reply), index);
    EXPECT_EQ(SdoLayout::subindex::load(reply), subindex);
    EXPECT_EQ((command & 0x10) != 0, complete);
    if ((command & 2) != 0) {
        out.data.assign(reply.begin() + 6, reply.begin() + 10 - ((command >> 2) & 3));
        return out;
    }
    const auto size = SdoLayout::complete_size::load(reply);
    out.data.assign(reply.begin() + 10, reply.end());
    for (unsigned toggle = 0; out.data.size() < size; toggle ^= 0x10) {
        reply = bench.exchange(sdo_request(static_cast<int>(0x60 | toggle), 0, 0));
        out.abort = abort_of(reply);
        if (out.abort != Abort::none || reply.size() < 10) return out;
        const auto segment = std::to_integer<unsigned>(reply[2]);
        EXPECT_EQ(segment & 0x10, toggle);
        const auto unused = reply.size() == 10 ? (segment >> 1) & 7 : 0;
        out.data.insert(out.data.end(), reply.begin() + 3, reply.end() - unused);
        ++out.segments;
        EXPECT_EQ((segment & 1) != 0, out.data.size() == size) << "last segment";
    }
    EXPECT_EQ(out.data.size(), size);
    return out;
}

Transfer download(Bench& bench, int index, int subindex, std::vector<std::byte> data, bool complete, bool normal,
                  std::size_t first_bytes) {
    Transfer out;
    const int flag = complete ? 0x10 : 0;
    if (data.size() <= 4 && !data.empty() && !normal) {
        const auto size = data.size();
        data.resize(4);
        const auto tail = load_le<std::uint32_t>(data);
        out.abort = abort_of(
            bench.exchange(sdo_request(0x23 | flag | static_cast<int>((4 - size) << 2), index, subindex, tail)));
        return out;
    }
    const std::size_t room = bench.esc.sync_manager(0).length_bytes - 6u;
    const auto first = std::min({room - 10, data.size(), first_bytes});
    auto request = sdo_request(0x21 | flag, index, subindex, static_cast<std::uint32_t>(data.size()));
    request.insert(request.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(first));
    auto reply = bench.exchange(request);
    out.abort = abort_of(reply);
    unsigned toggle = 0;
    for (std::size_t at = first; at < data.size() && out.abort == Abort::none; toggle ^= 0x10) {
        const auto bytes = std::min(room - 3, data.size() - at);
        const auto padded = std::max<std::size_t>(bytes, 7);
        const bool last = at + bytes == data.size();
        std::vector<std::byte> segment(3 + padded);
        wire::coe::store_header(segment, {0, wire::coe::Service::sdo_request});
        segment[2] = static_cast<std::byte>(toggle | (last ? 1u : 0u) | static_cast<unsigned>((padded - bytes) << 1));
        std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), bytes, segment.begin() + 3);
        reply = bench.exchange(segment);
        out.abort = abort_of(reply);
        if (out.abort == Abort::none) {
            EXPECT_EQ(std::to_integer<unsigned>(reply[2]), 0x20u | toggle);
        }
        at += bytes;
        ++out.segments;
    }
    return out;
}

}  // namespace margay::subdevice::testing
