// Single datagrams with any command and address, for programs that speak to ESCs below the level of slaves: before the
// slaves have station addresses, to all slaves at once, or to the logical address space. The library does not know what
// the application writes, and may write the same registers itself. For the registers of a slave with a number see
// registers.hpp.
//
//     std::array<std::byte, 2> status{};
//     margay::DatagramRequest request;             // lives in the caller's memory
//     request.command = margay::DatagramCommand::brd;
//     request.ado = 0x0130;                        // AL status
//     request.data = status;
//     margay::submit(ctx, request);                // before config_init() too
#pragma once

#include <margay/address.hpp>
#include <margay/request.hpp>

namespace margay {

// The commands of ETG.1000.4 "EtherCAT PDU", with the values of the wire.
enum class DatagramCommand : std::uint8_t {
    nop = 0,
    aprd = 1,
    apwr = 2,
    aprw = 3,
    fprd = 4,
    fpwr = 5,
    fprw = 6,
    brd = 7,
    bwr = 8,
    brw = 9,
    lrd = 10,
    lwr = 11,
    lrw = 12,
    armw = 13,
    frmw = 14,
};

// Sends one datagram and waits for its reply. Works before config_init() too, and with slaves that have no number. A
// reply with the working counter 0 is a success of the request: compare `wkc`. Errors: invalid_argument (no data, or
// more than 1486 octets; an unknown command), no_frame (the frame did not come back), timeout, nic, nic_busy.
struct DatagramRequest : Request {
    DatagramRequest();
    DatagramCommand command = DatagramCommand::nop;
    // Of all commands except LRD, LWR and LRW, as on the wire. ADP: the station address; of position addresses
    // RingPosition::on_wire(); of broadcasts 0. ADO: the address in the memory of the ESC.
    std::uint16_t adp = 0;
    std::uint16_t ado = 0;
    LogicalAddress logical;  // of LRD, LWR and LRW
    // What is sent, and what has come back, except for APWR, FPWR, BWR and LWR: these only send. The caller's memory.
    std::span<std::byte> data;
    // Whether the datagram is sent again when its frame is lost: a write may then have its effect twice.
    bool repeat = true;
    std::uint16_t wkc = 0;  // result: the working counter
};

// The same as a function that waits; see wait(). Returns the working counter.
Result<std::uint16_t> exchange_datagram(Context& ctx, DatagramCommand command, std::uint16_t adp, std::uint16_t ado,
                                        std::span<std::byte> data, Duration timeout = Duration{0});

}  // namespace margay
