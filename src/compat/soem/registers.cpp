// Datagrams: the functions of the header about them, and registers for the other sources.
#include "compat/soem/facade.hpp"

#include <cstring>

namespace margay::soem {

int read_registers(Session& session, std::uint16_t station, std::uint16_t address, std::span<std::byte> data,
                   Duration timeout) {
    return session.exchange(DatagramCommand::fprd, address_of(station, address), data, timeout);
}

int write_registers(Session& session, std::uint16_t station, std::uint16_t address, std::span<const std::byte> data,
                    Duration timeout) {
    std::array<std::byte, 64> copy{};
    const auto sent = std::span(copy).first(std::min(copy.size(), data.size()));
    std::ranges::copy(data.first(sent.size()), sent.begin());
    return session.exchange(DatagramCommand::fpwr, address_of(station, address), sent, timeout);
}

namespace {

// The data of the program changes only when a slave has taken part, and never by a write.
int exchange(ecx_portt* port, DatagramCommand command, std::uint32_t address, std::uint16_t length, void* data,
             int timeout, bool takes) {
    const Pinned session = session_of(*port);
    if (session == nullptr || length == 0 || length > 1486) return EC_NOFRAME;
    std::array<std::byte, 1486> copy;
    const auto octets = std::span(copy).first(length);
    std::memcpy(octets.data(), data, length);
    const int wkc = session->exchange(command, address, octets, us(timeout));
    if (wkc > 0 && takes) std::memcpy(data, octets.data(), length);
    return wkc;
}

int exchange_at(ecx_portt* port, DatagramCommand command, std::uint16_t adp, std::uint16_t ado, std::uint16_t length,
                void* data, int timeout) {
    const bool takes =
        command != DatagramCommand::bwr && command != DatagramCommand::apwr && command != DatagramCommand::fpwr;
    return exchange(port, command, address_of(adp, ado), length, data, timeout, takes);
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;
using margay::DatagramCommand;

extern "C" {

int ecx_BWR(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::bwr, ADP, ADO, length, data, timeout);
}
int ecx_BRD(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::brd, ADP, ADO, length, data, timeout);
}
int ecx_APRD(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::aprd, ADP, ADO, length, data, timeout);
}
int ecx_APWR(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::apwr, ADP, ADO, length, data, timeout);
}
int ecx_ARMW(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::armw, ADP, ADO, length, data, timeout);
}
int ecx_FRMW(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::frmw, ADP, ADO, length, data, timeout);
}
int ecx_FPRD(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::fprd, ADP, ADO, length, data, timeout);
}
int ecx_FPWR(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 length, void* data, int timeout) {
    return exchange_at(port, DatagramCommand::fpwr, ADP, ADO, length, data, timeout);
}
uint16 ecx_APRDw(ecx_portt* port, uint16 ADP, uint16 ADO, int timeout) {
    uint16 word = 0;
    ecx_APRD(port, ADP, ADO, sizeof(word), &word, timeout);
    return word;
}
uint16 ecx_FPRDw(ecx_portt* port, uint16 ADP, uint16 ADO, int timeout) {
    uint16 word = 0;
    ecx_FPRD(port, ADP, ADO, sizeof(word), &word, timeout);
    return word;
}
int ecx_APWRw(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 data, int timeout) {
    return ecx_APWR(port, ADP, ADO, sizeof(data), &data, timeout);
}
int ecx_FPWRw(ecx_portt* port, uint16 ADP, uint16 ADO, uint16 data, int timeout) {
    return ecx_FPWR(port, ADP, ADO, sizeof(data), &data, timeout);
}
int ecx_LRW(ecx_portt* port, uint32 LogAdr, uint16 length, void* data, int timeout) {
    return exchange(port, DatagramCommand::lrw, LogAdr, length, data, timeout, true);
}
int ecx_LRD(ecx_portt* port, uint32 LogAdr, uint16 length, void* data, int timeout) {
    return exchange(port, DatagramCommand::lrd, LogAdr, length, data, timeout, true);
}
int ecx_LWR(ecx_portt* port, uint32 LogAdr, uint16 length, void* data, int timeout) {
    return exchange(port, DatagramCommand::lwr, LogAdr, length, data, timeout, false);
}
int ecx_LRWDC(ecx_portt* port, uint32 LogAdr, uint16 length, void* data, uint16 DCrs, int64* DCtime, int timeout) {
    const Pinned session = session_of(*port);
    if (session == nullptr || length == 0 || length > EC_MAXLRWDATA - EC_FIRSTDCDATAGRAM) return EC_NOFRAME;
    margay::soem::Session::Flight frame;
    const auto octets = octets_at(static_cast<const void*>(data), length);
    frame.octets.assign(octets.begin(), octets.end());
    int64 time = htoell(*DCtime);
    margay::DatagramRequest& exchanged = frame.datagrams.emplace_back();
    exchanged.command = DatagramCommand::lrw;
    exchanged.logical = {LogAdr};
    exchanged.data = frame.octets;
    margay::DatagramRequest& told = frame.datagrams.emplace_back();
    told.command = DatagramCommand::frmw;
    told.adp = DCrs;
    told.ado = ECT_REG_DCSYSTIME;
    told.data = octets_at(static_cast<void*>(&time), sizeof(time));
    if (session->launch(frame)) session->await(frame, margay::later(session->now(), us(timeout)));
    session->land(frame);
    if (exchanged.state() != margay::RequestState::success) return EC_NOFRAME;
    if (exchanged.wkc > 0) std::memcpy(data, frame.octets.data(), length);
    if (told.state() == margay::RequestState::success && told.wkc > 0)
        *DCtime = static_cast<int64>(etohll(static_cast<uint64>(time)));
    return exchanged.wkc;
}

}  // extern "C"
