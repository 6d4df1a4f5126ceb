// The arguments of a program: options, flags, positional arguments and commands, each bound to a variable. The value
// that a variable has before parsing is the default, and --help shows it.
//
//     Arguments arguments("blink", "Switches an output on and off.");
//     arguments.positional("SOURCE", source, "the segment");
//     arguments.option("--period", period_us, "cycle period in µs", {50, 1'000'000});
//     return arguments.run(argc, argv, [&] { return blink(source, period_us); });
//
// This header includes no library for arguments: CLI11 costs each file that includes it 12 s of processor time.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace margay::samples {

// The range of a number that an option accepts, both ends included.
struct Bounds {
    std::int64_t least = 0;
    std::int64_t most = 0;
};

// Parses a whole number, decimal ("010" is ten) or hexadecimal with 0x. Returns nothing when `text` is neither.
[[nodiscard]] std::optional<std::int64_t> parse_number(std::string_view text);

template <class T>
concept WholeNumber = std::integral<T> && !std::same_as<T, bool>;

class Arguments {
  public:
    enum class Presence : std::uint8_t { required, optional };

    Arguments(std::string name, const std::string& description);
    ~Arguments();
    Arguments(const Arguments&) = delete;
    Arguments& operator=(const Arguments&) = delete;

    // The variables must outlive run(). Names of options and flags begin with "--".
    void positional(const std::string& name, std::string& value, const std::string& text,
                    Presence presence = Presence::required);
    void option(const std::string& name, std::string& value, const std::string& text);
    // `needs` names another option that must be given together with this flag; empty: none.
    void flag(const std::string& name, bool& value, const std::string& text, const std::string& needs = {});

    // A positional argument that is a number is optional by default, see `presence`.
    template <WholeNumber T>
    void positional(const std::string& name, T& value, const std::string& text,
                    Presence presence = Presence::optional) {
        number(name, {limits<T>(), false, {}, presence}, text, [&value](std::int64_t n) { value = static_cast<T>(n); });
    }
    template <WholeNumber T>
    void positional(const std::string& name, std::optional<T>& value, const std::string& text) {
        number(name, {limits<T>(), false, {}}, text, [&value](std::int64_t n) { value = static_cast<T>(n); });
    }
    // A default outside `bounds` means "not given", and --help does not show it.
    template <WholeNumber T>
    void option(const std::string& name, T& value, const std::string& text, std::optional<Bounds> bounds = {}) {
        number(name, {bounds.value_or(limits<T>()), bounds.has_value(), static_cast<std::int64_t>(value)}, text,
               [&value](std::int64_t n) { value = static_cast<T>(n); });
    }
    // --help shows `shown` as the default in place of `value`.
    template <WholeNumber T>
    void option(const std::string& name, T& value, const std::string& text, Bounds bounds, std::int64_t shown) {
        number(name, {bounds, true, shown}, text, [&value](std::int64_t n) { value = static_cast<T>(n); });
    }
    // An option whose value is one word of a list.
    template <class T>
    void choice(const std::string& name, std::optional<T>& value, const std::string& text,
                std::vector<std::pair<std::string, T>> words) {
        std::vector<std::string> names;
        for (const auto& word : words) names.push_back(word.first);
        one_of(name, std::move(names), text, [&value, words](std::size_t n) { value = words[n].second; });
    }

    // A command with its own arguments. When a program has commands, one command must be given. `chosen` is called
    // when this command is given. The reference is valid as long as the program's Arguments object.
    Arguments& command(const std::string& name, const std::string& text, const std::function<void()>& chosen);

    // Text that is printed besides the usage hint when the program is called without any argument.
    void without_arguments(std::function<std::string()> text);

    // Parses the arguments, executes `body` by run_program() and returns the exit code. --help and --version print
    // their text and end with 0. Wrong arguments end with exit_code::kUsage.
    int run(int argc, char** argv, const std::function<int()>& body);

  private:
    struct Command;
    struct NumberRule {
        Bounds bounds;
        bool show_bounds = false;
        std::optional<std::int64_t> default_value{};
        Presence presence = Presence::optional;
    };

    explicit Arguments(std::unique_ptr<Command> command);
    template <class T>
    static constexpr Bounds limits() {
        const auto most = std::numeric_limits<T>::max();
        return {static_cast<std::int64_t>(std::numeric_limits<T>::min()),
                std::cmp_less(most, INT64_MAX) ? static_cast<std::int64_t>(most) : INT64_MAX};
    }
    void number(const std::string& name, const NumberRule& rule, const std::string& text,
                std::function<void(std::int64_t)> set);
    void one_of(const std::string& name, std::vector<std::string> words, const std::string& text,
                std::function<void(std::size_t)> set);
    [[nodiscard]] std::optional<int> parse(int argc, char** argv);

    std::unique_ptr<Command> command_;
    std::function<std::string()> without_arguments_;
};

}  // namespace margay::samples
