// One master of the service: the thread that owns its context, brings the segment up, runs the cycle and keeps the
// slaves in their state, until it is asked to end.
#pragma once

#include "common/cycle_pace.hpp"
#include "common/cycle_plan.hpp"
#include "common/service_configuration.hpp"
#include "common/source.hpp"
#include "margayd/companion.hpp"

#include <margay/attach/server.hpp>
#include <margay/gateway/mailbox_gateway.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/master_clock.hpp>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace margay::service {

class Master {
  public:
    // `socket`: the path of the socket that it serves.
    Master(samples::MasterConfiguration configuration, std::string socket);
    // Brings the slaves to the end state and ends the thread.
    ~Master();
    Master(const Master&) = delete;
    Master& operator=(const Master&) = delete;

    // Starts the thread, which opens the source and the socket, and sends nothing yet. Returns why it cannot; empty:
    // the socket is served.
    [[nodiscard]] std::string open();
    // Starts the work on the segment.
    void begin();
    // Asks the thread to end, and does not wait for it.
    void stop();

    [[nodiscard]] const samples::MasterConfiguration& configuration() const { return configuration_; }
    [[nodiscard]] const std::string& socket() const { return socket_; }
    // For the thread that has created the object: the level of the configuration has changed.
    void set_debug_level(unsigned level);
    // One sentence. From any thread.
    [[nodiscard]] std::string status() const;
    // Whether the thread has ended by itself.
    [[nodiscard]] bool failed() const { return failed_; }

  private:
    void run(std::promise<std::string>& opened);
    [[nodiscard]] std::string open_here();
    [[nodiscard]] std::string open_gateway();
    void work();

    // Waits until slaves answer and may be scanned. False: it is asked to end.
    bool await_segment();
    // The reason why the segment cannot be scanned now; empty: it can be scanned.
    [[nodiscard]] std::string obstacle();
    // Scans and maps. False: the segment cannot be used now.
    bool bring_up();
    void set_clocks();
    // A state to which a client has set a slave.
    struct KeptTarget {
        std::uint16_t number;
        std::uint16_t ring_position;
        std::uint16_t alias;
        Identity identity;
        AlState target;
    };
    void keep_targets();
    enum class Exchange : bool { no, yes };  // of process data: in SAFEOP and OP
    void restore_targets(Exchange exchange);
    [[nodiscard]] const Slave* find_kept(const KeptTarget& kept) const;
    void map_groups();
    [[nodiscard]] std::string eoe_name(const Slave& slave) const;
    void open_eoe();
    void open_late_eoe();
    void close_eoe();
    // Exchanges process data until the thread is asked to end, or the segment must be scanned again.
    void cycle();
    void look_around(std::uint64_t overruns, bool settles);
    void look_at_clocks();
    [[nodiscard]] bool is_to_be_scanned();
    [[nodiscard]] bool has_strangers() const;
    // Whether slaves that respond have no place in the image until the image is laid out again.
    [[nodiscard]] bool lacks_places(const Error& wrong) const;
    void end_supervision();
    void leave();
    [[nodiscard]] std::filesystem::path left_file() const;
    void note_left_slaves() const;
    void read_left_slaves();
    // Polls for this time, or until the thread is asked to end.
    void pause(Duration time);

    samples::MasterConfiguration configuration_;
    std::string socket_;
    std::atomic<unsigned> debug_level_;  // of the configuration, or what a client has set since
    std::optional<files::EniConfiguration> eni_{};
    samples::CyclePlan plan_{};

    std::unique_ptr<samples::Source> source_{};
    std::unique_ptr<HostContext> ctx_{};
    std::unique_ptr<Companion> companion_{};
    std::unique_ptr<AttachServer> attach_{};  // these two end before the context
    std::unique_ptr<MailboxGateway> gateway_{};
    std::vector<std::byte> image_{};
    std::optional<samples::CyclePace> pace_{};
    std::vector<bool> has_eoe_line_{};  // by slave number - 1: its interface was opened, or refused
    SuperviseRequest supervise_{};
    std::optional<ClockSettings> late_clocks_{};  // of clocks that could not be measured before the cycle
    ClockRequest measure_clocks_{};
    bool is_measuring_ = false;  // measure_clocks_ was submitted, and its result is not used yet
    bool is_ours_ = false;       // this master has brought the slaves in SAFEOP or OP to their states
    bool was_left_in_safeop_ = false;
    bool is_left_well_ = false;  // at the end: all slaves that this master has found are in the end state
    bool brought_up_ = false;    // there are slaves that this master has configured
    using Clock = std::chrono::steady_clock;
    Clock::time_point next_measurement_{};  // of late_clocks_: not before
    // Since when lacks_places() is true, or false; looked at once a second.
    std::optional<Clock::time_point> lacks_since_{};
    std::optional<Clock::time_point> right_since_{};
    std::optional<Clock::time_point> scanned_for_places_{};  // the last scan for this reason, unless it has helped
    Duration places_pause_{};                                // before the next one
    std::string why_scanned_{};
    std::vector<KeptTarget> kept_targets_{};  // over a scan, and of slaves that the last one has not found

    std::atomic<bool> begun_{false};
    std::atomic<bool> stopping_{false};
    std::atomic<bool> failed_{false};
    std::thread thread_{};
};

}  // namespace margay::service
