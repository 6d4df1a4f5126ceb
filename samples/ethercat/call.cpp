#include "ethercat/call.hpp"

#include "common/eeprom.hpp"
#include "common/json_text.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace margay::ethercat {
namespace {

constexpr std::size_t kMostOctets = std::size_t{64} << 20;

struct CloseStream {
    void operator()(std::FILE* file) const { (void)std::fclose(file); }
};

}  // namespace

Output::Output() : json_(std::make_unique<nlohmann::ordered_json>(nlohmann::ordered_json::object())), json(*json_) {}
Output::~Output() = default;

int fail(const Arguments& arguments, const Problem& problem) {
    if (arguments.has("json")) samples::write_out(samples::json_text({{"error", problem.text}}));
    return samples::fail(problem.text, problem.code);
}

int Call::fail(const Problem& problem) const {
    if (printed_) return samples::fail(problem.text, problem.code);
    printed_ = true;
    return ethercat::fail(arguments_, problem);
}

void Call::warn(const std::string& text) const {
    if (!has("quiet")) samples::warn("warning: " + text);
}

int Call::each_master(const std::function<Answer<>(Master& master, Output& output)>& work) {
    int code = samples::exit_code::kWell;
    auto all = nlohmann::ordered_json::array();
    for (Master& master : masters_) {
        Output output;
        output.json["master"] = master.index;
        const auto done = work(master, output);
        if (!done) {
            code = std::max(code, samples::fail(done.problem().text, done.problem().code));
            output.json["error"] = done.problem().text;
        }
        if (json())
            all.push_back(std::move(output.json));
        else if (!output.text.empty())
            samples::write_out((masters_.size() > 1 ? fmt::format("Master{}\n", master.index) : "") + output.text);
    }
    if (json()) samples::write_out(samples::json_text({{"masters", all}}));
    printed_ = true;
    return code;
}

Answer<> Call::each_slave(std::span<const SlaveFacts> slaves, Output& output,
                          const std::function<Answer<>(const SlaveFacts& slave)>& work) {
    Answer<> first;
    for (const SlaveFacts& slave : slaves) {
        const auto done = work(slave);
        if (done) continue;
        output.json["slaves"].push_back({{"position", slave.position}, {"error", done.problem().text}});
        if (done.problem().code == samples::exit_code::kSystem) {
            if (!first) samples::fail(first.problem().text);
            return done;
        }
        if (!first)
            samples::fail(done.problem().text);
        else
            first = done;
    }
    return first;
}

int Call::print(const Output& output) const {
    samples::write_out(json() ? samples::json_text(output.json) : output.text);
    printed_ = true;
    return samples::exit_code::kWell;
}

int Call::print(const Output& output, std::span<const std::byte> content) const {
    const auto path = has("output-file") ? value("output-file") : std::string("-");
    if (!json() || path != "-")
        if (const auto written = write_octets(path, content); !written) return fail(written.problem());
    return json() ? print(output) : samples::exit_code::kWell;
}

Answer<std::optional<Numbers>> Call::option_numbers(std::string_view option) const {
    if (!has(option)) return std::optional<Numbers>();
    const auto text = value(option);
    const auto numbers = Numbers::parse(text);
    if (!numbers)
        return Problem{fmt::format("--{}: '{}' is no number, list or range of numbers (1,4,7-9)", option, text),
                       samples::exit_code::kUsage};
    return std::optional(*numbers);
}

Answer<std::vector<SlaveFacts>> Call::selected(Master& master) const {
    const auto aliases = option_numbers("alias");
    if (!aliases) return aliases.problem();
    const auto positions = option_numbers("position");
    if (!positions) return positions.problem();
    const auto slaves = master.session->slaves();
    if (!slaves) return slaves.problem();
    auto found = select(*slaves, *aliases, *positions);
    if (found.empty() && (*aliases || *positions))
        return Problem{fmt::format("no slave of master {} is selected{}{}", master.index,
                                   *aliases ? fmt::format(" by --alias {}", value("alias")) : "",
                                   *positions ? fmt::format(" by --position {}", value("position")) : "")};
    if (const auto none = unmatched(*slaves, *aliases, *positions))
        return Problem{fmt::format("no slave of master {} is selected by {}", master.index, *none)};
    return found;
}

Answer<std::vector<SlaveFacts>> Call::some_selected(Master& master) const {
    auto found = selected(master);
    if (found && found->empty())
        return Problem{fmt::format("{}: master {} has no slave", arguments_.command->name, master.index)};
    return found;
}

