#include "mailbox/soe_transfer.hpp"

#include <algorithm>

namespace margay {

namespace soe = wire::soe;

MailClient::Taken SoeTransfer::fail(Errc code, std::size_t expected, std::size_t actual) {
    over_ = true;
    error_.code = code;
    error_.expected = static_cast<std::uint32_t>(expected);
    error_.actual = static_cast<std::uint32_t>(actual);
    return Taken::all;
}

MailClient::Taken SoeTransfer::accept(const wire::MailboxMessage& mail) {
    if (over_ || mail.data.size() < soe::kHeaderBytes) return Taken::no;
    const auto header = soe::load_header(mail.data);
    if (header.opcode != answer_ || header.drive != target_.drive) return Taken::no;
    const auto data = mail.data.subspan(soe::kHeaderBytes);
    if (header.error) {
        if (header.number != target_.idn.value && !in_fragments()) return Taken::no;
        if (data.size() < soe::kErrorBytes) return fail(Errc::protocol, soe::kErrorBytes, data.size());
        error_.detail = load_le<std::uint16_t>(data, data.size() - soe::kErrorBytes);
        return fail(Errc::soe_error);
    }
    // Some slaves set the elements in requests only.
    if (header.elements != target_.elements && header.elements != 0) return Taken::no;
    return read_answer(header, data);
}

// ------------------------------------------------------------------ read

std::size_t SoeReadTransfer::compose(MutableBytes data) {
    if (data.size() < soe::kHeaderBytes) return 0;
    soe::store_header(data, {.opcode = soe::Opcode::read_request,
                             .drive = target_.drive,
                             .elements = target_.elements,
                             .number = target_.idn.value});
    return soe::kHeaderBytes;
}

MailClient::Taken SoeReadTransfer::read_answer(const soe::Header& header, Bytes data) {
    const Taken taken = take_fragment(header, data);
    return taken == Taken::all && header.incomplete ? Taken::broken : taken;
}

MailClient::Taken SoeReadTransfer::take_fragment(const soe::Header& header, Bytes data) {
    const bool first = left_ == 0;
    if (!header.incomplete && header.number != target_.idn.value)
        return first ? Taken::no : fail(Errc::protocol, target_.idn.value, header.number);
    const auto left = header.incomplete ? header.number : std::uint16_t{0};
    if (!first && left != left_ - 1) return fail(Errc::protocol, left_ - 1U, left);
    if (header.incomplete && (left == 0 || data.empty())) return fail(Errc::protocol, 1, left);
    if (done_ < into_.size()) {
        const auto part = data.first(std::min(data.size(), into_.size() - done_));
        std::ranges::copy(part, into_.begin() + static_cast<std::ptrdiff_t>(done_));
    }
    done_ += data.size();
    left_ = left;
    if (header.incomplete) return Taken::more;
    if (done_ > into_.size()) return fail(Errc::capacity, done_, into_.size());
    over_ = true;
    return Taken::all;
}

// ------------------------------------------------------------------ write

std::size_t SoeWriteTransfer::compose(MutableBytes data) {
    if (data.size() < soe::kHeaderBytes + room_ || room_ == 0) return 0;
    const std::size_t left = value_.size() - done_;
    const bool last = at_last();
    const std::size_t part = last ? left : room_;
    const std::size_t after = (left - part + room_ - 1) / room_;
    soe::store_header(data, {.opcode = soe::Opcode::write_request,
                             .incomplete = !last,
                             .drive = target_.drive,
                             .elements = target_.elements,
                             .number = last ? target_.idn.value : static_cast<std::uint16_t>(after)});
    std::ranges::copy(value_.subspan(done_, part), data.begin() + soe::kHeaderBytes);
    return soe::kHeaderBytes + part;
}

MailClient::Taken SoeWriteTransfer::read_answer(const soe::Header& header, Bytes) {
    if (header.incomplete || header.number != target_.idn.value) return Taken::no;
    over_ = true;
    return Taken::all;
}

}  // namespace margay
