#include "subdevice_check/kept.hpp"

#include "common/program.hpp"

#include <margay/margay.hpp>

#include <utility>

namespace margay::samples::conformance {
namespace {
constexpr int kTriesToPutBack = 10;
constexpr int kRefusals = 3;  // a slave that does not do what the check needs
}  // namespace

Kept::Kept(Session& session, std::uint16_t index, std::uint8_t subindex)
    : session_(session), index_(index), first_(subindex), list_(false) {
    keep(subindex);
}

Kept::Kept(Session& session, std::uint16_t index) : session_(session), index_(index), first_(1), list_(true) {
    const auto count = session.sdo.number(index, 0);
    if (!count) session.bench.skip(object_text(index, 0) + " cannot be read");
    for (unsigned n = 1; n <= *count; ++n) keep(static_cast<std::uint8_t>(n));
}

void Kept::keep(std::uint8_t subindex) {
    auto up = session_.sdo.upload(index_, subindex);
    if (!up.ok()) session_.bench.skip(object_text(index_, subindex) + " cannot be read");
    values_.push_back(std::move(up.data));
}

// The first answer that refuses a value.
Abort Kept::write() {
    auto& sdo = session_.sdo;
    Abort refused = Abort::none;
    const auto note = [&](Abort abort) { refused = refused == Abort::none ? abort : refused; };
    if (list_) note(sdo.download<std::uint8_t>(index_, 0, 0));
    for (std::size_t n = 0; n < values_.size(); ++n)
        note(sdo.download(index_, static_cast<std::uint8_t>(first_ + n), Bytes(values_[n])));
    if (list_) note(sdo.download<std::uint8_t>(index_, 0, static_cast<std::uint8_t>(values_.size())));
    return refused;
}

bool Kept::differs() {
    if (list_ && session_.sdo.number(index_, 0) != values_.size()) return true;
    for (std::size_t n = 0; n < values_.size(); ++n)
        if (session_.sdo.upload(index_, static_cast<std::uint8_t>(first_ + n)).data != values_[n]) return true;
    return false;
}

// Empty: the old values were restored, or an error of the device was reported. Otherwise the reason.
std::string Kept::put_back() {
    auto& bench = session_.bench;
    std::string why;
    for (int n = 0, refusals = 0; n < kTriesToPutBack && refusals < kRefusals && !stop_asked(); ++n) {
        try {
            bench.enter(AlState::preop);
            const auto refused = write();
            if (differs())
                bench.fail(fmt::format("{} does not take back what it had before the check: {}", name(),
                                       refused == Abort::none ? "it reads as another value" : abort_text(refused)));
            return {};
        } catch (const NotJudged& not_judged) {
            why = not_judged.reason;
            ++refusals;
        } catch (const LineFault& fault) {
            why = "the line loses frames: " + fault.reason;
        }
    }
    return why.empty() ? "the program was stopped" : why;
}

Kept::~Kept() {
    // A lost frame may be sent again, as in the scan, because this code does not search for faults of the device.
    auto& sendings = session_.bench.context().link_settings().sendings;
    const auto once = std::exchange(sendings, LinkSettings{}.sendings);
    if (const auto why = put_back(); !why.empty())
        session_.left_changed =
            fmt::format("{} may still have values of this check, because they could not be replaced: {}", name(), why);
    sendings = once;
}

std::string Kept::name() const {
    return list_ ? fmt::format("the list 0x{:04x}", index_) : object_text(index_, first_);
}

}  // namespace margay::samples::conformance
