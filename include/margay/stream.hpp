// Content that does not have to be in memory as a whole, and that may come or go later: the application gives it octet
// by octet to the library (ByteSource) or takes it from the library (ByteSink).
//
// poll() calls the functions in the thread that owns the context. They must return at once, must neither wait nor call
// the library except Request::cancel(), and must not throw. The object must live until its request is over.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class ByteSource {
  public:
    struct Piece {
        std::size_t bytes = 0;      // octets that were copied
        bool last = false;          // the content ends behind them
        std::uint32_t failure = 0;  // not 0: the source has failed; the request ends with Errc::stream_failed
    };
    // Copies the next octets of the content to the front of `into`, which is not empty. Fewer octets than into.size(),
    // also none, and `last` false: the source has no more octets yet, and the library asks again a millisecond later.
    virtual Piece pull(std::span<std::byte> into) = 0;

  protected:
    ~ByteSource() = default;
};

class ByteSink {
  public:
    struct Taken {
        std::size_t bytes = 0;      // octets that were accepted
        std::uint32_t failure = 0;  // not 0: the sink has failed; the request ends with Errc::stream_failed
    };
    // Accepts the next octets of the content, which is not empty. Fewer octets than octets.size(), also none: the sink
    // cannot accept more yet, and the library offers the rest a millisecond later.
    virtual Taken push(std::span<const std::byte> octets) = 0;

  protected:
    ~ByteSink() = default;
};

}  // namespace margay
