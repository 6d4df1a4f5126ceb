#include "gateway/slave_table.hpp"

#include "api/queue.hpp"

#include <margay/expected.hpp>
#include <margay/margay.hpp>

#include <algorithm>

namespace margay::gateway {
namespace {

using namespace std::chrono_literals;

constexpr auto kFresh = 100ms;
constexpr auto kUsable = 1s;

SlaveFacts facts_of(const Slave& s) {
    const bool boot = s.al.state == AlState::boot;
    const MailboxInfo& mailbox = boot ? s.boot_mailbox : s.mailbox;
    SlaveFacts facts{.number = s.number,
                     .station = s.station_address,
                     .ring_position = s.ring_position,
                     .configured = s.wanted != nullptr || (s.seen && !s.unexpected),
                     .detected = s.ring_position != 0 && s.al.state != AlState::none,
                     .wanted = s.identity,
                     .identity = s.identity,
                     .out_bytes = mailbox.out_bytes,
                     .in_bytes = mailbox.in_bytes};
    if (s.wanted != nullptr) {
        facts.wanted.vendor = s.wanted->vendor.value_or(s.identity.vendor);
        facts.wanted.product = s.wanted->product.value_or(s.identity.product);
        facts.wanted.revision = s.wanted->revision.value_or(s.identity.revision);
        facts.wanted.serial = s.wanted->serial.value_or(s.identity.serial);
    }
    return facts;
}

}  // namespace

SlaveTable::SlaveTable(Context& ctx) : ctx_(ctx) {
    request_.user = this;
    request_.visit = copy;
}

// In the thread of the owner.
void SlaveTable::copy(Context& ctx, void* user) {
    auto& table = *static_cast<SlaveTable*>(user);
    const auto all = ctx.slaves();
    table.all_ = all.size();
    const auto first = std::min(table.first_, all.size());
    table.copied_ = std::min(kOnce, all.size() - first);
    for (std::size_t n = 0; n < table.copied_; ++n) table.some_[n] = facts_of(all[first + n]);
}

bool SlaveTable::is_fresh(Moment now) const { return known_ && now - at_ < kFresh; }

bool SlaveTable::is_usable(Moment now) const { return known_ && now - at_ < kUsable; }

void SlaveTable::refresh(Moment now) {
    if (reading_) return;
    coming_.clear();
    first_ = 0;
    asked_ = now;
    reading_ = true;
    (void)submit(ctx_, request_);  // the state of the request shows a refusal
}

void SlaveTable::end(bool polled) {
    reading_ = false;
    polled_ = polled;
    known_ = polled;
}

bool SlaveTable::step(Moment now) {
    if (!reading_) return false;
    if (request_.busy()) {
        if (now - asked_ > kOwnerSilent && !RequestAccess::accepted(request_)) request_.cancel();
        if (request_.busy()) return false;
    }
    if (request_.state() != RequestState::success) {
        slaves_.clear();
        end(false);
        return true;
    }
    coming_.insert(coming_.end(), some_.begin(), some_.begin() + static_cast<std::ptrdiff_t>(copied_));
    first_ += copied_;
    if (copied_ != 0 && first_ < all_) {
        (void)submit(ctx_, request_);
        return false;
    }
    slaves_.swap(coming_);
    at_ = now;
    end(true);
    return true;
}

const SlaveFacts* SlaveTable::find(std::uint16_t station) const {
    const auto found = std::ranges::find(slaves_, StationAddress{station}, &SlaveFacts::station);
    return station == 0 || found == slaves_.end() ? nullptr : &*found;
}

}  // namespace margay::gateway
