// Runs of margayd and ethercat in a folder of the test.
#pragma once

#include <places.hpp>
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <string>

namespace margay::process {

class ServiceTest : public testing::Test {
  protected:
    ShellFolder folder;

    void SetUp() override { std::filesystem::create_directories(folder.path() / "etc"); }
    void configure(const std::string& file, const std::string& text) const { folder.write("etc/" + file, text); }

    // Executes commands of the shell, which may use these functions:
    //   start        margayd with the configuration in etc and the sockets in run, in the background; its log is `log`
    //   says TEXT    waits until the log has the text; says N TEXT: N times
    //   stop         ends it by SIGTERM, and returns its exit code
    //   e NAME …     ethercat, attached to the master NAME
    [[nodiscard]] Ran shell(const std::string& commands) const { return folder.run(functions() + commands); }

    static std::string functions() {
        const std::string bin = MARGAY_BIN_DIR;
        return "unset MARGAY_MASTER0 NOTIFY_SOCKET JOURNAL_STREAM RUNTIME_DIRECTORY\n"
               "margayd() { " +
               bin +
               "/margayd --config etc --sockets run \"$@\"; }\n"
               "start() { " +
               bin +
               "/margayd --config etc --sockets run \"$@\" 2>>log & d=$!; }\n"
               "says() { k=1; case $1 in [0-9]) k=$1; shift ;; esac; n=0\n"
               "  until [ \"$(grep -c -e \"$1\" log)\" -ge $k ]; do sleep 0.05; n=$((n+1))\n"
               "    [ $n -lt 1200 ] || { echo \"never said: $1\" >&2; cat log >&2; kill -9 $d; exit 98; }; done; }\n"
               "stop() { kill $d; wait $d; }\n"
               "e() { s=$1; shift; " +
               bin +
               "/ethercat \"$@\" --attach run/$s.sock; }\n"
               "touch log\n";
    }

    // The same with a private /run and /etc, so that ethercat finds everything without options.
    [[nodiscard]] Ran system_shell(const std::string& commands, const std::string& bin = MARGAY_BIN_DIR) const {
        folder.write(
            "commands",
            "set -e\nmount -t tmpfs none /run\nmkdir /run/etc\ncp -a /etc/. /run/etc/\nmount --bind /run/etc /etc\n"
            "mount -t tmpfs none /run\nset +e\nPATH=" +
                bin + ":$PATH\n" + functions() + "start() { " + bin +
                "/margayd 2>>log & d=$!; }\nrm -rf /etc/margay\ncp -r etc /etc/margay\n" + commands);
        return folder.run("unshare --mount --propagation private sh commands");
    }
    // The reason why system_shell() does not work here; empty: it works.
    [[nodiscard]] std::string no_system() const {
        const auto ran = folder.run("unshare --mount --propagation private sh -c 'mount -t tmpfs none /run'");
        return ran.status == 0 ? std::string() : "no mount namespaces here: " + ran.err;
    }
};

}  // namespace margay::process
