// A ring that the library opens itself, see Redundancy::begin_opening().
#include "link/redundancy.hpp"
#include "wire/esc.hpp"

namespace margay {
namespace {

bool writes_loops(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (d->header.command == wire::Command::FPWR && d->header.address.ado() == wire::reg::kDlControl.address)
            return true;
    return false;
}

}  // namespace

// Whether only the head sends the frame. Only the head sends the frame that closes or opens the port, because the copy
// of the other NIC could find the port already closed.
bool Redundancy::is_opened_by(Bytes frame) noexcept {
    const Opening before = opening_.load(std::memory_order_relaxed);
    const bool turns = (before == Opening::awaited || before == Opening::ends) && writes_loops(frame);
    if (turns) opening_.store(before == Opening::awaited ? Opening::open : Opening::closed, std::memory_order_relaxed);
    return turns || before == Opening::open || before == Opening::ends;
}

}  // namespace margay
