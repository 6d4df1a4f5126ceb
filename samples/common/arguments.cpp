// The only file that includes CLI11.
#include "common/arguments.hpp"

#include "common/program.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <sstream>

namespace margay::samples {

struct Arguments::Command {
    std::unique_ptr<CLI::App> owned;  // only for a program; App objects of commands belong to the App of the program
    CLI::App* app = nullptr;
    std::vector<std::unique_ptr<Arguments>> commands{};
};

namespace {

// Describes what is wrong with the arguments. CLI11 reports a missing argument before an unknown argument. The unknown
// argument is reported here, because it is the more useful message.
std::string complaint(const CLI::App& app, const CLI::ParseError& error) {
    const auto unknown = app.remaining(true);
    for (const auto& word : unknown)
        if (word.starts_with('-') && word != "--") return fmt::format("there is no option '{}'", word);
    for (const auto& word : unknown)
        if (word != "--") return fmt::format("unexpected argument or unknown command '{}'", word);
    if (dynamic_cast<const CLI::RequiredError*>(&error) == nullptr || !app.get_subcommands().empty())
        return error.what();
    std::vector<std::string> commands;
    for (const auto* command : app.get_subcommands([](const CLI::App*) { return true; }))
        commands.push_back(command->get_name());
    const std::string what = error.what();
    return what.starts_with("A subcommand") ? fmt::format("the command is missing: {}", fmt::join(commands, ", "))
                                            : what;
}

}  // namespace

std::optional<std::int64_t> parse_number(std::string_view text) {
    const bool negative = text.starts_with('-');
    if (negative) text.remove_prefix(1);
    const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
    if (hexadecimal) text.remove_prefix(2);
    if (text.starts_with('-')) return std::nullopt;
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, hexadecimal ? 16 : 10);
    if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return negative ? -value : value;
}

Arguments::Arguments(std::string name, const std::string& description) : command_(std::make_unique<Command>()) {
    command_->owned = std::make_unique<CLI::App>(description, std::move(name));
    command_->app = command_->owned.get();
    command_->app->footer(std::string(kExitCodeText));
    command_->app->set_help_flag("-h,--help", "print this help and exit");
    command_->app->set_version_flag("--version", command_->app->get_name() + " (Margay) " MARGAY_VERSION_TEXT,
                                    "print the version and exit");
}

Arguments::Arguments(std::unique_ptr<Command> command) : command_(std::move(command)) {}

Arguments::~Arguments() = default;

void Arguments::positional(const std::string& name, std::string& value, const std::string& text, Presence presence) {
    auto* added = command_->app->add_option(
        name, value, presence == Presence::optional && !value.empty() ? fmt::format("{} [{}]", text, value) : text);
    if (presence == Presence::required) added->required();
}

void Arguments::option(const std::string& name, std::string& value, const std::string& text) {
    command_->app->add_option(name, value, value.empty() ? text : fmt::format("{} [{}]", text, value));
}

void Arguments::flag(const std::string& name, bool& value, const std::string& text, const std::string& needs) {
    auto* added = command_->app->add_flag(name, value, text);
    if (!needs.empty()) added->needs(command_->app->get_option(needs));
}

void Arguments::number(const std::string& name, const NumberRule& rule, const std::string& text,
                       std::function<void(std::int64_t)> set) {
    const auto& [least, most] = rule.bounds;
    auto shown = text;
    if (rule.show_bounds) shown += fmt::format(" ({} to {})", least, most);
    if (rule.default_value && *rule.default_value >= least && *rule.default_value <= most)
        shown += fmt::format(" [{}]", *rule.default_value);
    const auto take = [name, rule, set = std::move(set)](const std::string& word) {
        const auto value = parse_number(word);
        if (!value)
            throw CLI::ValidationError(name,
                                       fmt::format("'{}' is no whole number (decimal, or 0x and hexadecimal)", word));
        if (*value < rule.bounds.least || *value > rule.bounds.most)
            throw CLI::ValidationError(
                name, fmt::format("{} is not from {} to {}", word, rule.bounds.least, rule.bounds.most));
        set(*value);
    };
    auto* added = command_->app->add_option_function<std::string>(name, take, shown)->type_name("NUMBER");
    if (rule.presence == Presence::required) added->required();
}

void Arguments::one_of(const std::string& name, std::vector<std::string> words, const std::string& text,
                       std::function<void(std::size_t)> set) {
    const auto list = fmt::format("{}", fmt::join(words, ", "));
    const auto take = [name, list, words = std::move(words), set = std::move(set)](const std::string& word) {
        const auto found = std::find(words.begin(), words.end(), word);
        if (found == words.end()) throw CLI::ValidationError(name, fmt::format("'{}' is none of {}", word, list));
        set(static_cast<std::size_t>(found - words.begin()));
    };
    command_->app->add_option_function<std::string>(name, take, text)->type_name("WORD");
}

Arguments& Arguments::command(const std::string& name, const std::string& text, const std::function<void()>& chosen) {
    auto added = std::make_unique<Command>();
    added->app = command_->app->add_subcommand(name, text);
    added->app->callback(chosen);
    command_->app->require_subcommand(1);
    command_->commands.push_back(std::unique_ptr<Arguments>(new Arguments(std::move(added))));
    return *command_->commands.back();
}

void Arguments::without_arguments(std::function<std::string()> text) { without_arguments_ = std::move(text); }

std::optional<int> Arguments::parse(int argc, char** argv) {
    auto& app = *command_->app;
    const auto hint = fmt::format("; see {} --help", app.get_name());
    if (argc <= 1 && without_arguments_) {
        (void)fail("arguments are missing" + hint);
        (void)std::fputs(without_arguments_().c_str(), stderr);
        return exit_code::kUsage;
    }
    // The user may request help for a command before the positional arguments in front of the command are known.
    const bool help = argc == 3 && (std::string_view(argv[2]) == "--help" || std::string_view(argv[2]) == "-h");
    for (const auto& command : command_->commands) {
        if (!help || command->command_->app->get_name() != argv[1]) continue;
        write_out(command->command_->app->help(app.get_name()));
        return exit_code::kWell;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForVersion& version) {
        print_out("{}\n", version.what());
        return exit_code::kWell;
    } catch (const CLI::Success& asked) {
        std::ostringstream text;
        (void)app.exit(asked, text, text);
        write_out(text.str());
        return exit_code::kWell;
    } catch (const CLI::ParseError& error) {
        return fail(complaint(app, error) + hint, exit_code::kUsage);
    }
    return std::nullopt;
}

int Arguments::run(int argc, char** argv, const std::function<int()>& body) {
    return run_program(command_->app->get_name(), [&] {
        const auto ended = parse(argc, argv);
        return ended ? *ended : body();
    });
}

}  // namespace margay::samples
