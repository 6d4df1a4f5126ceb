#include "common/capture.hpp"

#include "oshw/pcap/capture_file.hpp"

#include <algorithm>

namespace margay::samples {

namespace {

constexpr std::size_t kWindow = 64;  // number of later requests before which an answer must arrive

bool answers(Bytes request, Bytes answer) {
    if (request.size() > answer.size()) return false;
    for (std::size_t i = 0; i < 6; ++i) {
        auto expected = request[wire::kSourceMacOffset + i];
        if (i == 0) expected |= wire::kPassedEscBit;
        if (answer[wire::kSourceMacOffset + i] != expected) return false;
    }
    wire::DatagramReader asked(request);
    wire::DatagramReader got(answer);
    for (;;) {
        const auto a = asked.next();
        const auto b = got.next();
        if (!a || !b) return !a && !b;
        if (a->header.command != b->header.command || a->header.index != b->header.index ||
            a->data.size() != b->data.size() || a->header.address.ado() != b->header.address.ado())
            return false;
    }
}

}  // namespace

Capture load_capture(const std::string& path) {
    Capture capture;
    CaptureFile file;
    if (!file.load(path, CaptureFile::CutOff::accept)) {
        capture.error = file.problem();
        return capture;
    }
    capture.remark = file.remark();
    std::size_t oldest = 0;
    auto& all = capture.exchanges;
    for (const auto& frame : file.frames()) {
        const auto bytes = file.bytes(frame);
        if (!frame.reply) {
            all.push_back({static_cast<std::size_t>(frame.number), frame.at, {bytes.begin(), bytes.end()}, {}, 0});
            continue;
        }
        if (all.size() > kWindow) oldest = std::max(oldest, all.size() - kWindow);
        for (auto i = oldest; i < all.size(); ++i) {
            if (!all[i].answer.empty() || !answers(all[i].request, bytes)) continue;
            all[i].answer.assign(bytes.begin(), bytes.end());
            all[i].answer_frame = static_cast<std::size_t>(frame.number);
            break;
        }
    }
    return capture;
}

std::vector<DatagramPair> pairs_of(const Exchange& exchange) {
    std::vector<DatagramPair> pairs;
    wire::DatagramReader asked(exchange.request);
    wire::DatagramReader got(exchange.answer);
    for (;;) {
        const auto a = asked.next();
        const auto b = got.next();
        if (!a || !b) return pairs;
        pairs.push_back({exchange.frame, a->header, a->data, b->header, b->data, b->wkc});
    }
}

}  // namespace margay::samples
