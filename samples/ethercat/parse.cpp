#include "ethercat/parse.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::ethercat {
namespace {

Problem usage(std::string text, const Command* command = nullptr) {
    const auto where = command == nullptr ? std::string() : fmt::format(" {}", command->name);
    return {fmt::format("{}; see ethercat{} --help", text, where), samples::exit_code::kUsage};
}

bool is_number(std::string_view word) {
    return word.size() > 1 && (word[1] == '.' || (word[1] >= '0' && word[1] <= '9'));
}

// The element whose name is `name`, or the only one whose name begins with it.
template <class List>
auto by_name(const List& list, std::string_view name) -> decltype(&*list.begin()) {
    decltype(&*list.begin()) found = nullptr;
    bool ambiguous = false;
    for (const auto& one : list) {
        if (one.name == name) return &one;
        if (!one.name.starts_with(name)) continue;
        ambiguous |= found != nullptr;
        found = &one;
    }
    return ambiguous || name.empty() ? nullptr : found;
}

class Parser {
  public:
    explicit Parser(const std::vector<std::string>& words) : words_(words) {}

    Answer<Arguments> run() {
        while (at_ < words_.size()) {
            if (auto problem = take(words_[at_++])) return *problem;
        }
        for (const auto& name : {"help", "version", "man", "completion"})
            if (out_.has(name) && (out_.command != nullptr || positional_.empty())) return std::move(out_);
        if (positional_.empty() && out_.command == nullptr) {
            std::string all;
            for (const auto& command : commands()) all += fmt::format("{}{}", all.empty() ? "" : ", ", command.name);
            return usage("the command is missing: " + all);
        }
        std::string several;
        for (const auto& command : commands())
            if (out_.command == nullptr && command.name.starts_with(positional_.front()))
                several += fmt::format("{}{}", several.empty() ? "" : ", ", command.name);
        if (!several.empty()) return usage(fmt::format("'{}' may be {}", positional_.front(), several));
        if (out_.command == nullptr)
            return usage(fmt::format("unexpected argument or unknown command '{}'", positional_.front()));
        if (auto problem = check()) return *problem;
        return std::move(out_);
    }

  private:
    std::optional<Problem> take(const std::string& word) {
        if (only_words_ || word.size() < 2 || word[0] != '-' || is_number(word)) {
            take_positional(word);
            return std::nullopt;
        }
        if (word == "--") {
            only_words_ = true;
            return std::nullopt;
        }
        return word[1] == '-' ? take_long(word) : take_letters(word);
    }

    void take_positional(const std::string& word) {
        if (out_.command == nullptr && positional_.empty()) out_.command = by_name(commands(), word);
        if (out_.command == nullptr)
            positional_.push_back(word);
        else if (!command_seen_)
            command_seen_ = true;
        else
            out_.words.push_back(word);
    }

    std::optional<Problem> take_long(const std::string& word) {
        const auto equals = word.find('=');
        const auto* option = by_name(options(), std::string_view(word).substr(2, equals - 2));
        if (option == nullptr) return no_option(word.substr(0, equals));
        if (equals == std::string::npos) return add(*option, std::nullopt);
        if (option->value.empty()) return usage(fmt::format("--{} takes no value", option->name), out_.command);
        return add(*option, word.substr(equals + 1));
    }

    std::optional<Problem> take_letters(const std::string& word) {
        for (std::size_t n = 1; n < word.size(); ++n) {
            const auto all = options();
            const auto option = std::ranges::find(all, word[n], &Option::letter);
            if (option == all.end()) return no_option(fmt::format("-{}", word[n]));
            const bool last = option->value.empty() || n + 1 == word.size();
            auto problem = add(*option, last ? std::nullopt : std::optional(word.substr(n + 1)));
            if (problem || !option->value.empty()) return problem;
        }
        return std::nullopt;
    }

    // Errors of options are reported before all other errors, because after an unknown option the meaning of the other
    // words is uncertain.
    std::optional<Problem> no_option(std::string_view word) {
        return usage(fmt::format("there is no option '{}'", word), out_.command);
    }

    std::optional<Problem> add(const Option& option, std::optional<std::string> value) {
        if (!option.value.empty() && !value) {
            if (at_ == words_.size())
                return usage(fmt::format("--{} needs a value: {}", option.name, option.value), out_.command);
            value = words_[at_++];
        }
        out_.options.emplace_back(option.name, value.value_or(""));
        return std::nullopt;
    }

    [[nodiscard]] std::optional<Problem> check() const {
        const Command& command = *out_.command;
        for (const auto& [name, value] : out_.options) {
            if (!command.has_option(*find_option(name)))
                return usage(fmt::format("{} has no option --{}", command.name, name), &command);
        }
        if (out_.words.size() > command.most)
            return usage(fmt::format("unexpected argument '{}'", out_.words[command.most]), &command);
        if (out_.words.size() >= command.least) return std::nullopt;
        std::string forms;
        for (const auto form : command.forms)
            forms += fmt::format("{}{} {}", forms.empty() ? "" : " or ", command.name, form);
        return usage("arguments are missing: " + forms, &command);
    }

    const std::vector<std::string>& words_;
    std::size_t at_ = 0;
    bool only_words_ = false;
    bool command_seen_ = false;
    std::vector<std::string> positional_{};
    Arguments out_{};
};

}  // namespace

bool Arguments::has(std::string_view option) const {
    return std::ranges::any_of(options, [&](const auto& one) { return one.first == option; });
}

std::string Arguments::value(std::string_view option) const {
    const auto all = values(option);
    return all.empty() ? std::string() : all.back();
}

std::vector<std::string> Arguments::values(std::string_view option) const {
    std::vector<std::string> out;
    for (const auto& [name, value] : options)
        if (name == option) out.push_back(value);
    return out;
}

Answer<Arguments> parse(const std::vector<std::string>& words) { return Parser(words).run(); }

}  // namespace margay::ethercat
