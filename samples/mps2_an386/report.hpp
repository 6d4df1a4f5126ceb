// The output of the master: lines at the UART.
#pragma once

#include "board.hpp"

#include <margay/margay.hpp>
#include <margay/parts/util/text_writer.hpp>

// Composes a line of texts and numbers, and prints it. Not callable from an interrupt.
template <class... Parts>
void print(const Parts&... parts) {
    char line[200];
    margay::TextWriter text(line);
    (text << ... << parts);
    board::print(text.text());
}

// The sentence of an error or an event, in memory that the next call uses again.
template <class What>
std::string_view sentence_of(const What& what) {
    static char sentence[160];
    return margay::describe(what, sentence);
}

// Prints the errors and events since the last call.
inline void print_problems(margay::Context& ctx) {
    while (const auto error = ctx.errors().take()) print("error: ", sentence_of(*error));
    while (const auto event = ctx.events().take()) print("event: ", sentence_of(*event));
}

// Reads the vendor ID of a slave repeatedly beside the cycle, and prints it.
class VendorReader {
  public:
    explicit VendorReader(std::uint16_t slave) : slave_(slave) {}
    // Prints the last result, and begins the next reading.
    void read(margay::Context& ctx);

  private:
    std::uint16_t slave_;
    std::byte vendor_[4]{};
    margay::SdoUpload upload_;
};

// Prints whether the segment works without errors, and the first octet of the inputs of the first slave with inputs.
void print_state(margay::Context& ctx, std::uint64_t cycle);
