// The asynchronous requests of a slave's configuration, each a request of the library with memory of its own.
#pragma once

#include <margay/coe.hpp>
#include <margay/datagram.hpp>
#include <margay/foe.hpp>
#include <margay/registers.hpp>
#include <margay/soe.hpp>
#include <margay/voe.hpp>

#include <ecrt.h>

#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace margay::compat::ecrt {

class Bus;

[[nodiscard]] inline ec_request_state_t to_ec(RequestState state) {
    switch (state) {
        case RequestState::busy: return EC_REQUEST_BUSY;
        case RequestState::success: return EC_REQUEST_SUCCESS;
        case RequestState::error: return EC_REQUEST_ERROR;
        default: return EC_REQUEST_UNUSED;
    }
}

// The kind of the last transfer of a request, and whether it was refused before it began. …_later: it begins when the
// scan of the start-up is over, or when the slave is in PREOP. begin_waiting() and the state function of the request
// begin it; `beginning`: one of these two functions is beginning it.
enum class Transfer : std::uint8_t {
    none,
    read,
    write,
    refused,
    read_later,
    write_later,
    exchange,
    exchange_later,
    beginning
};

[[nodiscard]] inline bool is_waiting(Transfer last) {
    return last == Transfer::read_later || last == Transfer::write_later || last == Transfer::exchange_later ||
           last == Transfer::beginning;
}

// Whether a request may have memory of this size; if not, a message says so, and names the owner of the request.
[[nodiscard]] bool may_have(const ec_slave_config& config, std::size_t octets);
[[nodiscard]] bool may_have(const ec_master& master, std::uint16_t position, std::size_t octets);

// Data for the log about a request that has ended in ERROR. A program may ask for the state in each cycle, and may
// repeat the request: a reason is printed once, and again after a success.
struct RequestLog {
    Error refusal;                       // why the request could not begin; set before Transfer::refused
    std::atomic<std::uint64_t> said{0};  // the last reason; 0: none
};

// Gives the reason to the reporter thread (Bus::report_loop()). Does not wait: if other threads hold the lock, the next
// call gives the reason. `what`: text for the request.
void note_failure(ec_slave_config& config, RequestLog& log, const Error& error, const char* what);

// The state of a request that has one object of the library for reading and one for writing.
template <class Read, class Write>
[[nodiscard]] ec_request_state_t state_of(Transfer last, const Read& read, const Write& write) {
    switch (last) {
        case Transfer::read: return to_ec(read.state());
        case Transfer::write: return to_ec(write.state());
        case Transfer::refused: return EC_REQUEST_ERROR;
        default: return is_waiting(last) ? EC_REQUEST_BUSY : EC_REQUEST_UNUSED;
    }
}

// A request that is about to begin: activation and scans wait for it as for one that is under way.
class Beginning {
  public:
    explicit Beginning(ec_slave_config& config);
    ~Beginning();
    Beginning(const Beginning&) = delete;
    Beginning& operator=(const Beginning&) = delete;

  private:
    Bus& bus_;
};

// Whether the segment is being scanned, which ends transfers and gives numbers to the slaves, or this slave still goes
// through INIT.
[[nodiscard]] bool too_early(const ec_slave_config& config);

// Whether the slave is present and in INIT: it has no mailbox yet.
[[nodiscard]] bool before_preop(const ec_slave_config& config);

// The time after which a request that has not begun ends with an error; 0 ms: never.
[[nodiscard]] Time time_to_give_up(const ec_slave_config& config, std::uint32_t timeout_ms);
[[nodiscard]] Time time_now(const ec_slave_config& config);

// The number of the slave of a configuration; 0: the slave is not present.
[[nodiscard]] std::uint16_t slave_number(ec_slave_config& config);
// Submits a request to the slave of a configuration. False: the slave is not present, or the request was refused. The
// log then contains the reason.
[[nodiscard]] bool begin(ec_slave_config& config, SlaveRequest& request, RequestLog& log);

// The program sets the timeout of the request.
template <class Wish>
concept Timed = requires(Wish& wish) {
    wish.timeout_ms;
};

// The request could not begin.
template <class Wish>
void refuse(Wish& wish, Errc code) {
    wish.refusal = {.code = code};
    wish.last = Transfer::refused;
}

// Begins the requests of all configurations that wait, as far as their slaves are ready. For the owner; does not wait.
void begin_waiting(Bus& bus);
// Whether some request of the configurations, or a transfer of a call that waits, is under way.
[[nodiscard]] bool are_under_way(const Bus& bus);
// Notes that a request waits, so that begin_waiting() searches for it.
void note_waiting(ec_slave_config& config);

template <class Wish>
[[nodiscard]] bool has_to_wait(const Wish& wish) {
    return too_early(wish.config) || (Timed<Wish> && before_preop(wish.config));
}

// `what` is Transfer::read or Transfer::write.
template <class Wish>
void begin_or_later(Wish& wish, SlaveRequest& request, Transfer what) {
    const Beginning beginning(wish.config);
    if (!has_to_wait(wish)) {
        wish.last = begin(wish.config, request, wish) ? what : Transfer::refused;
        return;
    }
    if constexpr (Timed<Wish>) wish.give_up = time_to_give_up(wish.config, wish.timeout_ms);
    wish.last = what == Transfer::read ? Transfer::read_later : Transfer::write_later;
    note_waiting(wish.config);
}

