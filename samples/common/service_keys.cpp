// The keys of the configuration of margayd.
#include "common/service_configuration.hpp"

namespace margay::samples {
namespace {

constexpr ServiceKey kKeys[] = {
    {"source", "\"SOURCE\"", "",
     "the segment: an interface (\"eth0\"; \"xdp:eth0\" by AF_XDP; \"try-xdp:eth0\" by AF_XDP, or else as \"eth0\"), "
     "two interfaces at the ends of a ring (\"eth0+eth1\"), or a simulated segment (\"sim:demo\"). Each master has "
     "this key. An interface that is missing, a cable that is not plugged in and a segment without power are waited "
     "for"},
    {"number", "NUMBER", "the first free one", "0 to 63: the number for `ethercat --master`, and in eoe0s1"},
    {"eni", "\"FILE\"", "",
     "the expected slaves and their configuration, as a file of a configuration tool (ETG.2100); a relative path "
     "starts at the folder of the configuration. Without it, all slaves that are there are taken as they describe "
     "themselves. The segment is then scanned again when slaves are added, and when a slave has no place in the "
     "process image or other PDOs than before: after 2 s, 8 s, 32 s and so on up to 10 minutes. Each scan brings the "
     "slaves to INIT. Slaves that a client has set to another state are kept in that state afterwards"},
    {"cycle_us", "NUMBER", "as the ENI says, or 1000", "50 to 1000000: time of the cycle in microseconds"},
    {"state", "\"STATE\"", "\"OP\"",
     "INIT, PREOP, SAFEOP or OP: the slaves are brought to this state and kept there. All outputs are 0"},
    {"end_state", "\"STATE\"", "\"INIT\"", "INIT, PREOP or SAFEOP: the state in which the slaves are left at the end"},
    {"take_over", "true", "false",
     "scan also when slaves are in SAFEOP or OP at the start. Without it, margayd waits while another master may be "
     "running them. What a margayd that ended without order has left behind is taken over always"},
    {"tolerate", "[\"WHAT\"]", "[]",
     "\"missing\", \"other\", \"unexpected\": differences from the ENI that are accepted. Other slaves and unexpected "
     "slaves that are not accepted get no outputs"},
    {"priority", "NUMBER", "0",
     "1 to 99: real-time priority of the cycle (SCHED_FIFO), with memory locked and no deep sleep; 0: none"},
    {"cpu", "NUMBER", "any", "the processor for the cycle"},
    {"spin_us", "NUMBER", "0",
     "time before each cycle, in microseconds, in which the clock is polled instead of sleeping"},
    {"in_sync_us", "NUMBER", "4",
     "1 to 100000: with the clocks (DC) of an ENI, the log says that the cycle is in sync when it differs from the "
     "reference clock by no more than this for 1.5 s, in microseconds. A machine that is not made for real time needs "
     "more than 4"},
    {"debug", "NUMBER", "1",
     "messages about the segment: 0 none, 1 events and errors of slaves, 2 also every repetition, and once a second "
     "the "
     "counters of frames. `ethercat debug` changes it until the next start, or until this key changes"},
    {"socket", "{ ... }", "", "the socket for `ethercat` and other programs"},
    {"socket.path", "\"PATH\"", "/run/margay/NAME.sock", "where it is"},
    {"socket.owner", "\"USER\"", "the user of margayd", "the user that owns it"},
    {"socket.group", "\"GROUP\"", "the group of margayd", "its group"},
    {"socket.mode", "\"OCTAL\"", "\"0660\"", "its permissions. Who may write to it can do to slaves what a master can"},
    {"socket.read_only", "true", "false", "refuse everything that changes a slave or the service"},
    {"socket.clients", "NUMBER", "8", "1 to 32: connections at the same time"},
    {"eoe", "true or [{ ... }]", "false",
     "true: a network interface for each slave with EoE, eoe0s1 for the second slave of master 0, eoe0a7 for a slave "
     "with the alias 7. A list: for these slaves"},
    {"eoe.position", "NUMBER", "", "position of the slave in the ring, the first is 0"},
    {"eoe.alias", "NUMBER", "", "alias of the slave, in the place of its position"},
    {"eoe.name", "\"NAME\"", "as with true", "the name of the interface"},
    {"gateway", "{ ... }", "", "the mailbox gateway (ETG.8200)"},
    {"gateway.listen", "\"ADDRESS:PORT\"", "",
     "where it listens, for example \"127.0.0.1:34980\"; it has no passwords: whoever reaches another address than "
     "that of "
     "this machine can write to the slaves"},
    {"gateway.read_only", "true", "false", "refuse every message that may change a slave"},
};

}  // namespace

std::span<const ServiceKey> service_keys() { return kKeys; }

}  // namespace margay::samples
