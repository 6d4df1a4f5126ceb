#include "report.hpp"

#include <margay/parts/util/bytes.hpp>

using namespace margay;

void VendorReader::read(Context& ctx) {
    if (upload_.busy()) return;
    if (upload_.state() == RequestState::success) {
        char digits[16];
        TextWriter text(digits);
        text.hex(load_le<std::uint32_t>(vendor_), 8);
        print("slave ", std::uint64_t{slave_}, ": vendor ", text.text());
    } else if (upload_.state() == RequestState::error) {
        print("error: ", sentence_of(upload_.error()));
    }
    upload_.slave = slave_;
    upload_.index = 0x1018;  // identity
    upload_.subindex = 1;
    upload_.data = vendor_;
    if (const auto begun = submit(ctx, upload_); !begun) print("error: ", sentence_of(begun.error()));
}

void print_state(Context& ctx, std::uint64_t cycle) {
    std::uint64_t first = 0;
    for (const Slave& slave : ctx.slaves()) {
        if (slave.image.inputs.bytes.empty()) continue;
        first = std::to_integer<std::uint64_t>(slave.image.inputs.bytes[0]);
        break;
    }
    print("cycle ", cycle, all_right(ctx) ? ": all right" : ": not all right", ", first input ", first);
}
