// The texts that users of ecrt programs read: no error names a function of the library, because these programs do not
// use the library. The file that binds masters to segments: comments, blanks, aliases. A line that is cut ends with a
// mark.
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/segment.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

using margay::Errc;
using margay::Error;
using margay::Step;
using margay::compat::ecrt::bound_source;
using margay::compat::ecrt::with_positions;
using margay::compat::ecrt::words_of;

namespace {

unsigned wrong = 0;

void must(bool condition, const std::string& what) {
    if (condition) return;
    std::fprintf(stderr, "%s\n", what.c_str());
    ++wrong;
}

// True when a name before "()" does not begin with ecrt_.
bool names_other_functions(const std::string& words) {
    for (auto at = words.find("()"); at != std::string::npos; at = words.find("()", at + 1)) {
        const auto name = words.find_last_of(" (", at - 1) + 1;
        if (words.compare(name, 5, "ecrt_") != 0) return true;
    }
    return false;
}

void words_name_no_other_function() {
    for (const auto code :
         {Errc::identity_unread, Errc::no_place, Errc::remapping_needed, Errc::unknown_group, Errc::place_unknown,
          Errc::not_polled, Errc::not_supervised, Errc::no_cycle, Errc::supervised}) {
        const Error error{.code = code, .step = Step::request_state, .slave = 7};
        const auto words = words_of(error, "position 6");
        must(words.starts_with("position 6: " + std::string(to_text(Step::request_state))), words);
        must(!names_other_functions(words), words);
    }
    const Error too_early{.code = Errc::wrong_state, .step = Step::configure_sync, .slave = 7};
    must(!names_other_functions(words_of(too_early, "")), words_of(too_early, ""));
    must(words_of(too_early, "").ends_with(to_text(Errc::wrong_state)), words_of(too_early, ""));
    const Error mistake{.code = Errc::pdo_unknown, .step = Step::map_process_data, .slave = 7};
    must(words_of(mistake, "").starts_with(to_text(Step::map_process_data)), words_of(mistake, ""));
    must(names_other_functions("slave 7: call config_map() again"), "the test sees no function");
    const Error unreached{.code = Errc::clock_not_reached,
                          .step = Step::configure_sync,
                          .slave = 7,
                          .detail = Error::kReferenceLost,
                          .expected = 12};
    const auto place_of = [](std::uint16_t number) { return "position " + std::to_string(number - 1); };
    const auto reached = with_positions(words_of(unreached, "position 6"), place_of);
    must(reached.starts_with("position 6: ") && reached.ends_with("(lost: position 11)"), reached);
    const Error lost{.code = Errc::unstable, .step = Step::configure_clocks, .slave = 7};
    must(words_of(lost, "position 6").find("it was lost, or came back") != std::string::npos, words_of(lost, ""));
    const Error timeout{.code = Errc::timeout, .step = Step::request_state, .slave = 7};
    must(words_of(timeout, "").ends_with(std::string(to_text(Errc::timeout))), words_of(timeout, ""));
}

void a_file_may_have_comments(const std::string& path) {
    std::ofstream(path) << "# MARGAY_MASTER0=sim:wrong\n"
                           "  #MARGAY_MASTER0=sim:wrong\n"
                           "MARGAY_MASTER0 = sim:drive,drive#16   # two drives, the second one has alias 16\n"
                           "MARGAY_MASTER1=\"eth0+eth1\"\t# = a ring\n"
                           "no equals sign # MARGAY_MASTER2=sim:wrong\n"
                           "MARGAY_MASTER3=sim:drive#7\n";
    setenv("MARGAY_MASTERS", path.c_str(), 1);
    for (unsigned n = 0; n < 4; ++n) unsetenv(("MARGAY_MASTER" + std::to_string(n)).c_str());
    must(bound_source(0) == "sim:drive,drive#16", bound_source(0));
    must(bound_source(1) == "eth0+eth1", bound_source(1));
    must(bound_source(2).empty(), bound_source(2));
    must(bound_source(3) == "sim:drive#7", bound_source(3));
}

std::string said(const std::string& words, const std::string& path) {
    const int kept = dup(2);
    const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    dup2(file, 2);
    margay::compat::ecrt::say("%s", words.c_str());
    dup2(kept, 2);
    close(file);
    close(kept);
    std::ifstream in(path);
    std::string line;
    std::getline(in, line);
    return line;
}

void a_cut_line_has_a_mark(const std::string& path) {
    const std::string head = "margay ecrt: ";
    must(said(std::string(600, 'x'), path) == head + std::string(600, 'x'), "a line was cut");
    const std::string most(4095, 'x');
    must(said(most, path) == head + most, "the longest line was cut");
    must(said(most + "xy", path) == head + std::string(4092, 'x') + "...", "a line without a mark");
}

}  // namespace

int main(int, char** argv) {
    words_name_no_other_function();
    a_file_may_have_comments(std::string(argv[0]) + ".conf");
    a_cut_line_has_a_mark(std::string(argv[0]) + ".txt");
    return wrong == 0 ? 0 : 1;
}
