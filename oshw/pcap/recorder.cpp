#include "oshw/pcap/recorder.hpp"

#include <pcap/pcap.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace margay {

PcapRecorder::~PcapRecorder() { [[maybe_unused]] const auto closed = close(); }

Result<> PcapRecorder::fail(const std::string& what) {
    problem_ = "recording to " + path_ + ": " + what;
    return Error{.code = Errc::nic, .step = Step::open_nic};
}

Result<> PcapRecorder::open(const std::string& path, Duration epoch) {
    if (auto closed = close(); !closed) return closed;
    problem_.clear();
    path_ = path;
    epoch_ = epoch;
    constexpr int kSnapLength = 65535;
    pcap_ = pcap_open_dead_with_tstamp_precision(DLT_EN10MB, kSnapLength, PCAP_TSTAMP_PRECISION_NANO);
    if (pcap_ == nullptr) return fail("out of memory");
    file_ = pcap_dump_open(pcap_, path.c_str());
    if (file_ != nullptr) return {};
    auto failed = fail(std::string("the file cannot be made (") + pcap_geterr(pcap_) + ")");
    pcap_close(pcap_);
    pcap_ = nullptr;
    return failed;
}

Result<> PcapRecorder::close() {
    if (file_ == nullptr) return {};
    // A failed write sets the error flag of the stream and errno only at the time of the write; the last write is this
    // flush.
    errno = 0;
    const bool whole = pcap_dump_flush(file_) == 0 && std::ferror(pcap_dump_file(file_)) == 0;
    const int error = errno;
    pcap_dump_close(file_);
    pcap_close(pcap_);
    file_ = nullptr;
    pcap_ = nullptr;
    if (whole) return {};
    return fail(std::string("the file is not complete (") + (error != 0 ? std::strerror(error) : "write failed") + ")");
}

SendStatus PcapRecorder::send(std::span<const std::byte> frame) noexcept {
    const auto status = inner().send(frame);
    if (status == SendStatus::sent) write(frame);
    return status;
}

std::size_t PcapRecorder::receive(std::span<std::byte> into) noexcept {
    const auto length = inner().receive(into);
    if (length != 0) write(into.first(length));
    return length;
}

void PcapRecorder::write(std::span<const std::byte> frame) noexcept {
    if (file_ == nullptr) return;
    const auto at = clock_.now().time_since_epoch() + epoch_;
    const auto seconds = std::chrono::floor<std::chrono::seconds>(at);
    pcap_pkthdr header{};
    header.ts.tv_sec = static_cast<decltype(header.ts.tv_sec)>(seconds.count());
    // Nanoseconds in this file format.
    header.ts.tv_usec = static_cast<decltype(header.ts.tv_usec)>((at - seconds).count());
    header.caplen = header.len = static_cast<bpf_u_int32>(frame.size());
    pcap_dump(reinterpret_cast<u_char*>(file_), &header, reinterpret_cast<const u_char*>(frame.data()));
}

}  // namespace margay
