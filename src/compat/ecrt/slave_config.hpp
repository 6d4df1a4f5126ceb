// The configuration of a slave, as a program states it.
#pragma once

#include "compat/ecrt/pdos.hpp"

#include <margay/configuration.hpp>
#include <margay/detail/writable_ring.hpp>
#include <margay/emergency.hpp>
#include <margay/eoe_parameters.hpp>
#include <margay/expected.hpp>
#include <margay/slave.hpp>
#include <margay/startup.hpp>

#include <ecrt.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <vector>

namespace margay::compat::ecrt {

class Bus;

// A download at each start-up of the slave.
struct StartupWrite {
    bool parameter = false;  // an IDN, not an object
    bool complete = false;
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;  // or the number of the drive
    ec_al_state_t state = EC_AL_STATE_PREOP;
    std::vector<std::byte> data;
};

// The slave is in PREOP after the scan, and goes through INIT once more before it is started: until then no transfer
// begins, because the transition to INIT would end it.
enum class StartUp : std::uint8_t { before_init, in_init, over };

struct DcWish {
    bool set = false;
    std::uint16_t assign_activate = 0;
    std::uint32_t sync0_cycle = 0;
    std::int32_t sync0_shift = 0;
    std::uint32_t sync1_cycle = 0;
};

// The parts of a configuration that are passed to the library. The lists stay valid as long as the master is active.
struct SlavePlan {
    std::vector<std::vector<Pdo>> pdos;
    std::vector<SmPdos> sms;
    std::vector<StartupCommand> startup;
    SlaveSetup setup;
    SlaveConfiguration configuration;
};

}  // namespace margay::compat::ecrt

struct ec_sdo_request;
struct ec_soe_request;
struct ec_foe_request;
struct ec_voe_handler;
struct ec_reg_request;

struct ec_slave_config {
    ec_slave_config(margay::compat::ecrt::Bus& owner, std::uint16_t its_alias, std::uint16_t its_position,
                    std::uint32_t its_vendor, std::uint32_t its_product);
    ~ec_slave_config();
    ec_slave_config(const ec_slave_config&) = delete;
    ec_slave_config& operator=(const ec_slave_config&) = delete;

    margay::compat::ecrt::Bus& bus;
    const std::uint16_t alias;
    const std::uint16_t position;
    const std::uint32_t vendor;
    const std::uint32_t product;

    std::mutex changing;  // of a Change
    margay::compat::ecrt::SyncWishes syncs;
    bool asked = false;  // the slave was read for the settings that the program has not made
    // Why not all PDOs of the slave are known, for the message of the call that has asked; nullptr: they are known.
    const char* not_known = nullptr;
    bool answered = true;  // with `asked`
    std::vector<margay::compat::ecrt::StartupWrite> startup;
    margay::compat::ecrt::DcWish dc;
    margay::SlaveTimes times;
    std::uint16_t watchdog_intervals = 0;
    margay::EoeIp ip;
    margay::Duration wait_before_safeop{0};
    bool overlapping = false;  // its inputs may overlap outputs in the logical addresses
    std::vector<margay::Emergency> emergency_memory;
    margay::WritableRing<margay::Emergency> emergencies;  // without memory: they are not kept
    std::uint32_t emergencies_cleared = 0;                // dropped before the last clear

    // Results, set by the owner of the context. `state`: bit 0 online, bit 1 operational, bits 4 to 7 AL state.
    std::atomic<std::uint32_t> state{0};
    std::atomic<std::uint16_t> number{0};
    margay::compat::ecrt::SlavePlan plan;
    const margay::ExpectedSlave* expected = nullptr;
    std::uint8_t group = 0;
    std::atomic<margay::compat::ecrt::StartUp> start_up{margay::compat::ecrt::StartUp::over};
    bool late = false;  // the frames were laid out from its lists, before its slave was started

    std::vector<std::unique_ptr<ec_sdo_request>> sdo_requests;
    std::vector<std::unique_ptr<ec_soe_request>> soe_requests;
    std::vector<std::unique_ptr<ec_foe_request>> foe_requests;
    std::vector<std::unique_ptr<ec_voe_handler>> voe_handlers;
    std::vector<std::unique_ptr<ec_reg_request>> reg_requests;
};

namespace margay::compat::ecrt {

// Whether the master is active, so that the configuration cannot be changed any more; then a message is printed.
[[nodiscard]] bool refuse_active(const ec_slave_config& config);

// A call that changes a configuration, also while it waits for the slave. The calls for one configuration follow each
// other. Activation waits for their end, and a call that begins during activation is refused afterwards.
class Change {
  public:
    explicit Change(ec_slave_config& config);
    // Whether the master is active; then a message was printed.
    [[nodiscard]] bool refused() const { return refused_; }

  private:
    std::shared_lock<std::shared_mutex> before_activation_;
    std::unique_lock<std::mutex> alone_;
    bool refused_ = false;
};

}  // namespace margay::compat::ecrt