// The timeout counts from the start of the request. If two threads try to begin the request, one of them succeeds.
template <class Wish, class Read, class Write>
void begin_if_due(Wish& wish, Read& read, Write& write) {
    Transfer later = wish.last;
    if (later != Transfer::read_later && later != Transfer::write_later) return;
    if (!wish.last.compare_exchange_strong(later, Transfer::beginning)) return;
    const bool reads = later == Transfer::read_later;
    SlaveRequest& request = reads ? static_cast<SlaveRequest&>(read) : static_cast<SlaveRequest&>(write);
    if constexpr (Timed<Wish>)
        if (wish.timeout_ms != 0) {
            request.timeout = wish.give_up - time_now(wish.config);
            if (request.timeout <= Duration{0}) {
                refuse(wish, Errc::timeout);
                return;
            }
        }
    const Beginning beginning(wish.config);
    if (has_to_wait(wish)) {
        wish.last = later;
        note_waiting(wish.config);
        return;
    }
    wish.last = !begin(wish.config, request, wish) ? Transfer::refused : reads ? Transfer::read : Transfer::write;
}

// The state of a request for the program. `describe` writes a text for the request, for the log.
template <class Wish, class Read, class Write, class Describe>
[[nodiscard]] ec_request_state_t shown_state(Wish& wish, const Read& read, const Write& write, Describe describe) {
    const Transfer last = wish.last;
    const ec_request_state_t state = state_of(last, read, write);
    if (state == EC_REQUEST_SUCCESS && wish.said != 0) wish.said = 0;
    if (state != EC_REQUEST_ERROR) return state;
    const Error& error = last == Transfer::read ? read.error() : last == Transfer::write ? write.error() : wish.refusal;
    note_failure(wish.config, wish, error, describe().data());
    return state;
}

}  // namespace margay::compat::ecrt

struct ec_sdo_request : margay::compat::ecrt::RequestLog {
    explicit ec_sdo_request(ec_slave_config& owner) : config(owner) {}
    ec_slave_config& config;
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete = false;
    std::uint32_t timeout_ms = 0;
    margay::Time give_up{};
    std::vector<std::byte> memory;
    std::size_t size = 0;  // of a write
    std::atomic<margay::compat::ecrt::Transfer> last{margay::compat::ecrt::Transfer::none};
    margay::SdoUpload upload;
    margay::SdoDownload download;
};

struct ec_soe_request : margay::compat::ecrt::RequestLog {
    explicit ec_soe_request(ec_slave_config& owner) : config(owner) {}
    ec_slave_config& config;
    std::uint8_t drive = 0;
    std::uint16_t idn = 0;
    std::uint32_t timeout_ms = 0;
    margay::Time give_up{};
    std::vector<std::byte> memory;
    std::size_t size = 0;
    std::atomic<margay::compat::ecrt::Transfer> last{margay::compat::ecrt::Transfer::none};
    margay::SoeRead read;
    margay::SoeWrite write;
};

struct ec_foe_request : margay::compat::ecrt::RequestLog {
    explicit ec_foe_request(ec_slave_config& owner) : config(owner) {}
    ec_slave_config& config;
    std::string file;
    std::uint32_t password = 0;
    std::uint32_t timeout_ms = 0;
    margay::Time give_up{};
    std::vector<std::byte> memory;
    std::size_t size = 0;
    std::atomic<margay::compat::ecrt::Transfer> last{margay::compat::ecrt::Transfer::none};
    margay::FoeRead read;
    margay::FoeWrite write;
};

struct ec_reg_request : margay::compat::ecrt::RequestLog {
    explicit ec_reg_request(ec_slave_config& owner) : config(owner) {}
    ec_slave_config& config;
    std::uint16_t address = 0;  // of the last call
    std::vector<std::byte> memory;
    std::atomic<margay::compat::ecrt::Transfer> last{margay::compat::ecrt::Transfer::none};
    margay::RegisterReadRequest read;
    margay::RegisterWriteRequest write;
    margay::DatagramRequest exchange;
};

namespace margay::compat::ecrt {

// The messages of the slave of a configuration. The handler that reads gets the next one.
struct VoeMail {
    std::vector<std::byte> memory = std::vector<std::byte>(4096);
    VoeInbox inbox{std::span<std::byte>(memory)};
};

}  // namespace margay::compat::ecrt

struct ec_voe_handler : margay::compat::ecrt::RequestLog {
    ec_voe_handler(ec_slave_config& owner, std::shared_ptr<margay::compat::ecrt::VoeMail> of_owner)
        : config(owner), mail(std::move(of_owner)) {}
    ec_slave_config& config;
    std::shared_ptr<margay::compat::ecrt::VoeMail> mail;  // of all handlers of the configuration
    margay::VoeHeader header;
    margay::VoeHeader received;
    std::vector<std::byte> memory;
    std::size_t size = 0;
    margay::compat::ecrt::Transfer last = margay::compat::ecrt::Transfer::none;
    bool waiting = false;  // for a message
    margay::Time give_up{};
    ec_request_state_t read_state = EC_REQUEST_UNUSED;
    margay::VoeSend send;
};
