#include <margay/detail/octet_ring.hpp>

#include <algorithm>

namespace margay {

std::size_t OctetRing::used(std::size_t added, std::size_t removed) const {
    return added >= removed ? added - removed : added + 2 * memory_.size() - removed;
}

std::size_t OctetRing::advanced(std::size_t at, std::size_t octets) const {
    const std::size_t next = at + octets;
    return next >= 2 * memory_.size() ? next - 2 * memory_.size() : next;
}

std::size_t OctetRing::room() const {
    return memory_.size() - used(added_.load(std::memory_order_relaxed), removed_.load(std::memory_order_acquire));
}

bool OctetRing::empty() const {
    return added_.load(std::memory_order_acquire) == removed_.load(std::memory_order_acquire);
}

void OctetRing::put(std::size_t& at, std::span<const std::byte> octets) {
    const auto to_end = octets.first(std::min(octets.size(), memory_.size() - slot(at)));
    std::ranges::copy(to_end, memory_.begin() + static_cast<std::ptrdiff_t>(slot(at)));
    std::ranges::copy(octets.subspan(to_end.size()), memory_.begin());
    at = advanced(at, octets.size());
}

bool OctetRing::add(std::span<const std::byte> head, std::span<const std::byte> data) {
    if (head.size() + data.size() > room()) return false;
    std::size_t at = added_.load(std::memory_order_relaxed);
    put(at, head);
    put(at, data);
    added_.store(at, std::memory_order_release);
    return true;
}

void OctetRing::peek(std::size_t skip, std::span<std::byte> into) const {
    const std::size_t from = slot(advanced(removed_.load(std::memory_order_relaxed), skip));
    const auto to_end = memory_.subspan(from, std::min(into.size(), memory_.size() - from));
    std::ranges::copy(to_end, into.begin());
    std::ranges::copy(memory_.first(into.size() - to_end.size()),
                      into.begin() + static_cast<std::ptrdiff_t>(to_end.size()));
}

void OctetRing::drop(std::size_t octets) {
    removed_.store(advanced(removed_.load(std::memory_order_relaxed), octets), std::memory_order_release);
}

}  // namespace margay
