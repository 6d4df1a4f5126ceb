// For systems with a heap: a context that owns its memory. The library itself does not include this header.
#pragma once

#include <margay/context.hpp>

#include <cstddef>

namespace margay {

// A context that allocates its memory once, in its constructor.
class HostContext : public Context {
  public:
    explicit HostContext(const Limits& limits = {}) : HostContext(new std::byte[context_bytes(limits)]{}, limits) {}
    ~HostContext() {
        close();
        delete[] owned_;
    }

  private:
    HostContext(std::byte* memory, const Limits& limits)
        : Context({memory, context_bytes(limits)}, limits), owned_(memory) {}
    std::byte* owned_;
};

}  // namespace margay
