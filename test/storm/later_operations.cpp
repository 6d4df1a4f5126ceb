// Kinds of requests that were added to the library after the first seeds: streams, files, VoE, AoE, EoE, messages of
// any protocol, latches and targets.
#include "storm/operation_of.hpp"

#include <margay/latches.hpp>

#include <algorithm>

namespace margay::storm {
namespace {

// A source and a sink that are not ready each third time.
class SlowContent final : public ByteSource, public ByteSink {
  public:
    std::size_t left = 0;
    Piece pull(MutableBytes into) override {
        if (++calls_ % 3 == 0) return {};
        const std::size_t bytes = std::min({into.size(), left, std::size_t{100}});
        left -= bytes;
        return {.bytes = bytes, .last = left == 0};
    }
    Taken push(Bytes octets) override {
        if (++calls_ % 3 == 0) return {};
        return {.bytes = std::min<std::size_t>(octets.size(), 100)};
    }

  private:
    unsigned calls_ = 0;
};

// A request with a stream.
template <class R>
struct Streamed final : Operation {
    R r;
    SlowContent content;
    ~Streamed() override { r.cancel(); }
    Result<> submit(Context& ctx) override { return margay::submit(ctx, r); }
    Request& request() override { return r; }
    void cancel() override { r.cancel(); }
};
template <class R>
std::unique_ptr<Operation> make_streamed() {
    return std::make_unique<Streamed<R>>();
}
template <class R>
Streamed<R>& streamed(Operation& operation) {
    return static_cast<Streamed<R>&>(operation);
}

constexpr std::array<std::string_view, 4> kNames{"firmware", "parameters", "", "a name that no slave has"};

constexpr Set kUploadStream = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = streamed<SdoUploadStream>(o);
    address_mail(all.r, slave, b);
    constexpr std::array<std::uint16_t, 4> kObjects{0x1008, 0x1000, 0x100A, 0x2000};
    all.r.index = kObjects[a % kObjects.size()];
    all.r.sink = &all.content;
};
constexpr Set kDownloadStream = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = streamed<SdoDownloadStream>(o);
    address_mail(all.r, slave, b);
    constexpr std::array<std::uint16_t, 4> kObjects{0x2000, 0x2001, 0x7000, 0x3FFF};
    all.r.index = kObjects[a % kObjects.size()];
    all.r.size = 1 + (a >> 5) % 1024;
    all.content.left = all.r.size;
    all.r.source = &all.content;
};
constexpr Set kFoeRead = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = streamed<FoeRead>(o);
    address_mail(all.r, slave, b);
    all.r.name = kNames[a % kNames.size()];
    all.r.sink = &all.content;
};
constexpr Set kFoeWrite = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = streamed<FoeWrite>(o);
    address_mail(all.r, slave, b);
    all.r.name = kNames[a % kNames.size()];
    all.content.left = (a >> 4) % 4096;
    all.r.source = &all.content;
};
constexpr Set kVoeSend = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<VoeSend>(o);
    address_mail(all.r, slave, b);
    all.r.header = {.vendor_id = a % 3, .vendor_type = static_cast<std::uint16_t>(b % 3)};
    all.r.data = std::span<const std::byte>(all.data).first(a % 64);
};
// The gateway, its subordinates, and a device that does not exist.
constexpr std::array<std::uint16_t, 4> kAmsPorts{1000, 1001, 1002, 9};
template <class R>
void address_aoe(R& r, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    address_mail(r, slave, b);
    r.target = {{{1, 2, 3, 4, 5, static_cast<std::uint8_t>(a % 3)}}, kAmsPorts[b % kAmsPorts.size()]};
}
constexpr Set kAoeRead = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<AoeRead>(o);
    address_aoe(all.r, slave, a, b);
    all.r.index_group = 0xF302;
    all.r.index_offset = 0x10180001;
    all.r.data = std::span(all.data).first(a % 64);
};
constexpr Set kAoeWrite = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<AoeWrite>(o);
    address_aoe(all.r, slave, a, b);
    all.r.index_group = 0xF302;
    all.r.index_offset = 0x20000000;
    all.r.data = std::span<const std::byte>(all.data).first(a % 64);
};
constexpr Set kAoeState = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    address_aoe(as<AoeReadState>(o).r, slave, a, b);
};
constexpr Set kEoeGetIp = [](Operation& o, std::uint32_t slave, std::uint32_t, std::uint32_t b) {
    address_mail(as<EoeGetIp>(o).r, slave, b);
};
constexpr Set kEoeSetIp = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<EoeSetIp>(o).r;
    address_mail(r, slave, b);
    r.ip.address = Ipv4Address{192, 168, 0, static_cast<std::uint8_t>(a)};
};
constexpr Set kRawMail = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<RawMail>(o);
    address_mail(all.r, slave, b);
    if (all.r.timeout == Duration{0}) all.r.timeout = 100ms;  // the slave may not answer
    all.r.type = static_cast<MailboxType>(1 + a % 15);
    all.r.message = std::span<const std::byte>(all.data).first((a >> 4) % 40);
    all.r.answer = std::span(all.data).subspan(1024, (a >> 10) % 4 == 0 ? 0 : 128);
};
constexpr Set kLatch = [](Operation& o, std::uint32_t slave, std::uint32_t, std::uint32_t b) {
    auto& r = as<LatchRequest>(o).r;
    r.slave = slave_number(slave);
    r.interval = std::chrono::milliseconds(1 + b % 20);
};

}  // namespace

std::vector<KindInfo> later_kinds() {
    return {
        {"sdo_upload_stream", make_streamed<SdoUploadStream>, kUploadStream, true, false, true},
        {"sdo_download_stream", make_streamed<SdoDownloadStream>, kDownloadStream, true, false, false},
        {"foe_read", make_streamed<FoeRead>, kFoeRead, true, false, true},
        {"foe_write", make_streamed<FoeWrite>, kFoeWrite, true, false, false},
        {"voe_send", make<VoeSend>, kVoeSend, true, false, true},
        {"aoe_read", make<AoeRead>, kAoeRead, true, false, true},
        {"aoe_write", make<AoeWrite>, kAoeWrite, true, false, false},
        {"aoe_read_state", make<AoeReadState>, kAoeState, true, false, true},
        {"eoe_get_ip", make<EoeGetIp>, kEoeGetIp, true, false, true},
        {"eoe_set_ip", make<EoeSetIp>, kEoeSetIp, true, false, false},
        {"raw_mail", make<RawMail>, kRawMail, true, false, false},
        {"latch", make<LatchRequest>, kLatch, false, true, true},
    };
}

}  // namespace margay::storm
