// One call of `ethercat`: its arguments, its masters, the selected slaves, and its output.
#pragma once

#include "ethercat/parse.hpp"
#include "ethercat/session.hpp"
#include "ethercat/values.hpp"

#include <nlohmann/json_fwd.hpp>

#include <chrono>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace margay::ethercat {

struct Master {
    unsigned index = 0;
    std::unique_ptr<Session> session{};
};

// The output of a command for one master. With --json `json` is printed, otherwise `text`.
class Output {
    std::unique_ptr<nlohmann::ordered_json> json_;

  public:
    Output();
    ~Output();
    Output(const Output&) = delete;
    Output& operator=(const Output&) = delete;

    std::string text{};
    nlohmann::ordered_json& json;
};

// A selected slave, and the master that it belongs to.
struct SelectedSlave {
    Master* master = nullptr;
    SlaveFacts slave{};
    [[nodiscard]] Session& session() const { return *master->session; }
    [[nodiscard]] std::uint16_t position() const { return slave.position; }
};

class Call {
  public:
    Call(const Arguments& arguments, std::vector<Master> masters)
        : arguments_(arguments), masters_(std::move(masters)) {}

    [[nodiscard]] const Arguments& arguments() const { return arguments_; }
    [[nodiscard]] const std::vector<std::string>& words() const { return arguments_.words; }
    [[nodiscard]] bool has(std::string_view option) const { return arguments_.has(option); }
    [[nodiscard]] std::string value(std::string_view option) const { return arguments_.value(option); }
    [[nodiscard]] bool json() const { return has("json"); }
    [[nodiscard]] std::vector<Master>& masters() { return masters_; }

    // Reports a problem on standard error and returns its exit code. With --json the output is {"error": "…"} if there
    // is none yet.
    int fail(const Problem& problem) const;
    // Unless the user wants no warnings (--quiet).
    void warn(const std::string& text) const;

    // Calls `work` for each master and prints its output; {"masters": [{"master": 0, …}]} with --json. A problem of one
    // master is its key "error" then, and does not stop the others. Returns the greatest exit code.
    int each_master(const std::function<Answer<>(Master& master, Output& output)>& work);
    // Calls `work` for each of the slaves. A failure of one slave does not stop the work for the other slaves: the
    // function returns the first problem, and reports the other problems on standard error. An error of the system, for
    // example the end of the application, stops the work. With --json a slave that failed is in the list "slaves" of
    // `output` with its position and "error".
    static Answer<> each_slave(std::span<const SlaveFacts> slaves, Output& output,
                               const std::function<Answer<>(const SlaveFacts& slave)>& work);
    // Prints the result of a command for one slave.
    int print(const Output& output) const;
    // For a command with --output-file: writes `content` to this file, or to standard output. With --json the document
    // is on standard output, and `content` in the file only.
    int print(const Output& output, std::span<const std::byte> content) const;

    // The selected slaves of a master. A problem if --alias or --position selects no slave.
    [[nodiscard]] Answer<std::vector<SlaveFacts>> selected(Master& master) const;
    // The same for a command that changes slaves. An empty segment is a problem too.
    [[nodiscard]] Answer<std::vector<SlaveFacts>> some_selected(Master& master) const;
    // The one slave of a command that needs one.
    [[nodiscard]] Answer<SelectedSlave> one_slave();
    // The number in an argument or an option, for example number("INDEX", word, 0xFFFF).
    [[nodiscard]] static Answer<std::uint64_t> number(std::string_view what, std::string_view text, std::uint64_t most);
    // The number of an option; `standard` if the option is not given.
    [[nodiscard]] Answer<std::uint64_t> option_number(std::string_view option, std::uint64_t standard,
                                                      std::uint64_t most) const;
    [[nodiscard]] Answer<std::optional<Numbers>> option_numbers(std::string_view option) const;

    // Executes `once` one time, or with --watch again and again: with `pause` between, up to --count, until a signal.
    int repeat(const std::function<int()>& once);

  private:
    const Arguments& arguments_;
    std::vector<Master> masters_;
    mutable bool printed_ = false;  // output was printed already; with --json the output is one document
};

// Reports a problem on standard error, with --json also as {"error": "…"} on standard output. Returns its exit code.
int fail(const Arguments& arguments, const Problem& problem);

// {"master": 0, "position": 3}
[[nodiscard]] nlohmann::ordered_json place_json(const SelectedSlave& slave);
// "=== Master 0, Slave 3 ===" and a line end.
[[nodiscard]] std::string slave_heading(const Master& master, const SlaveFacts& slave);
// The name of an entry of a PDO; "Gap" for a gap.
[[nodiscard]] std::string title_of(const PdoEntryFacts& entry);
// The type that --type names; nullptr: the option is not given.
[[nodiscard]] Answer<const DataType*> named_type(const Call& call);
// The octets of a value on the command line; "-" reads standard input.
[[nodiscard]] Answer<Octets> value_argument(const DataType& type, const std::string& word);
// The octets of a file, or of standard input ("-").
[[nodiscard]] Answer<Octets> read_octets(const std::string& path);
// Writes octets to the file, or to standard output ("-").
[[nodiscard]] Answer<> write_octets(const std::string& path, std::span<const std::byte> octets);

}  // namespace margay::ethercat
