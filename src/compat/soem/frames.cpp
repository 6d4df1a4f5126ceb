// Frames that the program builds itself. The datagrams of such a frame are sent together, in a frame of the library.
#include "compat/soem/facade.hpp"

#include <bitset>
#include <chrono>
#include <cstring>
#include <mutex>
#include <thread>

extern "C" {
const uint16 priMAC[3] = EC_PRIMARY_MAC_ARRAY;
const uint16 secMAC[3] = EC_SECONDARY_MAC_ARRAY;
}

namespace margay::soem {
namespace {

constexpr int kHeaderOctets = ETH_HEADERSIZE + EC_ELENGTHSIZE;  // Ethernet and EtherCAT header
constexpr int kDatagramHeader = EC_HEADERSIZE - EC_ELENGTHSIZE;

bool is_index(int index) { return index >= 0 && index < EC_MAXBUF; }

// The index that ecx_getindex() has returned to this thread while other threads used all of them.
thread_local const ecx_portt* refused_port = nullptr;
thread_local int refused_index = 0;
bool is_refused(const ecx_portt& port, int index) { return refused_port == &port && refused_index == index; }
bool is_usable(const ecx_portt& port, int index) { return is_index(index) && !is_refused(port, index); }

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

// Builds the frame from the datagrams that have returned. Returns the working counter of the last datagram.
int unload(ecx_portt& port, int index, Session::Flight& flight) {
    for (const DatagramRequest& one : flight.datagrams) {
        if (one.state() != RequestState::success) return EC_NOFRAME;
        put_word(one.data.data() + one.data.size(), one.wkc);  // behind the data, in the octets of the flight
    }
    std::memcpy(port.rxbuf[index], flight.octets.data(), flight.octets.size());
    status_of(port, index) = EC_BUF_COMPLETE;
    return flight.datagrams.back().wkc;
}

// For a thread that uses the flight alone. `timeout` zero: checks once. If the frame has not returned yet, the function
// may be called again.
int await_frame(ecx_portt& port, Session& session, int index, Duration timeout) {
    if (status_of(port, index) != EC_BUF_TX) return EC_NOFRAME;
    Session::Flight& flight = session.flight_of(static_cast<std::size_t>(index));
    session.poll_now();
    session.await(flight, later(session.now(), timeout));
    if (flight.datagrams.empty() || !flight.over()) return EC_NOFRAME;
    return unload(port, index, flight);
}

int take_frame(ecx_portt& port, int index, Duration timeout) {
    const Pinned session = session_of(port);
    if (session == nullptr || !is_usable(port, index)) return EC_NOFRAME;
    const Session::FlightUse use(*session, static_cast<std::size_t>(index));
    return use.alone() ? await_frame(port, *session, index, timeout) : EC_NOFRAME;
}

// For a thread that uses the flight alone. Returns the octets of the frame, or -1.
int send_frame(ecx_portt& port, Session& session, int index) {
    const int length = port.txbuflength[index];
    if (length <= kHeaderOctets || length > EC_BUFSIZE) return -1;
    Session::Flight& flight = session.flight_of(static_cast<std::size_t>(index));
    session.land(flight);
    flight.datagrams.clear();
    load(flight,
         std::span(port.txbuf[index]).subspan(ETH_HEADERSIZE, static_cast<std::size_t>(length) - ETH_HEADERSIZE));
    if (flight.datagrams.empty()) return -1;
    status_of(port, index) = EC_BUF_TX;
    return session.launch(flight) ? length : -1;
}

// The thread that has reserved an index.
std::atomic_ref<int> owner_of(ecx_portt& port, int index) { return std::atomic_ref<int>(port.rxsa[index]); }

// Held while a thread looks at the state and the owner of indexes and reserves one: another thread then sees both as
// they were before or after.
constinit PriorityLock indexes_lock;
using IndexesLock = std::lock_guard<PriorityLock>;

// Reserves an index of this state.
bool reserve_in(ecx_portt& port, int index, int state) {
    if (!status_of(port, index).compare_exchange_strong(state, EC_BUF_ALLOC)) return false;
    owner_of(port, index) = static_cast<int>(PriorityLock::thread());
    std::atomic_ref(port.lastidx) = static_cast<FrameIndex>(index);
    return true;
}

// Whether the frame has returned or is lost, and the calling thread has not released its index.
bool is_left_behind(ecx_portt& port, int index) {
    if (owner_of(port, index) != static_cast<int>(PriorityLock::thread())) return false;
    const int state = status_of(port, index);
    if (state != EC_BUF_TX) return state == EC_BUF_COMPLETE;
    const Pinned session = session_of(port);
    if (session == nullptr) return true;
    const Session::FlightUse use(*session, static_cast<std::size_t>(index));
    return use.alone() && session->flight_of(static_cast<std::size_t>(index)).over();
}

// A free index, otherwise an index that this thread has not released. -1: none.
int look_for_index(ecx_portt& port) {
    const IndexesLock lock(indexes_lock);
    const int begin = std::atomic_ref(port.lastidx).load() + 1;
    for (int n = 0; n < EC_MAXBUF; ++n)
        if (reserve_in(port, (begin + n) % EC_MAXBUF, EC_BUF_EMPTY)) return (begin + n) % EC_MAXBUF;
    for (int n = 0; n < EC_MAXBUF; ++n) {
        const int index = (begin + n) % EC_MAXBUF;
        if (is_left_behind(port, index) && reserve_in(port, index, status_of(port, index))) return index;
    }
    return -1;
}

// The oldest index of this thread. Its frame is given up. -1: the thread has none.
int take_own(ecx_portt& port) {
    const IndexesLock lock(indexes_lock);
    const int begin = std::atomic_ref(port.lastidx).load() + 1;
    for (int n = 0; n < EC_MAXBUF; ++n) {
        const int index = (begin + n) % EC_MAXBUF;
        const int state = status_of(port, index);
        const bool own = state != EC_BUF_EMPTY && owner_of(port, index) == static_cast<int>(PriorityLock::thread());
        if (own && reserve_in(port, index, state)) return index;
    }
    return -1;
}

// An index whose frame had returned at every check. -1: there is none.
int take_idle(ecx_portt& port, const std::bitset<EC_MAXBUF>& idle) {
    const IndexesLock lock(indexes_lock);
    for (int n = 0; n < EC_MAXBUF; ++n)
        if (idle.test(static_cast<std::size_t>(n)) && reserve_in(port, n, EC_BUF_COMPLETE)) return n;
    return -1;
}

bool all_are_own(ecx_portt& port) {
    for (int n = 0; n < EC_MAXBUF; ++n)
        if (owner_of(port, n) != static_cast<int>(PriorityLock::thread())) return false;
    return true;
}

// Waits for an index that another thread releases. After the wait it reserves an index whose frame another thread has
// received long ago, or an index of its own thread. -1: other threads use all indexes.
int reserve(ecx_portt& port) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    std::bitset<EC_MAXBUF> idle;
    idle.set();
    do {
        if (const int index = look_for_index(port); index >= 0) return index;
        if (all_are_own(port)) return take_own(port);
        for (int n = 0; n < EC_MAXBUF; ++n)
            if (status_of(port, n) != EC_BUF_COMPLETE) idle.reset(static_cast<std::size_t>(n));
        std::this_thread::sleep_for(std::chrono::microseconds(100));
    } while (std::chrono::steady_clock::now() < until);
    const int idle_one = take_idle(port, idle);
    return idle_one >= 0 ? idle_one : take_own(port);
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
    if (is_refused(*port, idx)) return -1;
    auto* const octets = static_cast<std::uint8_t*>(frame);
    put_word(reinterpret_cast<std::byte*>(octets + ETH_HEADERSIZE),
             EC_ECATTYPE | static_cast<unsigned>(kDatagramHeader + length + EC_WKCSIZE));
    put_datagram(octets + kHeaderOctets, com, idx, ADP, ADO, length, data);
    if (is_index(idx)) port->txbuflength[idx] = kHeaderOctets + kDatagramHeader + length + EC_WKCSIZE;
    return 0;
}

DatagramOffset ecx_adddatagram(ecx_portt* port, void* frame, uint8 com, uint8 idx, boolean more, uint16 ADP, uint16 ADO,
                               uint16 length, void* data) {
    if (!is_usable(*port, idx)) return 0;
    auto* const octets = static_cast<std::uint8_t*>(frame);
    auto* const bytes = reinterpret_cast<std::byte*>(frame);
    const int end = port->txbuflength[idx];
    // Marks in each earlier datagram that another datagram follows.
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
    if (is_usable(*port, idx)) status_of(*port, idx) = bufstat;
}

FrameIndex ecx_getindex(ecx_portt* port) {
    refused_port = nullptr;
    int index = reserve(*port);
    if (index < 0) {
        say_once(
            "ecx_getindex(): other threads use all 16 frame indexes, and this thread has none: give each index back, "
            "ecx_setbufstat(…, EC_BUF_EMPTY)");
        index = std::atomic_ref(port->lastidx).load() % EC_MAXBUF;
        refused_port = port;
        refused_index = index;
    }
    return static_cast<FrameIndex>(index);
}

int ecx_outframe(ecx_portt* port, FrameIndex idx, int) {
    const Pinned session = session_of(*port);
    if (!is_usable(*port, idx) || session == nullptr) return -1;
    const Session::FlightUse use(*session, static_cast<std::size_t>(idx));
    return use.alone() ? send_frame(*port, *session, idx) : -1;
}

int ecx_outframe_red(ecx_portt* port, FrameIndex idx) { return ecx_outframe(port, idx, 0); }

int ecx_waitinframe(ecx_portt* port, FrameIndex idx, int timeout) { return take_frame(*port, idx, us(timeout)); }

int ecx_srconfirm(ecx_portt* port, FrameIndex idx, int timeout) {
    const Pinned session = session_of(*port);
    if (session == nullptr || !is_usable(*port, idx)) return EC_NOFRAME;
    const Session::FlightUse use(*session, static_cast<std::size_t>(idx));
    if (!use.alone()) return EC_NOFRAME;
    const margay::Time until = margay::later(session->now(), us(timeout));
    do {
        if (send_frame(*port, *session, idx) < 0) return EC_NOFRAME;
        const int wkc = await_frame(*port, *session, idx, us(std::min(timeout, EC_TIMEOUTRET)));
        if (wkc >= 0) return wkc;
    } while (session->now() < until);
    return EC_NOFRAME;
}

#ifdef EC_VER1
int ecx_inframe(ecx_portt* port, int idx, int) { return take_frame(*port, idx, margay::Duration{0}); }
#endif

}  // extern "C"
