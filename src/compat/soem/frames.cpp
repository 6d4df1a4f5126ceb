// Frames that the program builds itself. The datagrams of such a frame are sent together, in a frame of the library.
#include "compat/soem/facade.hpp"

#include <cstring>

extern "C" {
const uint16 priMAC[3] = EC_PRIMARY_MAC_ARRAY;
const uint16 secMAC[3] = EC_SECONDARY_MAC_ARRAY;
}

namespace margay::soem {
namespace {

constexpr int kHeaderOctets = ETH_HEADERSIZE + EC_ELENGTHSIZE;  // Ethernet and EtherCAT header
constexpr int kDatagramHeader = EC_HEADERSIZE - EC_ELENGTHSIZE;

bool is_index(int index) { return index >= 0 && index < EC_MAXBUF; }

// Writes the header, the data and the working counter of a datagram behind `at`.
void put_datagram(std::uint8_t* at, std::uint8_t command, std::uint8_t index, std::uint16_t adp, std::uint16_t ado,
                  std::uint16_t length, const void* data) {
    auto* const octets = reinterpret_cast<std::byte*>(at);
    octets[0] = std::byte{command};
    octets[1] = std::byte{index};
    put_word(octets + 2, adp);
    put_word(octets + 4, ado);
    put_word(octets + 6, length);
    put_word(octets + 8, 0);
    const bool reads = command == EC_CMD_NOP || command == EC_CMD_APRD || command == EC_CMD_FPRD ||
                       command == EC_CMD_BRD || command == EC_CMD_LRD;
    if (length > 0 && reads) std::memset(octets + kDatagramHeader, 0, length);
    if (length > 0 && !reads) std::memcpy(octets + kDatagramHeader, data, length);
    put_word(octets + kDatagramHeader + length, 0);
}

// The datagrams of a frame, as requests.
void load(Session::Flight& flight, std::span<const std::uint8_t> frame) {
    const auto* const begin = reinterpret_cast<const std::byte*>(frame.data());
    flight.octets.assign(begin, begin + frame.size());
    const auto octets = std::span(flight.octets);
    for (std::size_t at = EC_ELENGTHSIZE; at + kDatagramHeader + EC_WKCSIZE <= octets.size();) {
        const auto header = octets.subspan(at);
        const std::size_t size = word_at(&header[6]) & 0x7FFU;
        if (size == 0 || kDatagramHeader + size + EC_WKCSIZE > header.size()) return;
        DatagramRequest& one = flight.datagrams.emplace_back();
        one.command = static_cast<DatagramCommand>(std::to_integer<unsigned>(header[0]));
        one.adp = word_at(&header[2]);
        one.ado = word_at(&header[4]);
        one.logical = {address_of(one.adp, one.ado)};
        one.data = header.subspan(kDatagramHeader, size);
        one.repeat = false;
        at += kDatagramHeader + size + EC_WKCSIZE;
        if ((word_at(&header[6]) & EC_DATAGRAMFOLLOWS) == 0) return;
    }
}

// The frame as it has come back. Returns the working counter of the last datagram.
int unload(ecx_portt& port, int index, Session::Flight& flight) {
    for (const DatagramRequest& one : flight.datagrams) {
        if (one.state() != RequestState::success) return EC_NOFRAME;
        put_word(one.data.data() + one.data.size(), one.wkc);  // behind the data, in the octets of the flight
    }
    std::memcpy(port.rxbuf[index], flight.octets.data(), flight.octets.size());
    status_of(port, index) = EC_BUF_COMPLETE;
    return flight.datagrams.back().wkc;
}

// `timeout` zero: looks once. A frame that has not come back yet may be waited for again.
int take_frame(ecx_portt& port, int index, Duration timeout) {
    if (!is_index(index) || status_of(port, index) != EC_BUF_TX) return EC_NOFRAME;
    const Pinned session = session_of(port);
    if (session == nullptr) return EC_NOFRAME;
    Session::Flight& flight = session->flight_of(static_cast<std::size_t>(index));
    session->poll_now();
    session->await(flight, later(session->now(), timeout));
    if (flight.datagrams.empty() || !flight.over()) return EC_NOFRAME;
    return unload(port, index, flight);
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

void ec_setupheader(void* p) {
    auto* const octets = static_cast<std::byte*>(p);
    std::memset(octets, 0xFF, 6);
    for (int n = 0; n < 3; ++n) {
        octets[6 + 2 * n] = static_cast<std::byte>(priMAC[n] >> 8);
        octets[7 + 2 * n] = static_cast<std::byte>(priMAC[n]);
    }
    octets[12] = std::byte{ETH_P_ECAT >> 8};
    octets[13] = std::byte{ETH_P_ECAT & 0xFF};
}

int ecx_setupdatagram(ecx_portt* port, void* frame, uint8 com, uint8 idx, uint16 ADP, uint16 ADO, uint16 length,
                      void* data) {
    auto* const octets = static_cast<std::uint8_t*>(frame);
    put_word(reinterpret_cast<std::byte*>(octets + ETH_HEADERSIZE),
             EC_ECATTYPE | static_cast<unsigned>(kDatagramHeader + length + EC_WKCSIZE));
    put_datagram(octets + kHeaderOctets, com, idx, ADP, ADO, length, data);
    if (is_index(idx)) port->txbuflength[idx] = kHeaderOctets + kDatagramHeader + length + EC_WKCSIZE;
    return 0;
}

DatagramOffset ecx_adddatagram(ecx_portt* port, void* frame, uint8 com, uint8 idx, boolean more, uint16 ADP, uint16 ADO,
                               uint16 length, void* data) {
    if (!is_index(idx)) return 0;
    auto* const octets = static_cast<std::uint8_t*>(frame);
    auto* const bytes = reinterpret_cast<std::byte*>(frame);
    const int end = port->txbuflength[idx];
    // The datagrams before this one say that another one follows.
    for (int at = kHeaderOctets; at + kDatagramHeader <= end;) {
        const unsigned size = word_at(bytes + at + 6) & 0x7FFU;
        put_word(bytes + at + 6, word_at(bytes + at + 6) | EC_DATAGRAMFOLLOWS);
        at += kDatagramHeader + static_cast<int>(size) + EC_WKCSIZE;
    }
    put_datagram(octets + end, com, idx, ADP, ADO, length, data);
    if (more != 0) put_word(bytes + end + 6, length | EC_DATAGRAMFOLLOWS);
    const int added = kDatagramHeader + length + EC_WKCSIZE;
    const unsigned elength = word_at(bytes + ETH_HEADERSIZE) & 0x7FFU;
    put_word(bytes + ETH_HEADERSIZE, EC_ECATTYPE | (elength + static_cast<unsigned>(added)));
    port->txbuflength[idx] = end + added;
    return static_cast<DatagramOffset>(end - ETH_HEADERSIZE + kDatagramHeader);
}

void ecx_setbufstat(ecx_portt* port, FrameIndex idx, int bufstat) {
    if (is_index(idx)) status_of(*port, idx) = bufstat;
}

FrameIndex ecx_getindex(ecx_portt* port) {
    const std::atomic_ref last(port->lastidx);
    const int begin = last.load() + 1;
    int index = 0;
    for (int n = 0; n < EC_MAXBUF; ++n) {
        index = (begin + n) % EC_MAXBUF;
        int free = EC_BUF_EMPTY;
        if (status_of(*port, index).compare_exchange_strong(free, EC_BUF_ALLOC)) break;
        if (n + 1 == EC_MAXBUF) status_of(*port, index) = EC_BUF_ALLOC;  // all are in use
    }
    last = static_cast<FrameIndex>(index);
    return static_cast<FrameIndex>(index);
}

int ecx_outframe(ecx_portt* port, FrameIndex idx, int) {
    const Pinned session = session_of(*port);
    if (!is_index(idx) || session == nullptr) return -1;
    const int length = port->txbuflength[idx];
    if (length <= kHeaderOctets || length > EC_BUFSIZE) return -1;
    Session::Flight& flight = session->flight_of(static_cast<std::size_t>(idx));
    session->land(flight);
    flight.datagrams.clear();
    load(flight,
         std::span(port->txbuf[idx]).subspan(ETH_HEADERSIZE, static_cast<std::size_t>(length) - ETH_HEADERSIZE));
    if (flight.datagrams.empty()) return -1;
    status_of(*port, idx) = EC_BUF_TX;
    return session->launch(flight) ? length : -1;
}

int ecx_outframe_red(ecx_portt* port, FrameIndex idx) { return ecx_outframe(port, idx, 0); }

int ecx_waitinframe(ecx_portt* port, FrameIndex idx, int timeout) { return take_frame(*port, idx, us(timeout)); }

int ecx_srconfirm(ecx_portt* port, FrameIndex idx, int timeout) {
    const Pinned session = session_of(*port);
    if (session == nullptr) return EC_NOFRAME;
    const margay::Time until = margay::later(session->now(), us(timeout));
    do {
        if (ecx_outframe(port, idx, 0) < 0) return EC_NOFRAME;
        const int wkc = take_frame(*port, idx, us(std::min(timeout, EC_TIMEOUTRET)));
        if (wkc >= 0) return wkc;
    } while (session->now() < until);
    return EC_NOFRAME;
}

#ifdef EC_VER1
int ecx_inframe(ecx_portt* port, int idx, int) { return take_frame(*port, idx, margay::Duration{0}); }
#endif

}  // extern "C"
