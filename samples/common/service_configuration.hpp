// The configuration of the service margayd: the masters that it runs, described in /etc/margay/*.toml. margayd runs
// them, and `ethercat` finds them.
#pragma once

#include <margay/attach/server.hpp>
#include <margay/expected.hpp>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

inline constexpr const char* kConfigurationFolder = "/etc/margay";
inline constexpr const char* kSocketFolder = "/run/margay";

// A key of a master, of its tables `socket` and `gateway` (socket.mode), or of an element of `eoe` (eoe.name). The
// allowed content of a file, --help and the manual page are derived from this table.
struct ServiceKey {
    std::string_view name;
    std::string_view value;     // what the user writes
    std::string_view standard;  // the value without the key; empty: none
    std::string_view text;
};
[[nodiscard]] std::span<const ServiceKey> service_keys();

struct SocketConfiguration {
    std::string path{};  // empty: NAME.sock in the folder of the sockets
    std::string owner{};
    std::string group{};
    unsigned mode = 0660;
    bool read_only = false;
    unsigned clients = 8;
    bool operator==(const SocketConfiguration&) const = default;
};

// An interface of the kernel for one slave with EoE.
struct EoeInterface {
    std::optional<std::uint16_t> position{};  // in the ring, the first is 0
    std::optional<std::uint16_t> alias{};
    std::string name{};
    bool operator==(const EoeInterface&) const = default;
};

// One master. Two configurations are equal if a running master need not be restarted for a change from one to the
// other.
struct MasterConfiguration {
    std::string name{};
    std::string source{};
    unsigned number = 0;  // of `ethercat --master`, and in the names of EoE interfaces
    std::filesystem::path eni{};
    std::string eni_text{};  // the content of that file
    unsigned cycle_us = 0;   // 0: the value of the ENI, or 1000
    AlState state = AlState::op;
    AlState end_state = AlState::init;
    bool take_over = false;
    bool tolerate_missing = false;
    bool tolerate_other = false;
    bool tolerate_unexpected = false;
    int priority = 0;
    int cpu = -1;
    unsigned spin_us = 0;
    unsigned in_sync_us = 4;
    unsigned debug = 1;  // level of messages
    SocketConfiguration socket{};
    bool eoe = false;                       // an interface for each slave with EoE
    std::vector<EoeInterface> eoe_named{};  // or for these slaves only
    // The address at which it listens: "127.0.0.1:34980"; empty: no mailbox gateway.
    std::string gateway{};
    bool gateway_read_only = false;
    bool operator==(const MasterConfiguration&) const = default;
};

struct ServiceConfiguration {
    std::vector<MasterConfiguration> masters{};  // by number
    // One sentence for each error, with file and line. The masters are not usable if there is one.
    std::vector<std::string> errors{};
    // Findings with which the service starts nevertheless: remarks about ENI files, missing interfaces.
    std::vector<std::string> warnings{};
    bool unreadable = false;  // the folder or a file cannot be read: an error of the system, not of the content
};

// The checks in addition to the TOML files.
enum class ConfigurationCheck : std::uint8_t {
    files,  // no other checks, for programs that only search for masters
    whole,  // sources, ENI files, users and groups
};

// Reads all files *.toml of a folder, in the order of their names. `sockets`: the folder of sockets without a path.
[[nodiscard]] ServiceConfiguration read_service_configuration(const std::filesystem::path& folder,
                                                              ConfigurationCheck check,
                                                              const std::string& sockets = kSocketFolder);

// The socket of a master: that of the configuration, or NAME.sock in `folder`.
[[nodiscard]] std::string socket_path(const MasterConfiguration& master, const std::string& folder = kSocketFolder);

}  // namespace margay::samples