Answer<SelectedSlave> Call::one_slave() {
    if (masters_.size() != 1)
        return Problem{fmt::format("{} works on one master, and {} are selected: use --master",
                                   arguments_.command->name, masters_.size()),
                       samples::exit_code::kUsage};
    const auto found = selected(masters_[0]);
    if (!found) return found.problem();
    if (found->size() == 1) return SelectedSlave{&masters_[0], (*found)[0]};
    return Problem{fmt::format("{} works on one slave, and {} are selected: use --position or --alias",
                               arguments_.command->name, found->size()),
                   samples::exit_code::kUsage};
}

Answer<std::uint64_t> Call::number(std::string_view what, std::string_view text, std::uint64_t most) {
    const auto value = parse_unsigned(text, most);
    if (!value)
        return Problem{fmt::format("{}: '{}' is no whole number from 0 to {}", what, text, most),
                       samples::exit_code::kUsage};
    return *value;
}

Answer<std::uint64_t> Call::option_number(std::string_view option, std::uint64_t standard, std::uint64_t most) const {
    if (!has(option)) return standard;
    return number(fmt::format("--{}", option), value(option), most);
}

int Call::repeat(const std::function<int()>& once) {
    const auto interval = option_number("interval", 1000, 3'600'000);
    if (!interval) return fail(interval.problem());
    const auto count = option_number("count", has("watch") ? UINT64_MAX : 1, UINT64_MAX);
    if (!count) return fail(count.problem());
    if (*count > 1) samples::stop_at_signals();
    int code = samples::exit_code::kWell;
    for (std::uint64_t n = 0; n < *count && !samples::stop_asked(); ++n) {
        if (n != 0)
            for (Master& master : masters_) master.session->pause(std::chrono::milliseconds(*interval));
        if (samples::stop_asked()) break;
        code = once();
        samples::flush_out();
        if (code != samples::exit_code::kWell) break;
    }
    return code;
}

nlohmann::ordered_json place_json(const SelectedSlave& slave) {
    return {{"master", slave.master->index}, {"position", slave.position()}};
}

std::string slave_heading(const Master& master, const SlaveFacts& slave) {
    return fmt::format("=== Master {}, Slave {} ===\n", master.index, slave.position);
}

std::string title_of(const PdoEntryFacts& entry) { return entry.index == 0 && entry.name.empty() ? "Gap" : entry.name; }

Answer<const DataType*> named_type(const Call& call) {
    if (!call.has("type")) return static_cast<const DataType*>(nullptr);
    const auto* type = type_by_name(call.value("type"));
    if (type == nullptr)
        return Problem{fmt::format("there is no data type '{}'; see ethercat {} --help", call.value("type"),
                                   call.arguments().command->name),
                       samples::exit_code::kUsage};
    return type;
}

Answer<Octets> value_argument(const DataType& type, const std::string& word) {
    if (word != "-") return parse_value(type, word);
    auto octets = read_octets("-");
    using Kind = DataType::Kind;
    if (!octets || type.kind == Kind::text || type.kind == Kind::octets || type.kind == Kind::unicode) return octets;
    std::string text;
    for (const std::byte b : *octets) text += static_cast<char>(b);
    constexpr std::string_view kBlank = " \t\r\n";
    const auto first = text.find_first_not_of(kBlank);
    if (first == std::string::npos) return parse_value(type, "");
    return parse_value(type, std::string_view(text).substr(first, text.find_last_not_of(kBlank) - first + 1));
}

Answer<Octets> read_octets(const std::string& path) {
    const std::unique_ptr<std::FILE, CloseStream> opened(path == "-" ? nullptr : std::fopen(path.c_str(), "rb"));
    std::FILE* file = path == "-" ? stdin : opened.get();
    const auto failed = [&] {
        return Problem{
            fmt::format("{}: cannot be read: {}", path == "-" ? "standard input" : path, std::strerror(errno)),
            samples::exit_code::kSystem};
    };
    if (file == nullptr) return failed();
    Octets out;
    std::array<std::byte, 4096> block{};
    while (const auto n = std::fread(block.data(), 1, block.size(), file)) {
        if (out.size() + n > kMostOctets)  // a device like /dev/zero has no end
            return Problem{
                fmt::format("{}: has more than {} octets", path == "-" ? "standard input" : path, kMostOctets),
                samples::exit_code::kSystem};
        out.insert(out.end(), block.begin(), block.begin() + static_cast<std::ptrdiff_t>(n));
    }
    if (std::ferror(file) != 0) return failed();
    return out;
}

Answer<> write_octets(const std::string& path, std::span<const std::byte> octets) {
    const auto error = samples::save_image(path, samples::ImageFormat::binary, octets);
    if (!error.empty()) return Problem{error, samples::exit_code::kSystem};
    return {};
}

}  // namespace margay::ethercat
