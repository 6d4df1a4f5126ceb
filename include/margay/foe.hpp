// File access over EtherCAT (FoE, ETG.1000.6) for the application: files of a slave, mostly its firmware, by requests
// that run beside the cycle and by functions that wait.
//
//     margay::FoeWrite request;                        // lives in the caller's memory, may be used again and again
//     request.slave = 2;
//     request.name = "firmware";
//     request.data = file;                             // or request.source = &source, for a file of any size
//     margay::submit(ctx, request);                    // from any thread
//     … the owner of the context goes on with poll() or its cycle …
//     if (request.state() == margay::RequestState::error) … request.error(), request.slave_text() …
//
//     auto bytes = margay::FOEread(ctx, 2, "parameters.txt", 0, buffer);   // waits
//
// After a timeout, cancel() or a silence of the slave, the slave may still answer, and the answers of FoE do not name
// their file. So the next transfer of this slave begins when the late answer has come, or when no late answer is
// expected any more. This is the case 100 ms after the slave has accepted the error message that ends the transfer;
// after cancel() or a silence before the first answer, the `answer_timeout` of that request must also be over.
//
// An answer may come even later from these slaves:
// - a slave that keeps messages in a queue, and answers a read more than 100 ms after its timeout;
// - a slave that works on several protocols at a time: its mailbox error (which names no message) ends a read, and the
//   slave answers the read more than 100 ms later;
// - any slave that answers more than 9 s after the timeout.
//
// While such an answer may come, the first packet of a file may belong to the earlier file. So the library reads a file
// of one packet again, as often as answers may be late. It sends the request of a write again (behind an error
// message). The slave answers in order, so the last of these answers belongs to the file. A read of several packets
// ends with Errc::protocol if the late packet was used as its first packet, and a late error of the slave is reported
// as an error of the next transfer: the application may try both again. Set an `answer_timeout` that is longer than the
// slave needs.
//
// Most slaves accept firmware in BOOT only: bring the slave to BOOT before (StateRequest, or set_target() while a
// supervision is busy), and to INIT afterwards.
#pragma once

#include <margay/borrowed.hpp>
#include <margay/request.hpp>
#include <margay/result.hpp>
#include <margay/stream.hpp>

#include <array>
#include <atomic>
#include <span>
#include <string_view>

namespace margay {

class Context;

// The progress of a file transfer.
struct FoeProgress {
    std::size_t bytes = 0;  // octets of the file that have been transferred and acknowledged
    std::size_t total = 0;  // octets of the file; 0: not known (a slave does not announce the size of a file)
    // The slave has answered that it is busy; the library repeats its message later. `busy_done` of `busy_entire` is
    // the progress of the work in the slave; both 0: not reported. `busy_text`: the text that the slave has sent, valid
    // until the callback returns.
    bool busy = false;
    std::uint16_t busy_done = 0;
    std::uint16_t busy_entire = 0;
    std::string_view busy_text;
};

// The common members of FoeRead and FoeWrite. `timeout` zero: no limit for the whole transfer.
class FoeRequest : public MailRequest {
  public:
    static constexpr std::size_t kTextBytes = 80;

    // The name of the file, in the caller's memory. It may have as many octets as the mailbox of the slave, less 12.
    std::string_view name;
    std::uint32_t password = 0;
    // The time limit for each answer of the slave. A slave may erase its flash memory before it answers.
    Duration answer_timeout = std::chrono::seconds(15);
    // How long the slave may be busy with one packet; then the request ends with Errc::timeout.
    Duration busy_timeout = std::chrono::seconds(60);
    // poll() calls this function after each packet, and each time the slave answers that it is busy. It must not wait
    // and must not call the library, except cancel() of this request. It must not throw.
    void (*progressed)(const FoeProgress& progress, void* user) = nullptr;
    void* user = nullptr;

    // Octets that have been transferred and acknowledged. From any thread, also while the request is busy.
    [[nodiscard]] std::size_t bytes() const { return bytes_.load(std::memory_order_relaxed); }
    // The text that the slave has sent with its error, after the request has ended with Errc::foe_error; empty: the
    // slave has sent no text. Octets that are no printable ASCII characters are replaced by '?', and a long text is
    // cut.
    [[nodiscard]] std::string_view slave_text() const { return {text_.data(), text_bytes_}; }

  protected:
    using MailRequest::MailRequest;

  private:
    friend struct FoeAccess;
    std::atomic<std::size_t> bytes_{0};
    std::array<char, kTextBytes> text_{};
    std::size_t text_bytes_ = 0;
};

// Reads a file of the slave. Errors: foe_error (detail: the FoE error code; describe() puts it in words, slave_text()
// has the words of the slave), capacity (`data` is too small), stream_failed, timeout, mailbox_error, protocol,
// wrong_state (the mailbox is not open in this AL state), unsupported (no FoE) …
struct FoeRead : FoeRequest {
    FoeRead();
    std::span<std::byte> data;  // destination of the file, in the caller's memory; not used if there is a sink
    ByteSink* sink = nullptr;   // accepts a file of any size
};

// Writes a file of the slave. Errors as of FoeRead. A transfer that ends early, also by cancel(), is ended in the slave
// by an error message; a slave whose firmware was cut stays in BOOT, where it accepts another transfer.
struct FoeWrite : FoeRequest {
    FoeWrite();
    Borrowed<std::byte> data;      // content of the file, in the caller's memory; not used if there is a source
    ByteSource* source = nullptr;  // provides a file of any size; called when the slave has accepted the request
    std::size_t total = 0;         // octets that the source will give, for the progress only; 0: not known
};

// ------------------------------------------------------------------ functions that wait
//
// Each function submits the request of the same name and waits for it; wait() describes how it waits in each thread.

// Reads a file and returns its size in octets. `timeout` zero: no limit for the whole transfer, and 15 s for each
// answer of the slave. Errors: see FoeRead.
Result<std::size_t> FOEread(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                            std::span<std::byte> into, Duration timeout = Duration{0});
Result<std::size_t> FOEread(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                            ByteSink& sink, Duration timeout = Duration{0});
// Writes a file. Errors: see FoeWrite.
Result<> FOEwrite(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                  std::span<const std::byte> content, Duration timeout = Duration{0});
Result<> FOEwrite(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password, ByteSource& source,
                  Duration timeout = Duration{0});

// The text of an error code (ETG.1000.6 table "FoE error codes"). A static string, callable from anywhere.
[[nodiscard]] std::string_view foe_error_text(std::uint32_t code);

}  // namespace margay
